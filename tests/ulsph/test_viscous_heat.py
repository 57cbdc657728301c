"""Heat of the artificial viscosity is what its forces take from the motion, in steps of any lengths."""

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.materials.plastic.tile_update import HEAT
from parsolid.methods.ulsph.elastic_plastic import viscous_losses
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation
from parsolid.tiles import TILE

COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}


def collision(dimension: int) -> Simulation:
    """Two blocks of copper that are one but for their velocities, of eight particles a side together."""
    side, flat = 8e-3, [0.0] * (dimension - 1)
    shape = {"box": {"lower": [*flat, 0.0], "upper": [4e-3] * (dimension - 1) + [side]}}
    body = {"shape": shape, "particles": [4] * (dimension - 1) + [8], "placement": "cells", "material": COPPER}
    axis = "XYZ"[dimension - 1]
    body["velocity"] = ["0"] * (dimension - 1) + [f"-25*where({axis} > {0.5 * side}, 1, -1)"]
    tables = {"dimension": dimension, "end_time": 1.0, "method": {"kind": "ulsph"}, "bodies": [body]}
    return Simulation(MPI.COMM_SELF, parse_scene(tables))


@pytest.mark.parametrize("dimension", [2, 3])
def test_heat_is_the_work_of_both_kicks_however_long_their_steps(dimension):
    """After a step that follows, of length 0, nothing is to come, and all that was taken is heat; to round-off."""
    sim = collision(dimension)
    system, taken = sim.systems[0], []
    kicks, book = system.kicks, system.kicks.book

    def watched(step, ledger, plastic, lost):
        taken.append(kicks.opening.viscous + kicks.closing.viscous)
        book(step, ledger, plastic, lost)

    kicks.book = watched
    whole = sim.take_step(0.0)
    for share in (0.1, 1.0, 0.05, 0.7, 0.0):
        sim.take_step(share * whole)
    row = sim.energy_row()
    assert row["viscous_heat"] > 0.02 * row["kinetic"] and abs(row["viscous_heat_to_come"]) < 1e-12 * row["kinetic"]
    assert abs(row["viscous_heat"] - np.sum(taken)) < 1e-9 * row["viscous_heat"]


@pytest.mark.parametrize("steps", [1, 7])
def test_the_balance_does_not_wait_for_heat_that_is_to_come(steps):
    """2.3e-2 of the energy before, and that of the first half step for good."""
    sim = collision(2)
    start = sim.energy_row()["kinetic"]
    for _ in range(steps):
        sim.take_step(sim.stable_step())
        row = sim.energy_row()
        assert row["viscous_heat_to_come"] > 1e-3 * start and abs(row["energy_error"]) < 1e-3 * start


@pytest.mark.parametrize("with_contact", [False, True])
def test_the_loss_of_two_half_kicks_with_an_impulse_between(with_contact):
    """The closing half kick of a step d, an impulse of contact, the opening one of the next step d', one by one."""
    rng, before, step, m = np.random.default_rng(1), 0.3, 0.5, 2.0
    v, V, S, C, change = rng.normal(size=(5, 3))
    F = V + S + (C if with_contact else 0.0)
    closed = v + 0.5 * before * F / m
    opened = closed + change + 0.5 * step * F / m
    wanted = -0.25 * before * V @ (v + closed) - 0.25 * step * V @ (closed + change + opened)
    column = [one[:, None] for one in (S, V)]
    numbers = [np.array([[one]]) for one in (m, -V @ v, V @ change)]
    tile = np.zeros((HEAT + 1) * TILE)
    external = C[:, None] if with_contact else None
    viscous_losses(step, 0.5 * (before + step), numbers[0], *column, numbers[1], numbers[2], external, 0, 1, tile)
    assert tile[HEAT * TILE] == pytest.approx(wanted, rel=1e-12)
