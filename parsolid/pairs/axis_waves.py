"""The largest step of leapfrog with lagged dissipation on boxes of lattices, from the operators of their axes.

A step dt is stable where dt^2 K + 2 dt B <= 4 M for stiffness, damping and mass. On a box
    K <= M c^2 sum_k F_k / h_k^2,    B_i = M sum_k c_ik B_k / h_k,
of matrices F_k (of the gradient) and B_k (of the dissipation) of one axis each, with c the greatest speed of waves,
c_ii that of pressure and c_ik that of shear waves. They act along different axes, so that the greatest eigenvalue of
the sum is the sum of the greatest ones. 1/dt is convex in both speeds and grows with them: chords bound it.
"""

from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from parsolid.pairs.lattice_stencils import WIDEST, Axis, lengths_of, operator_of

# an axis of more nodes is one of so many whose damping is that of the longest
_MOST_NODES = 24
_BISECTIONS = 16
# rates of growth, in waves' times of a step, that are more than rounding of the double rate 0
_GROWTH = 1e-6


@lru_cache(maxsize=256)
def _matrices(axis: Axis, wide: bool, reconstruction: bool) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """F, the symmetric part of B, and B of an axis with steps of 1 m, over the norm, of nodes that may move; S = 1."""
    nodes, norm, operator = axis.nodes, lengths_of(axis, wide), operator_of(axis, wide)
    slope = np.zeros((nodes, nodes + 2 * WIDEST))
    for i in range(nodes):
        slope[i, i : i + 2 * WIDEST + 1] = operator[i]
        slope[i, i + WIDEST] = -operator[i].sum()
    slope = slope[:, WIDEST:-WIDEST] / norm[:, None]
    difference = np.eye(nodes - 1, nodes, 1) - np.eye(nodes - 1, nodes)
    if reconstruction:
        steps = np.diff(axis.places)[:, None] if axis.places else 1.0
        jump = difference - 0.5 * steps * np.abs(difference) @ slope
    else:
        jump = difference
    damping = difference.T @ (operator[:-1, WIDEST + 1, None] * jump)
    root = np.sqrt(norm)
    over = root[:, None] * root
    moving = slice(int(axis.held[0]), nodes - int(axis.held[1]))
    found = slope.T @ (norm[:, None] * slope) / over, 0.5 * (damping + damping.T) / over, damping / over
    F, B, whole = (one[moving, moving] for one in found)
    return F, B, whole


def feeds_waves(axis: Axis, wide: bool, dissipation: float) -> bool:
    """Whether the reconstructed dissipation makes shear waves of half the pressure waves' speed grow along an axis,
    in short steps: where spacings change fast at ends of fourth order, it is no positive form.
    """
    F, _, B = _matrices(axis.whole, wide, True)
    rates = np.linalg.eigvals(np.block([[0.0 * F, np.eye(len(F))], [-0.25 * F, -dissipation * B]]))
    return bool(rates.real.max() > _GROWTH)


@lru_cache(maxsize=4096)
def _greatest(axis: Axis, wide: bool, reconstruction: bool, square: float, damping: float) -> float:
    """Greatest eigenvalue of square F + 2 damping B of an axis with steps of 1 m."""
    few = axis.nodes if axis.places else min(axis.nodes, _MOST_NODES)
    F, B, _ = _matrices(axis._replace(nodes=few), wide, reconstruction)
    if axis.nodes > few:
        # 4 q, of the wave that alternates from node to node
        damping *= (8.0 / 3.0 if wide else 2.0) / float(np.linalg.eigvalsh(B)[-1])
    return float(np.linalg.eigvalsh(square * F + 2.0 * damping * B)[-1])


class Lattice(NamedTuple):
    """Axes of a box, whether those with room are of fourth order, the factor on the dissipation, and whether its jumps
    are reconstructed."""

    axes: tuple[Axis, ...]
    wide: bool
    dissipation: float
    reconstruction: bool


def signal(lattice: Lattice, pressure: float, shear: float) -> float:
    """Least spacing [m] over the largest step [s], for waves of these speeds [m/s]."""
    axes, fastest, d = lattice.axes, max(pressure, shear), len(lattice.axes)
    least, whole = min(axis.step for axis in axes), [axis.whole for axis in axes]

    def greatest(k: int, step: float, speed: float) -> float:
        u, wide = step * least / axes[k].step, lattice.wide and axes[k].wide
        shares = (u * fastest) ** 2, u * speed * lattice.dissipation
        return _greatest(whole[k], wide, lattice.reconstruction, *shares)

    def stable(step: float) -> bool:
        across = [greatest(k, step, shear) for k in range(d)]
        return max(sum(across) - across[k] + greatest(k, step, pressure) for k in range(d)) <= 4.0

    low, high = 0.0, 4.0 / fastest
    for _ in range(_BISECTIONS):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if stable(middle) else (low, middle)
    return 1.0 / low


def wave_forms(signals: Iterable[Callable[[float, float], float]], middle: float) -> list[tuple[float, float]]:
    """Of c_p and c_s in three linear forms of which the greatest is at least what each of the signals is of them.

    signals: convex, of degree 1, that grow with both; middle: c_s/c_p where, as at 0 and 1, it is the greatest of them.
    """
    every = list(signals)
    ratios = (0.0, middle, 1.0)
    at = [max(one(1.0, ratio) for one in every) for ratio in ratios]
    slopes = [*(np.diff(at) / np.diff(ratios)).tolist(), max(one(0.0, 1.0) for one in every)]
    return [(value - slope * ratio, slope) for value, slope, ratio in zip(at, slopes, ratios)]
