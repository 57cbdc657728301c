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
def test_a_scene_of_one_method_imports_the_settings_of_no_other(kind):
    program = f"""import sys
from parsolid.scene.methods import method_kinds, settings_class
import parsolid.commands.run
found = settings_class({{"kind": {kind!r}}})
named = [name.split(".")[2] for name in sys.modules if name.endswith(".settings") and "methods" in name]
print(found.system.split(".")[2], *named)
print(settings_class({{"kind": "none"}}), *sorted(method_kinds()))"""
    found = subprocess.run([sys.executable, "-c", program], cwd=ROOT, capture_output=True, text=True, check=True)
    assert found.stdout.splitlines() == [f"{kind} {kind}", f"None {' '.join(sorted(METHODS))}"]
