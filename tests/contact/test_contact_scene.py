"""What a scene may say of contact, and what is told of how bodies meet."""

from pathlib import Path

import numpy as np
import pytest
from contact.meeting import BONDS, SPH, bars, block, simulated, tables
from mpi4py import MPI
from solids import recorded

from parsolid.collective import SolverError
from parsolid.contact.kernel import lattice_colour
from parsolid.contact.report import describe_contacts
from parsolid.observables.declared import Observables
from parsolid.scene import SceneError, load_scene, parse_scene
from parsolid.simulation.history import Probes
from parsolid.simulation.loop import Simulation


@pytest.mark.parametrize(("method", "friction", "told"), [(BONDS, 0.3, True), (BONDS, 0.0, False), (SPH, 0.3, False)])
def test_friction_of_bodies_that_nothing_damps_is_warned_of(method, friction, told):
    contact = [{"bodies": ["left", "right"], "friction": friction}]
    sim = simulated(bars(placement="cells", method=method, contact=contact))
    assert ("friction-of-rattling-bodies" in [one.code for one in sim.warnings]) is told


@pytest.mark.parametrize(("across", "told"), [(6, []), (7, ["unlike-axes-in-contact"]), (8, None)])
def test_spacings_that_differ_along_the_axes_of_a_body_in_contact_are_told_or_refused(across, told):
    """At 5 cells along X and 7 along Y faces that just touch are 12 % of a spacing apart; at 1 : 4 they press by E."""
    data = tables(*(block(name, (x, 0), (x + 1, 1), [5, across], "cells") for name, x in (("a", 0), ("b", 1))))
    if told is None:
        with pytest.raises(SolverError) as refused:
            simulated(data)
        assert str(refused.value).startswith("bodies.0: ")
    else:
        assert sorted({one.code for one in simulated(data).warnings}) == told


def noted(comm, data) -> list:
    """Notes on the contacts of a scene."""
    sim = simulated(data, comm)
    return describe_contacts(comm, sim.scene, sim.systems)


def test_relations_are_told_and_a_collision_course_is_warned_of(comm):
    assert noted(comm, bars(gap=0.3)) == [("bodies", "bodies in contact: left and right")]
    slow = [block("a", (0, 0), (1, 1), [5, 5], velocity=[1.0, 0.0]), block("b", (2, 0), (3, 1), [5, 5])]
    slow.append(block("c", (3, 0), (4, 1), [5, 5], "cells"))
    bonded, apart, (code, text) = noted(comm, tables(*slow, contact=[], bond=[{"bodies": ["b", "c"]}], end_time=2.0))
    assert bonded == ("bodies", "bodies bonded where they touch: b and c")
    assert apart == ("bodies", "bodies apart: a and b, a and c")
    assert code == "collision-course" and "a and b (at about t = 1 s)" in text and "b and c" not in text


@pytest.mark.parametrize("contact, words", [("compression", "pressing on one another"), ("welded", "bonded")])
def test_bodies_of_rebuilt_neighbours_press_on_one_another_unless_they_are_welded(comm, contact, words):
    ends = [(0, 1), (1, 2), (5, 6)]
    copper = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
    boxes = [block(name, (a, 0), (b, 1), [5, 5], "cells", material=copper) for name, (a, b) in zip("abc", ends)]
    rest = {"contact": [], "bond": [{"bodies": ["a", "b"]}], "method": {"kind": "ulsph", "contact": contact}}
    assert noted(comm, tables(*boxes, **rest, end_time=2.0))[0].text == f"bodies {words} where they touch: a and b"


def test_bodies_on_their_way_to_another_method_are_told(comm):
    ends = {"a": (0, 1), "c": (2.5, 3.5), "d": (5, 6)}
    bodies = [block(name, (a, 0), (b, 1), [5, 5], "cells", method="two") for name, (a, b) in ends.items()]
    bodies[0]["method"], bodies[2]["velocity"] = "one", [-2.0, 0.0]
    methods = [SPH | {"name": "one"}, BONDS | {"name": "two"}]
    data = tables(*bodies, contact=[], end_time=2.5, methods=methods)
    del data["method"]
    text = noted(comm, data)[-1].text
    assert "a and d (at about t = 2.1 s)" in text and "c and d" in text and "a and c" not in text


