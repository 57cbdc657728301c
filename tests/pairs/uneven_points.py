"""Points on an uneven lattice, and their shares of ranks."""

import numpy as np

from parsolid.pairs.candidates import metrics


def points(dimension: int, jitter: float = 0.2) -> np.ndarray:
    """An uneven lattice (n, d) with the spacing 1."""
    shape = (9, 7) if dimension == 2 else (6, 5, 4)
    place = np.stack(np.meshgrid(*map(np.arange, map(float, shape)), indexing="ij"), axis=-1).reshape(-1, dimension)
    return place + jitter * np.random.default_rng(dimension).uniform(-1.0, 1.0, place.shape)


def share_of(comm, place: np.ndarray) -> np.ndarray:
    """Which of the points (n, d) this rank owns: a slab along x."""
    edges = np.quantile(place[:, 0], np.linspace(0.0, 1.0, comm.size + 1))
    return np.flatnonzero(np.searchsorted(edges[1:-1], place[:, 0], side="right") == comm.rank)


def even_metric(place: np.ndarray, smoothing: float = 1.2) -> np.ndarray:
    """Metrics (n, 6) of a spacing 1."""
    return metrics(np.ones_like(place), None, smoothing)
