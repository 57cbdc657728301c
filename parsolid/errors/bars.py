"""Error bars of a run's history: every column over time, the parts of its error, and how all of it is told."""

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from parsolid.errors.estimate import LOST, SAFE, UNSAFE, Bar, Series, nearby_reach, spacing_bar
from parsolid.errors.orders import kind_of, order_in_spacing, order_in_time, rough, stepped_by_hand, unconverging
from parsolid.errors.places import Corners, asked_for, placed
from parsolid.errors.running import Done
from parsolid.errors.swinging import phase_and_amplitude
from parsolid.errors.variants import LOOSER, SOLVER, SPACING, STEP
from parsolid.scene import Scene
from parsolid.splines import cubic_spline

History = dict[str, np.ndarray]
# of the largest component of a vector or tensor, what is rounding of the others
ROUNDING = 1e-12
# columns of the history that are no results
NO_RESULTS = ("step", "time", "dt", "balance")


@dataclass
class ErrorTable:
    """Bars of all columns that have one, and why others have none."""

    times: np.ndarray
    values: History
    bars: dict[str, Bar]
    without: str | None = None
    steps: np.ndarray | None = None

    @classmethod
    def nothing(cls) -> "ErrorTable":
        """That of ranks that keep no history."""
        return cls(np.zeros(0), {}, {})

    def share(self, column: str) -> float:
        """The bar at the end over the largest absolute value of a column over time; infinite where there is none."""
        largest = float(np.abs(self.values[column]).max(initial=0.0))
        error = float(self.bars[column].error[-1])
        return error / largest if largest > 0.0 and math.isfinite(error) else math.inf


def error_table(scene: Scene, history: History, done: list[Done], corners: tuple[Corners, ...] = ()) -> ErrorTable:
    """The bars of a run's history from the companions that have been run; for one rank alone.

    corners: of probes of the run itself, whose values are then those at the places that were asked for, in all runs.
    """
    if corners:
        history = asked_for(scene, history, corners)
        done = [replace(one, history=asked_for(scene, one.history, one.companion.corners)) for one in done]
    done, apart = (done, {}) if corners else at_own_places(scene, done)
    coarse = sorted((one for one in done if one.companion.purpose == SPACING and one.history), key=lambda d: d.ratio)
    times = history["time"]
    columns = {name: values for name, values in history.items() if name not in NO_RESULTS}
    if not coarse or len(times) < 2:
        faults = [f"{one.companion.title}: {one.fault}" for one in done if one.fault]
        return ErrorTable(times, columns, {}, "; ".join(faults) or "no coarser companion could be made")
    bars: dict[str, Bar] = {}
    ratios = np.array([1.0, *(one.ratio for one in coarse)])
    for name, values in columns.items():
        if not all(name in one.history for one in coarse) or not np.isfinite(values).all():
            continue
        series = Series(times, np.array([values, *(on_times(one.history, name, times) for one in coarse)]), ratios)
        bars[name] = spacing_bar(series, order_in_spacing(name, scene), scene.end_time)
        _add_parts(scene, name, bars[name], times, done)
        if name in apart:
            # the run's particle is not where the probe was asked for
            bars[name].parts["place"] = part = nearby_reach(on_times(apart, name, times), times, scene.end_time)
            bars[name].error = bars[name].error + SAFE * part
        if name in ("kinetic", "stored") and "dissipation_numerical" in columns:
            # what the scheme has taken of both
            bars[name].parts["dissipation"] = np.abs(columns["dissipation_numerical"])
        bars[name].phase, bars[name].amplitude = phase_and_amplitude(series, bars[name].used)
    return ErrorTable(times, columns, bars, steps=history["step"])


def at_own_places(scene: Scene, done: list[Done]) -> tuple[list[Done], History]:
    """Companions with their probes where the run's particles are, and what the finest says of the way to the places
    that were asked for.
    """
    result, apart, finest = [], {}, math.inf
    for one in done:
        history, differences = placed(scene, one.history, one.companion.corners) if one.history else (one.history, {})
        result.append(replace(one, history=history))
        if one.companion.purpose == SPACING and differences and one.ratio < finest:
            apart, finest = differences | {"time": history["time"]}, one.ratio
    return result, apart


def on_times(history: History, name: str, times: np.ndarray) -> np.ndarray:
    """A column of another run at the times (n,) of this one [s]: at a jump, of which this one has two rows, what
    is before it for the first row and what follows it for the second."""
    own, values = history["time"], history[name]
    after = _between(own, values, np.append(np.diff(own) > 0.0, True), times)
    first = np.append(np.diff(times) == 0.0, False)
    if first.any():
        after[first] = _between(own, values, np.insert(np.diff(own) > 0.0, 0, True), times[first])
    return after


def _between(own: np.ndarray, values: np.ndarray, kept: np.ndarray, times: np.ndarray) -> np.ndarray:
    """Values (n,) at times from those of the rows that are kept."""
    own, values = own[kept], values[kept]
    result: np.ndarray = np.interp(times, own, values)
    if len(own) > 3:
        smooth = cubic_spline(own, values, np.clip(times, own[0], own[-1]))
        # next to a kink a cubic swings, a line does not
        near = np.clip(np.searchsorted(own, times), 1, len(own) - 1)
        room = np.abs(values[near] - values[near - 1])
        low, high = np.minimum(values[near], values[near - 1]) - room, np.maximum(values[near], values[near - 1]) + room
        result = np.clip(smooth, low, high)
    return result


