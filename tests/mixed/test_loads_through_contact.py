"""Loads and walls of material points in contact, whose work the balance does not test: against momentum and ways."""

import numpy as np
import pytest
from mixed.bodies_apart import RUBBER
from mpi4py import MPI
from solids import late_impulse

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

PRESSURE, WIDTH, STEPS = 4e5, 6e-3, (1.5e-6, 0.7e-6, 2.1e-6, 1.2e-6)
PULL = {
    "kind": "traction",
    "plane": "Y = 6e-3",
    "body": "top",
    "traction": [0.3 * PRESSURE, -PRESSURE],
    "name": "load",
    "reaction": True,
}
WALL = {"kind": "wall", "plane": "Y = 0", "side": "above", "velocity": [0.0, 0.5], "name": "wall", "reaction": True}


def pile(*boundaries: dict, **more) -> Simulation:
    """A block of 6 x 3 particles on another one of its size, which it touches, with friction."""
    bodies = []
    for name, low in (("base", 0.0), ("top", 3e-3)):
        box = {"lower": [0.0, low], "upper": [WIDTH, low + 3e-3]}
        body = {"name": name, "shape": {"box": box}, "particles": [6, 3], "placement": "cells", "material": RUBBER}
        bodies.append(body | {"velocity": [0.0, -3.0 if name == "top" else 0.0]})
    data = {"dimension": 2, "end_time": 1.0, "method": {"kind": "mpm", "cell": 2e-3}, "bodies": bodies}
    data["contact"] = [{"bodies": ["base", "top"], "friction": 0.3}]
    return Simulation(MPI.COMM_SELF, parse_scene(data | {"boundaries": list(boundaries)} | more))


def momentum(sim: Simulation) -> np.ndarray:
    """Of all bodies, with what waits for the next step [N s]."""
    total = np.zeros(2)
    for system in sim.systems:
        rows = system.particles.owned_rows
        total += (rows("mass")[:, None] * rows("velocity")).sum(axis=0) + late_impulse(system).sum(axis=0)
    return total


def push(sim: Simulation, steps: int) -> tuple[float, float]:
    """Steps of unlike lengths; the time, and that until which velocities have had their forces [s]."""
    time = 0.0
    for k in range(steps):
        sim.take_step(STEPS[k % len(STEPS)])
        time += STEPS[k % len(STEPS)]
    return time, time - 0.5 * STEPS[(steps - 1) % len(STEPS)]


def pressed(sim: Simulation) -> None:
    """Contact acts, or nothing is tested."""
    row = sim.energy_row()
    assert row["contact_energy"] > 1e-2 * row["kinetic"] and row["friction_dissipation"] >= 0.0


def test_a_traction_gives_its_impulse_through_contact():
    sim = pile(PULL)
    before = momentum(sim)
    _, until = push(sim, 24)
    pressed(sim)
    wanted = WIDTH * until * np.array([0.3 * PRESSURE, -PRESSURE])
    np.testing.assert_allclose(momentum(sim) - before, wanted, rtol=1e-9)


@pytest.mark.parametrize("speed", [0.5, 0.0])
def test_a_wall_takes_what_momentum_lacks_and_works_by_its_velocity(speed):
    sim, told = pile(PULL, WALL | {"velocity": [0.0, speed]}), 0.0
    before, until = momentum(sim), 0.0
    for k in range(24):
        sim.take_step(STEPS[k % 4])
        kicked = 0.5 * (STEPS[k % 4] + (STEPS[k % 4 - 1] if k else 0.0))
        told, until = told + kicked * sum(system.reaction("wall")[1] for system in sim.systems), until + kicked
    pressed(sim)
    missing = momentum(sim) - before - WIDTH * until * np.array([0.3 * PRESSURE, -PRESSURE])
    assert missing[1] > 0.5 * WIDTH * until * PRESSURE
    np.testing.assert_allclose([0.0, told], missing, atol=1e-9 * missing[1])
    row = sim.energy_row()
    assert row["wall.work"] == pytest.approx(speed * missing[1], rel=1e-9)
    assert row["external_work"] == pytest.approx(row["wall.work"] + row["load.work"], rel=1e-9)


def test_the_work_of_a_load_is_its_force_along_its_way():
    """Until the time of velocities, half a step before that of places."""
    sim = pile(PULL, WALL)
    system = sim.systems[1]
    force, rows = PRESSURE * np.array([0.3, -1.0]) * 1e-3, system.particles.owned_rows
    upper, start = rows("reference_position")[:, 1] > 5e-3, rows("position").copy()
    push(sim, 24)
    pressed(sim)
    way = rows("position") - start - 0.5 * STEPS[23 % 4] * rows("moved")
    wanted = float(np.sum(force * way[upper]))
    assert upper.sum() == 6 and sim.energy_row()["load.work"] == pytest.approx(wanted, rel=2e-3)
