"""Contact, and sums that exact solutions ask for, on ranks without particles: two squares of a cell each."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import COPPER, gathered, simulation

from parsolid.exact.solution import View


def squares() -> dict:
    """All points of each have one stencil, and so one owner."""
    bodies = [
        {
            "name": name,
            "shape": {"box": {"lower": [low, 0.0], "upper": [low + 1.0, 1.0]}},
            "particles": [3, 3],
            "placement": "cells",
            "material": COPPER,
            "velocity": [speed, "0"],
        }
        for name, low, speed in (("a", 0.0, "100"), ("b", 1.0, "-100"))
    ]
    method, contact = {"kind": "mpm", "cell": 2.0}, [{"bodies": ["a", "b"]}]
    return {"dimension": 2, "end_time": 1.0, "method": method, "bodies": bodies, "contact": contact}


class Rows:
    """Particles of a rank, as `View` asks for them."""

    def __init__(self, count: int) -> None:
        self.volume = np.full(count, 0.5)

    def rows(self, name: str) -> np.ndarray:
        assert name == "volume"
        return self.volume


def test_sums_count_ranks_without_particles(comm):
    """All of 6 particles are on the last rank."""
    count = 6 if comm.rank == comm.size - 1 else 0
    values = np.ones(count), np.ones((count, 3)), np.ones((count, 2, 2))
    assert View(comm, Rows(count)).sums(*values).tolist() == [3.0, 9.0, 12.0]


def test_ranks_without_particles_take_part_in_contact(comm):
    found = []
    for one in (comm, MPI.COMM_SELF):
        sim = simulation(squares(), one)
        if one.size == 3:
            assert min(one.allgather(sim.systems[0].owned)) == 0
        step = 0.1 * one.allreduce(sim.stable_step(), MPI.MIN)
        for _ in range(3):
            sim.take_step(step)
        found.append(gathered(sim, "position", "velocity"))
    for many, alone in zip(*found):
        assert many == pytest.approx(alone, rel=1e-9, abs=1e-9)
