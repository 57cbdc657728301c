"""Shapes, mass properties and motions of the rigid tools of a scene."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import SolverError
from parsolid.contact.tools.rigid_body import FreeBody, GuidedBody, Pose
from parsolid.contact.tools.shapes import BALL, BOX, CYLINDER, MESH, PLANE, Shape
from parsolid.contact.tools.surface import make_surface
from parsolid.scene.formulas import FormulaVector
from parsolid.scene.tools import Tool

_FACETS = {2: "line", 3: "triangle"}
# corners closer than this share of a mesh's size are merged
_SAME = 1e-9


class Shaped(NamedTuple):
    """A shape, its place (3,) [m], least width [m], greatest distance of its points from the place [m], and the inertia
    over mass (3, 3) [m^2] of a homogeneous body about the place, None where it is infinite."""

    shape: Any
    place: np.ndarray
    width: float
    far: float
    inertia: np.ndarray | None


def in_space(values: Any) -> np.ndarray:
    """One, two or three components, followed by zeros to three."""
    return np.concatenate((np.asarray(values, float), np.zeros(3 - len(values))))


def shaped(tool: Tool, dimension: int) -> Shaped:
    """The shape of a tool; raises SolverError for a mesh that cannot be read or is not closed."""
    kind, model = tool.shape.kind, tool.shape.model
    if kind == "plane":
        normal = in_space(model.normal) / np.linalg.norm(model.normal)
        return Shaped(Shape(PLANE, axis=tuple(normal.tolist())), in_space(model.point), np.inf, np.inf, None)
    if kind == "sphere":
        radius, share = model.radius, 0.4 if dimension == 3 else 0.5
        shape = Shape(BALL, size=(radius, 0.0, 0.0))
        return Shaped(shape, in_space(model.centre), 2.0 * radius, radius, share * radius**2 * np.eye(3))
    if kind == "box":
        lower, upper = in_space(model.lower), in_space(model.upper)
        half, place = 0.5 * (upper - lower), 0.5 * (upper + lower)
        ends, squares = np.where(np.arange(3) < dimension, half, np.inf).tolist(), half**2 / 3.0
        inertia = np.diag(squares.sum() - squares)
        return Shaped(Shape(BOX, size=tuple(ends)), place, 2.0 * min(ends), float(np.linalg.norm(half)), inertia)
    if kind == "cylinder":
        radius, axis, length = model.radius, np.eye(3)["XYZ".index(model.axis)], model.length
        half = np.inf if length is None else 0.5 * length
        shape = Shape(CYLINDER, tuple(axis.tolist()), (radius, half, 0.0))
        if length is None:
            return Shaped(shape, in_space(model.base), 2.0 * radius, np.inf, None)
        along, across = 0.5 * radius**2, 0.25 * radius**2 + length**2 / 12.0
        inertia = across * np.eye(3) + (along - across) * np.outer(axis, axis)
        place = in_space(model.base) + half * axis
        return Shaped(shape, place, 2.0 * min(radius, half), float(np.hypot(radius, half)), inertia)
    return _mesh(tool, dimension)


# --- meshes ---------------------------------------------------------------------------------------------------------


def _mesh(tool: Tool, dimension: int) -> Shaped:
    stated, key = tool.shape.mesh, f"tools.{tool.name}.shape.mesh.file"
    assert stated is not None
    import meshio

    kind = _FACETS[dimension]
    try:
        mesh = meshio.read(stated.file)
    except (Exception, SystemExit) as error:
        raise SolverError(f"{key}: expected a mesh that meshio reads, found {stated.file} ({error})") from None
    pieces = [np.asarray(block.data, np.int64) for block in mesh.cells if block.type == kind]
    if not pieces:
        found = ", ".join(block.type for block in mesh.cells) or "nothing"
        raise SolverError(f"{key}: expected cells of the kind {kind!r} in {dimension}-D, found {found}")
    points, facets = _joined(np.asarray(mesh.points, float)[:, :dimension] * stated.scale, np.concatenate(pieces))
    facets = _oriented(key, points, facets)
    volume, centre, inertia = _moments(points - points.mean(axis=0), facets)
    centre = centre + points.mean(axis=0)
    shape = Shape(MESH, surface=make_surface(points - centre, facets))
    # at most the side of a cube (a square) of the same volume, as slanted thin shapes have a large bounding box
    width = min(float(np.ptp(points[np.unique(facets)], axis=0).min()), volume ** (1.0 / dimension))
    far = float(np.linalg.norm(points[np.unique(facets)] - centre, axis=1).max())
    return Shaped(shape, in_space(centre), width, far, inertia)


def _joined(points: np.ndarray, facets: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Points that are used, with those at one place merged; facets without those that are degenerate then."""
    size = float(np.ptp(points[np.unique(facets)], axis=0).max())
    rounded = np.round(points / (_SAME * size)) if size > 0.0 else points
    _, first, place = np.unique(rounded, axis=0, return_index=True, return_inverse=True)
    facets = place.ravel()[facets]
    whole = np.array([len(set(facet)) == len(facet) for facet in facets.tolist()])
    used, facets = np.unique(facets[whole], return_inverse=True)
    return points[first][used], facets.reshape(-1, points.shape[1])


