"""What a correspondence bar on a uniform lattice does by itself: dispersion and periods, exact in time, without
control.

Points at (i + 1/2) dx with gradient G_i = sum_j w_ij (u_j - u_i) j dx / sum_j w_ij (j dx)^2 and its adjoint as the
force.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy.sparse import coo_matrix, csr_matrix
from scipy.sparse.linalg import eigsh

# of the distance over the horizon
Weight = Callable[[np.ndarray], np.ndarray]


def lattice_frequency(angle: Any, reach: int, weight: Weight = np.ones_like) -> np.ndarray:
    """omega dx/c = |sum_j w_j j sin(j theta)| / sum_j w_j j^2 of a wave of `angle` theta a point in an infinite
    lattice.

    reach: the horizon in points; weight: influence function of |xi|/delta, 1 by default.
    """
    j = np.arange(1, reach + 1)
    w = weight(j / reach)
    return np.abs(np.sin(np.multiply.outer(np.asarray(angle, float), j)) @ (w * j)) / np.sum(w * j**2)


def _gradient(points: int, reach: int, clamp: str, weight: Weight) -> csr_matrix:
    """The gradient matrix times dx, (points + layer, points): of the points, and of a layer of resting points that has
    stresses.
    """
    layer = reach if clamp == "layer" else 0
    low = -reach if clamp == "mirror" else -layer
    rows, columns, values = [], [], []
    for i in range(-layer, points):
        first, last = max(i - reach, low), min(i + reach, points - 1)
        j = np.array([k for k in range(first, last + 1) if k != i])
        w = weight(np.abs(j - i) / reach)
        g = w * (j - i) / np.sum(w * (j - i) ** 2)
        # an image of k < 0 is the point -1 - k with the opposite displacement; a point of the layer rests
        image = j < 0
        target = np.where(image, -1 - j, j)
        sign = np.where(image, -1.0 if clamp == "mirror" else 0.0, 1.0)
        rows += [i + layer] * (len(j) + 1)
        columns += [*target, max(i, 0)]
        values += [*(g * sign), -g.sum() if i >= 0 else 0.0]
    return coo_matrix((values, (rows, columns)), (points + layer, points)).tocsr()


def fundamental_period(points: int, reach: int, clamp: str = "mirror", weight: Weight = np.ones_like) -> float:
    """Period of mode 1 of a clamped and free elastic bar over that of the continuum, 4 L/c.

    points: lattice points along the bar; clamp: "mirror" (odd images at the end X = 0) or "layer" (`reach` resting
    points before it); the other end is free, with truncated families.
    """
    gradient = _gradient(points, reach, clamp, weight)
    wave_number = 0.5 * np.pi / points
    # a lattice without control has oscillating modes of any low frequency as well: the wanted one looks like the
    # continuum's
    squares, shapes = eigsh((gradient.T @ gradient).tocsc(), k=8, sigma=wave_number**2)
    overlap = np.abs(np.sin(wave_number * (np.arange(points) + 0.5)) @ shapes)
    return wave_number / float(np.sqrt(squares[np.argmax(overlap)]))
