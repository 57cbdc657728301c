"""Series that swing: how much of a difference is a shift in time, and how much of the size."""

import numpy as np

from parsolid.errors.estimate import Series, swings

# stretches of time that are tried, and how many swings a series needs to have a phase
_LARGEST, _TRIALS, _SWINGS = 0.08, 41, 3


def phase_and_amplitude(series: Series, order: float) -> tuple[float | None, float | None]:
    """Errors of the first run's phase (stretch of its time) and of its amplitude, both relative; None where nothing
    swings.
    """
    times, values, ratios = series
    if swings(values[0]) < _SWINGS or np.ptp(times) <= 0.0:
        return None, None
    about, own = values[1] - values[1].mean(), values[0] - values[0].mean()

    def fit(stretch: float) -> tuple[float, float, float]:
        moved = np.interp(times[0] + (times - times[0]) * (1.0 + stretch), times, own)
        size = float(moved @ about / max(moved @ moved, 1e-300))
        return float(np.sum((about - size * moved) ** 2)), float(stretch), size

    best = min(map(fit, np.linspace(-_LARGEST, _LARGEST, _TRIALS)))
    step = 2.0 * _LARGEST / (_TRIALS - 1)
    best = min(map(fit, best[1] + np.linspace(-step, step, _TRIALS // 2)))
    share = 1.0 / (ratios[1] ** order - 1.0)
    return abs(best[1]) * share, abs(best[2] - 1.0) * share
