"""The impact on any number of ranks and through a restart, with lists made anew."""

import numpy as np
import pytest
from solids import simulation
from ulsph.plates import impact


def run(sim, steps):
    system = sim.systems[0]
    sim.stable = sim.stable or sim.comm.allreduce(system.stable_step(), min_of())
    for _ in range(steps):
        sim.take_step(2e-8)
    return system


def min_of():
    from mpi4py import MPI

    return MPI.MIN


@pytest.mark.parametrize("contact", ["compression", "welded"])
def test_bodies_that_touch_at_rest_stay_at_rest(contact, comm):
    data = impact(across=7, along=12, speed=0.0, method={"contact": contact})
    system = run(simulation(data, comm), 5)
    assert np.abs(system.particles.owned_rows("velocity")).max(initial=0.0) == 0.0


def test_bodies_part_freely(comm):
    """Bodies that fly apart feel nothing of one another in compression-only contact, and do when welded."""
    for contact, free in (("compression", True), ("welded", False)):
        data = impact(across=7, along=12, speed=-5.0, method={"contact": contact})
        system = run(simulation(data, comm), 5)
        spread = np.abs(np.abs(system.particles.owned_rows("velocity")[:, 0]) - 5.0).max(initial=0.0)
        assert (comm.allreduce(spread, max_of()) < 1e-9) == free


def max_of():
    from mpi4py import MPI

    return MPI.MAX
