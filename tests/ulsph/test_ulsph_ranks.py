"""The impact on any number of ranks and through a restart, with lists made anew."""

import numpy as np
import pytest
from solids import simulation
from ulsph.plates import block, impact, scene


def run(sim, steps):
    system = sim.systems[0]
    sim.stable = sim.stable or sim.comm.allreduce(system.stable_step(), min_of())
    for _ in range(steps):
        sim.take_step(2e-8)
    return system


def min_of():
    from mpi4py import MPI

    return MPI.MIN


def spinning() -> dict:
    """A square that turns, so that its lists are made anew."""
    return scene(block([24, 24], [24e-3, 24e-3], velocity=["-3e4*(Y - 0.012)", "3e4*(X - 0.012)"]), end_time=3.5e-5)


def test_momentum_is_kept_while_lists_are_made_anew(comm):
    data = spinning()
    sim = simulation(data, comm)
    system = run(sim, 300)
    momentum = comm.allreduce((system.mass[:, None] * system.particles.owned_rows("velocity")).sum(axis=0))
    size = comm.allreduce((system.mass * np.linalg.norm(system.particles.owned_rows("velocity"), axis=1)).sum())
    assert np.abs(momentum).max() < 1e-12 * size
    assert system.pairs.builds > 3
    assert comm.allreduce(system.pairs.late) == 0


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
