"""What the start of a run does without: packages that take as long to import as a small job."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]
METHODS = ("tlsph", "peridynamics", "ulsph", "mpm")
# each is imported where a scene, a terminal or a picture asks for it
SPARED = ("scipy.linalg", "scipy.optimize", "scipy.sparse", "rich", "matplotlib", "meshio")


def test_what_every_run_imports_has_nothing_that_few_need():
    names = ["parsolid.commands.run", *(f"parsolid.methods.{name}.system" for name in METHODS)]
    program = f"import sys, {', '.join(names)}\nprint([name for name in {SPARED} if name in sys.modules])"
    found = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"


@pytest.mark.parametrize("kind", METHODS)
def test_a_scene_is_read_without_the_code_of_methods(kind):
    """Their settings say what a scene may state; what computes is imported where a run asks for its method."""
    program = f"""import sys
from parsolid.scene import load_scene
scene = load_scene("parsolid/methods/{kind}/example.toml")
found = [name.split(".")[2] for name in sys.modules if name.startswith("parsolid.methods.") and "system" in name]
print(scene.method.kind, *found)"""
    found = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.split() == [kind]
