"""What a background grid obeys of a scene's boundaries: folds at mirror planes, walls, driven regions, temperatures."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.occupied import Mirror
from parsolid.boundary import surface_loads
from parsolid.boundary.declarations import (
    Declarations,
    Declared,
    PrescribedMotion,
    RigidWall,
    Support,
    SurfaceHeat,
    TemperaturePlane,
)
from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.boundary.reactions import Told
from parsolid.collective import SolverError, maximum, minimum
from parsolid.methods.mpm import grid as kernels
from parsolid.numerics.sums import in_turn
from parsolid.scene.base_model import Plane
from parsolid.scene.formulas import Formula
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import NearestTo, region_of
from parsolid.scene.schema import Scene

# a plane this near, in cells, to nodes or to the middle between them counts as there
_NEAR = 1e-6
TAKES = (Support, PrescribedMotion, RigidWall, TemperaturePlane, SurfaceHeat, *surface_loads.TAKES)


@dataclass
class FoldedPlane:
    """A mirror plane between or on nodes; signs (1, 8): how its image changes the columns of nodes."""

    plane: MirrorPlane
    mirror: Mirror

    @property
    def signs(self) -> np.ndarray:
        """Of velocity and of force alike."""
        result = np.ones((1, 8))
        result[0, 0:3] = result[0, 4:7] = self.plane.signs()
        return result


@dataclass
class ThermalPlane:
    """A plane at a temperature, formula(X, t) [K], or a plane of symmetry (formula None) through which fluxes
    [W/m^2] may enter matter of a conductivity [W/(m K)]."""

    mirror: Mirror
    axis: int
    offset: float
    formula: Formula | None
    fluxes: tuple[LoadHistory, ...] = ()
    conductivity: float = 1.0

    @property
    def sign(self) -> float:
        """Of the image's temperatures, less those of the plane."""
        return 1.0 if self.formula is None else -1.0

    def temperatures(self, places: np.ndarray, time: float) -> np.ndarray:
        """Temperatures [K] at the feet of places (n, d) [m]."""
        if self.formula is None:
            return np.zeros(len(places))
        feet = places.copy()
        feet[:, self.axis] = self.offset
        return self.formula.evaluate(feet, time)

    def lift(self, places: np.ndarray, time: float) -> np.ndarray:
        """What the image's temperatures (n,) [K] are beyond those of the matter times the sign, at a time [s]; places
        (n, d) [m]: behind the plane.
        """
        if self.formula is not None:
            return 2.0 * self.temperatures(places, time)
        slope, feet = np.zeros(len(places)), places.copy()
        feet[:, self.axis] = self.offset
        for flux in self.fluxes:
            slope += flux.evaluate(feet, time)[:, 0] / self.conductivity
        return -2.0 * slope * np.abs(places[:, self.axis] - self.offset)


class MovingWall:
    """A rigid wall that starts at a plane and moves with a constant velocity [m/s]."""

    def __init__(self, wall: RigidWall, dimension: int):
        self.start, self.normal, self.velocity = np.zeros((3, 4))
        axis = wall.plane.axis
        self.start[axis] = wall.plane.offset
        self.normal[axis] = 1.0 if wall.side == "above" else -1.0
        if wall.velocity is not None:
            self.velocity[:dimension] = wall.velocity
        self.stick = 1.0 if wall.sticking else 0.0
        self._held, self._seen = np.zeros(0, bool), -1
        self.told = Told(wall, dimension) if wall.where.reports is not None else None

    def held(self, tables: Any) -> np.ndarray:
        """Which nodes (count,) it holds in the step, kept from the motion for what is mapped back."""
        if self._seen != tables.changes:
            self._held, self._seen = np.zeros(tables.count, bool), tables.changes
        return self._held

    def at(self, time: float) -> kernels.RigidWall:
        """The wall at a time [s]."""
        return kernels.RigidWall(self.start + time * self.velocity, self.normal, self.velocity, self.stick)


