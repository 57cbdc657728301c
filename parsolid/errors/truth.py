"""True values of a history's columns, where a scene has an exact solution, a series or values at the end beside it."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.errors.places import box_of, nearest
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
    wanted = (reference.columns or {}) if names is None else names
    return {column: CubicSpline(data["t"], data["series"][name]) for column, name in wanted.items()}


def exact_values(scene: Scene, column: str, run: Scene | None = None) -> Values | None:
    """True values of a column of a probe at a point or with a weight, where the exact solution knows its field; at the
    particle that the probe of a run takes.
    """
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
                lattice = None if place is None or run is None else box_of(run, place)
                place = nearest(lattice, place) if lattice is not None and place is not None else place
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
