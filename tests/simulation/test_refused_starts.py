"""What no run starts from, in every method: strain of which a law has no stress, folds, temperatures below zero."""

import re

import numpy as np
import pytest
from mpi4py import MPI
from ranks import first_on_ranks
from solids import COPPER, RUBBER, Record, follow, simulation, tables

from parsolid.collective import SolverError
from parsolid.particles.generation import generate
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.formulas import NOT_FINITE, Formula
from parsolid.simulation.loop import RunFailed

NEO = {key: value for key, value in RUBBER.items() if key != "kind"} | {"kind": "neo-hookean", "poissons_ratio": 0.3}
LINEAR = NEO | {"kind": "linear-elastic"}
CASES = {
    "tlsph": ({"kind": "tlsph"}, NEO),
    "tlsph of metal": ({"kind": "tlsph", "integrator": "leapfrog"}, COPPER),
    "peridynamics": ({"kind": "peridynamics"}, LINEAR),
    "mpm": ({"kind": "mpm", "cell": 0.4}, NEO),
    "mpm of metal": ({"kind": "mpm", "cell": 0.4}, COPPER),
    "ulsph": ({"kind": "ulsph"}, COPPER),
}


def start(name: str, body: dict, comm, **rest):
    method, material = CASES[name]
    # 8 x 8 particles at 0.2
    data = tables((8, 8), [1.6, 1.6], material=material, method=method, body={"placement": "cells"} | body, **rest)
    return simulation(data, comm)


@pytest.mark.serial
@pytest.mark.parametrize("formula", ["-1.5*X", "where(X > 0.8, -0.5, 0)"])
@pytest.mark.parametrize("name", CASES)
def test_a_folded_start_is_refused(name, formula, comm):
    with pytest.raises(SolverError) as refused:
        start(name, {"displacement": [formula, "0"]}, comm)
    assert str(refused.value).startswith("bodies.0.displacement: ")


@pytest.mark.serial
@pytest.mark.parametrize("name", CASES)
@pytest.mark.parametrize(
    "displacement, strained",
    [(["1e-3*X", "0"], True), (["1e-6*Y", "0"], True), (["3", "-1e3"], False), (["-X - Y", "X - Y"], False)],
    ids=["stretch", "small shear", "moved", "turned"],
)
def test_strain_at_the_start_needs_a_law_that_has_a_stress_for_it(name, displacement, strained, comm):
    """Moved and turned by a right angle nothing is strained."""
    if strained and CASES[name][1] is COPPER:
        with pytest.raises(SolverError) as refused:
            start(name, {"displacement": displacement}, comm)
        assert str(refused.value).startswith("bodies.0.displacement: ")
    elif not (displacement[0].startswith("-X") and name == "peridynamics"):
        # small strain takes a turn for one, and is refused for it
        start(name, {"displacement": displacement}, comm)


@pytest.mark.serial
@pytest.mark.parametrize("name", ["mpm of metal", "ulsph"])
def test_a_deformation_gradient_of_a_law_without_a_stress_for_it_is_refused(name, comm):
    """One so near to that of the displacement that it passes for it."""
    with pytest.raises(SolverError) as refused:
        start(name, {"deformation_gradient": [["1.0005", "0"], ["0", "1"]]}, comm)
    assert str(refused.value).startswith("bodies.0.deformation_gradient: ")
    start(name, {"deformation_gradient": [["1", "0"], ["0", "1"]]}, comm)


@pytest.mark.serial
@pytest.mark.parametrize("name", ["tlsph", "mpm", "peridynamics"])
def test_rounding_of_a_turned_start_is_no_imbalance(name, comm):
    """A body at rest without strain, whose energies are rounding alone, runs on."""
    method, _ = CASES[name]
    turned = ["cos(0.3)*X - sin(0.3)*Y - X", "sin(0.3)*X + cos(0.3)*Y - Y"]
    method = method | ({"horizon_ratio": 3.0, "solution": {"kind": "explicit"}} if name == "peridynamics" else {})
    body = {"placement": "cells", "displacement": turned}
    sim = simulation(tables((8, 8), [1.6, 1.6], material=NEO, method=method, body=body), comm)
    rows = follow(sim, Record(lambda one: one.energy_row()), 5)
    assert sim.energy_check.violation is None and rows["kinetic"].max() < 1e-12 * sim.energy_scale


@pytest.mark.serial
@pytest.mark.parametrize("name", ["mpm of metal", "ulsph"])
def test_temperatures_are_absolute(name, comm):
    with pytest.raises(SceneError) as refused:
        start(name, {"temperature": "300 - 400*X"}, comm)
    assert refused.value.faults[0].startswith("bodies.0.temperature: ")
    sim = start(name, {"temperature": "300"}, comm)
    sim.systems[0].particles.owned_rows("temperature")[:] = -1.0
    with pytest.raises(RunFailed):
        follow(sim, Record(lambda one: one.energy_row()), 2)
    assert sim.coldest < 0.0 and sim.clock.step < 2


