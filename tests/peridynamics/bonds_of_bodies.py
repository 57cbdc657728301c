"""Jittered, partly broken bodies of correspondence peridynamics with mirror planes, on any number of ranks, and random
fields.
"""

import numpy as np
from mpi4py import MPI
from solids import random_of, simulation, supports, tables

SOFT = {"kind": "linear-elastic", "density": 1.1, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
SIZES = {1: ((24,), [1.0]), 2: ((9, 8), [1.0, 0.9]), 3: ((6, 5, 6), [1.0, 0.8, 1.0])}
PLANES = {
    "free": {},
    "roller": {"X": (0.0, "roller")},
    "fixed": {"X": (0.0, "fixed")},
    "corner": {"X": (0.0, "roller"), "Y": (0.0, "fixed")},
}


def scene(
    dimension, planes="free", placement="cells", broken=False, jitter=0.2, material=None, method=None, **more
) -> dict:
    """Raw tables; broken: with a crack through a part of the body."""
    particles, upper = SIZES[dimension]
    settings = {"kind": "peridynamics", "horizon_ratio": 2.6, "influence": "linear", **(method or {})}
    if broken:
        settings["pre_cracks"] = [
            {"plane": "X = 0.5", "box": {"lower": [0.0] * dimension, "upper": [1.0, 0.42, 1.0][:dimension]}}
        ]
    body = {"placement": placement, "jitter": jitter, "seed": 5, **more.pop("body", {})}
    return tables(
        particles,
        upper,
        material={**SOFT, **(material or {})},
        method=settings,
        body=body,
        boundaries=supports(**PLANES[planes]),
        **more,
    )


def body_of(dimension, planes="free", placement="cells", broken=False, comm=MPI.COMM_SELF, **more):
    """The method of such a scene."""
    return simulation(scene(dimension, planes, placement, broken, **more), comm).systems[0]


def random_field(method, seed=0) -> np.ndarray:
    """Normal numbers (owned, d) on free components, by identifier."""
    return random_of(method.particles.owned_rows("identifier"), method.dimension, seed=seed) * method.operator.free


def stiffness(method, field: np.ndarray, step: float = 0.0) -> np.ndarray:
    """K u [N] on free components."""
    out = np.empty_like(field)
    method.operator.stiffness(field, out, step)
    return out * method.operator.free


def gradients(method, field: np.ndarray) -> np.ndarray:
    """The scheme's gradient (owned, d, d) of a field (owned, d)."""
    d = method.dimension
    method.displacement[:] = field
    method.particles.update("motion")
    return method.forces.displacement_gradients()[:, :d, :d]


def gathered(method, values: np.ndarray) -> np.ndarray:
    """Values (owned, ...) of all ranks in the order of identifiers."""
    comm = method.comm
    order = np.argsort(np.concatenate(comm.allgather(method.particles.owned_rows("identifier").copy())))
    return np.concatenate(comm.allgather(values))[order]
