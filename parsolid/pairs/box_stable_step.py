"""The largest step of leapfrog with lagged dissipation on boxes of nodes, from the matrices of their axes.

A step dt is stable where dt^2 K + 2 dt B <= 4 M for stiffness, damping and mass. On a box

    K <= M c^2 sum_k F_k / h_k^2,    B_i = M sum_k c_ik B_k / h_k

with matrices F_k (of the gradient) and B_k (of the dissipation) of one axis each, the greatest wave speed c, and c_ik
that of pressure waves for i = k, else that of shear waves. They act along different axes, so that the greatest
eigenvalue of the sum is the sum of the greatest ones. 1/dt is convex in both speeds and grows with them, so that chords
bound it.
"""

from collections.abc import Callable, Iterable
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from parsolid.pairs.box_weights import REACH, Axis, axis_tables

# an even axis with more nodes is one with so many whose damping is that of the longest
_MOST_NODES = 24
# of longer graded axes only parts of so many nodes are computed, at the ends and where nodes are closest: waves of the
# greatest frequencies are that local. The eigenvalue of a part is below that of the whole by no more than this
_PART = 64
_BEYOND_PART = (np.pi / _PART) ** 2
# nodes of a grading that are enough to tell whether waves grow; fewer nodes change faster
_ENOUGH_NODES = 32
# squares of the speed of waves over that whose impedance dissipates: where volume hardly changes, shear waves have the
# dissipation of pressure waves
_SPEED_RATIOS = (1.0, 0.25, 0.01, 1e-3)
# rates of growth, times the step over the wave speed, that are more than rounding of the double rate 0
_GROWTH = 1e-6
# logarithm of the change from one distance to the next times S c_p/c_s that boxes bear
_OF_VOLUME = 14.0
_BISECTIONS = 16


class AxisMatrices(NamedTuple):
    """F and B of the nodes that may move along an axis with steps of 1 m, or of a part of them, scaled by the norm, for
    waves of 1 m/s and an undiminished dissipation; the symmetric part of B."""

    F: np.ndarray
    B: np.ndarray
    power: np.ndarray


class BoxWaves(NamedTuple):
    """Properties of a box that bound its step: its axes, whether those with room are of fourth order, the factor on the
    dissipation, and whether its jumps are reconstructed."""

    axes: tuple[Axis, ...]
    fourth_order: bool
    dissipation: float
    reconstruction: bool

    def signal_speed(self, pressure: float, shear: float) -> float:
        """Least spacing over the largest step [m/s], for waves of these speeds [m/s]."""
        axes, fastest, d = self.axes, max(pressure, shear), len(self.axes)
        least, whole = min(axis.step for axis in axes), [axis.whole for axis in axes]

        def greatest(k: int, step: float, speed: float) -> float:
            u, fourth_order = step * least / axes[k].step, self.fourth_order and axes[k].has_room
            stiffness, damping = (u * fastest) ** 2, u * speed * self.dissipation
            return _greatest_eigenvalue(whole[k], fourth_order, self.reconstruction, stiffness, damping)

        def stable(step: float) -> bool:
            across = [greatest(k, step, shear) for k in range(d)]
            return max(sum(across) - across[k] + greatest(k, step, pressure) for k in range(d)) <= 4.0

        low, high = 0.0, 4.0 / fastest
        for _ in range(_BISECTIONS):
            middle = 0.5 * (low + high)
            low, high = (middle, high) if stable(middle) else (low, middle)
        return 1.0 / low


@lru_cache(maxsize=256)
def axis_matrices(
    axis: Axis, fourth_order: bool, reconstruction: bool, part: tuple[int, int] | None = None
) -> AxisMatrices:
    """The matrices of an axis with free ends; part: first node and the one after the last."""
    first, last = part or _moving(axis)
    # no operator reaches farther than these
    low, high = max(first - REACH, 0), min(last + REACH, axis.nodes)
    n, near = high - low, slice(low, high)
    tables = axis_tables(axis, fourth_order, 1.0, reconstruction)
    gradient, length = np.zeros((n, n + 2 * REACH)), tables.length[near]
    for i in range(n):
        gradient[i, i : i + 2 * REACH + 1] = tables.gradient[1, :, low + i]
    gradient = gradient[:, REACH:-REACH]
    difference = np.eye(n - 1, n, 1) - np.eye(n - 1, n)
    jump = difference - tables.half_step[near][:-1, None] * (np.abs(difference) @ gradient)
    weight = (tables.jump[1, 0] * tables.length)[near][:-1]
    damping = difference.T @ (weight[:, None] * jump)
    scale = np.sqrt(length)[:, None] * np.sqrt(length)
    F, B = gradient.T @ (length[:, None] * gradient) / scale, damping / scale
    wanted = slice(first - low, last - low)
    return AxisMatrices(*(one[wanted, wanted] for one in (F, B, 0.5 * (B + B.T))))