def _add_parts(scene: Scene, name: str, bar: Bar, times: np.ndarray, done: list[Done]) -> None:
    """Parts of step and solver; they widen the bar where finer particles do not make them smaller."""
    base = max((one for one in done if one.companion.purpose == SPACING and one.history), key=lambda one: one.ratio)
    for one in done:
        if one.companion.purpose == SPACING or not one.history or name not in one.history:
            continue
        if one.ratio != base.ratio:
            continue
        difference = on_times(base.history, name, times) - on_times(one.history, name, times)
        if one.companion.purpose == STEP:
            order, own = order_in_time(scene), stepped_by_hand(scene)
            shrunk = 1.0 if own else one.ratio**-order
            part = nearby_reach(difference, times, scene.end_time) * shrunk / (1.0 - 0.5**order)
            bar.parts["step"] = part
            # with steps that follow the spacing it is in the differences of the spacings already
            bar.error = bar.error + (SAFE * part if own else 0.0)
        elif one.companion.purpose == SOLVER:
            part = nearby_reach(difference, times, scene.end_time) / (LOOSER - 1.0)
            bar.parts["solver"] = part
            bar.error = bar.error + UNSAFE * part


def told_columns(table: ErrorTable, scene: Scene) -> list[str]:
    """The columns of the last lines: of probes and reactions but for rounding, or the energies where there are none."""
    known = [name for name in table.bars if "." in name]
    if not known:
        return [name for name in ("kinetic", "stored") if name in table.bars]
    largest = {name: float(np.abs(table.values[name]).max(initial=0.0)) for name in known}
    alike: dict[str, float] = {}
    for name, value in largest.items():
        alike[_without_axes(name)] = max(value, alike.get(_without_axes(name), 0.0))
    return [name for name in known if largest[name] > ROUNDING * alike[_without_axes(name)]]


def _without_axes(name: str) -> str:
    """What components of one vector or tensor have in common."""
    stem, _, axes = name.rpartition("_")
    return stem if stem and set(axes) <= set("xyz") else name


def lines(table: ErrorTable, scene: Scene, extra: float | None) -> Iterator[str]:
    """The last lines of a run."""
    if table.without:
        yield f"error bars: none: {table.without}"
        return
    for name in told_columns(table, scene):
        yield told(table, name)
    if not any("." in name for name in table.bars):
        yield "error bars: the scene has no probe: bars are of its energies"
    reason = rough(scene)
    if reason:
        yield f"error bars: {reason} makes the motion rough: order 1 is what is known of it"
    if lost := unconverging(scene):
        yield f"error bars: {lost}: factor of safety {LOST:g}"
    if extra is not None:
        yield f"error bars: extra time {100.0 * extra:.0f} %"


def told(table: ErrorTable, name: str) -> str:
    """A column at the end with its bar: "tip.twist 0.240 +- 0.012 (5 %), order 1.9"."""
    bar, value = table.bars[name], float(table.values[name][-1])
    error, share = float(bar.error[-1]), table.share(name)
    if not math.isfinite(error):
        mean = f", mean over time {bar.mean:.4g} +- {bar.mean_error:.2g}" if bar.mean_error is not None else ""
        return f"{name} {value:.4g}: no bar, {bar.verdict}{mean}"
    percent = f" ({percentage(share)} % of its largest)" if math.isfinite(share) else ""
    return f"{name} {_rounded(value, error)} +- {error:.2g}{percent}, {bar.verdict}"


def percentage(share: float) -> str:
    """A share in percent, to two digits but never with a power of ten."""
    return f"{100.0 * share:.0f}" if share >= 1.0 else f"{100.0 * share:.2g}"


def _rounded(value: float, error: float) -> str:
    """A value to the second digit of its error."""
    if error <= 0.0 or value == 0.0:
        return f"{value:.6g}"
    digits = math.ceil(math.log10(abs(value))) - math.floor(math.log10(error)) + 1
    return f"{value:.{min(10, max(2, digits))}g}"


def summary_of_bars(table: ErrorTable, scene: Scene, done: list[Done], refused: list[str]) -> dict[str, Any]:
    """What summary.json says of them."""
    columns = {
        name: {
            "value": float(table.values[name][-1]),
            "error": float(bar.error[-1]),
            "share": table.share(name),
            "kind": kind_of(name, scene),
            "order": bar.order,
            "order_used": bar.used,
            "safety": bar.factor,
            "verdict": bar.verdict,
            "parts": {part: float(values[-1]) for part, values in bar.parts.items()},
            "phase_error": bar.phase,
            "amplitude_error": bar.amplitude,
            "mean": bar.mean,
            "mean_error": bar.mean_error,
        }
        for name, bar in table.bars.items()
    }
    companions = [
        {
            "for": one.companion.purpose,
            "particles": one.companion.lattices,
            "ratio": one.ratio,
            "core_seconds": one.core_seconds,
            "processor_seconds": one.processor_seconds,
            "fault": one.fault,
            "digest": one.companion.digest,
        }
        for one in done
    ]
    return {"columns": columns, "companions": companions, "refused": refused, "without": table.without}
