"""Contact on the nodes of the grid: blows that keep momentum and book what they take, friction, release, ranks."""

import hertz
import numpy as np
import pytest
from mixed.test_methods_meet import CLOSING, SPEED, bars, momenta
from mpi4py import MPI
from solids import Record, follow

from parsolid.methods.mpm.nodal_contact import FieldPair
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

GRID = {"bodies": ["a", "b"], "model": "grid"}


def test_bars_meet_when_their_gap_is_closed_and_part_in_tension():
    data = bars("points", "points", contact=[GRID])
    for method in data.get("methods", [data.get("method")]):
        # of whose lumping the numbers are
        method["transfer"] = "flip"
    sim = Simulation(MPI.COMM_SELF, parse_scene(data))
    found = follow(sim, Record(momenta))
    p, energy = found["momenta"], found["kinetic"][0]
    # lumped over 25 spacings; the exact bars exchange their velocities and meet for 2 L/c
    assert p[-1, 0] == pytest.approx(-0.904 * p[0, 0], rel=0.01)
    assert np.abs(p.sum(axis=1)).max() < 1e-13 * np.abs(p).max()
    pressed = found["time"][np.flatnonzero(np.abs(np.diff(p[:, 0])) > 1e-6 * p[0, 0]) + 1]
    assert pressed[0] * CLOSING * 25 == pytest.approx(0.5, abs=0.05)
    assert (pressed[-1] - pressed[0]) * SPEED / 2.0 == pytest.approx(1.05, abs=0.03)
    # what blows take is a term of its own, found at the nodes, and what particles do not gain is nothing else
    assert found["contact_dissipation"][-1] == pytest.approx(0.040 * energy, rel=0.05)
    assert (
        np.abs(found["numerical_dissipation"]).max() < 1e-4 * energy
        and np.abs(found["energy_error"]).max() < 2e-5 * energy
    )


def sliding(friction: float, **rest) -> dict:
    """Raw tables of a block that rubs on a longer one under a pull towards it, both free to move along X."""
    data = bars("points", "points", contact=[GRID | {"friction": friction}])
    h, solid = 1.0 / 25, data["bodies"][0]["material"]
    shapes = ([0.0, 0.0], [20 * h, 4 * h]), ([4 * h, 4 * h], [12 * h, 8 * h])
    for body, (lower, upper), speed in zip(data["bodies"], shapes, (0.0, CLOSING)):
        cells = [round((b - a) / h) for a, b in zip(lower, upper)]
        body |= {"shape": {"box": {"lower": lower, "upper": upper}}, "particles": cells, "velocity": [speed, 0.0]}
        body["material"] = solid
    data["boundaries"] = [{"plane": "Y = 0", "kind": "roller", "body": "a"}]
    data["loads"] = {"acceleration": ["0", f"-{0.5 * SPEED**2 * CLOSING / SPEED:g}"]}
    return data | {"end_time": 0.5 / SPEED} | rest


def upwards(sim) -> dict:
    """Momentum of the block on the other [N s], with that across it."""
    block = sim.systems[1]
    return momenta(sim) | {"up": float(block.mass[: block.owned] @ block.particles.owned_rows("velocity")[:, 1])}


def test_friction_takes_its_share_of_the_normal_impulse_and_is_heat():
    found = {}
    for friction in (0.0, 0.3):
        found[friction] = follow(Simulation(MPI.COMM_SELF, parse_scene(sliding(friction))), Record(upwards))
    rubbed, smooth = found[0.3], found[0.0]
    weight = 0.5 * SPEED * CLOSING * 32 / 625 * 1000.0
    pressed = weight * rubbed["time"][-1] + rubbed["up"][-1]
    start, end = rubbed["momenta"][0], rubbed["momenta"][-1]
    assert np.abs(rubbed["momenta"].sum(axis=1) - start.sum()).max() < 1e-12 * start.sum()
    assert start[1] - end[1] == pytest.approx(0.3 * pressed, rel=0.03) and pressed > 0.5 * weight * rubbed["time"][-1]
    assert np.abs(smooth["momenta"][-1, 1] - start[1]) < 0.03 * (start[1] - end[1])
    heat = rubbed["friction_dissipation"]
    assert np.diff(heat).min() > -1e-12 * heat[-1] and heat[-1] == pytest.approx(0.3 * pressed * CLOSING, rel=0.3)
    assert np.abs(rubbed["energy_error"]).max() < 1e-3 * rubbed["kinetic"][0]


