"""Forces that conditions tell, in every method: those of the change of momentum, and with their work in the ledger."""

from types import SimpleNamespace

import numpy as np
import pytest
from ranks import first_on_ranks
from solids import Record, follow, simulation, tables

from parsolid.boundary.loads import Loads
from parsolid.boundary.reactions import Reaction
from parsolid.simulation.time_step import TimeSteps

ELASTIC = {"kind": "neo-hookean", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
STEEL = {"kind": "micro-inertia", "library": "4340 steel, Rahaman"}
PULL = {"kind": "velocity", "where": "high", "name": "top", "reaction": True}
REST = {"kind": "velocity", "where": "low", "velocity": [0, 0], "name": "foot", "reaction": True}
HELD = {"kind": "fixed", "where": "low", "name": "foot", "reaction": True, "moment_about": [0.5, 0.0]}
WALL = {"kind": "wall", "plane": "Y = 0", "side": "above", "velocity": [0, 0.1], "name": "foot", "reaction": True}
LOW, HIGH = {"name": "low", "formula": "Y < 0.21"}, {"name": "high", "formula": "Y > 0.79"}
EXPLICIT = {"kind": "peridynamics"}
QUASI = EXPLICIT | {"solution": {"kind": "quasi-static", "step": 0.02}}
MPM = {"kind": "mpm", "cell": 0.2}
# of a second: steel is so much faster than what is soft
FAST = 3e3


def pulled(method: dict, foot: dict, top: dict | None = None, gravity: bool = True) -> dict:
    """A block that stands on a foot and is pulled (or loaded) at its top, thrown sideways."""
    scale = FAST if method["kind"] == "ulsph" else 1.0
    pull = (top or PULL | {"velocity": [0, f"0.3*sin({5 * scale}*t)"]}) | {"name": "top", "reaction": True}
    data = tables((10, 10), material=STEEL if scale > 1.0 else ELASTIC, end_time=0.2 / scale, boundaries=[foot, pull])
    data["method"], data["regions"] = (
        method,
        [one for one in (LOW, HIGH) if one["name"] in (foot.get("where"), pull.get("where"))],
    )
    data["bodies"][0]["placement"] = "cells"
    if method != QUASI:
        data["bodies"][0]["velocity"] = ["0.2*Y", "0"]
    if gravity:
        data["loads"] = {"acceleration": [0.3 * scale, 0.1 * scale]}
    return data


def told(sim) -> dict:
    """Forces and moments, momentum, mass, the work of both."""
    system = sim.systems[0]
    mass, v = (
        (system.mass[: system.owned] * system.share[: system.owned])[:, None],
        system.particles.owned_rows("velocity"),
    )
    mine = {"momentum": (mass * v).sum(axis=0), "mass": mass.sum(axis=0)}
    mine |= {name: system.reaction(name) for name in ("foot", "top")}
    return {name: sim.comm.allreduce(np.array(value)) for name, value in mine.items()}


METHODS = {
    "tlsph": ({"kind": "tlsph"}, HELD),
    "peridynamics": (EXPLICIT, HELD),
    "mpm": (MPM, REST),
    "mpm-wall": (MPM, WALL),
    "ulsph": ({"kind": "ulsph"}, HELD),
    "ulsph-wall": ({"kind": "ulsph"}, WALL),
    "mpm-pressure": (MPM, REST, {"kind": "pressure", "plane": "Y = 1", "pressure": "0.3*t"}),
    "mpm-traction": (MPM, REST, {"kind": "traction", "where": "high", "traction": ["0.2", "0.3*X*t"]}),
    "mpm-spring": (MPM, REST, {"kind": "spring", "plane": "Y = 1", "stiffness": 2.0, "damping": 0.5}),
    "ulsph-traction": ({"kind": "ulsph"}, HELD, {"kind": "traction", "plane": "Y = 1", "traction": [1e8, "1e8*X"]}),
    "ulsph-spring": ({"kind": "ulsph"}, HELD, {"kind": "spring", "where": "high", "stiffness": 1e11, "damping": 1e7}),
}


def impulses_of(rows: dict) -> np.ndarray:
    """Of both conditions in each step."""
    return (rows["foot"] + rows["top"])[1:, :2] * np.diff(rows["time"])[:, None]


@pytest.mark.parametrize("stated", METHODS.values(), ids=list(METHODS))
def test_forces_change_the_momentum_and_their_work_is_that_of_the_ledger(stated):
    sim = simulation(pulled(*stated, gravity=False))
    rows = follow(sim, Record(told), 12)
    found, work = impulses_of(rows), rows["foot.work"] + rows["top.work"]
    assert np.abs(rows["foot"][1:, 1]).max() > 0.0 and np.abs(rows["top"][1:, 1]).max() > 0.0 < np.abs(work).max()
    np.testing.assert_allclose(np.diff(rows["momentum"], axis=0), found, atol=1e-9 * np.abs(found).max())
    np.testing.assert_allclose(work, rows["external_work"], atol=1e-11 * np.abs(work).max())


@pytest.mark.parametrize("name", first_on_ranks(["tlsph", "peridynamics", "mpm", "ulsph"]))
def test_supports_bear_what_gravity_in_time_adds(name, comm):
    data = pulled(*METHODS[name])
    scale = FAST if name == "ulsph" else 1.0
    data["loads"] = {"acceleration": [f"{0.3 * scale}*cos({9 * scale}*t)", 0.1 * scale]}
    rows = follow(simulation(data, comm), Record(told), 8)
    times = rows["time"]
    # the mean of both ends of a step, or in the material point method its start; stages of the other are nearer
    along = 0.3 * scale * np.cos(9 * scale * times)
    ends, steps = (along[:-1], 0.5 * (along[1:] + along[:-1])), np.diff(times)
    gravity = np.column_stack([ends[name != "mpm"], np.full(len(steps), 0.1 * scale)]) * steps[:, None]
    wanted = impulses_of(rows) + rows["mass"][1:] * gravity
    precise = 1e-2 if name == "tlsph" else 1e-9
    np.testing.assert_allclose(np.diff(rows["momentum"], axis=0), wanted, atol=precise * np.abs(wanted).max())


def test_the_works_of_an_equilibrium_are_that_of_the_ledger():
    rows = follow(simulation(pulled(QUASI, HELD, gravity=False)), Record(told), 12, TimeSteps)
    work = rows["foot.work"] + rows["top.work"]
    np.testing.assert_allclose(work, rows["external_work"], atol=1e-11 * np.abs(work).max())
    np.testing.assert_allclose(rows["foot"][-1, :2], -rows["top"][-1, :2], atol=1e-6 * np.abs(rows["top"]).max())


@pytest.mark.parametrize("method", [EXPLICIT, QUASI], ids=["explicit", "quasi-static"])
def test_a_traction_in_peridynamics_is_met_by_the_support(method):
    """In balance the support's force and moment are those of the traction; the works are those of the ledger."""
    data = pulled(method, HELD, gravity=False)
    push = {"kind": "traction", "plane": "Y = 1", "traction": [0.01, "0.02*X"], "name": "top", "reaction": True}
    data["method"] = method | {"traction": "single-layer"}
    data["boundaries"][1], data["regions"] = push | {"moment_about": [0.5, 0.0]}, [LOW]
    sim = simulation(data)
    rows = follow(sim, Record(told), 12, TimeSteps)
    np.testing.assert_allclose(rows["top"][-1, :2], [0.01, 0.01], rtol=1e-9)
    np.testing.assert_allclose(rows["foot.work"] + rows["top.work"], rows["external_work"], atol=1e-16)
    assert rows["top.work"][-1] > 1e-6
    if method == QUASI:
        # 0.02 X about the middle, and 0.01 at a height of 1, of the particles half a spacing within
        np.testing.assert_allclose(rows["foot"][-1, :2], -rows["top"][-1, :2], rtol=1e-6)
        np.testing.assert_allclose(rows["foot"][-1, 2], -rows["top"][-1, 2], rtol=0.02)


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_moment_is_right_handed_about_its_point(dimension):
    rng = np.random.default_rng(2)
    places, forces, about = rng.normal(size=(3, 5)), rng.normal(size=(3, 5)), rng.normal(size=3)
    if dimension == 2:
        places[2], forces[2], about[2] = 0.0, 0.0, 0.0
    reaction = Reaction(SimpleNamespace(reports="held", moment_about=about[:dimension].tolist()), dimension)
    wanted = sum(np.cross(x - about, f) for x, f in zip(places.T, forces.T))
    wanted = np.append(forces.sum(axis=1)[:dimension], wanted[2:] if dimension == 2 else wanted)
    reaction.set(places[:dimension], forces[:dimension], 0.0)
    np.testing.assert_allclose(reaction.values, wanted, rtol=1e-12)
    # the mean of a step's impulses
    booked = {}
    reaction.sums[:] = 0.0
    for part in (0.25, 0.75):
        reaction.add(places[:dimension], 0.5 * part * forces[:dimension], part)
    reported = SimpleNamespace(reactions=[reaction], _sums=reaction.sums[None])
    Loads.report(reported, 0.5, SimpleNamespace(add_term=booked.__setitem__))
    np.testing.assert_allclose(reaction.values, wanted, rtol=1e-12)
    assert booked == {"held.work": 1.0}
