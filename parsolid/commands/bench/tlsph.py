"""Speed of total-Lagrangian SPH."""

from time import process_time
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.commands.bench.timing import Steps, best_time
from parsolid.scene import parse_scene
from parsolid.solvers.runge_kutta import SSP_RK3


def cube_scene(
    particles: int, smoothing: float, branches: int, integrator: str = "ssp-rk3", weights: str = "kernel"
) -> Any:
    """A cube of about so many particles with a gentle motion and nothing at its boundary."""
    side = max(2, round(particles ** (1.0 / 3.0)))
    return parse_scene(
        {
            "title": "bench",
            "dimension": 3,
            "end_time": 1.0,
            "method": {"kind": "tlsph", "smoothing": smoothing, "integrator": integrator, "weights": weights},
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
    cases = [(h, n, integrator) for integrator in ("ssp-rk3", "leapfrog") for h in (0.85, 1.2) for n in (0, 1)]
    rows = [_kernel_row(particles, *case) for case in cases]
    names = ["h/dx", "branches", "integrator", "particles", "neighbours", "steps/s", "ns a particle-step"]
    title = (
        "One core, three dimensions, float64 (processor time; steps of SSP-RK3 have three stages; a pair counts once)"
    )
    return [(title, [*names, "evaluations/s", "ns/pair"], rows)]


def _kernel_row(particles: int, smoothing: float, branches: int, integrator: str) -> list[Any]:
    run = Steps(MPI.COMM_SELF, cube_scene(particles, smoothing, branches, integrator), 2)
    method: Any = run.simulation.systems[0]
    step = best_time(run.advance, clock=process_time) / run.steps
    evaluation = best_time(lambda: evaluate_forces(method), clock=process_time)
    inner = method.lists.near.inner
    degree = np.diff(inner.start) + np.bincount(inner.neighbour, minlength=method.owned)
    pairs = method.directed_pairs / 2
    return [
        smoothing,
        branches,
        integrator,
        method.owned,
        int(degree.max()),
        f"{method.owned / step:.3g}",
        f"{step / method.owned * 1e9:.0f}",
        f"{method.owned / evaluation:.3g}",
        f"{evaluation / pairs * 1e9:.1f}",
    ]


def evaluate_forces(method: Any) -> None:
    """One stabilised force evaluation of the current state, which stays as it is."""
    if method.leapfrog is not None:
        method.leapfrog.evaluate()
        return
    method.lists.advance_stage(SSP_RK3[0], 0.0)
    method.lists.find_forces()