@pytest.mark.serial
@pytest.mark.parametrize("name", ["mpm of metal", "ulsph"])
def test_temperatures_between_rows_are_absolute(name):
    """A particle is colder than nothing between two rows, and warm again at both; the end names it."""
    material = COPPER | {"conductivity": 400.0}
    body = {"placement": "cells", "temperature": 100.0}
    sim = simulation(tables((8, 8), [1.6, 1.6], material=material, method=CASES[name][0], body=body))
    for lowest in (50.0, -20.0, -60.0, 40.0):
        sim.systems[0].particles.owned_rows("temperature")[37] = lowest
        sim.take_step(1e-6)
    assert sim.systems[0].particles.owned_rows("temperature").min() > 0.0
    with pytest.raises(RunFailed) as failed:
        follow(sim, Record(lambda one: one.energy_row()), 2)
    assert sim.coldest == pytest.approx(-60.0, abs=0.1)
    wanted = int(sim.systems[0].particles.owned_rows("identifier")[37])
    assert int(re.search(r"particle +([0-9]+)", str(failed.value))[1]) == wanted


@pytest.mark.serial
@pytest.mark.parametrize("temperature, sound", [(-1.0, False), ("-1 + 0*t", True), (0.0, True)])
def test_a_plane_below_absolute_zero_is_refused(temperature, sound):
    material = COPPER | {"conductivity": 400.0}
    plane = [{"kind": "temperature", "plane": "X = 0", "temperature": temperature}]
    data = tables((4, 4), material=material, method={"kind": "mpm", "cell": 0.5}, boundaries=plane)
    data["bodies"][0]["placement"] = "cells"
    if sound:
        parse_scene(data)
        return
    with pytest.raises(SceneError) as refused:
        parse_scene(data)
    assert refused.value.faults[0].startswith("boundaries.0.temperature")


PULLED = {"kind": "velocity", "plane": "X = 1", "velocity": ["1", "free"]}


CORNER = {"lower": [0.9, -0.1], "upper": [1.1, 0.3]}


@pytest.mark.parametrize("method", first_on_ranks(["tlsph", "peridynamics", "mpm", "ulsph"]))
@pytest.mark.parametrize(
    "first, second, sound",
    [
        (PULLED, {"kind": "velocity", "box": CORNER, "velocity": ["2", "free"]}, False),
        (PULLED, {"kind": "velocity", "box": CORNER, "velocity": ["cos(t)", "free"]}, False),
        (PULLED, {"kind": "velocity", "box": CORNER, "velocity": ["2 - 1", "t"]}, True),
        (PULLED, {"kind": "velocity", "box": CORNER, "velocity": ["free", "t"]}, True),
        (
            PULLED,
            {"kind": "velocity", "box": {"lower": [-0.1, 0.3], "upper": [0.5, 0.7]}, "velocity": ["2", "0"]},
            True,
        ),
    ],
)
def test_conditions_that_contradict_one_another_on_particles_are_refused(method, first, second, sound, comm):
    """In any order, with the key of the later one, on any number of ranks."""
    kind, material = CASES[method]
    for boundaries in ([first, second], [second, first]):
        body = {"placement": "cells"}
        scene = parse_scene(tables((8, 8), material=material, method=kind, boundaries=boundaries, body=body))
        if sound:
            generate(scene, comm)
            continue
        with pytest.raises(SceneError) as refused:
            generate(scene, comm)
        assert [(one.code, one.key) for one in refused.value.faults] == [("contradiction", "boundaries.1")]


@pytest.mark.parametrize("lower, velocity, sound", [(0.49, "-1", False), (0.49, "2 - 1", True), (0.51, "-1", True)])
def test_conditions_that_contradict_one_another_on_nodes_are_refused(lower, velocity, sound, comm):
    """Two boxes that share the nodes at X = .5 and no particle."""
    boxes = [
        {"kind": "velocity", "box": {"lower": [-0.1, -0.1], "upper": [0.505, 1.1]}, "velocity": ["1", "free"]},
        {"kind": "velocity", "box": {"lower": [lower, -0.1], "upper": [1.1, 1.1]}, "velocity": [velocity, "free"]},
    ]
    data = tables((8, 8), material=NEO, method=CASES["mpm"][0] | {"cell": 0.25}, boundaries=boxes)
    data["bodies"][0]["placement"] = "cells"
    if sound:
        simulation(data, comm)
        return
    with pytest.raises(SceneError) as refused:
        simulation(data, comm)
    assert [(one.code, one.key) for one in refused.value.faults] == [("contradiction", "boundaries.1")]


