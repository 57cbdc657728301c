"""docs/architecture.md shows the code that runs.

the steps as they stand in the source, and how few files a step takes.
"""

import importlib
import inspect
import re
import sys
import textwrap
import types
from pathlib import Path

import pytest
from mpi4py import MPI

from parsolid.scene import load_scene
from parsolid.simulation.loop import Simulation

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "architecture.md").read_text()
SHOWN = re.findall(r"<!-- source: (\S+):(\S+) -->\n```python\n(.*?)```\n", TEXT, re.DOTALL)
# what a step of a method may take at most: its lines, and its files besides those that all methods share
MOST_LINES = 15
FILES = {
    "tlsph/punch": 10,
    "peridynamics/vibrating_bar": 12,
    # with fracture
    "peridynamics/kalthoff_winkler": 13,
    # with a preconditioner
    "peridynamics/plate": 13,
    "mpm/taylor": 14,
    "ulsph/plate_impact": 14,
}
SHARED = ("simulation", "particles", "boundary", "scene", "numerics")


def source_of(module: str, name: str) -> str:
    thing = importlib.import_module(module)
    for part in name.split("."):
        thing = getattr(thing, part)
    return textwrap.dedent(inspect.getsource(getattr(thing, "py_func", thing)))


@pytest.mark.parametrize(("module", "name", "text"), SHOWN, ids=[f"{one[0]}:{one[1]}" for one in SHOWN])
def test_a_step_is_shown_as_it_stands_in_the_source(module, name, text):
    assert text == source_of(module, name)


def test_the_steps_of_all_methods_are_shown():
    rooms = {module.split(".")[2] for module, _, _ in SHOWN if module.startswith("parsolid.methods")}
    assert rooms >= {"tlsph", "peridynamics", "mpm", "ulsph"}


@pytest.mark.parametrize(("module", "name", "text"), SHOWN, ids=[f"{one[0]}:{one[1]}" for one in SHOWN])
def test_a_step_is_short(module, name, text):
    body = re.sub(r'""".*?"""', "", text, flags=re.DOTALL)
    lines = [line for line in body.split("\n") if line.strip() and not line.strip().startswith(("#", "@"))]
    assert len(lines) <= MOST_LINES + 1, lines  # and the line of its name


def files_of_a_step(path: Path) -> set[str]:
    """Files of this project with a function that a step runs, or with a kernel that such a function calls."""
    simulation = Simulation(MPI.COMM_SELF, load_scene(str(path), []))
    step = 1e-3 * simulation.systems[0].stable_step()
    simulation.take_step(step)
    seen = {}

    def note(frame, event, argument):
        if event == "call" and frame.f_code.co_filename.startswith(str(ROOT)):
            seen[frame.f_code] = frame.f_globals

    sys.setprofile(note)
    try:
        simulation.take_step(step)
    finally:
        sys.setprofile(None)
    files = {code.co_filename for code in seen}
    for code, names in seen.items():
        values = [names.get(name) for name in code.co_names]
        modules = [value for value in values if isinstance(value, types.ModuleType)]
        values += [getattr(module, name, None) for module in modules for name in code.co_names]
        files |= {value.py_func.__code__.co_filename for value in values if hasattr(value, "py_func")}
    places = (Path(file).relative_to(ROOT) for file in files if file.startswith(str(ROOT / "parsolid")))
    return {str(place) for place in places if place.parts[1] not in SHARED}


@pytest.mark.parametrize(("scene", "most"), FILES.items(), ids=list(FILES))
def test_how_many_files_a_step_takes(scene, most):
    found = files_of_a_step(ROOT / "runs" / f"{scene}.toml")
    assert len(found) <= most, sorted(found)


def fill() -> None:
    """Bring the page's blocks up to date: `python tests/docs/test_architecture.py`."""
    page = ROOT / "docs" / "architecture.md"
    pattern = r"(<!-- source: (\S+):(\S+) -->\n```python\n).*?(```\n)"
    page.write_text(re.sub(pattern, lambda m: m[1] + source_of(m[2], m[3]) + m[4], TEXT, flags=re.DOTALL))


if __name__ == "__main__":
    fill()
