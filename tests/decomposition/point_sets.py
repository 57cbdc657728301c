"""Point sets that try a decomposition: scattered, on lattices, at one place, clustered, few or none."""

import numpy as np


def lattice(edge: int, dimension: int) -> np.ndarray:
    """Integer lattice points (edge ** dimension, dimension), around zero, so that both signs of zero may occur."""
    axes = np.meshgrid(*[np.arange(edge) - edge // 2] * dimension, indexing="ij")
    return np.stack(axes, axis=-1).reshape(-1, dimension).astype(float)


def point_set(kind: str, dimension: int) -> np.ndarray:
    """The same points on every rank."""
    random = np.random.default_rng(7)
    if kind == "none":
        return np.empty((0, dimension))
    if kind == "one":
        return np.full((1, dimension), 0.3)
    if kind == "few":
        return random.random((2, dimension))
    if kind == "same place":
        return np.full((40, dimension), -0.0)
    if kind == "random":
        return random.random((300, dimension)) - 0.5
    if kind == "clusters":
        # far apart: a dense grid of cells over all would not fit in memory
        return np.concatenate([random.random((60, dimension)) + shift for shift in (-1e7, 0.0, 4e6)])
    edge = {1: 200, 2: 15, 3: 7}[dimension]
    return lattice(edge, dimension) / 8


KINDS = ["none", "one", "few", "same place", "random", "clusters", "lattice"]


def close(points: np.ndarray, others: np.ndarray, reach: float) -> np.ndarray:
    """Whether each of the points is closer than reach to each of the others, by brute force."""
    square = np.zeros((len(points), len(others)))
    for x, y in zip(points.T, others.T):
        difference = x[:, None] - y[None, :]
        square += difference * difference
    return square < reach * reach


def share(comm, total: int) -> np.ndarray:
    """Rows of this rank out of a set that all ranks know: dealt out in turn, none to the last of several ranks."""
    dealers = max(comm.size - 1, 1)
    return np.arange(comm.rank, total, dealers) if comm.rank < dealers else np.empty(0, np.int64)
