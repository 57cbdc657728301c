"""Stages: from equilibria to motion and back, with one ledger, on all ranks, through restarts, and what is refused."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import Record, follow, gathered, simulation, tables
from tlsph.test_mesh_weights import of_mesh

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.simulation.time_step import TimeSteps

MOVING, STILL = {"integrator": "leapfrog"}, {"integrator": "static"}
PRESSED = ["0", "-0.1*min(t, 1) - 0.05*where(t > 1, where(t < 1.5, 1, 0), 0)"]


def staged(first, *stages, shape=None, load=PRESSED, **rest):
    """Tables of a block on a foot, pressed until t = 1, with a method at first and one at each time."""
    boundaries = [
        {"plane": "Y = 0", "kind": "fixed", "mirror": False, "name": "foot", "reaction": True},
        {"plane": "Y = 1", "kind": "traction", "traction": load},
    ]
    data = shape or tables((9, 9), (1.0, 1.0))
    data |= {"end_time": 2.0, "output": {"fields_interval": 1.0}, "boundaries": boundaries, **rest}
    data["method"] = {"kind": "tlsph", **first}
    return data | {"stages": [{"start": start, "method": method} for start, method in stages]}


def run(data, comm):
    """A run to its end, and the columns of its record."""
    sim = simulation(data, comm)
    return sim, follow(sim, Record(), policy=TimeSteps)


def there_and_back(shape=None, **rest):
    """A block that is pressed, struck and pressed again."""
    stages = (1.0, MOVING), (1.75, STILL)
    return staged(
        STILL, *stages, shape=shape, **{"load": [*PRESSED[:1], PRESSED[1] + " - 0.1*max(t - 1.75, 0)"]} | rest
    )


@pytest.mark.serial
@pytest.mark.parametrize("kind", ["box", "mesh"])
def test_there_and_back(shared_path, comm, kind):
    """The last state is that of equilibria alone."""
    shape = of_mesh(shared_path, "triangle", 2, moving=0.0) if kind == "mesh" else None
    data = there_and_back(shape)
    rows = run(data, comm)[1]
    largest = rows["strain_energy"].max()
    assert rows["kinetic"][rows["time"] <= 1.0].max() == 0.0
    assert rows["kinetic"][(rows["time"] > 1.0) & (rows["time"] < 1.75)].max() > 1e-3 * largest
    assert rows["kinetic"][rows["time"] >= 1.75].max() == 0.0
    alone = run(data | {"stages": []}, comm)[1]
    assert rows["strain_energy"][-1] == pytest.approx(alone["strain_energy"][-1], rel=1e-6)


@pytest.mark.serial
def test_equilibrium_stays(comm):
    """A motion from an equilibrium under the same loads has no velocity but that of its tolerance."""
    data = staged(STILL, (1.0, MOVING), load=["0", "-0.1*min(t, 1)"])
    _, rows = run(data, comm)
    assert rows["kinetic"].max() < 1e-14 * rows["strain_energy"].max()


@pytest.mark.serial
def test_driven_through_stages(comm):
    """Displacements are prescribed in equilibrium and in motion, to the same places."""
    driven = [
        {"plane": "Y = 0", "kind": "fixed", "mirror": False},
        {"plane": "Y = 1", "kind": "displacement", "displacement": ["free", "-0.05*t"]},
    ]
    data = staged(STILL, (1.0, MOVING), (1.5, STILL), boundaries=driven)
    sim, rows = run(data, comm)
    X, x = gathered(sim, "reference_position", "position")
    np.testing.assert_allclose(x[X[:, 1] == 1.0, 1], 0.9, rtol=0.0, atol=1e-14)
    assert np.abs(rows["energy_error"]).max() < 2e-4 * rows["strain_energy"].max()


def test_check_counts_the_steps_of_every_stage():
    scene = parse_scene(there_and_back())
    system = Simulation(MPI.COMM_SELF, scene).systems[0]
    of_motion = 0.75 / system.leapfrog.stable_step()
    # of equilibria ten load steps a stage, at least
    assert system.steps_to(scene.end_time) == pytest.approx(of_motion + 2 * 10) and of_motion > 20.0


@pytest.mark.serial
def test_settings_of_a_stage(comm):
    """Steps of a motion are as long as its own stage says."""
    data = staged(STILL, (1.0, MOVING), (1.5, MOVING | {"maximum_step": 0.01}))
    _, rows = run(data, comm)
    steps = np.diff(rows["time"])
    before, after = (steps[(rows["time"][1:] > low) & (rows["time"][1:] <= high)] for low, high in ((1, 1.5), (1.5, 2)))
    assert after.max() < 0.010001 < before.max()


@pytest.mark.serial
@pytest.mark.parametrize("weights", ["cells", "mesh"])
def test_struck_beside_a_motion_that_waited(shared_path, comm, weights):
    """A column that is pressed in equilibrium and then struck moves as one that was pressed over many of its periods of
    2.5 s; an equilibrium at the end lets the boxes that only move have the same stabiliser."""
    start, end = 40.0, 44.0
    pressed = f"-0.2*(1 - 0.5*(1 + cos(pi*min(t/{0.8 * start}, 1))))"
    struck = f"-0.1*where(t > {start}, where(t < {start + 2.0}, sin(pi*(t - {start})/2), 0), 0)"
    foot = {"plane": "Y = 0", "kind": "fixed", "mirror": False}
    boundaries = [foot, {"plane": "Y = 1", "kind": "traction", "traction": ["0", f"{pressed} + {struck}"]}]
    shape = of_mesh(shared_path, "triangle", 2) if weights == "mesh" else tables((5, 5))
    rest = {"shape": shape, "boundaries": boundaries, "end_time": 44.5, "output": {"fields_interval": 4.0}}

    def tip(sim):
        X, x = gathered(sim, "reference_position", "position")
        return {"tip": (x - X)[X[:, 1] == 1.0, 1].mean()}

    ways = []
    for first, *stages in ((STILL, (start, MOVING)), (MOVING, (end, STILL))):
        sim = simulation(staged({**first, "weights": weights}, *stages, **rest), comm)
        ways.append(follow(sim, Record(tip), policy=TimeSteps))
    pressed_first, waited = ways
    seen = (waited["time"] >= start) & (waited["time"] < end)
    way = waited["tip"][seen]
    np.testing.assert_allclose(
        np.interp(waited["time"][seen], pressed_first["time"], pressed_first["tip"]), way, atol=1e-3 * np.ptp(way)
    )
    assert np.ptp(way) > 0.5 * np.abs(way).max()
    assert len(pressed_first["time"]) < 0.2 * len(waited["time"])
