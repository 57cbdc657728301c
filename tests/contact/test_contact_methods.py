"""Contact in every method that knows it, in two and three dimensions, and within one body."""

import numpy as np
import pytest
from contact.meeting import BONDS, SOFT, SPEED, block, simulated, tables
from mpi4py import MPI
from solids import recorded

from parsolid.simulation.loop import Limits

pytestmark = pytest.mark.slow
LINEAR = {"kind": "linear-elastic", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}


@pytest.mark.serial
def test_blocks_rebound_in_space(comm):
    n, h = 5, 0.2
    left = block("left", [-1.0, 0.0, 0.0], [0.0, 0.6, 0.6], [n + 1, 4, 4], velocity=[0.005 * SPEED, 0.0, 0.0])
    right = block("right", [0.0, 0.1, 0.05], [1.0, 0.7, 0.65], [n + 1, 4, 4], velocity=[-0.005 * SPEED, 0.0, 0.0])
    sim = simulated(tables(left, right, end_time=32.0 * h / SPEED), comm)
    columns, system = recorded(sim), sim.systems[0]
    body, v = system.particles.owned_rows("body"), system.particles.owned_rows("velocity")[:, 0]
    m = system.mass[: system.owned] * system.share[: system.owned]
    sums = comm.allreduce(np.array([[(m * v)[body == i].sum(), m[body == i].sum()] for i in (0, 1)]))
    left_v, right_v = sums[:, 0] / sums[:, 1] / (0.01 * SPEED)
    # the bodies part with so much of their closing speed
    assert 0.5 < right_v - left_v < 1.0 and abs(right_v + left_v) < 1e-12
    assert np.abs(columns["energy_error"]).max() < 0.02 * columns["kinetic"][0]
    assert columns["contact_energy"].max() > 0.005 * columns["kinetic"][0]


def ring(contact) -> dict:
    """A ring whose top and bottom run into each other."""
    shell = {"cylindrical_shell": {"centre": [0.0, 0.0], "radius": 1.0, "thickness": 0.3, "angles": [0.0, 360.0]}}
    body = {
        "name": "ring",
        "shape": shell,
        "particles": [64, 4],
        "placement": "cells",
        "material": SOFT,
        "velocity": ["0", "-0.9*Y"],
    }
    return tables(body, contact=contact, end_time=2.0)


def test_a_ring_does_not_pass_through_itself(comm):
    columns = []
    for contact in ([], [{"bodies": ["ring"]}]):
        sim = simulated(ring(contact), comm)
        place = sim.systems[0].particles.owned_rows("reference_position")
        top = (np.abs(place[:, 0]) < 0.1) & (place[:, 1] > 0.0) & (np.linalg.norm(place, axis=1) < 0.93)

        def look(sim, top=top):
            y = sim.systems[0].particles.owned_rows("position")[top, 1]
            return {"lowest": comm.allreduce(float(y.min(initial=1.0)), MPI.MIN)}

        columns.append(recorded(sim, look))
    free, held = columns
    assert free["lowest"].min() < -0.05 and held["lowest"].min() > -0.02
    # nothing before it closes, but for steps that are shorter when it is near
    closed = np.flatnonzero(held["contact_energy"])[0]
    wanted = np.interp(held["time"][:closed], free["time"], free["lowest"])
    assert closed > 5 and np.abs(held["lowest"][:closed] - wanted).max() < 5e-3
    assert np.abs(held["energy_error"]).max() < 0.02 * held["kinetic"][0]


def cracked(contact, speed, upper_half) -> dict:
    """A plate cut through along Y = 0 by a pre-crack, whose halves move at these velocities."""
    plate = block("plate", (0.0, -1.0), (3.0, 1.0), [24, 16], "cells")
    plate |= {"material": LINEAR, "velocity": ["0", f"{speed}*where(Y > 0, {upper_half}, 1)"]}
    cut = {"plane": "Y = 0"}
    method = BONDS | {"pre_cracks": [cut], "damage": {"critical_stretch": 10.0}}
    return tables(plate, method=method, contact=contact, end_time=3.0)


@pytest.mark.serial
def test_faces_of_a_crack_meet_without_a_push_where_they_were(comm):
    named = [{"bodies": ["plate"]}]
    resting = simulated(cracked(named, 0.0, 1.0), comm)
    resting.run(limits=Limits(20))
    assert np.abs(resting.systems[0].particles.owned_rows("velocity")).max() < 1e-14
    gaps = {}
    for contact in ([], named):
        sim = simulated(cracked(contact, 0.02, -1.0), comm)
        system = sim.systems[0]
        place = system.particles.owned_rows("reference_position")
        lower = (place[:, 1] < 0.0) & (place[:, 1] > -0.1)
        upper = (place[:, 1] > 0.0) & (place[:, 1] < 0.1)
        columns = recorded(sim)
        y = system.particles.owned_rows("position")[:, 1]
        ends = comm.allreduce(np.array([y[lower].sum(), lower.sum(), y[upper].sum(), upper.sum()]))
        gaps[bool(contact)] = ends[2] / ends[3] - ends[0] / ends[1]
    # of 0.125 at the start, each half ran 0.06 towards the other
    assert gaps[False] < 0.02 and gaps[True] > 0.1
    assert np.abs(columns["energy_error"]).max() < 0.02 * columns["kinetic"][0]
