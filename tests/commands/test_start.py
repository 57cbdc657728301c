"""What the start of a run does without: packages that take as long to import as a small job, and a look for garbage."""

import gc
import subprocess
import sys
from pathlib import Path

import pytest

from parsolid import start

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


@pytest.fixture
def collector():
    """Looks for garbage afterwards, in all that there is."""
    yield
    gc.unfreeze()
    gc.enable()
    start._begun.clear()


def test_garbage_is_looked_for_once_all_is_loaded_and_not_at_the_end(collector):
    start.begin()
    assert not gc.isenabled()
    start.loaded()
    assert gc.isenabled() and gc.get_freeze_count() > 0
    kept, made = gc.get_freeze_count(), [[] for _ in range(100)]
    start.end()
    assert made and not gc.isenabled() and gc.get_freeze_count() > kept


def test_a_script_keeps_its_garbage_and_what_it_has_said_of_the_collector(collector):
    kept = gc.get_freeze_count()
    gc.disable()
    start.loaded()
    assert not gc.isenabled() and gc.get_freeze_count() == kept
    start.begin()
    start.loaded()
    start.loaded()
    assert gc.isenabled() and gc.get_freeze_count() > kept
