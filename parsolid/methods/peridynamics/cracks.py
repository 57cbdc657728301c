"""Cracks that a body has from the start, as flat patches, and the bonds that they cross."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.methods.peridynamics.sweeps import ONE, ZERO, image_of

# an unbounded patch reaches this many times the size of the body beyond it
_BEYOND = 10.0


class Patch(NamedTuple):
    """A flat crack: the parallelogram of two edges (3,) [m] at a corner (3,) [m]."""

    corner: np.ndarray
    first: np.ndarray
    second: np.ndarray


def patch_of(crack: Any, lower: np.ndarray, upper: np.ndarray) -> Patch:
    """The patch of a scene's `PreCrack`; lower, upper (d,): the bounds of all particles [m]."""
    if crack.plane is None:
        points = np.zeros((3, 3))
        stated = np.array(crack.segment if crack.segment is not None else crack.rectangle, float)
        points[: len(stated), : stated.shape[1]] = stated
        edges = points[1:] - points[0]
        if crack.segment is not None:
            points[0, 2], edges[1] = -0.5, (0.0, 0.0, 1.0)
        return Patch(points[0], edges[0], edges[1])
    d, margin = len(lower), _BEYOND * np.max(upper - lower)
    low, high = np.full(3, -0.5), np.full(3, 0.5)
    low[:d], high[:d] = lower - margin, upper + margin
    if crack.box is not None:
        low[:d], high[:d] = crack.box.lower, crack.box.upper
    low[crack.plane.axis] = crack.plane.offset
    first, second = (np.where(np.arange(3) == axis, high - low, 0.0) for axis in range(3) if axis != crack.plane.axis)
    return Patch(low, first, second)


def distance(patch: Patch, positions: np.ndarray) -> np.ndarray:
    """Distance (n,) [m] of points (n, d) from a patch with a right angle at its corner."""
    x = np.zeros((len(positions), 3))
    x[:, : positions.shape[1]] = positions
    x -= patch.corner
    nearest = np.zeros_like(x)
    for edge in (patch.first, patch.second):
        nearest += np.clip(x @ edge / (edge @ edge), 0.0, 1.0)[:, None] * edge
    return np.linalg.norm(x - nearest, axis=1)


def parted(patch: Patch, place: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Which lines (n,) from a place (d,) to others (n, d) [m] cut a patch."""
    missing = ((0, 0), (0, 3 - len(place)))
    A, B = np.pad(place[None], missing) - patch.corner, np.pad(others, missing) - patch.corner
    normal = np.cross(patch.first, patch.second)
    before, after, slack = A @ normal, B @ normal, 1e-9 * np.linalg.norm(normal) * np.abs(B - A).sum(axis=1)
    across = (before < -slack) != (after < -slack)
    part = before / np.where(across, before - after, 1.0)
    shares = np.linalg.pinv(np.stack([patch.first, patch.second])).T @ (A + part[:, None] * (B - A)).T
    return across & ((shares >= -1e-9) & (shares <= 1.0 + 1e-9)).all(axis=0)


@kernel
def find_crossing(bonds, images, positions, patch, found):
    """List the intact bonds that a crack crosses, see `fracture.find_failed`; through a mirror plane its image counts
    too.

    positions (n, 3) [m].
    """
    count = 0
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            if bonds.weight[k] == 0.0:
                continue
            b = bonds.neighbour[k]
            _, R, T = image_of(images, k)
            crossed = crosses(place(positions, ONE, ZERO, a), place(positions, R, T, b), patch)
            if images is not None:
                crossed = crossed | crosses(place(positions, ONE, ZERO, b), place(positions, R, T, a), patch)
            if crossed:
                if count < found.shape[0]:
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@inlined
def place(positions, R, T, b):
    """R X + T of a particle."""
    return (R[0] * positions[b, 0] + T[0], R[1] * positions[b, 1] + T[1], R[2] * positions[b, 2] + T[2])


@inlined
def dot(x, y):
    return x[0] * y[0] + x[1] * y[1] + x[2] * y[2]


@inlined
def cross(x, y):
    return (x[1] * y[2] - x[2] * y[1], x[2] * y[0] - x[0] * y[2], x[0] * y[1] - x[1] * y[0])


@inlined
def crosses(A, B, patch):
    """Whether the line from A to B cuts the patch."""
    u, v = (patch.first[0], patch.first[1], patch.first[2]), (patch.second[0], patch.second[1], patch.second[2])
    # what lies on an edge, or on the plane, does so for both ends of a bond whatever their rounding
    slack = 1e-9 * (abs(B[0] - A[0]) + abs(B[1] - A[1]) + abs(B[2] - A[2]))
    normal = cross(u, v)
    area = dot(normal, normal) ** 0.5
    to_A = (A[0] - patch.corner[0], A[1] - patch.corner[1], A[2] - patch.corner[2])
    line = (B[0] - A[0], B[1] - A[1], B[2] - A[2])
    before = dot(to_A, normal) / area
    after = before + dot(line, normal) / area
    part = before / (before - after)
    x = (to_A[0] + part * line[0], to_A[1] + part * line[1], to_A[2] + part * line[2])
    first, second = dot(cross(x, v), normal) / (area * area), dot(cross(u, x), normal) / (area * area)
    p, q = slack / dot(u, u) ** 0.5, slack / dot(v, v) ** 0.5
    inside = (-p <= first) & (first <= 1.0 + p) & (-q <= second) & (second <= 1.0 + q)
    return ((before < -slack) != (after < -slack)) & inside
