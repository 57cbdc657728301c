"""Reference values of columns of a history: a series or exact solution or final values stated in the scene, else the
extrapolated limit of runs of several resolutions.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.campaign.error_bars import on_times
from parsolid.campaign.estimate import SAFETY, Series, fitted_error, rms, spacing_bar
from parsolid.campaign.in_process import VariantRun
from parsolid.campaign.orders import order_in_spacing
from parsolid.scene import Scene

Values = Callable[[np.ndarray], np.ndarray]
# dimension -> quadrature points along a direction for a probe with a weight
_POINTS = {1: 400, 2: 80, 3: 24}


def series_of(scene: Scene) -> dict[str, Values]:
    """Column -> function of times (n,) [s] that returns values (n,) of the scene's series."""
    reference = scene.reference
    if reference is None or reference.series is None:
        return {}
    from scipy.interpolate import CubicSpline

    data = json.loads(Path(reference.series).read_text(encoding="utf-8"))
    return {column: CubicSpline(data["t"], data["series"][name]) for column, name in (reference.columns or {}).items()}


def exact_values(scene: Scene, column: str) -> Values | None:
    """Values of a column over time by the scene's exact solution; None unless the column is of a probe at a point or
    with a weight and the solution has its field."""
    if scene.reference is None or scene.reference.exact is None:
        return None
    from parsolid.exact import SOLUTIONS

    kind: Any = SOLUTIONS[scene.reference.exact]
    for probe in scene.probes:
        if probe.quantity is not None or getattr(probe, "where", None) is not None:
            continue
        for field, names in probe.columns_of_fields(scene.dimension).items():
            if column in names:
                return _values_of_probe(kind.of_scene(scene), scene, probe, field, names.index(column))
    return None


def _values_of_probe(solution: Any, scene: Scene, probe: Any, field: str, component: int) -> Values | None:
    d = scene.dimension
    if probe.at is not None:
        points, weight = np.array([probe.at], float), np.ones(1)
    else:
        quadrature = _quadrature(scene)
        if quadrature is None:
            return None
        points, measure = quadrature
        weight = probe.weight.evaluate(points)
        weight = weight * measure / np.sum(weight * weight * measure)
    if field not in solution.fields(points[:1], 0.0):
        return None

    def values(times: np.ndarray) -> np.ndarray:
        result = []
        for time in np.atleast_1d(times):
            fields = solution.fields(points, float(time))[field]
            fields = fields[:, :d, :d] if fields.ndim == 3 else fields
            result.append(float(weight @ fields.reshape(len(points), -1)[:, component]))
        return np.array(result)

    return values


def _quadrature(scene: Scene) -> tuple[np.ndarray, np.ndarray] | None:
    """Points (n, d) [m] and relative weights (n,) over the first body, a box or a ring; None for other shapes."""
    body = scene.bodies[0]
    shape: Any = body.shape.model
    if body.shape.kind == "box":
        count = _POINTS[scene.dimension]
        lines = [a + (np.arange(count) + 0.5) / count * (b - a) for a, b in zip(shape.lower, shape.upper)]
        points = np.stack([grid.ravel() for grid in np.meshgrid(*lines, indexing="ij")], axis=1)
        return points, np.ones(len(points))
    if body.shape.kind == "cylindrical_shell" and scene.dimension == 2 and shape.closed:
        radii = shape.radius + ((np.arange(400) + 0.5) / 400 - 0.5) * shape.thickness
        r, angle = np.meshgrid(radii, np.arange(200) / 200 * 2.0 * np.pi, indexing="ij")
        from_centre = np.stack([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()], axis=1)
        return np.array(shape.centre) + from_centre, r.ravel()
    return None


@dataclass
class Reference:
    """Reference values (n,) of a column at times (n,) [s]; words: their source; uncertain: their relative error."""

    words: str
    times: np.ndarray
    values: np.ndarray
    uncertain: float = 0.0

    def error(self, run: VariantRun, column: str) -> float:
        """The rms difference of a run from the reference over the rms of the reference (1 if that is 0)."""
        values, scale = on_times(run.history, column, self.times), rms(self.values)
        return rms(values - self.values) / scale if scale > 0.0 else rms(values)


def _times_of(scene: Scene) -> np.ndarray:
    """Times (n,) [s] at which histories are compared, after the start."""
    return np.linspace(0.0, scene.end_time, 201)[1:]


def stated_reference(scene: Scene, column: str) -> Reference | None:
    """The reference that the scene states; None if it has no values of the column."""
    times = _times_of(scene)
    series = series_of(scene).get(column)
    if series is not None:
        return Reference("the scene's series", times, np.asarray(series(times)))
    exact = exact_values(scene, column)
    if exact is not None:
        return Reference("the exact solution", times, exact(times))
    final: Any = (scene.reference.final if scene.reference else None) or {}
    if column in final:
        return Reference("the scene's value at the end", times[-1:], np.array([final[column]]))
    return None


def observed_reference(scene: Scene, column: str, families: Sequence[tuple[str, list[VariantRun]]]) -> Reference | None:
    """The extrapolated limit of the best family of runs, with its bar; None if no family has two runs.

    families: name and runs, coarsest first. Three runs are better than two, a fine level is better than a small bar of
    a coarse one, and an observed order is better than none.
    """
    times, best = _times_of(scene), None
    for name, family in families:
        runs = [run for run in reversed(family) if run.history][:3]
        if len(runs) < 2:
            continue
        ratios = np.array([run.ratio for run in runs]) / runs[0].ratio
        series = Series(times, np.array([on_times(run.history, column, times) for run in runs]), ratios)
        bar = spacing_bar(series, order_in_spacing(column, runs[0].variant.scene), scene.end_time)
        uncertain = rms(bar.error) / max(rms(series.values[0]), 1e-300)
        key = (len(runs) < 3, runs[0].ratio, bar.factor != SAFETY, uncertain)
        if np.isfinite(uncertain) and (best is None or key < best[0]):
            values = series.values[0] - fitted_error(series, bar.used)[0]
            best = key, Reference(f"the limit of '{name}' from {len(runs)} resolutions", times, values, uncertain)
    return None if best is None else best[1]
