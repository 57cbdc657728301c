"""Contact between bodies in equilibria and long steps: patch, energy, stages; `cases` has friction and ranks."""

import numpy as np
import pytest
from element_meshes import element_mesh
from mpi4py import MPI
from solids import SOFT, Record, follow, gathered, run_to_end, simulation
from tlsph.test_mesh_weights import write
from tlsph.test_stages import run

from parsolid.methods.tlsph.closing import _rotation
from parsolid.methods.tlsph.static import Failed, Static
from parsolid.scene import parse_scene
from parsolid.simulation.loop import RunFailed, Simulation
from parsolid.simulation.time_step import TimeSteps

FLAT = [{"plane": "X = 0", "kind": "roller"}, {"plane": "X = 1", "kind": "roller"}]


def moved(plane, *displacement):
    """A face with a prescribed displacement."""
    return {"plane": plane, "kind": "displacement", "displacement": list(displacement)}


def square(name, low, particles, **keys):
    """A square of one metre that begins at a height."""
    shape = {"box": {"lower": [0.0, low], "upper": [1.0, low + 1.0]}}
    return {"name": name, "shape": shape, "particles": list(particles), "material": SOFT, **keys}


def stacked(boundaries, gap=0.0, particles=((5, 5), (5, 5)), end=1.0, method=None, **contact):
    """Two squares, one above the other, that touch or nearly do."""
    return {
        "dimension": 2,
        "end_time": end,
        "method": {"kind": "tlsph", "integrator": "static", "weights": "cells", **(method or {})},
        "bodies": [square("low", 0.0, particles[0]), square("high", 1.0 + gap, particles[1])],
        "contact": [{"bodies": ["low", "high"], **contact}],
        "boundaries": boundaries,
        "output": {"fields_interval": end},
    }


def rubbing():
    """A square that is pressed on another one and drawn along it, so that it slips."""
    boundaries = [{"plane": "Y = 0", "kind": "fixed"}, moved("Y = 2", "0.12*t", "-0.12*t")]
    # the rate of a path is a difference of what is solved for
    return stacked(boundaries, particles=((3, 4), (4, 4)), method={"tolerance": 1e-11}, friction=0.1)


@pytest.mark.serial
def test_patch(comm):
    """Equal lattices that meet after a gap are strained evenly along the face, by the work of what moves them."""
    boundaries = [*FLAT, {"plane": "Y = 0", "kind": "roller"}, moved("Y = 2.02", "free", "-0.22*t")]
    sim, rows = run(stacked(boundaries, 0.02), comm)
    X, F = gathered(sim, "reference_position", "deformation_gradient")
    strain = F[:, 3] - 1.0
    for height in np.unique(X[:, 1]):
        assert np.ptp(strain[X[:, 1] == height]) < 1e-3 * abs(strain.mean())
    # beyond the layers that the forces between the bodies reach
    far = strain[(X[:, 1] < 0.1) | (X[:, 1] > 1.9)]
    assert np.ptp(far) < 0.02 * abs(far.mean())
    assert np.abs(rows["energy_error"]).max() < 1e-4 * rows["external_work"][-1]
    assert rows["contact_energy"][-1] > 0.02 * rows["external_work"][-1]


def test_tangent():
    """Forces are the gradient of the energy, and the tangent that of the forces, where some particles press."""
    sim = Simulation(MPI.COMM_SELF, parse_scene(rubbing() | {"contact": [{"bodies": ["low", "high"]}]}))
    sim.take_step(0.0)
    statics, random = sim.systems[0].statics, np.random.default_rng(1)
    X = sim.systems[0].particles.owned_rows("reference_position")
    u = 0.01 * random.standard_normal(X.shape) * statics.free
    u[:, 1] -= 0.1 * (X[:, 1] > 1.0)
    change, part = random.standard_normal(X.shape) * statics.free, 1e-5
    one, other = (statics.evaluate(u + sign * part * change) for sign in (1.0, -1.0))
    state = statics.evaluate(u)
    statics.linearise()
    product = statics.stiffness(change) * statics.free
    assert sim.interactions[0].energy > 1e-3
    assert (one.energy - other.energy) / (2.0 * part) == pytest.approx(-np.vdot(state.residual, change), rel=1e-6)
    np.testing.assert_allclose((one.residual - other.residual) / (-2.0 * part), product, atol=1e-6 * abs(product).max())


