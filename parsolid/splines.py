"""Cubic splines through series of a few hundred numbers, without scipy, whose import takes as long as a small run."""

import numpy as np


def cubic_spline(x: np.ndarray, y: np.ndarray, at: np.ndarray) -> np.ndarray:
    """Values (m,) at points (m,) of the cubic spline through (x, y) (n,), x rising; the first two pieces are one cubic,
    and so are the last two (not-a-knot). Two points give a line, three a parabola; outside, the end pieces go on.

    Source: de Boor, "A practical guide to splines", 1978, chapter IV.
    """
    x, y, at = (np.asarray(values, float) for values in (x, y, at))
    width, slope = np.diff(x), np.diff(y) / np.diff(x)
    if len(x) < 4:
        # Newton's form
        bent = (slope[1] - slope[0]) / (x[2] - x[0]) if len(x) == 3 else 0.0
        return np.asarray(y[0] + (at - x[0]) * (slope[0] + bent * (at - x[1])))
    tangent = _tangents(x, width, slope)
    piece = np.clip(np.searchsorted(x, at, side="right") - 1, 0, len(width) - 1)
    t, h = at - x[piece], width[piece]
    excess = (tangent[piece] + tangent[piece + 1] - 2.0 * slope[piece]) / h
    curve = (slope[piece] - tangent[piece]) / h - excess
    return np.asarray(y[piece] + t * (tangent[piece] + t * (curve + t * excess / h)))


def _tangents(x: np.ndarray, width: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Slopes (n,) at the points, with which second derivatives are continuous."""
    first, last = x[2] - x[0], x[-1] - x[-3]
    below = np.concatenate(([0.0], width[1:], [last]))
    middle = np.concatenate((width[1:2], 2.0 * (width[:-1] + width[1:]), width[-2:-1]))
    above = np.concatenate(([first], width[:-1], [0.0]))
    right = np.concatenate(
        (
            [((width[0] + 2.0 * first) * width[1] * slope[0] + width[0] ** 2 * slope[1]) / first],
            3.0 * (width[1:] * slope[:-1] + width[:-1] * slope[1:]),
            [(width[-1] ** 2 * slope[-2] + (2.0 * last + width[-1]) * width[-2] * slope[-1]) / last],
        )
    )
    # pivots stay above the sum of the two widths beside
    for i in range(1, len(x)):
        ratio = below[i] / middle[i - 1]
        middle[i] -= ratio * above[i - 1]
        right[i] -= ratio * right[i - 1]
    result = np.empty_like(x)
    result[-1] = right[-1] / middle[-1]
    for i in range(len(x) - 2, -1, -1):
        result[i] = (right[i] - above[i] * result[i + 1]) / middle[i]
    return result
