"""`parsolid bench`: how fast the kernels are on this machine, as particle-steps/s a rank and nanoseconds a pair.

Every figure is the best of several repetitions, because other work on the machine only ever makes a repetition slower.
"""

import time

import numpy as np
from mpi4py import MPI

from parsolid.scene import parse_scene
from parsolid.simulation import Simulation
from parsolid.warmup import wait_quietly

REPETITIONS = 7


def cube_scene(particles: int, smoothing: float, branches: int):
    """A cube of about so many particles with a gentle motion and nothing at its boundary."""
    side = max(2, round(particles ** (1.0 / 3.0)))
    return parse_scene(
        {
            "title": "bench",
            "dimension": 3,
            "end_time": 1.0,
            "method": {"kind": "tlsph", "smoothing": smoothing},
            "bodies": [
                {
                    "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}},
                    "particles": [side, side, side],
                    "velocity": ["sin(pi*Y)", "0.5*sin(pi*Z)", "0.25*sin(pi*X)"],
                    "material": {
                        "kind": "mooney-rivlin",
                        "density": 1100.0,
                        "youngs_modulus": 17e6,
                        "poissons_ratio": 0.45,
                        "branches": [{"beta": 1.0, "tau": 0.02}] * branches,
                    },
                }
            ],
        }
    )


def best_time(action, repetitions: int = REPETITIONS) -> float:
    """Least wall time [s] of an action that has already run once."""
    action()
    best = np.inf
    for _ in range(repetitions):
        began = time.perf_counter()
        action()
        best = min(best, time.perf_counter() - began)
    return best


class _Steps:
    """Advances a simulation by a few small steps at each call, and times its force evaluation."""

    def __init__(self, comm, scene, steps: int):
        self.simulation = Simulation(comm, scene)
        self.steps = steps
        stable = self.simulation.method.stable_step()
        self.step = 0.1 * comm.allreduce(stable, MPI.MIN)

    def advance(self) -> None:
        for _ in range(self.steps):
            self.simulation.take_step(self.step)

    def evaluate(self) -> None:
        """One stabilised force evaluation: gradient, stress, divergence."""
        self.simulation.method.evaluate_forces()


def _kernel_row(particles: int, smoothing: float, branches: int) -> list:
    run = _Steps(MPI.COMM_SELF, cube_scene(particles, smoothing, branches), 2)
    method = run.simulation.method
    step, evaluation = best_time(run.advance) / run.steps, best_time(run.evaluate)
    degree = np.diff(method.pairing.inner.start) + np.bincount(method.pairing.inner.neighbour, minlength=method.owned)
    pairs = method.pairing.directed_pairs / 2
    return [
        smoothing, branches, method.owned, int(degree.max()),
        f"{method.owned / step:.3g}", f"{method.owned / evaluation:.3g}", f"{evaluation / pairs * 1e9:.1f}",
    ]  # fmt: skip


def _scaling_rows(comm, particles: int) -> list[list]:
    """Whole steps on one rank while the others wait, then on all ranks."""
    scene = cube_scene(particles, 0.85, 1)
    alone = None
    if comm.rank == 0:
        run = _Steps(MPI.COMM_SELF, scene, 3)
        alone = best_time(run.advance) / run.steps
        del run
    wait_quietly(comm)
    alone = comm.bcast(alone)
    run = _Steps(comm, scene, 3)
    together = comm.allreduce(best_time(run.advance) / run.steps, MPI.MAX)
    total = run.simulation.particles
    speeds = [f"{total / alone:.3g}", f"{total / together / comm.size:.3g}"]
    return [[1, total, speeds[0], 1.0], [comm.size, total, speeds[1], f"{alone / together:.2f}"]]


def _table(title: str, names: list[str], rows: list[list]) -> None:
    from rich.console import Console
    from rich.table import Table

    table = Table(title=title, title_justify="left")
    for name in names:
        table.add_column(name, justify="right")
    for row in rows:
        table.add_row(*map(str, row))
    Console(width=110).print(table)


def bench(comm, particles: int, scaling: int | None) -> int:
    """Print the tables on rank 0; exit status 0. Collective."""
    if comm.rank == 0:
        rows = [_kernel_row(particles, h, n) for h, n in ((0.85, 0), (0.85, 1), (1.2, 0), (1.2, 1))]
        names = ["h/dx", "branches", "particles", "neighbours", "steps/s", "evaluations/s", "ns/pair"]
        _table("One core, three dimensions, float64 (a step has three stages; a pair counts once)", names, rows)
    wait_quietly(comm)
    if scaling:
        rows = _scaling_rows(comm, scaling)
        if comm.rank == 0:
            _table("Whole steps", ["ranks", "particles", "steps/s a rank", "speed-up"], rows)
    return 0
