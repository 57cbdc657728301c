"""Error bars from the histories of a run and its coarse runs.

After Eca & Hoekstra, J. Comput. Phys. 262 (2014) 104: phi = phi_0 + alpha h^p is fitted to the spacings h by least
squares with weights 1/h, and the error gets a factor of safety of 1.25 if the observed order is near the known one, of
3 if not. The order is observed from the norms of differences over all times, which zeros of an oscillating difference
do not disturb; the error at a time is the largest nearby.
"""

from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

# factors of safety with an observed order, without one, and where the method has no order; with the last one 95 of 100
# bars of the linear basis contain the error
SAFETY, SAFETY_NO_ORDER, SAFETY_DIVERGED = 1.25, 3.0, 6.0


class Trust(NamedTuple):
    """How far observed orders are trusted.

    least: smallest observed order that counts; with_order, without: factors of safety with and without an observed
    order; by_spread: where differences are uncorrelated, the error is the spread of all runs
    """

    least: float
    with_order: float
    without: float
    by_spread: bool


# differences of meshes are partly random; their factors make 97 of 100 bars hold at the end (docs/error-bars.md)
OF_LATTICES, OF_MESHES = Trust(0.4, SAFETY, SAFETY_NO_ORDER, False), Trust(1.0, 1.75, 2.0, True)
# share of the duration within which the largest error counts
TIME_WINDOW = 0.04
# an observed order this much below the known one still counts as the known one
TOLERANCE = 0.5
# a series is unresolved if the finest difference exceeds the first share of its variation and the second share of the
# next difference
UNRESOLVED, MIN_REDUCTION = 0.5, 0.8
# correlation of consecutive differences above which they converge together, and below which they are independent
CORRELATED, UNCORRELATED = 0.5, 0.1
# a series with at least so many crossings of its mean oscillates
_MIN_CROSSINGS = 3
# largest stretch of time, and number of stretches, tried for a phase error
_LARGEST_STRETCH, _STRETCHES = 0.08, 41


class Series(NamedTuple):
    """A column in runs of several spacings: times (n,) [s], values (m, n), ratios (m,) of the spacings, the first 1."""

    times: np.ndarray
    values: np.ndarray
    ratios: np.ndarray


@dataclass
class Bar:
    """The error bar of a column.

    error (n,): at the times of the run; order: observed, or None; used: the order of the estimate; factor: of safety;
    verdict: on the order, in words; parts: (n,) each, without the factor, by the source of error; phase, amplitude:
    relative errors of an oscillation; mean, mean_error: time average of an unresolved series, and its bar
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
    """The order p with (r_3^p - r_2^p)/(r_2^p - 1) = far/near, clipped to -2 <= p <= 8.

    near, far: norms of the differences of runs 2 - 1 and 3 - 2; None if one of them is 0.
    """
    if near <= 0.0 or far <= 0.0:
        return None
    orders = np.linspace(-2.0, 8.0, 2001)
    orders = orders[np.abs(orders) > 1e-9]
    second, third = ratios[1] ** orders, ratios[2] ** orders
    miss = np.log(np.abs((third - second) / (second - 1.0))) - np.log(far / near)
    change = np.nonzero(np.diff(np.sign(miss)))[0]
    return float(orders[change[0]]) if len(change) else float(orders[0] if miss[0] > 0.0 else orders[-1])


def fitted_error(series: Series, order: float) -> tuple[np.ndarray, np.ndarray]:
    """Error (n,) of the first run by a least-squares fit with an order, and the standard deviation (n,) of the fit."""
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
    """The largest |value| (n,) in a window of half-width `reach` [s] about each time; the window is moved inwards at
    the start and the end."""
    size = np.abs(values)
    after_end, before_start = np.maximum(times + reach - times[-1], 0.0), np.maximum(times[0] - times + reach, 0.0)
    first = np.searchsorted(times, times - reach - after_end)
    last = np.searchsorted(times, times + reach + before_start, side="right")
    return np.array([size[a:b].max() for a, b in zip(first, last)])


def crossings(values: np.ndarray) -> int:
    """How often a series (n,) crosses its mean; deviations below a tenth of the largest one are ignored."""
    deviation = values - values.mean()
    large = np.abs(deviation) > 0.1 * np.abs(deviation).max(initial=0.0)
    return int(np.sum(np.diff(np.sign(deviation[large])) != 0.0))


def spacing_bar(series: Series, known: float, duration: float, trust: Trust = OF_LATTICES) -> Bar:
    """The bar of the discretisation error of a column.

    known: order of the method, 0 if it has none; the estimate never uses a higher one; duration: of the run [s]
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
        # the larger of the errors from all spacings and from the two finest
        error, misfit = fitted_error(series, used)
        error_of_two, _ = fitted_error(Series(times, values[:2], ratios[:2]), used)
        error = np.maximum(np.abs(error), np.abs(error_of_two))
    elif trust.by_spread:
        error = np.ptp(values, axis=0)
    else:
        # errors of runs are independent: their squares add up
        error = (np.abs(values[1:] - values[0]) / np.sqrt(1.0 + ratios[1:, None] ** (2.0 * used))).max(axis=0)
    # the window spans a quarter of the period of an oscillation, which holds a maximum of the error
    crossed = crossings(values[0])
    quarter = float(np.ptp(times)) / (2.0 * crossed) if crossed >= _MIN_CROSSINGS else 0.0
    near = largest_nearby(error, times, max(TIME_WINDOW * duration, quarter))
    # where the difference vanishes, the bar is at least half the rms error so far
    steps = np.maximum(np.diff(times, prepend=times[:1]), 0.0)
    spans = np.cumsum(steps)
    so_far = np.sqrt(np.cumsum(steps * error**2) / np.where(spans > 0.0, spans, 1.0))
    total = factor * np.maximum(near, 0.5 * so_far) + misfit
    return Bar(total, order, used, factor, verdict, {"spacing": near})