def _moving(axis: Axis) -> tuple[int, int]:
    """First node that may move, and the one after the last."""
    return int(axis.held[0]), axis.nodes - int(axis.held[1])


@lru_cache(maxsize=4096)
def _greatest_eigenvalue(
    axis: Axis, fourth_order: bool, reconstruction: bool, stiffness: float, damping: float
) -> float:
    """The greatest eigenvalue of stiffness F + 2 damping B of an axis with steps of 1 m."""
    few = axis._replace(nodes=axis.nodes if axis.places else min(axis.nodes, _MOST_NODES))
    parts = _parts(few)
    found = [axis_matrices(few, fourth_order, reconstruction, part) for part in parts]
    if axis.nodes > few.nodes:
        # 4 q, of the wave that alternates from node to node
        damping *= (8.0 / 3.0 if fourth_order else 2.0) / float(np.linalg.eigvalsh(found[0].power)[-1])
    # of no nodes where all are held
    values = [np.linalg.eigvalsh(stiffness * one.F + 2.0 * damping * one.power) for one in found]
    most = max(float(one.max(initial=0.0)) for one in values)
    return most if len(parts) == 1 else (1.0 + _BEYOND_PART) * most


def _parts(axis: Axis) -> list[tuple[int, int]]:
    """First node, and the one after the last, of parts where the greatest eigenvalue may be at home."""
    (first, last), half = _moving(axis), _PART // 2
    if not axis.places or last - first <= 3 * _PART:
        return [(first, last)]
    # not only the ends: nodes by a mirror plane may be as close as those, and have the damping that ends lack
    closest = half + int(np.argmin(np.diff(axis.places)[half:-half]))
    between = max(closest - half, first), min(closest + half, last)
    return [(first, first + _PART), between, (last - _PART, last)]


def chords(signal_speeds: Iterable[Callable[[float, float], float]], middle: float) -> list[tuple[float, float]]:
    """Factors on c_p and c_s in three sums of which the greatest is at least each of the signal speeds.

    signal_speeds: of (c_p, c_s), convex, homogeneous and growing with both; middle: c_s/c_p where, as at 0 and 1, the
    greatest sum is the greatest of them.
    """
    every = list(signal_speeds)
    ratios = (0.0, middle, 1.0)
    at = [max(one(1.0, ratio) for one in every) for ratio in ratios]
    slopes = [*(np.diff(at) / np.diff(ratios)).tolist(), max(one(0.0, 1.0) for one in every)]
    return [(value - slope * ratio, slope) for value, slope, ratio in zip(at, slopes, ratios)]


# --- gradings that the dissipation does not bear --------------------------------------------------------------------


def feeds_waves(axis: Axis, fourth_order: bool, dissipation: float) -> bool:
    """Whether the reconstructed dissipation makes waves grow along an axis, in short steps: where spacings change fast
    at ends of fourth order, it is no positive form."""
    F, B, _ = axis_matrices(_fewer(axis.whole, _ENOUGH_NODES), fourth_order, True)
    one, none = np.eye(len(F)), np.zeros_like(F)
    for ratio in _SPEED_RATIOS:
        rates = np.linalg.eigvals(np.block([[none, one], [-ratio * F, -dissipation * B]]))
        if rates.real.max() > _GROWTH:
            return True
    return False


def feeds_waves_of_volume(axis: Axis, dissipation: float, ratio: float) -> bool:
    """Whether it may in boxes, of shear waves that are `ratio` times as fast as pressure waves: what keeps the volume
    feels but a part of what each axis damps. By eigenvalues of boxes of 8 to 10 nodes a side, dense at all faces:
    motions grow from 20 on (docs/tlsph.md)."""
    return dissipation * np.log(most_change(axis)) > _OF_VOLUME * ratio


def most_change(axis: Axis) -> float:
    """The largest ratio of two adjacent distances of nodes."""
    if not axis.places:
        return 1.0
    steps = np.diff(axis.places)
    return float(np.max(np.maximum(steps[1:] / steps[:-1], steps[:-1] / steps[1:])))


def _fewer(axis: Axis, nodes: int) -> Axis:
    """An axis of the same grading with at most this number of nodes."""
    if not axis.places or axis.nodes <= nodes:
        return axis
    places = np.interp(np.linspace(0.0, axis.nodes - 1.0, nodes), np.arange(axis.nodes), axis.places)
    return axis._replace(nodes=nodes, places=tuple((places * (nodes - 1) / places[-1]).tolist()))