@pytest.mark.parametrize("depth", [1e-9, 1e-3])
def test_friction_is_linearised(depth):
    """The tangent of bodies that rub is linear in the change, also where slip and Coulomb's limit are shorter than the
    differences that it takes."""
    sim = Simulation(MPI.COMM_SELF, parse_scene(rubbing()))
    sim.take_step(0.0)
    statics, random = sim.systems[0].statics, np.random.default_rng(1)
    high = sim.systems[0].particles.owned_rows("body") == 1
    down = 0.0
    for _ in range(20):
        statics.evaluate(np.outer(high, [0.4 * depth, -down]))
        down += statics._clearances().min() + depth
    assert sim.interactions[0].energy > 0.0
    statics.linearise()
    one, other = random.standard_normal((2, *statics.free.shape)) * statics.free
    together = statics.stiffness(one + other)
    np.testing.assert_allclose(
        together, statics.stiffness(one) + statics.stiffness(other), atol=1e-6 * np.abs(together).max()
    )


@pytest.mark.ranks(1, 2)
def test_drag(shared_path, comm):
    """A block of a mesh that is pressed on another one by 1 % and dragged along it bears its coefficient times what
    presses, on one rank and on two; what nodes give that pass beneath its ends grows with the load."""
    bodies, friction = [], 0.2
    for name, counts, corner in (("slab", (12, 3), (0.0, 0.0)), ("block", (6, 3), (0.5, 0.5))):
        points, blocks = element_mesh("triangle", counts, 0.0, 1.0 / 6.0)
        write(shared_path / f"{name}.vtu", points + np.array(corner), blocks)
        bodies.append({"name": name, "material": SOFT, "shape": {"mesh": {"file": str(shared_path / f"{name}.vtu")}}})
    data = stacked([{"plane": "Y = 0", "kind": "fixed"}], friction=friction)
    del data["method"]["weights"]
    data["bodies"], data["contact"][0]["bodies"] = bodies, ["slab", "block"]
    data["boundaries"].append(moved("Y = 1", "0.0075*t", "-0.005*t") | {"name": "top", "reaction": True})
    sim, rows = run(data, comm)
    force = comm.allreduce(sim.systems[0].reaction("top"))
    assert force[0] == pytest.approx(-friction * force[1], rel=2e-3)
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"][-1]


@pytest.mark.serial
def test_bodies_that_only_contact_holds(comm):
    """A load that pulls a body away ends the run with its name, and not that of the one it may touch."""
    load = {"plane": "Y = 2.02", "kind": "traction", "traction": ["0", "1e-3*t"]}
    with pytest.raises(RunFailed) as failed:
        run(stacked([{"plane": "Y = 0", "kind": "fixed"}, load], 0.02, ((3, 3), (3, 3))), comm)
    assert "bodies.1 (high)" in str(failed.value) and "bodies.0" not in str(failed.value)


@pytest.mark.parametrize("part", ["t", "1"])
@pytest.mark.ranks(1, 2)
def test_a_load_closes_gaps(comm, part):
    """A square above another one, which nothing else holds, is brought into contact by a load that grows from nothing
    or comes at once, without work, and bears it."""
    load = {"plane": "Y = 2.1", "kind": "traction", "traction": ["0", f"-0.05*{part}"]}
    foot = {"plane": "Y = 0", "kind": "roller", "mirror": False, "name": "foot", "reaction": True}
    sim, rows = run(stacked([*FLAT, foot, load], 0.1, ((3, 3), (4, 4))), comm)
    assert comm.allreduce(sim.systems[0].reaction("foot"))[1] == pytest.approx(0.05, rel=1e-6)
    work = rows["external_work"][-1]
    assert 0.0 < work < 0.05 * 0.05
    # contact is soft where it has just begun
    assert 0.1 < sim.systems[0].summary()["closed_gap_metres"] < 0.101
    assert np.abs(rows["energy_error"]).max() < 5e-3 * work


