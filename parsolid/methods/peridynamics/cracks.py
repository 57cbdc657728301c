"""Cracks that a body has from the start, as flat patches."""

from typing import Any

import numpy as np

from parsolid.methods.peridynamics.bond_damage_kernels import Patch

# an unbounded patch reaches this many times the size of the body beyond it
_BEYOND = 10.0


def patch_of(crack: Any, lower: np.ndarray, upper: np.ndarray) -> Patch:
    """The patch of a scene's `PreCrack`; lower, upper (d,): the bounds of all particles [m]."""
    if crack.plane is not None:
        return _in_plane(crack, lower, upper)
    points = np.zeros((3, 3))
    stated = np.array(crack.segment if crack.segment is not None else crack.rectangle, float)
    points[: len(stated), : stated.shape[1]] = stated
    edges = points[1:] - points[0]
    if crack.segment is not None:
        points[0, 2], edges[1] = -0.5, (0.0, 0.0, 1.0)
    return Patch(points[0], edges[0], edges[1])


def _in_plane(crack: Any, lower: np.ndarray, upper: np.ndarray) -> Patch:
    d, margin = len(lower), _BEYOND * np.max(upper - lower)
    low, high = np.full(3, -0.5), np.full(3, 0.5)
    low[:d], high[:d] = lower - margin, upper + margin
    if crack.box is not None:
        low[:d], high[:d] = crack.box.lower, crack.box.upper
    low[crack.plane.axis] = crack.plane.offset
    edges = [np.where(np.arange(3) == axis, high - low, 0.0) for axis in range(3) if axis != crack.plane.axis]
    return Patch(low, *edges)


def distance(patch: Patch, positions: np.ndarray) -> np.ndarray:
    """Distance (n,) [m] of points (n, d) from a patch with a right angle at its corner."""
    x = np.zeros((len(positions), 3))
    x[:, : positions.shape[1]] = positions
    x -= patch.corner
    nearest = np.zeros_like(x)
    for edge in (patch.first, patch.second):
        nearest += np.clip(x @ edge / (edge @ edge), 0.0, 1.0)[:, None] * edge
    return np.linalg.norm(x - nearest, axis=1)
