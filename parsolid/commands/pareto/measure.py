"""Errors of runs: against a reference of the scene, else against what the best of the choices tends to."""

from dataclasses import dataclass
from typing import Any

import numpy as np

from parsolid.commands.pareto.plan import Candidate, Plan, grid_of
from parsolid.errors.bars import on_times
from parsolid.errors.estimate import SAFE, Series, fitted_error, rms, spacing_bar
from parsolid.errors.orders import order_in_spacing
from parsolid.errors.running import Done
from parsolid.errors.truth import exact_values, series_of
from parsolid.scene import Scene


@dataclass
class Truth:
    """What runs are compared with: values (n,) at times (n,) [s], in which words, how uncertain, as an error, and for a
    probe of an exact solution the scene, whose values are those at the place of a run's particle.
    """

    words: str
    times: np.ndarray
    values: np.ndarray
    uncertain: float = 0.0
    exact: Scene | None = None

    def error(self, run: Done, column: str) -> float:
        """Root of the mean square of the difference over that of the true values, over all times or that at the end."""
        true = self.values
        if self.exact is not None:
            values = exact_values(self.exact, column, run.companion.scene)
            assert values is not None
            true = values(self.times)
        found, scale = on_times(run.history, column, self.times), rms(true)
        return rms(found - true) / scale if scale > 0.0 else float(rms(found))


def stated_truth(plan: Plan) -> Truth | None:
    """The truth that stands beside the scene; None where it says nothing of the column."""
    scene, times = plan.scene, grid_of(plan.scene)
    series = series_of(scene).get(plan.column)
    if series is not None:
        return Truth("the scene's series", times, np.asarray(series(times)))
    exact = exact_values(scene, plan.column)
    if exact is not None:
        # a particle stands somewhere else in each run
        at_point = any(one.name == plan.column.partition(".")[0] and one.at is not None for one in scene.probes)
        words = "the exact solution" + (" where a run's particle is" if at_point else "")
        return Truth(words, times, exact(times), exact=scene if at_point else None)
    final: Any = (scene.reference.final if scene.reference else None) or {}
    if plan.column in final:
        return Truth("the scene's value at the end", times[-1:], np.array([final[plan.column]]))
    return None


def observed_truth(plan: Plan) -> Truth | None:
    """The limit of the choice whose runs differ least, with its bar; None before a choice has two runs."""
    times, best = grid_of(plan.scene), None
    for one in plan.candidates:
        runs = [run for run in reversed(one.runs) if run.history][:3]
        if len(runs) < 2:
            continue
        ratios = np.array([run.ratio for run in runs]) / runs[0].ratio
        series = Series(times, np.array([on_times(run.history, plan.column, times) for run in runs]), ratios)
        bar = spacing_bar(series, order_in_spacing(plan.column, runs[0].companion.scene), plan.scene.end_time)
        uncertain = rms(bar.error) / max(rms(series.values[0]), 1e-300)
        # a fine level tells more than a small bar of a coarse one, and an observed order more than none
        key = (len(runs) < 3, runs[0].ratio, bar.factor != SAFE, uncertain)
        if np.isfinite(uncertain) and (best is None or key < best[0]):
            values = series.values[0] - fitted_error(series, bar.used)[0]
            words = f"the limit of '{one.choice.name}' from {len(runs)} resolutions"
            best = key, Truth(words, times, values, uncertain)
    return None if best is None else best[1]


def judge(plan: Plan, truth: Truth) -> None:
    """Errors of all runs."""
    for one in plan.candidates:
        one.errors = [truth.error(run, plan.column) for run in one.runs if run.history]


def time_to(one: Candidate, error: float, dimension: int) -> float:
    """Processor seconds that a choice would need for an error, by the power law of its last two runs."""
    if not one.errors:
        return float("inf")
    least, most = (dimension + 1) / 4.0, (dimension + 1) / 0.4
    slope = least * 2.0
    if len(one.errors) > 1 and one.errors[-1] > 0.0:
        gain, cost = np.log(one.errors[-2] / one.errors[-1]), np.log(one.times[-1] / one.times[-2])
        slope = min(most, max(least, cost / gain)) if gain > 0.0 else most
    # finer is worth more than is known of it only by the order; coarser no more than the runs show
    ratio = max(one.errors[-1], 1e-300) / error
    return float(one.times[-1] * ratio ** (slope if ratio > 1.0 else min(slope, most / 2.0)))


def seconds_for(one: Candidate, error: float) -> float:
    """Processor seconds for an error between those of a choice's runs; infinite where none is as good."""
    for number, (seconds, found) in enumerate(zip(one.times, one.errors)):
        if found <= error:
            if number == 0 or found <= 0.0:
                return float(seconds)
            before, cost = one.errors[number - 1], one.times[number - 1]
            share = np.log(before / error) / np.log(before / found)
            return float(cost * (seconds / cost) ** share)
    return float("inf")


def envelope(plan: Plan) -> list[tuple[float, float, Candidate, int]]:
    """The runs that no other has less error than in less time: (seconds, error, choice, level), cheapest first."""
    points = [(t, e, one, i) for one in plan.candidates for i, (t, e) in enumerate(zip(one.times, one.errors))]
    result: list[tuple[float, float, Candidate, int]] = []
    for point in sorted(points, key=lambda p: p[:2]):
        # a hundredth is no gain
        if not result or point[1] < 0.99 * result[-1][1]:
            result.append(point)
    return result