@pytest.mark.ranks(1, 2)
@pytest.mark.parametrize("nodes", [3, 4])
def test_friction_alone_holds(comm, nodes):
    """A block above a slab is brought down by its weight and bears a push of half of Coulomb's limit along the slab.
    One of three nodes an edge touches with the middle one alone, and turns until another one bears the moment."""
    push = {"plane": "X = 0", "kind": "traction", "body": "high", "traction": ["2e-3*t", "0"]}
    weight = {"plane": "Y = 2.05", "kind": "traction", "traction": ["0", "-0.02*min(4*t, 1)"]}
    foot = {"plane": "Y = 0", "kind": "fixed", "mirror": False, "name": "foot", "reaction": True}
    data = stacked([foot, push, weight], 0.05, ((9, 5), (nodes, nodes)), friction=0.2)
    data["bodies"][0]["shape"] = {"box": {"lower": [-0.5, 0.0], "upper": [1.5, 1.0]}}
    sim, rows = run(data, comm)
    np.testing.assert_allclose(comm.allreduce(sim.systems[0].reaction("foot"))[:2], [-2e-3, 0.02], rtol=1e-6)
    assert rows["friction_dissipation"][-1] < 0.01 * rows["external_work"][-1]
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["external_work"][-1]


@pytest.mark.parametrize("dimension", [2, 3])
def test_a_linear_turn_is_made_a_rotation(comm, dimension):
    """Of places that all ranks have a part of: it keeps all distances, and is that turn where it is small."""
    every = np.random.default_rng(1).uniform(size=(3 * comm.size, dimension))
    places = every[3 * comm.rank : 3 * comm.rank + 3]
    turn = np.array([[0.0, -0.3, 0.1], [0.3, 0.0, -0.2], [-0.1, 0.2, 0.0]])[:dimension, :dimension]
    for part in (1.0, 1e-4):
        way = 0.5 + part * places @ turn.T
        moved, R, angle = _rotation(comm, places, way)
        assert angle == pytest.approx(part * np.linalg.norm(turn) / 2.0**0.5, rel=1e-9)
        np.testing.assert_allclose(R @ R.T, np.eye(dimension), atol=1e-14)
        found = np.concatenate(comm.allgather(places + moved))
        np.testing.assert_allclose(found - found[0], (every - every[0]) @ R.T, atol=1e-13)
        np.testing.assert_allclose(moved, way, atol=part**2)


@pytest.mark.serial
def test_attempts_that_do_not_get_on_end_the_run(comm, monkeypatch):
    """Contacts that close again and again, however near."""
    sim = simulation(stacked([{"plane": "Y = 0", "kind": "fixed"}, moved("Y = 2", "0", "-0.1*t")]), comm)
    tries = []
    monkeypatch.setattr(Static, "_attempt", lambda *_: tries.append(0) or Failed("", part=0.99))
    with pytest.raises(RunFailed):
        follow(sim, Record(), policy=TimeSteps)
    assert len(tries) < 100


@pytest.mark.serial
def test_bounce(comm):
    """A square that falls on another one in long steps: momentum and energy are kept."""
    data = stacked([], 0.05, ((4, 4), (5, 5)), 1.2, {"integrator": "implicit", "maximum_step": 0.02})
    data["bodies"][1]["velocity"] = ["0.1", "-0.3"]
    sim, rows = run_to_end(data, comm)
    assert rows["contact_energy"].max() > 0.05 * rows["kinetic"][0]
    assert np.abs(rows["energy_error"]).max() < 5e-3 * rows["kinetic"][0]
    velocity, mass, body = gathered(sim, "velocity", "mass", "body")
    momentum = mass @ velocity
    np.testing.assert_allclose(momentum, mass[body == 1].sum() * np.array([0.1, -0.3]), rtol=1e-6)


@pytest.mark.serial
def test_pressed_then_let_go(comm):
    """One ledger where bodies are pressed on one another in equilibrium and drawn apart in motion."""
    drawn = "where(t < 0.1, -0.4*t, t - 0.14)"
    boundaries = [*FLAT, {"plane": "Y = 0", "kind": "roller"}, moved("Y = 2", "free", drawn)]
    data = stacked(boundaries, 0.0, ((4, 4), (4, 4)), 0.4)
    _, rows = run(data | {"stages": [{"start": 0.1, "method": {"integrator": "leapfrog"}}]}, comm)
    pressed = rows["time"] <= 0.1
    assert rows["contact_energy"].max() > 0.02 * rows["strain_energy"][pressed].max()
    assert rows["contact_energy"][-1] < 0.5 * rows["contact_energy"].max()
    assert np.abs(rows["energy_error"]).max() < 5e-3 * rows["external_work"].max()