def _oriented(key: str, points: np.ndarray, facets: np.ndarray) -> np.ndarray:
    """Facets with outward normals; raises SolverError where they are not closed, or not oriented alike."""
    d = points.shape[1]
    ridges = facets[:, :, None] if d == 2 else np.stack([facets[:, [i, (i + 1) % 3]] for i in range(3)], axis=1)
    flat = np.sort(ridges.reshape(-1, d - 1), axis=1)
    _, place, count = np.unique(flat, axis=0, return_inverse=True, return_counts=True)
    wrong = int((count != 2).sum())
    if wrong:
        what = {2: "corners", 3: "edges"}[d]
        raise SolverError(f"{key}: expected a closed surface, found {wrong} {what} that are not of two facets")
    ways = np.where(ridges[:, :, 0] < ridges[:, :, 1], 1, -1) if d == 3 else np.tile([1, -1], (len(facets), 1))
    balance = np.bincount(place.ravel(), ways.ravel(), minlength=len(count))
    if balance.any():
        if d == 3:
            raise SolverError(f"{key}: expected facets that are oriented alike, found {int((balance != 0).sum())} not")
        facets = _walked(facets)
    return facets if _moments(points, facets)[0] > 0.0 else facets[:, ::-1].copy()


def _walked(segments: np.ndarray) -> np.ndarray:
    """Segments of closed curves, each oriented so that it begins where the one before it ends."""
    at: dict[int, list[int]] = {}
    for number, pair in enumerate(segments.tolist()):
        for corner in pair:
            at.setdefault(corner, []).append(number)
    result, left = [], set(range(len(segments)))
    while left:
        number = min(left)
        begin = int(segments[number, 0])
        while number in left:
            left.remove(number)
            one, other = map(int, segments[number])
            end = other if one == begin else one
            result.append((begin, end))
            number = next((near for near in at[end] if near in left), number)
            begin = end
    return np.array(result)


def _moments(points: np.ndarray, facets: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
    """Volume, centre (d,), and inertia (3, 3) about it over the volume: sums over simplices from the origin."""
    d, corners = points.shape[1], points[facets]
    volumes = np.linalg.det(corners) / (2.0 if d == 2 else 6.0)
    total = float(volumes.sum())
    sums = corners.sum(axis=1)
    centre = (volumes @ sums) / ((d + 1) * total)
    second = np.einsum("m,mki,mkj->ij", volumes, corners, corners) + np.einsum("m,mi,mj->ij", volumes, sums, sums)
    second = second / ((d + 1) * (d + 2) * total) - np.outer(centre, centre)
    full = np.zeros((3, 3))
    full[:d, :d] = second
    return total, centre, np.trace(full) * np.eye(3) - full


# --- motion ---------------------------------------------------------------------------------------------------------


class Course:
    """Velocity [m/s] and rate [rad/s] of a prescribed motion at a time [s]; at rest without one."""

    def __init__(self, motion: Any):
        self.velocity = FormulaVector(() if motion is None or motion.velocity is None else motion.velocity)
        self.rate = None if motion is None else motion.rate
        self._place = np.zeros((1, 3))

    def __call__(self, time: float) -> tuple[np.ndarray, float]:
        velocity = in_space(self.velocity.evaluate(self._place, time)[0])
        return velocity, 0.0 if self.rate is None else float(self.rate.evaluate(self._place, time)[0])


def make_body(tool: Tool, form: Shaped, dimension: int, share: float) -> FreeBody | GuidedBody:
    """The body of a tool; share: mass over the stated mass, 1/(2 pi) where masses are per radian, else 1."""
    if tool.mass is None:
        motion, axis, about = tool.motion, np.array([0.0, 0.0, 1.0]), form.place
        if motion is not None and motion.axis is not None:
            axis = np.asarray(motion.axis) / np.linalg.norm(motion.axis)
        if motion is not None and motion.about is not None:
            about = in_space(motion.about)
        return GuidedBody(Pose(form.place), Course(motion), axis, about)
    mass, turns = share * tool.mass, tool.turns(dimension)
    inertia, axes = np.ones(3), np.eye(3)
    if turns and tool.inertia is not None:
        inertia = np.array(tool.inertia) if dimension == 3 else np.full(3, tool.inertia[0])
    elif turns:
        assert form.inertia is not None
        inertia, axes = np.linalg.eigh(mass * form.inertia)
        axes[:, 0] *= np.linalg.det(axes)
        if dimension == 2:
            inertia, axes = np.full(3, mass * form.inertia[2, 2]), np.eye(3)
    pose = Pose(form.place, velocity=in_space(tool.velocity or ()))
    if tool.spin is not None:
        pose.spin = np.array([0.0, 0.0, tool.spin[0]] if dimension == 2 else tool.spin)
    free = np.array([axis in tool.translations(dimension) for axis in "XYZ"])
    return FreeBody(pose, mass, inertia, axes, free, turns)
