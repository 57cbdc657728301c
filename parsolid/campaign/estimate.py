"""From the histories of a run and its coarse runs to error bars.

After Eca & Hoekstra, J. Comput. Phys. 262 (2014) 104: an expansion phi = phi_0 + alpha h^p is fitted to the spacings by
least squares with weights 1/h, and its error gets the factor 1.25 where the observed order is one that the method has,
3 where it is not. A history is a function of time: the order is observed from the norms of differences over all of it,
which zeros of an oscillating difference do not disturb, and the error at a time is the largest nearby.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

# factors of safety: of an observed order that the method has, of one that it has not, and of what has no order at all,
# twice as much, by which 95 of 100 bars of the linear basis hold
SAFETY, SAFETY_NO_ORDER, SAFETY_DIVERGED = 1.25, 3.0, 6.0


class Trust(NamedTuple):
    """How far observed orders are trusted: the least one that counts, factors of safety where there is one and where
    there is none, and whether what does not fall from one difference to the next is told by the spread of all runs."""

    least: float
    with_order: float
    without: float
    by_spread: bool


# observed orders below the least are no orders. Meshes are unlike one another, so that a part of each difference is
# chance; their factors are those with which 97 of 100 bars hold at the end of runs (docs/error-bars.md)
OF_LATTICES, OF_MESHES = Trust(0.4, SAFETY, SAFETY_NO_ORDER, False), Trust(1.0, 1.75, 2.0, True)
# of the duration, within which the largest error counts
TIME_WINDOW = 0.04
# of the observed order below the known one, by which it is still the known one
TOLERANCE = 0.5
# differences of so much of the variation that do not fall from one resolution to the next by this are of no use
UNRESOLVED, MIN_REDUCTION = 0.5, 0.8
# differences whose correlation is above the first fall together, below the second they are independent
CORRELATED, UNCORRELATED = 0.5, 0.1
# crossings of the mean from which a series oscillates
_MIN_CROSSINGS = 3
# stretches of time that are tried for a phase
_LARGEST_STRETCH, _STRETCHES = 0.08, 41


class Series(NamedTuple):
    """A column over time as runs of several spacings have it: times (n,) [s], values (m, n), ratios (m,) from 1 on."""

    times: np.ndarray
    values: np.ndarray
    ratios: np.ndarray


@dataclass
class Bar:
    """The error bar of a column.

    error (n,): at the times of the run; order: that was observed, None where none was; used: that of the estimate;
    factor: of safety; parts: (n,) by name, without that factor; verdict: in words.
    """

    error: np.ndarray
    order: float | None
    used: float
    factor: float
    verdict: str
    parts: dict[str, np.ndarray] = field(default_factory=dict)
    phase: float | None = None
    amplitude: float | None = None
    mean: float | None = None
    mean_error: float | None = None


def rms(values: np.ndarray) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.mean(values**2))) if values.size else 0.0


def observed_order(near: float, far: float, ratios: np.ndarray) -> float | None:
    """p with (r_3^p - r_2^p)/(r_2^p - 1) = far/near, norms of the differences of runs 2 - 1 and 3 - 2; None if none."""
    if near <= 0.0 or far <= 0.0:
        return None
    orders = np.linspace(-2.0, 8.0, 2001)
    orders = orders[np.abs(orders) > 1e-9]
    second, third = ratios[1] ** orders, ratios[2] ** orders
    miss = np.log(np.abs((third - second) / (second - 1.0))) - np.log(far / near)
    change = np.nonzero(np.diff(np.sign(miss)))[0]
    return float(orders[change[0]]) if len(change) else float(orders[0] if miss[0] > 0.0 else orders[-1])


def fitted_error(series: Series, order: float) -> tuple[np.ndarray, np.ndarray]:
    """Error (n,) of the first run by least squares with an order, and what the fit misses of the values (n,)."""
    spacing = series.ratios**order
    weights = 1.0 / series.ratios
    weights = weights / weights.sum()
    mean = weights @ spacing
    slope = (weights * (spacing - mean)) @ series.values / (weights @ (spacing - mean) ** 2)
    limit = weights @ series.values - slope * mean
    misfit = series.values - (limit + np.outer(spacing, slope))
    spread = np.sqrt((weights * len(weights)) @ misfit**2 / max(1, len(weights) - 2))
    result: np.ndarray = series.values[0] - limit
    return result, spread


def largest_nearby(values: np.ndarray, times: np.ndarray, reach: float) -> np.ndarray:
    """The largest of |values| (n,) within a time [s] of each; at the ends of time, where there is nothing on one side,
    as much more on the other."""
    size = np.abs(values)
    beyond, before = np.maximum(times + reach - times[-1], 0.0), np.maximum(times[0] - times + reach, 0.0)
    first = np.searchsorted(times, times - reach - beyond)
    last = np.searchsorted(times, times + reach + before, side="right")
    return np.array([size[a:b].max() for a, b in zip(first, last)])


def crossings(values: np.ndarray) -> int:
    """How often a series (n,) crosses its mean, small ripples aside."""
    about = values - values.mean()
    sound = np.abs(about) > 0.1 * np.abs(about).max(initial=0.0)
    return int(np.sum(np.diff(np.sign(about[sound])) != 0.0))


def spacing_bar(series: Series, known: float, duration: float, trust: Trust = OF_LATTICES) -> Bar:
    """The bar of the discretisation of a column; known: the order that its method has, 0 for none; duration: of the run
    [s]. Estimates with more than the known order are never made.
    """
    times, values, ratios = series
    changes = np.abs(values - values[:, :1])
    scale = float(changes.max()) if changes.size else 0.0
    differences = np.diff(values, axis=0)
    norms = [rms(one) for one in differences]
    if max(norms, default=0.0) <= 1e-13 * float(np.abs(values).max(initial=0.0)):
        return Bar(np.abs(values).max(axis=0) * 1e-13, None, max(known, trust.least), SAFETY, "exact to rounding")
    order, correlation = None, 0.0
    if len(values) > 2 and norms[0] > 0.0:
        order = observed_order(norms[0], norms[1], ratios)
        correlation = float(np.mean(differences[0] * differences[1])) / (norms[0] * norms[1]) if norms[1] > 0.0 else 0.0
        varies = scale > 0.0 and norms[0] > UNRESOLVED * rms(values[0] - values[0].mean())
        if varies and norms[0] > MIN_REDUCTION * norms[1]:
            return mean_bar(series, known)
    used, factor, verdict = order_to_use(order, correlation, known, trust)
    misfit = np.zeros(len(times))
    if order is None or correlation >= UNCORRELATED:
        # the larger of what all spacings and the two finest say
        error, misfit = fitted_error(series, used)
        other, _ = fitted_error(Series(times, values[:2], ratios[:2]), used)
        error = np.maximum(np.abs(error), np.abs(other))
    elif trust.by_spread:
        error = np.ptp(values, axis=0)
    else:
        # errors of runs are independent of one another: squares add up
        error = (np.abs(values[1:] - values[0]) / np.sqrt(1.0 + ratios[1:, None] ** (2.0 * used))).max(axis=0)
    # a quarter of the period, so that an error of the same period is seen near its largest
    crossed = crossings(values[0])
    quarter = float(np.ptp(times)) / (2.0 * crossed) if crossed >= _MIN_CROSSINGS else 0.0
    near = largest_nearby(error, times, max(TIME_WINDOW * duration, quarter))
    # errors grow: a zero of the difference is none of the error
    steps = np.maximum(np.diff(times, prepend=times[:1]), 0.0)
    spans = np.cumsum(steps)
    so_far = np.sqrt(np.cumsum(steps * error**2) / np.where(spans > 0.0, spans, 1.0))
    total = factor * np.maximum(near, 0.5 * so_far) + misfit
    return Bar(total, order, used, factor, verdict, {"spacing": near})


def mean_bar(series: Series, known: float) -> Bar:
    """What a column has whose runs differ by as much as it varies, finer ones no less: a bar of its mean over time."""
    times, values, _ = series
    spans = np.diff(times)
    means = (0.5 * (values[:, 1:] + values[:, :-1])) @ spans / spans.sum()
    verdict = "resolutions differ by as much as it varies (chaotic?)"
    bar = Bar(np.full(len(times), np.nan), None, max(known, OF_LATTICES.least), SAFETY_NO_ORDER, verdict)
    bar.mean, bar.mean_error = float(means[0]), SAFETY_NO_ORDER * float(np.abs(means[1:] - means[0]).max())
    return bar


def order_to_use(
    order: float | None, correlation: float, known: float, trust: Trust = OF_LATTICES
) -> tuple[float, float, str]:
    """The order to estimate with, the factor of safety and why; known: 0 where the method has none."""
    if known <= 0.0:
        return min(1.0, max(trust.least, order or 1.0)), SAFETY_DIVERGED, "the method has no order here"
    if order is None:
        return known, SAFETY_NO_ORDER, "two resolutions: no order observed"
    if correlation < CORRELATED:
        # what does not fall from one difference to the next has not the known order, whatever its sign
        used = min(known, max(trust.least, order))
        return used, trust.without, "differences change sign between resolutions: no order observed"
    if order < trust.least:
        return trust.least, trust.without, f"hardly converges: order {order:.1f}"
    if order > known + TOLERANCE:
        # an error of the known order is larger than one of the observed order would be
        return known, trust.with_order, f"order {order:.1f}, above the known one"
    if order >= known - TOLERANCE:
        return min(order, known), trust.with_order, f"order {order:.1f}"
    return order, trust.with_order, f"order {order:.1f}, below the known one"


def phase_and_amplitude(series: Series, order: float) -> tuple[float | None, float | None]:
    """Errors of the first run's phase (stretch of its time) and of its amplitude, both relative; None where nothing
    oscillates.
    """
    times, values, ratios = series
    if crossings(values[0]) < _MIN_CROSSINGS or np.ptp(times) <= 0.0:
        return None, None
    about, own = values[1] - values[1].mean(), values[0] - values[0].mean()

    def fit(stretch: float) -> tuple[float, float, float]:
        moved = np.interp(times[0] + (times - times[0]) * (1.0 + stretch), times, own)
        size = float(moved @ about / max(moved @ moved, 1e-300))
        return float(np.sum((about - size * moved) ** 2)), float(stretch), size

    best = min(map(fit, np.linspace(-_LARGEST_STRETCH, _LARGEST_STRETCH, _STRETCHES)))
    step = 2.0 * _LARGEST_STRETCH / (_STRETCHES - 1)
    best = min(map(fit, best[1] + np.linspace(-step, step, _STRETCHES // 2)))
    share = 1.0 / (ratios[1] ** order - 1.0)
    return abs(best[1]) * share, abs(best[2] - 1.0) * share
