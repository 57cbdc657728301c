"""Which particles' surroundings contribute most to the error: stresses against what their neighbours make of them.

A particle's stress is compared with the linear function of the reference place that fits those of its neighbours best,
itself left out (recovery of gradients after Zienkiewicz & Zhu, Int. J. Numer. Meth. Eng. 24 (1987) 337, with least
squares over particles). What a scene's particles resolve differs by the second order of their spacing, what jumps from
particle to particle by as much as it jumps.
"""

from typing import Any

import numpy as np

from decomposition.halo import REACH_MARGIN, Halo
from parsolid.collective import maximum
from parsolid.observables.declared import field_of

NAME = "error_indicator"
# neighbours are within so many spacings; pairs that are looked at together
_REACH, _PAIRS = 2.3, 2_000_000
_COMPONENTS = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def indicate(comm: Any, systems: list[Any]) -> None:
    """Give every system its `indicated`, (owned,) [J/m^3]: the square of the difference over twice its body's modulus
    of waves, a density of strain energy. Collective.
    """
    for system in systems:
        stress = np.asarray(field_of(system, "stress"))
        values = np.stack([stress[:, i, j] for i, j in _COMPONENTS], axis=1)
        rows, d = system.particles.owned_rows, system.dimension
        place, body = np.array(rows("reference_position")[:, :d]), np.array(rows("body"))
        reach = _REACH * float(maximum(comm, np.max(rows("spacing"), initial=0.0)))
        # a hair farther, for distances are rounded in another way
        everything = Halo(comm, place, reach * REACH_MARGIN).with_ghosts(np.column_stack([place, body, values]))
        fitted = fit_of_neighbours(place, body, everything, reach, d)
        # components off the diagonal count twice
        difference = np.where(np.isfinite(fitted), (fitted - values) ** 2, 0.0) @ (1.0, 1.0, 1.0, 2.0, 2.0, 2.0)
        moduli = np.array([system.wave_modulus(number)[0] for number in range(len(system.bodies))])
        system.indicated = 0.5 * difference / moduli[body.astype(int)]


def fit_of_neighbours(place: np.ndarray, body: np.ndarray, rows: np.ndarray, reach: float, d: int) -> np.ndarray:
    """What neighbours of the same body say at places (n, d) by a linear fit: (n, components), not numbers where they
    are too few; rows: place, body and components of all particles.
    """
    from scipy.spatial import cKDTree

    result = np.full((len(place), rows.shape[1] - d - 1), np.nan)
    if not len(place):
        return result
    tree, here = cKDTree(rows[:, :d]), cKDTree(place)
    density = here.count_neighbors(tree, reach) / len(place)
    count = max(1, int(_PAIRS / density))
    for first in range(0, len(place), count):
        part = slice(first, first + count)
        pairs = cKDTree(place[part]).sparse_distance_matrix(tree, reach, output_type="ndarray")
        i, j = pairs["i"], pairs["j"]
        kept = (pairs["v"] > 1e-9 * reach) & (rows[j, d] == body[part][i])
        result[part] = _solved(len(place[part]), i[kept], j[kept], place[part], rows, reach, d)
    return result


def _solved(n: int, i: np.ndarray, j: np.ndarray, place: np.ndarray, rows: np.ndarray, reach: float, d: int) -> Any:
    """Values at the places of weighted least squares over pairs (i, j)."""
    apart = (rows[j, :d] - place[i]) / reach
    base = np.column_stack([np.ones(len(i)), apart])
    weight = (1.0 - np.minimum((apart**2).sum(axis=1), 1.0)) ** 2
    values = rows[j, d + 1 :]
    matrix = np.empty((n, d + 1, d + 1))
    right = np.empty((n, d + 1, values.shape[1]))
    for a in range(d + 1):
        for b in range(d + 1):
            matrix[:, a, b] = np.bincount(i, weight * base[:, a] * base[:, b], n)
        for c in range(values.shape[1]):
            right[:, a, c] = np.bincount(i, weight * base[:, a] * values[:, c], n)
    few = np.bincount(i, minlength=n) < d + 1
    fitted = (np.linalg.pinv(matrix, rcond=1e-8, hermitian=True)[:, :1] @ right)[:, 0]
    fitted[few] = np.nan
    return fitted