def mean_bar(series: Series, known: float) -> Bar:
    """The bar of the time average of an unresolved column, whose bar at each time is nan."""
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
    """The order of the estimate, the factor of safety, and the reason; order: observed; known: 0 if there is none."""
    if known <= 0.0:
        return min(1.0, max(trust.least, order or 1.0)), SAFETY_DIVERGED, "the method has no order here"
    if order is None:
        return known, SAFETY_NO_ORDER, "two resolutions: no order observed"
    if correlation < CORRELATED:
        used = min(known, max(trust.least, order))
        return used, trust.without, "differences change sign between resolutions: no order observed"
    if order < trust.least:
        return trust.least, trust.without, f"hardly converges: order {order:.1f}"
    if order > known + TOLERANCE:
        # the known order gives the larger error
        return known, trust.with_order, f"order {order:.1f}, above the known one"
    if order >= known - TOLERANCE:
        return min(order, known), trust.with_order, f"order {order:.1f}"
    return order, trust.with_order, f"order {order:.1f}, below the known one"


def phase_and_amplitude(series: Series, order: float) -> tuple[float | None, float | None]:
    """Relative errors of the phase (stretch of time) and the amplitude of the first run; None without oscillation."""
    times, values, ratios = series
    if crossings(values[0]) < _MIN_CROSSINGS or np.ptp(times) <= 0.0:
        return None, None
    coarse, fine = values[1] - values[1].mean(), values[0] - values[0].mean()

    def fit(stretch: float) -> tuple[float, float, float]:
        """Squared misfit, stretch and amplitude of the fine run stretched to the coarse one."""
        moved = np.interp(times[0] + (times - times[0]) * (1.0 + stretch), times, fine)
        amplitude = float(moved @ coarse / max(moved @ moved, 1e-300))
        return float(np.sum((coarse - amplitude * moved) ** 2)), float(stretch), amplitude

    best = min(map(fit, np.linspace(-_LARGEST_STRETCH, _LARGEST_STRETCH, _STRETCHES)))
    step = 2.0 * _LARGEST_STRETCH / (_STRETCHES - 1)
    best = min(map(fit, best[1] + np.linspace(-step, step, _STRETCHES // 2)))
    share = 1.0 / (ratios[1] ** order - 1.0)
    return abs(best[1]) * share, abs(best[2] - 1.0) * share