def rubbing_copper() -> dict:
    """Contact on a grid whose friction heats both bodies."""
    data = sliding(0.3, end_time=3e-4)
    copper = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
    for body, speed in zip(data["bodies"], (0.0, 20.0)):
        body |= {"material": copper, "velocity": [speed, 0.0]}
    return data | {"loads": {"acceleration": ["0", "-1e5"]}}


def test_friction_heats_both_bodies():
    whole = follow(Simulation(MPI.COMM_SELF, parse_scene(rubbing_copper())), Record(momenta), 16)
    # all of it is in the temperatures, half of it in each body
    taken, heat = whole["friction_dissipation"], whole["friction_heat"]
    np.testing.assert_allclose(heat, taken, rtol=1e-12)
    assert heat[-1] > 0.01 * whole["kinetic"][0] and np.diff(taken).min() >= 0.0


def test_a_cylinder_on_a_block_has_hertzs_force_width_and_peak():
    """With two cells in the half width; without gaps it has three times the force."""
    found = hertz.pressed(2, "grid", 4.0, 6.0, 2.0)
    assert max(abs(found.force), abs(found.width), abs(found.peak)) < 0.05, found


def test_blocks_off_their_centres_keep_their_momentum_in_space():
    h, bodies, solid = 0.05, [], bars("points", "points")["bodies"][0]["material"]
    for name, lower, speed in (("a", [0.0, 0.0, 0.0], 3.0), ("b", [6.2 * h, 0.7 * h, 1.4 * h], -3.0)):
        box = {"lower": lower, "upper": [start + 6 * h for start in lower]}
        body = {"name": name, "shape": {"box": box}, "particles": [6, 6, 6], "placement": "cells"}
        bodies.append(body | {"velocity": [speed, 0.0, 0.0], "material": solid})
    method = {"name": "points", "kind": "mpm", "cell": 2 * h, "balance_limit": 1.0}
    data = {"dimension": 3, "end_time": 1.0, "methods": [method], "bodies": bodies}
    sim = Simulation(MPI.COMM_SELF, parse_scene(data | {"contact": [GRID | {"friction": 0.2}]}))

    def whole(sim):
        return {"p": sum(one.mass[: one.owned] @ one.particles.owned_rows("velocity") for one in sim.systems)}

    found = follow(sim, Record(whole), 25)
    # each block has 27 kg at 3 m/s
    assert np.abs(found["p"]).max() < 1e-12 * 81.0
    assert found["contact_dissipation"][-1] > 0.02 * found["kinetic"][0] and found["friction_dissipation"][-1] > 0.0
    meeting = sim.interactions[-1].pairs[0]
    assert meeting.active.any() and (meeting.normal[meeting.active][:, 0] > 0.7).all()


def test_what_friction_holds_sticks_and_what_it_does_not_slides():
    """Of the nodes' velocities, in an impact without a gap; mass in kg, velocities in m/s."""
    pair = FieldPair.__new__(FieldPair)
    pair.normal, pair.active = np.array([[1.0, 0.0]] * 3), np.array([True, True, False])
    mass, relative = np.array([[2.0, 3.0]] * 3), np.array([[0.5, 0.25], [0.5, -4.0], [0.5, 0.25]])
    both, pair.friction = 1.2, 0.8
    pair._find_impulses(mass, relative, np.zeros(3), 1.0)
    left = relative - pair.impulse / both
    # closing is lost, the slow one sticks, the fast one is slowed by mu times as much as was pressed
    np.testing.assert_allclose(left, [[0.0, 0.0], [0.0, -4.0 + 0.8 * 0.5], [0.5, 0.25]], atol=1e-15)
    lost = 0.5 * both * (relative[:, 1] ** 2 - left[:, 1] ** 2)
    np.testing.assert_allclose(pair.rubbed, lost, atol=1e-15)
    # a gap that closes within the step leaves so much of the approach
    pair._find_impulses(mass, relative, np.full(3, 0.3), 1.0)
    np.testing.assert_allclose((relative - pair.impulse / both)[:, 0], [0.3, 0.3, 0.5], atol=1e-15)