class DrivenRegion:
    """Nodes in a region of space whose velocity components follow formulas of place and time."""

    def __init__(self, motion: PrescribedMotion, scene: Scene):
        """Raises SolverError for the place of a single particle, for groups of meshes, and for motions of particles
        that turn, which have no meaning on a grid."""
        if motion.turn is not None:
            known = " or ".join(map(repr, scene.method.boundaries))
            raise SolverError(f"{motion.key}.kind: expected {known} with this method, found {motion.where.kind!r}")
        if isinstance(motion.where.region, NearestTo):
            raise SolverError(f"{motion.key}.point: expected a plane, box or ball of grid nodes, found a point")
        self.region, self._seen = region_of(scene, motion.key, motion.where), -1
        free = motion.course.free
        self.components = [(int(i), motion.course.component(int(i))) for i in np.flatnonzero(~free)]
        self.told = Told(motion, scene.dimension) if motion.where.reports is not None else None

    def choose(self, tables: Any, dimension: int) -> None:
        """The nodes in the region, anew when there are others."""
        if self._seen == tables.changes:
            return
        self._seen = tables.changes
        place = tables.places[:, :dimension]
        self.slots = np.flatnonzero(self.region.contains(place, _NEAR * tables.spacing))
        self.places = np.ascontiguousarray(place[self.slots])

    def drive(self, nodes: np.ndarray, tables: Any, time: float, dimension: int) -> float:
        """Set the nodes' velocities to those of a time [s]; the work [J] done on the nodes that this rank counts."""
        self.choose(tables, dimension)
        work, mass = 0.0, nodes[self.slots, 3] * tables.share[self.slots]
        for axis, course in self.components:
            wanted, found = course.evaluate(self.places, time)[:, 0], nodes[self.slots, axis]
            change = np.where(nodes[self.slots, 3] > 0.0, wanted - found, 0.0)
            work += in_turn(mass * (change * (found + 0.5 * change - 0.5 * nodes[self.slots, 4 + axis])))
            nodes[self.slots, axis] += change
            nodes[self.slots, 4 + axis] += change
        return work


