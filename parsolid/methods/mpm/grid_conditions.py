"""Planes at which a background grid is folded, and rigid walls, from a scene's boundaries."""

from dataclasses import dataclass

import numpy as np

from decomposition.occupied import Mirror
from parsolid.collective import SolverError, maximum, minimum
from parsolid.methods.mpm.grid import RigidWall, obey_wall

# a plane this near, in cells, to nodes or to the middle between them counts as there
_NEAR = 1e-6


@dataclass
class MirrorPlane:
    """A plane of symmetry ("roller") or rest ("fixed"); signs (8,): how its image changes the columns of nodes."""

    mirror: Mirror
    signs: np.ndarray


class MovingWall:
    """A rigid wall that starts at a plane and moves with a constant velocity [m/s]."""

    def __init__(self, boundary, dimension: int):
        self.start, self.normal, self.velocity = np.zeros((3, 4))
        axis = boundary.plane.axis
        self.start[axis] = boundary.plane.offset
        self.normal[axis] = 1.0 if boundary.side == "above" else -1.0
        if boundary.velocity is not None:
            self.velocity[:dimension] = boundary.velocity
        self.stick = 1.0 if boundary.contact == "sticking" else 0.0

    def at(self, time: float) -> RigidWall:
        """The wall at a time [s]."""
        return RigidWall(self.start + time * self.velocity, self.normal, self.velocity, self.stick)


def mirror_planes(comm, scene, position: np.ndarray, origin: np.ndarray, spacing: float) -> list[MirrorPlane]:
    """Planes of symmetry and rest of a scene, and the axis of axisymmetry; position (n, d) [m] of this rank's particles.

    Raises SolverError on all ranks when a plane lies neither on nodes nor half-way between, or does not bound all bodies. Collective.
    """
    lower, upper = (
        minimum(comm, position.min(axis=0, initial=np.inf)),
        maximum(comm, position.max(axis=0, initial=-np.inf)),
    )
    wanted = [
        (f"boundaries.{i}", boundary.plane.axis, boundary.plane.offset, boundary.kind)
        for i, boundary in enumerate(scene.boundaries)
        if boundary.kind in ("roller", "fixed")
    ]
    given = {(axis, offset) for _, axis, offset, _ in wanted}
    if scene.method.geometry == "axisymmetric" and (0, 0.0) not in given and lower[0] < 4.0 * spacing:
        wanted.append(("method.geometry", 0, 0.0, "roller"))
    planes = []
    for key, axis, offset, kind in wanted:
        doubled = mirror_index(key, axis, offset, origin, spacing)
        if lower[axis] < offset < upper[axis]:
            raise SolverError(
                f"{key}: expected a plane that bounds all bodies, found particles from {'XYZ'[axis]} = {lower[axis]:g} to {upper[axis]:g}"
            )
        signs = np.ones((1, 8))
        reversed_ = [axis] if kind == "roller" else [0, 1, 2]
        signs[0, reversed_], signs[0, [4 + i for i in reversed_]] = -1.0, -1.0
        planes.append(MirrorPlane(Mirror(axis, doubled, 1 if lower[axis] >= offset else -1), signs))
    return planes


def mirror_index(key: str, axis: int, offset: float, origin: np.ndarray, spacing: float) -> int:
    """Twice the index of a plane; raises SolverError, naming the scene's `key`, when it is neither on nodes nor half-way between."""
    place = 2.0 * (offset - origin[axis]) / spacing
    if abs(place - round(place)) > 2.0 * _NEAR:
        raise SolverError(
            f"{key}: expected a plane on nodes of the grid or half-way between (method.origin, method.cell), "
            f"found {'XYZ'[axis]} = {offset:g}, {0.5 * place:.6g} cells from the origin"
        )
    return round(place)


def walls(scene) -> list[MovingWall]:
    """Rigid walls of a scene."""
    return [MovingWall(boundary, scene.dimension) for boundary in scene.boundaries if boundary.kind == "wall"]


class DrivenRegion:
    """Nodes in a region of space whose velocity components follow formulas of place and time."""

    def __init__(self, boundary):
        self.boundary, self._seen = boundary, -1

    def _choose(self, tables, dimension: int) -> None:
        """The nodes in the region, anew when there are others."""
        if self._seen == tables.changes:
            return
        self._seen = tables.changes
        place, boundary = tables.places[:, :dimension], self.boundary
        tolerance = _NEAR * tables.spacing
        if boundary.plane is not None:
            inside = np.abs(place[:, boundary.plane.axis] - boundary.plane.offset) <= tolerance
        elif boundary.box is not None:
            lower, upper = np.array(boundary.box.lower), np.array(boundary.box.upper)
            inside = ((lower - tolerance <= place) & (place <= upper + tolerance)).all(axis=1)
        else:
            inside = np.linalg.norm(place - np.array(boundary.ball.centre), axis=1) <= boundary.ball.radius + tolerance
        self.slots = np.flatnonzero(inside)
        self.places = np.ascontiguousarray(place[self.slots])

    def drive(self, nodes: np.ndarray, tables, time: float, dimension: int) -> float:
        """Set the nodes' velocities to those of a time [s]; the work [J] done on the nodes that this rank counts."""
        self._choose(tables, dimension)
        work, mass = 0.0, nodes[self.slots, 3] * tables.share[self.slots]
        for axis, formula in enumerate(self.boundary.velocity):
            if formula is None:
                continue
            wanted, found = formula.evaluate(self.places, time), nodes[self.slots, axis]
            change = np.where(nodes[self.slots, 3] > 0.0, wanted - found, 0.0)
            work += float(mass @ (change * (found + 0.5 * change - 0.5 * nodes[self.slots, 4 + axis])))
            nodes[self.slots, axis] += change
            nodes[self.slots, 4 + axis] += change
        return work


def driven_regions(scene) -> list[DrivenRegion]:
    """Regions of prescribed velocity; those at a single particle's place have no meaning on a grid."""
    regions = []
    for i, boundary in enumerate(scene.boundaries):
        if boundary.kind == "velocity":
            if boundary.point is not None:
                raise SolverError(f"boundaries.{i}.point: expected a plane, box or ball of grid nodes, found a point")
            regions.append(DrivenRegion(boundary))
    return regions


class GridConditions:
    """All that a scene prescribes to the grid's motion: mirror planes, walls, driven regions."""

    def __init__(self, comm, scene, position: np.ndarray, origin: np.ndarray):
        """position (n, d) [m] of this rank's particles; see `mirror_planes` for what it raises. Collective."""
        self.planes = mirror_planes(comm, scene, position, origin, float(scene.method.cell))
        self.walls, self.driven, self.dimension = walls(scene), driven_regions(scene), scene.dimension

    def obey(self, nodes, array: np.ndarray, time: float) -> tuple[float, float]:
        """Let velocities in one of the arrays of `Nodes` obey at a time [s]; the work that this takes and what of it is lost [J]."""
        supplied, caught = 0.0, 0.0
        for wall in self.walls:
            *impulse, lost = obey_wall(0, nodes.count, array, nodes.places, nodes.share, wall.at(time))
            supplied, caught = supplied + float(np.dot(impulse, wall.velocity[:3])), caught + lost
        for region in self.driven:
            supplied += region.drive(array, nodes, time, self.dimension)
        nodes.spread(array)
        return supplied, caught