def test_colours_of_lattices():
    found = [lattice_colour(0.5, 1.0, nodal, 2.7, d) for d in (2, 3) for nodal in (False, True)]
    wanted = [(0.1892, 0.484), (0.2677, 0.424), (0.1839, 0.487), (0.2661, 0.428)]
    assert found == [pytest.approx(pair, abs=6e-4) for pair in wanted]
    assert lattice_colour(0.0, 1.0, True, 2.7, 2) == pytest.approx((0.5, 0.484), abs=6e-4)


@pytest.mark.parametrize("name", ["contact/three_bodies", "contact/stack", "contact/friction_heat", "mixed/tied"])
def test_scenes_that_are_shown_run(name):
    scene = load_scene(Path(__file__).parents[2] / "runs" / f"{name}.toml", [])
    columns = recorded(Simulation(MPI.COMM_SELF, scene), steps=3)
    assert len(columns["time"]) == 4 and np.isfinite(columns["energy_error"]).all()


def test_forces_of_contact_and_components_are_watched_by_the_names_of_their_columns():
    low = block("low", (0.0, -1.0), (1.0, 0.0), (4, 4), "cells")
    top = block("top", (0.0, 0.0), (1.0, 1.0), (4, 4), "cells")
    whole = {"fields": ["contact_force", "stress"], "where": "low", "statistic": "integral", "name": "whole"}
    part = whole | {"fields": ["contact_force_y", "stress_xy"], "name": "part"}
    at = {"at": [0.125, -0.125], "fields": ["contact_force_y", "velocity_x", "contact_force"], "name": "at"}
    region = {"name": "low", "shape": {"box": {"lower": [0.0, -1.0], "upper": [1.0, 0.0]}}}
    more = {"probes": [whole, part, at], "regions": [region], "output": {"fields": ["contact_force", "stress_xy"]}}
    sim = simulated(tables(low, top, **more))
    rows = sim.systems[0].particles.owned_rows
    rows("position")[rows("body") == 1, 1] -= 0.1
    rows("deformation_gradient")[:, 1] = 0.1
    sim.interactions[0].rebuild(0.0)
    sim.interactions[0].find_forces(held=True)
    observables = Observables(sim.systems)
    probes = Probes(MPI.COMM_SELF, sim.scene, observables)
    found = dict(zip(probes.columns, probes.sample()))
    force, corner = rows("contact_force"), int(np.argmin(np.abs(rows("position") - at["at"]).sum(axis=1)))
    here = rows("body") == 0
    assert force[here, 1].sum() < 0.0
    assert found["whole.contact_force_y"] == pytest.approx(found["part.contact_force_y"], rel=1e-12)
    assert found["part.contact_force_y"] == pytest.approx(rows("volume")[here] @ force[here, 1])
    assert found["at.contact_force_y"] == force[corner, 1] != 0.0 and found["at.velocity_x"] == 0.0
    assert found["whole.stress_xy"] == pytest.approx(found["part.stress_xy"], rel=1e-12) != 0.0
    assert observables.written(sim.scene.output.fields) == ["contact_force", "stress_xy"]
    assert observables.field("stress_xy").shape == (len(force),)


def test_components_that_a_field_does_not_have_are_unknown():
    data = tables(block("alone", (0.0, 0.0), (1.0, 1.0), (4, 4), "cells"), contact=[])
    for name in ("stress_xz", "velocity_z", "pressure_x", "stress_x", "velocity_xy"):
        with pytest.raises(SceneError) as error:
            parse_scene(data | {"probes": [{"name": "a", "at": [0.1, 0.1], "fields": [name]}]})
        assert [fault.code for fault in error.value.faults] == ["unknown-name"]