class GridConditions:
    """Conditions of a scene on a background grid, the same on all ranks; planes include the axis of axisymmetry."""

    def __init__(self, comm: MPI.Comm, scene: Scene, position: np.ndarray, origin: np.ndarray):
        """position (n, d) [m] of this rank's particles; origin (4,) [m] of the grid. Collective.

        Raises SolverError on all ranks when a plane lies neither on nodes nor half-way between, or does not bound all
        bodies, and for a condition that a grid cannot obey.
        """
        self.declared = Declarations(scene, *TAKES)
        self.origin, self.cell = origin, float(scene.method.cell)
        self.lower = minimum(comm, position.min(axis=0, initial=np.inf))
        self.upper = maximum(comm, position.max(axis=0, initial=-np.inf))
        for one in self.declared.all:
            _refuse_body(one)
        self.planes, self.dimension = self._folded(scene), scene.dimension
        self.walls = [MovingWall(wall, scene.dimension) for wall in self.declared.of(RigidWall)]
        self.driven = [DrivenRegion(motion, scene) for motion in self.declared.of(PrescribedMotion, "velocity")]
        telling: list[Any] = [*self.walls, *self.driven]
        self.told: list[Told] = [one.told for one in telling if one.told is not None]

    def _folded(self, scene: Scene) -> list[FoldedPlane]:
        supports = self.declared.of(Support, "roller", "fixed")
        for one in supports:
            if not one.mirrored:
                raise SolverError(f"{one.key}.mirror: expected true with this method, found false")
        wanted = [(one.key, one.plane) for one in supports]
        given = {(plane.axis, plane.coordinate) for _, plane in wanted}
        near = self.lower[0] < 4.0 * self.cell
        if scene.method.geometry == "axisymmetric" and (0, 0.0) not in given and near:
            wanted.append(("method.geometry", MirrorPlane(0, 0.0, "roller")))
        return [self._fold(key, plane) for key, plane in wanted]

    def _fold(self, key: str, plane: MirrorPlane) -> FoldedPlane:
        mirror = self._mirror(key, plane.axis, plane.coordinate)
        lower, upper = self.lower[plane.axis], self.upper[plane.axis]
        if lower < plane.coordinate < upper:
            raise SolverError(
                f"{key}: expected a plane that bounds all bodies, "
                f"found particles from {'XYZ'[plane.axis]} = {lower:g} to {upper:g}"
            )
        return FoldedPlane(plane, mirror)

    def _mirror(self, key: str, axis: int, offset: float) -> Mirror:
        """The plane by its index; raises SolverError, naming the scene's `key`, when it is not on or between nodes."""
        place = 2.0 * (offset - self.origin[axis]) / self.cell
        if abs(place - round(place)) > 2.0 * _NEAR:
            raise SolverError(
                f"{key}: expected a plane on nodes of the grid or half-way between (method.origin, method.cell), "
                f"found {'XYZ'[axis]} = {offset:g}, {0.5 * place:.6g} cells from the origin"
            )
        return Mirror(axis, round(place), 1 if self.lower[axis] >= offset else -1)

    def _take(self, one: Any, nodes: Any, before: np.ndarray | None) -> None:
        """Count the impulses by which the velocities `before` (count, d) of a step's nodes have changed; their work is
        that on a wall's velocity, or on the mean of the nodes' own."""
        if one.told is None or before is None:
            return
        d, now = self.dimension, nodes.motion[: nodes.count]
        change = now[:, :d] - before
        moving = now[:, :d] - 0.5 * now[:, 4 : 4 + d]
        if isinstance(one, MovingWall):
            moving = np.broadcast_to(one.velocity[:d], moving.shape)
        mass = nodes.share * now[:, 3]
        # with others the sums would have other bits
        here = np.flatnonzero(mass)
        one.told.add(nodes.places[here, :d], mass[here, None] * change[here], moving[here])

    def obey(self, nodes: Any, array: np.ndarray, time: float) -> tuple[float, float]:
        """Let velocities in an array of `Nodes` obey at a time [s]; the work this takes, and what of it is lost [J]."""
        supplied, caught = 0.0, 0.0
        telling = bool(self.told) and array is nodes.motion
        for wall in self.walls:
            before = array[: nodes.count, : self.dimension].copy() if telling else None
            reached = wall.at(time)
            here = nodes.places, nodes.share, wall.held(nodes), nodes.motion, array is nodes.again
            *impulse, lost = kernels.obey_wall(0, nodes.count, array, *here, reached)
            supplied, caught = supplied + float(np.dot(impulse, wall.velocity[:3])), caught + lost
            self._take(wall, nodes, before)
        for region in self.driven:
            before = array[: nodes.count, : self.dimension].copy() if telling else None
            supplied += region.drive(array, nodes, time, self.dimension)
            self._take(region, nodes, before)
        nodes.spread(array)
        return supplied, caught

    def driven_nodes(self, tables: Any) -> np.ndarray:
        """Which nodes (count,) of `Nodes` are in a driven region."""
        result = np.zeros(tables.count, bool)
        for region in self.driven:
            region.choose(tables, self.dimension)
            result[region.slots] = True
        return result

    def thermal_planes(self, conductivity: float | None) -> list[ThermalPlane]:
        """Mirror planes of the motion and planes at given temperatures, those through which heat enters first.

        conductivity [W/(m K)]: of all matter. Where there is more than one (None), or where heat enters one body alone,
        the temperatures of an image are not known, and the plane is a surface like others.
        """
        result, heated = [], []
        for one in self.declared.of(TemperaturePlane):
            axis, offset = one.plane.axis, float(one.plane.offset)
            result.append(ThermalPlane(self._mirror(one.key, axis, offset), axis, offset, one.formula))
        held = [plane.mirror for plane in result]
        for fold in self.planes:
            if fold.mirror in held:
                continue
            axis, offset = fold.plane.axis, float(fold.plane.coordinate)
            entering = [each for each in self.declared.of(SurfaceHeat) if each.plane == Plane(axis, offset)]
            if not entering:
                result.append(ThermalPlane(fold.mirror, axis, offset, None))
            elif conductivity and all(each.where.body is None for each in entering):
                fluxes = tuple(each.course for each in entering)
                heated.append(ThermalPlane(fold.mirror, axis, offset, None, fluxes, conductivity))
        return heated + result


def _refuse_body(one: Declared) -> None:
    """Nodes belong to all bodies; only heat through a plane and loads on surfaces go to the particles of one."""
    if one.where.body is not None and not isinstance(one, (SurfaceHeat, *surface_loads.TAKES)):
        what = "a plane's temperature" if isinstance(one, TemperaturePlane) else "a condition on nodes"
        raise SolverError(f"{one.key}.body: expected none, {what} is that of all bodies, found one")
