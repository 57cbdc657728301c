"""Which places are inside a shape, farther from its surface than a margin [m]; one below zero adds to the shape."""

from collections.abc import Callable
from typing import Any

import numpy as np


def _in_box(box: Any, places: np.ndarray, margin: float) -> np.ndarray:
    within = (places > np.array(box.lower) + margin) & (places < np.array(box.upper) - margin)
    return np.asarray(within.all(axis=1))


def _in_perforated_box(box: Any, places: np.ndarray, margin: float) -> np.ndarray:
    return _in_box(box, places, margin) & (_distance(places, box.centre) > box.radius + margin)


def _in_sphere(sphere: Any, places: np.ndarray, margin: float) -> np.ndarray:
    return _distance(places, sphere.centre) < sphere.radius - margin


def _distance(places: np.ndarray, centre: list[float]) -> np.ndarray:
    return np.asarray(np.linalg.norm(places - np.array(centre), axis=1))


def _in_cylinder(cylinder: Any, places: np.ndarray, margin: float) -> np.ndarray:
    axis = "XYZ".index(cylinder.axis)
    from_base = places - np.array(cylinder.base)
    across = [i for i in range(3) if i != axis]
    inside = np.linalg.norm(from_base[:, across], axis=1) < cylinder.radius - margin
    inside &= (from_base[:, axis] > margin) & (from_base[:, axis] < cylinder.length - margin)
    for i in across[: {"whole": 0, "half": 1, "quarter": 2}[cylinder.part]]:
        inside &= from_base[:, i] > margin
    return np.asarray(inside)


def _in_shell(shell: Any, places: np.ndarray, margin: float) -> np.ndarray:
    dimension = places.shape[1]
    axis = 2 if dimension == 2 else "XYZ".index(shell.axis)
    from_centre = places - np.array(shell.centre if dimension == 2 else shell.base)
    first, second = from_centre[:, (axis + 1) % 3], from_centre[:, (axis + 2) % 3]
    radius = np.hypot(first, second)
    inside = np.abs(radius - shell.radius) < 0.5 * shell.thickness - margin
    if dimension == 3:
        inside &= (from_centre[:, axis] > margin) & (from_centre[:, axis] < shell.length - margin)
    if not shell.closed:
        begin, end = np.radians(shell.angles)
        turned = (np.arctan2(second, first) - begin) % (2.0 * np.pi)
        slack = margin / shell.radius
        inside &= (turned > slack) & (turned < end - begin - slack)
    return np.asarray(inside)


INSIDE: dict[str, Callable[[Any, np.ndarray, float], np.ndarray]] = {
    "box": _in_box,
    "perforated_box": _in_perforated_box,
    "sphere": _in_sphere,
    "cylinder": _in_cylinder,
    "cylindrical_shell": _in_shell,
}
