"""Reference values of a history's columns: of an exact solution, a series or values at the end beside the scene, else
the limit to which runs of rising resolution tend.
"""

import json
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.campaign.error_bars import on_times
from parsolid.campaign.estimate import SAFETY, Series, fitted_error, rms, spacing_bar
from parsolid.campaign.orders import order_in_spacing
from parsolid.campaign.runner import VariantRun
from parsolid.scene import Scene

Values = Callable[[np.ndarray], np.ndarray]
# points along a direction by which the mean of a probe with a weight is taken, by dimension
_POINTS = {1: 400, 2: 80, 3: 24}


def series_of(scene: Scene, names: dict[str, str] | None = None) -> dict[str, Values]:
    """Column -> function of times (n,) [s] that gives its values (n,), of the scene's series; names: other than the
    scene's.
    """
    reference = scene.reference
    if reference is None or reference.series is None:
        return {}
    from scipy.interpolate import CubicSpline

    data = json.loads(Path(reference.series).read_text(encoding="utf-8"))
    requested = (reference.columns or {}) if names is None else names
    return {column: CubicSpline(data["t"], data["series"][name]) for column, name in requested.items()}


def exact_values(scene: Scene, column: str) -> Values | None:
    """Reference values of a column of a probe at a point or with a weight, where the exact solution knows its field."""
    if scene.reference is None or scene.reference.exact is None:
        return None
    from parsolid.exact import SOLUTIONS

    kind: Any = SOLUTIONS[scene.reference.exact]
    for probe in scene.probes:
        if probe.quantity is not None or getattr(probe, "where", None) is not None:
            continue
        for field, names in probe.columns_of_fields(scene.dimension).items():
            if column in names:
                place = None if probe.at is None else np.array(probe.at, float)
                return _at_probe(kind.of_scene(scene), scene, probe, (field, names.index(column)), place)
    return None


def _at_probe(solution: Any, scene: Scene, probe: Any, what: tuple[str, int], place: Any) -> Values | None:
    (field, component), d = what, scene.dimension
    if place is not None:
        places, weight = place[None, :], np.ones(1)
    else:
        found = _places(scene)
        if found is None:
            return None
        places, measure = found
        weight = probe.weight.evaluate(places)
        weight = weight * measure / np.sum(weight * weight * measure)
    if field not in solution.fields(places[:1], 0.0):
        return None

    def values(times: np.ndarray) -> np.ndarray:
        result = []
        for time in np.atleast_1d(times):
            fields = solution.fields(places, float(time))[field]
            fields = fields[:, :d, :d] if fields.ndim == 3 else fields
            result.append(float(weight @ fields.reshape(len(places), -1)[:, component]))
        return np.array(result)

    return values


def _places(scene: Scene) -> tuple[np.ndarray, np.ndarray] | None:
    """Places (n, d) [m] over the first body, a box or a ring, and what each stands for; None for other shapes."""
    body = scene.bodies[0]
    box: Any = body.shape.model
    if body.shape.kind == "box":
        count = _POINTS[scene.dimension]
        lines = [a + (np.arange(count) + 0.5) / count * (b - a) for a, b in zip(box.lower, box.upper)]
        places = np.stack([grid.ravel() for grid in np.meshgrid(*lines, indexing="ij")], axis=1)
        return places, np.ones(len(places))
    if body.shape.kind == "cylindrical_shell" and scene.dimension == 2 and box.closed:
        radii = box.radius + ((np.arange(400) + 0.5) / 400 - 0.5) * box.thickness
        r, angle = np.meshgrid(radii, np.arange(200) / 200 * 2.0 * np.pi, indexing="ij")
        around = np.stack([(r * np.cos(angle)).ravel(), (r * np.sin(angle)).ravel()], axis=1)
        return np.array(box.centre) + around, r.ravel()
    return None


@dataclass
class Reference:
    """What runs are compared with: values (n,) at times (n,) [s], in which words, how uncertain, as an error."""

    words: str
    times: np.ndarray
    values: np.ndarray
    uncertain: float = 0.0

    def error(self, run: VariantRun, column: str) -> float:
        """Root of the mean square of the difference over that of the reference, over all times or that at the end."""
        found, scale = on_times(run.history, column, self.times), rms(self.values)
        return rms(found - self.values) / scale if scale > 0.0 else float(rms(found))


def _times_of(scene: Scene) -> np.ndarray:
    """Times (n,) [s] at which histories are compared, after the start."""
    return np.linspace(0.0, scene.end_time, 201)[1:]


def stated_reference(scene: Scene, column: str) -> Reference | None:
    """The reference that stands beside the scene; None where it says nothing of the column."""
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
    """The limit of the family of runs, coarsest first, that differ least, with its bar; None where none has two."""
    times, best = _times_of(scene), None
    for name, family in families:
        runs = [run for run in reversed(family) if run.history][:3]
        if len(runs) < 2:
            continue
        ratios = np.array([run.ratio for run in runs]) / runs[0].ratio
        series = Series(times, np.array([on_times(run.history, column, times) for run in runs]), ratios)
        bar = spacing_bar(series, order_in_spacing(column, runs[0].variant.scene), scene.end_time)
        uncertain = rms(bar.error) / max(rms(series.values[0]), 1e-300)
        # a fine level tells more than a small bar of a coarse one, and an observed order more than none
        key = (len(runs) < 3, runs[0].ratio, bar.factor != SAFETY, uncertain)
        if np.isfinite(uncertain) and (best is None or key < best[0]):
            values = series.values[0] - fitted_error(series, bar.used)[0]
            best = key, Reference(f"the limit of '{name}' from {len(runs)} resolutions", times, values, uncertain)
    return None if best is None else best[1]
