"""Speed of peridynamics."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.commands.bench.timing import Steps, best_time
from parsolid.scene import parse_scene


def cube_scene(particles: int, horizon_ratio: float, stabilisation: str, terms: int) -> Any:
    """A cube of about so many particles with a gentle motion and nothing at its boundary."""
    side = max(3, round(particles ** (1.0 / 3.0)))
    return parse_scene(
        {
            "title": "bench",
            "dimension": 3,
            "end_time": 1.0,
            "method": {
                "kind": "peridynamics",
                "horizon_ratio": horizon_ratio,
                "stabilisation": {"kind": stabilisation},
            },
            "bodies": [
                {
                    "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 1.0, 1.0]}},
                    "particles": [side, side, side],
                    "placement": "cells",
                    "velocity": ["sin(pi*Y)", "0.5*sin(pi*Z)", "0.25*sin(pi*X)"],
                    "material": {
                        "kind": "prony",
                        "density": 1100.0,
                        "youngs_modulus": 17e6,
                        "poissons_ratio": 0.25,
                        "terms": [{"ratio": 1.0, "tau": 0.02}] * terms,
                    },
                }
            ],
        }
    )


def scaling_scene(particles: int) -> Any:
    """A cube at the usual horizon with one term."""
    return cube_scene(particles, 3.0, "shear-scaled", 1)


def kernel_tables(particles: int) -> list[tuple[Any, ...]]:
    """Steps and force evaluations on one core."""
    cases = (
        (2.0, "shear-scaled", 1),
        (3.0, "none", 0),
        (3.0, "shear-scaled", 0),
        (3.0, "shear-scaled", 1),
    )
    names = [
        "horizon/dx",
        "stabiliser",
        "terms",
        "particles",
        "bonds",
        "bytes/bond",
        "steps/s",
        "evaluations/s",
        "ns/directed bond",
    ]
    title = "One core, three dimensions, float64 (a step has one evaluation; bonds: directed ones of a particle inside)"
    return [(title, names, [_kernel_row(particles, *case) for case in cases])]


def _kernel_row(particles: int, horizon_ratio: float, stabilisation: str, terms: int) -> list[Any]:
    run = Steps(MPI.COMM_SELF, cube_scene(particles, horizon_ratio, stabilisation, terms), 2)
    method: Any = run.simulation.systems[0]
    step, evaluation = best_time(run.advance) / run.steps, best_time(lambda: method.forces.internal_force(0.0))
    inner = method.pairs.inner
    degree = np.diff(inner.start) + np.bincount(inner.neighbour.astype(np.int64), minlength=method.owned)
    listed = sum(array.nbytes for array in inner[1:]) / len(inner.neighbour)
    return [
        horizon_ratio,
        stabilisation,
        terms,
        method.owned,
        int(degree.max()),
        f"{listed:.0f}",
        f"{method.owned / step:.3g}",
        f"{method.owned / evaluation:.3g}",
        f"{evaluation / method.directed_pairs * 1e9:.2f}",
    ]
