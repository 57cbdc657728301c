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

# an even axis of more nodes is one of so many whose damping is that of the longest
_MOST_NODES = 24
# of longer graded ones parts of so many nodes are looked at, by the ends and where nodes between them are closest:
# waves of the greatest frequencies are that local; a part's eigenvalue is below that of the whole by no more than this
_PART = 64
_BEYOND_PART = (np.pi / _PART) ** 2
# nodes of a grading that are enough to tell whether waves grow; fewer nodes change faster
_TOLD_BY = 32
# squares of the speed of waves over that whose impedance dissipates: where volume hardly changes, waves of shear have
# the dissipation of pressure
_SLOWNESS = (1.0, 0.25, 0.01, 1e-3)
# logarithm of the change from one distance to the next times S c_p/c_s that boxes bear
_OF_VOLUME = 14.0
_BISECTIONS = 16
# rates of growth, in waves' times of a step, that are more than rounding of the double rate 0
_GROWTH = 1e-6


class _Matrices(NamedTuple):
    """Of an axis with steps of 1 m, of nodes that may move or a part of them, over the norm, S = 1: F, B, the symmetric
    part of B."""

    F: np.ndarray
    B: np.ndarray
    power: np.ndarray


@lru_cache(maxsize=256)
def _matrices(axis: Axis, wide: bool, reconstruction: bool, part: tuple[int, int] | None = None) -> _Matrices:
    first, last = part or _moving(axis)
    # no operator reaches farther than these
    low, high = max(first - WIDEST, 0), min(last + WIDEST, axis.nodes)
    nodes, near = high - low, slice(low, high)
    norm, operator = lengths_of(axis, wide)[near], operator_of(axis, wide)[near]
    slope = np.zeros((nodes, nodes + 2 * WIDEST))
    for i in range(nodes):
        slope[i, i : i + 2 * WIDEST + 1] = operator[i]
        slope[i, i + WIDEST] = -operator[i].sum()
    slope = slope[:, WIDEST:-WIDEST] / norm[:, None]
    difference = np.eye(nodes - 1, nodes, 1) - np.eye(nodes - 1, nodes)
    if reconstruction:
        steps = np.diff(axis.places[near])[:, None] if axis.places else 1.0
        jump = difference - 0.5 * steps * np.abs(difference) @ slope
        weight = np.where(axis.undamped(wide)[near][:-1, 1], 0.0, operator[:-1, WIDEST + 1])
    else:
        jump, weight = difference, operator[:-1, WIDEST + 1]
    damping = difference.T @ (weight[:, None] * jump)
    root = np.sqrt(norm)
    over = root[:, None] * root
    wanted = slice(first - low, last - low)
    stiffness, power = slope.T @ (norm[:, None] * slope) / over, 0.5 * (damping + damping.T) / over
    return _Matrices(*(one[wanted, wanted] for one in (stiffness, damping / over, power)))


def _moving(axis: Axis) -> tuple[int, int]:
    """First node that may move, and the one after the last."""
    return int(axis.held[0]), axis.nodes - int(axis.held[1])


def feeds_waves(axis: Axis, wide: bool, dissipation: float) -> bool:
    """Whether the reconstructed dissipation makes waves grow along an axis, in short steps: where spacings change fast
    at ends of fourth order, it is no positive form.
    """
    F, B, _ = _matrices(_fewer(axis.whole, _TOLD_BY), wide, True)
    one, none = np.eye(len(F)), np.zeros_like(F)
    for square in _SLOWNESS:
        rates = np.linalg.eigvals(np.block([[none, one], [-square * F, -dissipation * B]]))
        if rates.real.max() > _GROWTH:
            return True
    return False


def feeds_waves_of_volume(axis: Axis, dissipation: float, ratio: float) -> bool:
    """Whether it may in boxes, of waves of shear that are `ratio` times as fast as those of pressure: what keeps the
    volume feels but a part of what each axis damps.

    By eigenvalues of boxes of 8 to 10 nodes a side, dense at all faces: motions grow from 20 on (docs/weights.md).
    """
    return dissipation * np.log(most_change(axis)) > _OF_VOLUME * ratio


def most_change(axis: Axis) -> float:
    """How many times as great as the one beside it a distance of nodes is."""
    steps = np.diff(axis.places)
    return float(np.max(np.maximum(steps[1:] / steps[:-1], steps[:-1] / steps[1:]))) if axis.places else 1.0


def _fewer(axis: Axis, nodes: int) -> Axis:
    """Of the same grading with no more than so many nodes."""
    if not axis.places or axis.nodes <= nodes:
        return axis
    places = np.interp(np.linspace(0.0, axis.nodes - 1.0, nodes), np.arange(axis.nodes), axis.places)
    return axis._replace(nodes=nodes, places=tuple((places * (nodes - 1) / places[-1]).tolist()))


@lru_cache(maxsize=4096)
def _greatest(axis: Axis, wide: bool, reconstruction: bool, square: float, damping: float) -> float:
    """Greatest eigenvalue of square F + 2 damping B of an axis with steps of 1 m."""
    few = axis._replace(nodes=axis.nodes if axis.places else min(axis.nodes, _MOST_NODES))
    parts = _parts(few)
    found = [_matrices(few, wide, reconstruction, part) for part in parts]
    if axis.nodes > few.nodes:
        # 4 q, of the wave that alternates from node to node
        damping *= (8.0 / 3.0 if wide else 2.0) / float(np.linalg.eigvalsh(found[0].power)[-1])
    most = max(float(np.linalg.eigvalsh(square * one.F + 2.0 * damping * one.power)[-1]) for one in found)
    return most if len(parts) == 1 else (1.0 + _BEYOND_PART) * most


def _parts(axis: Axis) -> list[tuple[int, int]]:
    """First node, and the one after the last, of parts where the greatest eigenvalue may be at home."""
    (first, last), half = _moving(axis), _PART // 2
    if not axis.places or last - first <= 3 * _PART:
        return [(first, last)]
    # of the others than at ends: nodes by a mirror plane may be as close as those, and have the damping that ends lack
    closest = half + int(np.argmin(np.diff(axis.places)[half:-half]))
    between = max(closest - half, first), min(closest + half, last)
    return [(first, first + _PART), between, (last - _PART, last)]


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
