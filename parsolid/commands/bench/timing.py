"""Timing of a simulation's steps."""

import time
from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.simulation.loop import Simulation

REPETITIONS = 7


def best_time(action: Any, clock: Callable[[], float] = time.perf_counter) -> float:
    """Least time [s] of an action that has already run once, on the wall unless another clock is given."""
    action()
    best = np.inf
    for _ in range(REPETITIONS):
        began = clock()
        action()
        best = min(best, clock() - began)
    return best


class Steps:
    """Advances a simulation by a few small steps at each call."""

    def __init__(self, comm: MPI.Comm, scene: Any, steps: int) -> None:
        self.simulation = Simulation(comm, scene)
        self.steps = steps
        stable = self.simulation.systems[0].stable_step()
        self.step = 0.1 * comm.allreduce(stable, MPI.MIN)

    def advance(self) -> None:
        """So many steps."""
        for _ in range(self.steps):
            self.simulation.take_step(self.step)