@pytest.mark.serial
@pytest.mark.parametrize(
    "second, sound",
    [
        ({"kind": "velocity", "plane": "Y = 1", "velocity": ["1", "free"]}, False),
        ({"kind": "velocity", "plane": "Y = 1", "velocity": ["free", "1"]}, False),
        ({"kind": "velocity", "plane": "Y = 1", "velocity": ["0", "0*t"]}, True),
        ({"kind": "roller", "plane": "Y = 1"}, True),
        ({"kind": "displacement", "plane": "Y = 1", "displacement": ["1", "free"]}, False),
        ({"kind": "displacement", "plane": "Y = 1", "displacement": ["0", "free"]}, True),
        ({"kind": "fixed", "where": "corner"}, True),
        ({"kind": "rotation", "plane": "Y = 1", "centre": [0.0, 1.0], "angle": "t"}, True),
        ({"kind": "rotation", "plane": "Y = 1", "centre": [0.1, 1.0], "angle": "t"}, False),
    ],
)
def test_planes_meet_at_a_corner_where_values_agree(second, sound):
    """A node on the fixed plane X = 0; a rotation about it leaves it where it is."""
    static = (
        {"kind": "tlsph", "integrator": "static", "weights": "cells"}
        if second["kind"] == "displacement"
        else {"kind": "tlsph"}
    )
    boundaries = [{"kind": "fixed", "plane": "X = 0", "mirror": False}, second]
    named = {"regions": [{"name": "corner", "formula": "X + Y < 0.3"}]} if "where" in second else {}
    scene = parse_scene(tables((8, 8), material=NEO, method=static, boundaries=boundaries, **named))
    if sound:
        generate(scene, MPI.COMM_SELF)
        return
    with pytest.raises(SceneError) as refused:
        generate(scene, MPI.COMM_SELF)
    assert [(one.code, one.key) for one in refused.value.faults] == [("contradiction", "boundaries.1")]


HEATED = {"kind": "temperature", "plane": "X = 1", "temperature": "400"}
FIXED, ROLLER = ({"kind": kind, "plane": "X = 1"} for kind in ("fixed", "roller"))


@pytest.mark.serial
@pytest.mark.parametrize(
    "first, second, sound",
    [
        (PULLED, FIXED, False),
        (PULLED, PULLED | {"velocity": ["2", "free"]}, False),
        (PULLED, ROLLER, False),
        (PULLED, PULLED | {"velocity": ["1", "0"]}, True),
        (PULLED, PULLED | {"velocity": ["free", "t"]}, True),
        (PULLED, FIXED | {"plane": "X = 0"}, True),
        (HEATED, HEATED | {"temperature": "300"}, False),
        (HEATED, {"kind": "heat-flux", "plane": "X = 1", "heat_flux": "1"}, False),
        (HEATED, HEATED | {"plane": "X = 0", "temperature": "300"}, True),
        (HEATED, PULLED, True),
        (FIXED, ROLLER, False),
        (ROLLER, PULLED | {"velocity": ["0", "1"]}, True),
    ],
)
def test_conditions_of_one_plane_that_contradict_one_another_are_refused(first, second, sound):
    method, metal = {"kind": "mpm", "cell": 0.5}, COPPER | {"conductivity": 400.0}
    for boundaries in ([first, second], [second, first]):
        body = {"placement": "cells"}
        data = tables((4, 4), method=method, material=metal, boundaries=boundaries, body=body)
        if sound:
            parse_scene(data)
            continue
        with pytest.raises(SceneError) as refused:
            parse_scene(data)
        assert [fault.key for fault in refused.value.faults] == ["boundaries.1.plane"]


@pytest.mark.serial
@pytest.mark.parametrize("text", ["arccos(2)", "log(-1)", "cos(1e400)", "1/0", "sqrt(-X*0 - 1)*0"])
def test_a_formula_that_is_never_a_number_is_refused(text):
    if "X" in text:
        NOT_FINITE.clear()
        assert np.isnan(Formula(text).evaluate(np.ones((1, 3)), 0.25)).all()
        assert NOT_FINITE[0][0] == text and NOT_FINITE[0].place == [1.0, 1.0, 1.0] and NOT_FINITE[0].time == 0.25
        NOT_FINITE.clear()
        return
    with pytest.raises(ValueError, match="."):
        Formula(text)


LATER = "sqrt(1e-9 - t)"
DRIVEN_LATER = {"boundaries": [{"kind": "velocity", "plane": "X = 0", "velocity": [LATER, "0"]}]}


@pytest.mark.parametrize(
    "name, acting",
    first_on_ranks(
        [
            ("tlsph", {"loads": {"body_force": [f"1e3*{LATER}", "0"]}}),
            *((name, DRIVEN_LATER) for name in ("mpm", "peridynamics", "ulsph")),
        ]
    ),
)
@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_what_acts_and_is_no_number_later_is_told_with_its_formula(name, acting, comm):
    NOT_FINITE.clear()
    sim = start(name, {}, comm, **acting)
    with pytest.raises(RunFailed) as failed:
        follow(sim, Record(), 20)
    NOT_FINITE.clear()
    assert LATER in str(failed.value)
