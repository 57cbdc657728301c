"""Pair systems of bare points, for tests of what pairs promise without a method."""

import numpy as np
from mpi4py import MPI

from parsolid.numerics.layout import LAYOUT
from parsolid.pairs.candidates import metrics
from parsolid.pairs.pair_system import FIELD, PairSystem
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field, Within


def points(dimension: int, jitter: float = 0.2) -> np.ndarray:
    """An uneven lattice (n, d) with the spacing 1."""
    shape = (9, 7) if dimension == 2 else (6, 5, 4)
    place = np.stack(np.meshgrid(*map(np.arange, map(float, shape)), indexing="ij"), axis=-1).reshape(-1, dimension)
    return place + jitter * np.random.default_rng(dimension).uniform(-1.0, 1.0, place.shape)


def share_of(comm, place: np.ndarray) -> np.ndarray:
    """Which of the points (n, d) this rank owns: a slab along x."""
    edges = np.quantile(place[:, 0], np.linspace(0.0, 1.0, comm.size + 1))
    return np.flatnonzero(np.searchsorted(edges[1:-1], place[:, 0], side="right") == comm.rank)


def system_of(place, metric, weights, comm=MPI.COMM_SELF, terms=None, codes=None, fields=FIELD) -> PairSystem:
    """A system of owned points (n, d) of volume 1 whose first vector is the message "motion"; it is built once."""
    owned, d = place.shape
    at, body = KINEMATICS[d], np.zeros(owned, np.int64)
    particles = Particles(body)
    system = PairSystem(comm, particles, LAYOUT[d], weights, terms, codes, fields)
    still = Within("kinematics", at.reference)
    particles.declare(Field("reference_position", d, "m", ghosts="forward", message="reference", layout=still), place)
    moving = Within("kinematics", at.field)
    particles.declare(Field("velocity", d, "m/s", ghosts="forward", message="motion", layout=moving))
    rest = Within("kinematics", at.position)
    particles.declare(Field("position", d, "m", ghosts="forward", message="motion", layout=rest), place)
    system.rebuild(place, body, metric, np.ones(owned))
    return system


def even_metric(place: np.ndarray, smoothing: float = 1.2) -> np.ndarray:
    """Metrics (n, 6) of a spacing 1."""
    return metrics(np.ones_like(place), None, smoothing)
