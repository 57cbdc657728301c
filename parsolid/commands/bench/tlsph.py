"""Speed of total-Lagrangian SPH."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.commands.bench.timing import Steps, best_time
from parsolid.scene import parse_scene


def cube_scene(particles: int, smoothing: float, branches: int) -> Any:
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


def scaling_scene(particles: int) -> Any:
    """A cube at the usual smoothing with one branch."""
    return cube_scene(particles, 0.85, 1)


def kernel_tables(particles: int) -> list[tuple[Any, ...]]:
    """Steps and stabilised force evaluations of one core."""
    rows = [_kernel_row(particles, h, n) for h, n in ((0.85, 0), (0.85, 1), (1.2, 0), (1.2, 1))]
    names = ["h/dx", "branches", "particles", "neighbours", "steps/s", "evaluations/s", "ns/pair"]
    return [("One core, three dimensions, float64 (a step has three stages; a pair counts once)", names, rows)]


def _kernel_row(particles: int, smoothing: float, branches: int) -> list[Any]:
    run = Steps(MPI.COMM_SELF, cube_scene(particles, smoothing, branches), 2)
    method: Any = run.simulation.systems[0]
    step, evaluation = best_time(run.advance) / run.steps, best_time(method.evaluate_forces)
    inner = method.pairs.inner
    degree = np.diff(inner.start) + np.bincount(inner.neighbour, minlength=method.owned)
    pairs = method.directed_pairs / 2
    return [
        smoothing,
        branches,
        method.owned,
        int(degree.max()),
        f"{method.owned / step:.3g}",
        f"{method.owned / evaluation:.3g}",
        f"{evaluation / pairs * 1e9:.1f}",
    ]
