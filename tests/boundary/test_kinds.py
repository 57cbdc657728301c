"""Every boundary kind with every method: taken, or refused by its name and by what it means; a new kind is one file."""

from pathlib import Path

import numpy as np
import pytest
from kinds import KINDS, table, tables_of, translated
from mpi4py import MPI
from solids import gathered, simulation

from parsolid.collective import SolverError
from parsolid.scene import Scene, SceneError, boundaries, parse_scene
from parsolid.scene.boundaries import BOUNDARY_KINDS
from parsolid.scene.methods import settings_class

ROOT = Path(__file__).parents[2]
METHODS = ("tlsph", "peridynamics", "mpm", "ulsph")
TAKEN = {method: settings_class({"kind": method}).boundaries for method in METHODS}


def test_these_are_all_kinds():
    assert set(KINDS) == set(BOUNDARY_KINDS) == {kind for kinds in TAKEN.values() for kind in kinds}


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("kind", KINDS)
def test_a_method_takes_a_kind_or_refuses_it(method, kind, comm):
    data = tables_of(method, table(kind, method))
    if kind in TAKEN[method]:
        translated(comm, data)
        return
    with pytest.raises(SceneError) as found:
        parse_scene(data)
    known, why = ", ".join(map(repr, TAKEN[method])), settings_class({"kind": method}).refused[kind]
    expected = f"one of {known}, which the method of the scene knows ({kind}: {why})"
    assert found.value.faults == [f"boundaries.0.kind: expected {expected}, found {kind!r}"]


def test_the_table_in_the_documents_is_that_of_the_methods():
    text = (ROOT / "docs" / "boundary.md").read_text(encoding="utf-8")
    rows = [[cell.strip() for cell in line.strip("|").split("|")] for line in text.splitlines() if line[:3] == "| `"]
    assert [cells[0].strip("`") for cells in rows] == list(KINDS)
    for kind, *marks, model in rows:
        kind = kind.strip("`")
        assert dict(zip(METHODS, marks)) == {one: "yes" if kind in TAKEN[one] else "" for one in METHODS}, kind
        assert BOUNDARY_KINDS[kind].__name__ == model.strip("`")


def in_region(kind: str, method: str) -> str:
    """Whether a method takes a kind in a region with a name, as a cell of the table says it."""
    stated = {key: value for key, value in table(kind, method).items() if key not in ("plane", "ball")}
    if "where" not in BOUNDARY_KINDS[kind].model_fields:
        return "yes"
    data = tables_of(method, stated | {"where": "here"})
    if method == "peridynamics":
        # tractions of other kinds spread along the normal of a plane
        data["method"]["traction"] = "single-layer"
    data["regions"] = [{"name": "here", "formula": "X > 0.95" if method == "tlsph" else "X > 0.5"}]
    try:
        translated(MPI.COMM_SELF, data)
    except (SceneError, SolverError):
        return "yes, no regions"
    return "yes, regions"


def table_of_parts() -> str:
    """What each method takes, in regions with a name too, with the force that it tells, or why it takes none."""
    lines = [f"| kind | {' | '.join(METHODS)} |", "|---" * 5 + "|"]
    for kind in KINDS:
        cells = []
        for method in METHODS:
            settings = settings_class({"kind": method})
            told = ", force" if kind in settings.reactions else ""
            cells.append(in_region(kind, method) + told if kind in TAKEN[method] else f"no: {settings.refused[kind]}")
        lines.append(f"| `{kind}` | {' | '.join(cells)} |")
    return "\n".join(lines)


PARTS = ROOT / "docs" / "parts.md"
_BEGIN, _END = "<!-- kinds: python tests/boundary/test_kinds.py -->\n", "\n<!-- end of kinds -->"


def test_the_page_on_parts_says_what_each_method_takes():
    text = PARTS.read_text(encoding="utf-8")
    assert text.split(_BEGIN)[1].split(_END)[0] == table_of_parts()


PRESSURE = '''
"""Pressure on planes that bound a body."""

from typing import Literal

from parsolid.scene.boundaries import boundary_kind
from parsolid.scene.boundaries import Traction
from parsolid.scene.formulas import Formula, FormulaVector
from parsolid.scene.load_histories import LoadHistory


@boundary_kind
class Push(Traction):
    """A constant pressure [Pa] on a plane; outward: along its axis, 1.0 or -1.0."""

    kind: Literal["push"]
    traction: None = None
    pressure: float
    outward: float

    @property
    def prescribed(self):
        force = [-self.outward * self.pressure * (axis == self.plane.axis) for axis in range(2)]
        return LoadHistory(FormulaVector(map(Formula, force)))
'''


@pytest.fixture
def new_kind():
    """Enters the kinds of a text, for the time of a test."""
    models = dict(BOUNDARY_KINDS)

    def enter() -> None:
        """As it is when the program starts."""
        Scene.model_fields["boundaries"].annotation = list[boundaries.union_of_kinds()]
        Scene.model_rebuild(force=True)

    def write(text: str) -> None:
        exec(text, {"__name__": "brand_new"})
        enter()

    yield write
    BOUNDARY_KINDS.clear()
    BOUNDARY_KINDS.update(models)
    enter()


def test_a_new_kind_is_one_file_and_a_word_in_the_methods_list(new_kind, monkeypatch):
    new_kind(PRESSURE)
    pressed = tables_of("tlsph", {"kind": "push", "plane": "X = 1", "pressure": 0.1, "outward": 1.0})
    with pytest.raises(SceneError, match="which the method of the scene knows, found 'push'"):
        parse_scene(pressed)
    monkeypatch.setattr(settings_class({"kind": "tlsph"}), "boundaries", (*TAKEN["tlsph"], "push"))
    pulled = tables_of("tlsph", {"kind": "traction", "plane": "X = 1", "traction": [-0.1, 0.0]})
    motions = []
    for data in (pressed, pulled):
        sim = simulation(data)
        for _ in range(3):
            sim.take_step(0.02)
        motions.append(gathered(sim, "velocity")[0])
    assert np.array_equal(*motions) and motions[0].min() < -1e-3
    pressed["boundaries"][0]["plane"] = "X = 0.5"
    with pytest.raises(SceneError, match="boundaries.0.plane: expected a plane that bounds a body"):
        parse_scene(pressed)


@pytest.mark.parametrize(("method", "other"), [("tlsph", "peridynamics"), ("peridynamics", "tlsph")])
def test_a_pressure_where_a_method_knows_none_is_refused(method, other):
    with pytest.raises(SceneError, match=r"boundaries.0.\w+: expected one of .*where.* with this method"):
        parse_scene(tables_of(method, table("pressure", other)))


if __name__ == "__main__":
    before, rest = PARTS.read_text(encoding="utf-8").split(_BEGIN)
    PARTS.write_text(before + _BEGIN + table_of_parts() + _END + rest.split(_END)[1], encoding="utf-8")
