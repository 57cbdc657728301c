"""Boundary conditions on the nodes of a background grid: mirror planes, walls, prescribed velocities, temperatures."""

import itertools
from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.occupied import Mirror, words
from parsolid.boundary.constraints import mirror_plane
from parsolid.boundary.forces import surface_load
from parsolid.boundary.loads import Loads
from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.boundary.reactions import Reaction
from parsolid.boundary.walls import RigidWall
from parsolid.collective import SolverError, maximum, minimum
from parsolid.kernels import kernel
from parsolid.methods.mpm.grid import FoldedPlane, Nodes
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.particles.generation import contradictions
from parsolid.particles.initial_fields import initial_displacement
from parsolid.particles.particle_set import ParticleSet
from parsolid.particles.regions import region_of
from parsolid.scene import Scene, SceneError
from parsolid.scene.base_model import Plane
from parsolid.scene.boundaries import HeatFlux, MotionCondition, PrescribedTemperature, Support, Wall
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import NearestTo

# distance in cells within which a plane counts as lying on nodes or half-way between them
_NEAR = 1e-6
# gap in cells from which on a body counts as apart from a wall
_APART = 0.1


def sum_in_order(values: np.ndarray) -> float:
    """The sum of an array, one number after the other. Zeros in between do not change its bits, as they do in numpy's
    pairwise sums: a restart has fewer empty nodes."""
    return float(np.cumsum(values)[-1]) if values.size else 0.0


@kernel
def stop_at_wall(count, nodes, places, share, held, motion, remapped, wall):
    """Let nodes at or behind a rigid wall move with it; after `grid.accelerate`. Returns the impulse (x, y, z) on the
    body [N s] and what is lost [J].

    nodes (slots, 8): velocities and changes, those of the motion or, if `remapped`, of the momentum that was mapped
    back; places (count, 3 or 4) [m]; share (count,), see `grid.Nodes`; wall: plane point (3,) [m], normal into the body
    (3,), velocity (3,) [m/s], and whether the wall sticks, else nodes may slide and leave.

    held (count,) bool: which nodes the wall holds in the step, found in the motion. Those, and no others, obey when
    momentum is mapped back: matter that strained with nodes free to leave, which in the motion are held, would gain
    energy from the wall. In the motion m/2 of the square of what the whole step changes in the velocity that the wall
    sets is lost: all of it when a body is caught, nothing while it stays. In the remapped momentum it is what the
    particles kept of the held nodes' velocity.
    """
    point, normal, velocity, sticking = wall
    x, y, z, lost = 0.0, 0.0, 0.0, 0.0
    for i in range(count):
        distance, speed = 0.0, 0.0
        for d in range(3):
            distance += normal[d] * (places[i, d] - point[d])
            speed += normal[d] * (nodes[i, d] - velocity[d])
        if not remapped:
            held[i] = distance <= 0.0 < nodes[i, 3] and (sticking or speed < 0.0)
        if not held[i]:
            continue
        caught, along, kept, mass = 0.0, 0.0, 0.0, share[i] * nodes[i, 3]
        for d in range(3):
            change = velocity[d] - nodes[i, d] if sticking else -speed * normal[d]
            nodes[i, d] += change
            nodes[i, 4 + d] += change
            x += mass * change if d == 0 else 0.0
            y += mass * change if d == 1 else 0.0
            z += mass * change if d == 2 else 0.0
            caught += nodes[i, 4 + d] ** 2
            along += normal[d] * nodes[i, 4 + d]
            kept += change * motion[i, 4 + d]
        if not remapped:
            kept = caught if sticking else along**2
        lost += 0.5 * mass * kept
    return x, y, z, lost


class NodalWall:
    """A rigid wall that acts on nodes."""

    def __init__(self, wall: RigidWall, reaction: Reaction | None):
        self.wall, self.reaction = wall, reaction
        self.normal, self.velocity = np.zeros((2, 3))
        self.normal[: len(wall.normal)], self.velocity[: len(wall.normal)] = wall.normal, wall.velocity
        self._held, self._seen = np.zeros(0, bool), -1

    def impose(self, nodes: Nodes, array: np.ndarray, time: float) -> tuple[float, float]:
        """Work of the wall on the nodes and what is lost [J], see `stop_at_wall`."""
        if self._seen != nodes.changes:
            self._held, self._seen = np.zeros(nodes.count, bool), nodes.changes
        point = np.zeros(3)
        point[self.wall.axis] = self.wall.offset(time)
        wall = point, self.normal, self.velocity, self.wall.sticking
        here = nodes.places, nodes.share, self._held, nodes.motion, array is nodes.remapped
        *impulse, lost = stop_at_wall(nodes.count, array, *here, wall)
        return float(np.dot(impulse, self.velocity)), lost

    def moving(self, nodes: Nodes) -> np.ndarray:
        """Velocities (count, d) [m/s] on which its impulses work."""
        return np.broadcast_to(self.wall.velocity, (nodes.count, len(self.wall.velocity)))


class DrivenRegion:
    """Nodes in a region of space whose velocity components follow formulas of place and time.

    Of a plane that bounds all bodies they are also those beyond it, in which the last points of a body have a part:
    free ones would follow the points, and these leave what drives them. Where its normal velocity is the same all over
    it, such a plane moves with it. Then the row of nodes that is less than a cell before the plane is driven, too, as
    there are too few points beyond it to carry the load: velocities of that row and of those beyond change linearly
    from the plane to the next row before them, so that matter strains up to the plane.

    Behind a plane whose normal velocity is zero or free nodes have the velocities of a mirror image that moves against
    the prescribed one, as those behind a folded plane: nodes at rest there would see a strain that halves beside the
    plane, and take energy from what swings.

    plane: axis, side (1: bodies are below), offset [m], or None; moved, at: how far it has moved [m] by a time [s],
    before: the time [s] of the last step.
    """

    def __init__(self, key: str, motion: MotionCondition, scene: Scene, reaction: Reaction | None, bounds: Any):
        """bounds: lower and upper ones (d,) [m] of all particles. Raises SolverError for the place of a single particle
        and for groups of meshes."""
        if isinstance(motion.region, NearestTo):
            raise SolverError(f"{key}.point: expected a plane, box or ball of grid nodes, found a point")
        self.key, self.region, self.reaction, self._seen = key, region_of(scene, key, motion), reaction, -1
        velocity = motion.prescribed
        assert isinstance(velocity, LoadHistory)
        self.components = [(int(i), velocity.component(int(i))) for i in np.flatnonzero(~velocity.free)]
        self.plane = _bounding(motion, *bounds)
        normal = dict(self.components).get(self.plane[0]) if self.plane is not None else None
        self.stays = self.plane is not None and (normal is None or _is_zero(normal))
        self.moved, self.at, self.before, self._chosen_at = 0.0, 0.0, 0.0, np.nan
        self._rows, self._images, self._ratio = np.zeros(0, int), np.zeros(0, int), np.zeros(0)

    def follow(self, time: float) -> None:
        """Move a plane that bounds bodies to a time [s]."""
        found = dict(self.components).get(self.plane[0]) if self.plane is not None else None
        speed = found if found is not None and not set(found.formulas[0].names) - {"t"} else None
        if speed is not None and time > self.at:
            self.moved += (
                0.5 * (time - self.at) * sum(speed.evaluate(np.zeros((1, 3)), t)[0, 0] for t in (self.at, time))
            )
        self.before, self.at = self.at, time

    def choose(self, nodes: Nodes) -> np.ndarray:
        """Slots of the nodes in the region, found anew when there are others."""
        if self._seen != nodes.changes or self._chosen_at != self.moved:
            self._seen, self._chosen_at = nodes.changes, self.moved
            places = nodes.places[:, : nodes.points.dimension]
            inside = self.contains(places, nodes.spacing)
            self._slots = np.flatnonzero(inside)
            self._places = np.ascontiguousarray(places[self._slots])
            if self.plane is not None:
                self._find_images(nodes, self._beyond(self._places) / nodes.spacing)
        return self._slots

    def contains(self, places: np.ndarray, spacing: float) -> np.ndarray:
        """True (n,) for nodes at places (n, d) [m] that it drives."""
        if self.plane is None:
            return np.asarray(self.region.contains(places, _NEAR * spacing))
        # a plane at NaN drives all nodes, so that the run ends
        return np.asarray(~(self._beyond(places) < -((0.5 if self.stays else 1.0) - _NEAR) * spacing))

    def _beyond(self, places: np.ndarray) -> np.ndarray:
        """Distance of places (n, d) [m] behind the plane [m]."""
        assert self.plane is not None
        axis, side, offset = self.plane
        return np.asarray(side * (places[:, axis] - offset - self.moved))

    def _find_images(self, nodes: Nodes, beyond: np.ndarray) -> None:
        """Find those of the driven nodes, by how far they are beyond the plane [cells], that follow a node before it:
        their rows, its slots, and ratios of both distances from the plane."""
        assert self.plane is not None
        axis, side, _ = self.plane
        if self.stays:
            # the node nearest to the mirror image, half a cell before the plane at least
            rows = np.flatnonzero(beyond > _NEAR)
            s = beyond[rows]
            steps = np.maximum(np.rint(2.0 * s), np.ceil(s + 0.5 - _NEAR))
        else:
            # the first row that is not driven, a cell before the plane at least
            rows = np.flatnonzero(np.abs(beyond) > _NEAR)
            s = beyond[rows]
            steps = np.ceil(s - _NEAR) + 1.0
        place = nodes.grid.cells.nodes[self._slots[rows]].copy()
        place[:, axis] -= int(side) * steps.astype(np.int64)
        slot = nodes.grid.cells.slots(words(place))
        there = slot >= 0
        self._rows, self._images, self._ratio = rows[there], slot[there], (s / (steps - s))[there]

    def impose(self, nodes: Nodes, array: np.ndarray, time: float) -> tuple[float, float]:
        """Set the nodes' velocities to those of a time [s]; the work on the nodes that this rank counts, and what is
        lost where they are held at rest or follow others [J]."""
        slots, rows, work, lost = self.choose(nodes), self._rows, 0.0, 0.0
        mass = array[slots, 3] * nodes.share[slots]
        for axis, velocity in self.components:
            wanted, found = velocity.evaluate(self._places, time)[:, 0], array[slots, axis]
            if len(rows):
                has = array[self._images, 3] > 0.0
                wanted = wanted.copy()
                wanted[rows] -= np.where(has, self._ratio * (array[self._images, axis] - wanted[rows]), 0.0)
            change = np.where(array[slots, 3] > 0.0, wanted - found, 0.0)
            given = mass * (change * (found + 0.5 * change - 0.5 * array[slots, 4 + axis]))
            # what moves as the boundary does takes its work; the rest is lost in nodes that follow others
            supplied = np.zeros(len(slots))
            if not _is_zero(velocity):
                supplied = given.copy()
                supplied[rows] = (mass * change)[rows] * self._speeds(velocity, self._places[rows], time)
            work, lost = work + sum_in_order(supplied), lost + sum_in_order(supplied - given)
            array[slots, axis] += change
            array[slots, 4 + axis] += change
        return work, lost if array is nodes.motion else 0.0

    def _speeds(self, velocity: LoadHistory, places: np.ndarray, time: float) -> np.ndarray:
        """Mean velocity (n,) [m/s] of the boundary at places in the step that ends at a time [s]."""
        return np.asarray(0.5 * (velocity.evaluate(places, self.before) + velocity.evaluate(places, time))[:, 0])

    def moving(self, nodes: Nodes) -> np.ndarray:
        """Velocities (count, d) [m/s] on which its impulses work: those in the middle of the step, 0 where it holds,
        and its own where nodes follow others."""
        now, d, follow = nodes.motion[: nodes.count], nodes.points.dimension, self._slots[self._rows]
        middle = np.asarray(now[:, :d] - 0.5 * now[:, 4 : 4 + d])
        for axis, velocity in self.components:
            if _is_zero(velocity):
                middle[:, axis] = 0.0
            elif len(follow):
                middle[follow, axis] = self._speeds(velocity, self._places[self._rows], self.at)
        return middle


def _is_zero(velocity: LoadHistory) -> bool:
    """Whether a component is zero everywhere and always."""
    return not velocity.formulas[0].names and not velocity.evaluate(np.zeros((1, 3)), 0.0).any()


def _bounding(motion: MotionCondition, lower: np.ndarray, upper: np.ndarray) -> tuple[int, float, float] | None:
    """Axis, side and offset [m] of a condition's plane that has all particles on one side; None for other regions."""
    plane = getattr(motion, "plane", None)
    if plane is None or not lower[plane.axis] <= upper[plane.axis]:
        return None
    if upper[plane.axis] <= plane.offset:
        return plane.axis, 1.0, float(plane.offset)
    return (plane.axis, -1.0, float(plane.offset)) if lower[plane.axis] >= plane.offset else None


class ThermalPlane:
    """A plane at a prescribed temperature [K], or a plane of symmetry (None) through which fluxes [W/m^2] may enter
    matter of a conductivity [W/(m K)]. sign: of the image's temperatures, less those of the plane."""

    def __init__(
        self, mirror: Mirror, plane: Plane, prescribed: LoadHistory | None = None, fluxes: Any = (), k: float = 1.0
    ):
        """k: the conductivity."""
        self.mirror, self.axis, self.offset = mirror, plane.axis, float(plane.offset)
        self.prescribed, self.fluxes, self.conductivity = prescribed, tuple(fluxes), k
        self.sign = 1.0 if prescribed is None else -1.0

    def _feet(self, places: np.ndarray) -> np.ndarray:
        feet = places.copy()
        feet[:, self.axis] = self.offset
        return feet

    def temperatures(self, places: np.ndarray, time: float) -> np.ndarray:
        """Temperatures [K] at the feet of places (n, d) [m]."""
        if self.prescribed is None:
            return np.zeros(len(places))
        return self.prescribed.evaluate(self._feet(places), time)[:, 0]

    def lift(self, places: np.ndarray, time: float) -> np.ndarray:
        """What the image's temperatures (n,) [K] are beyond those of the matter times the sign, at a time [s]; places
        (n, d) [m]: behind the plane."""
        if self.prescribed is not None:
            return 2.0 * self.temperatures(places, time)
        slope, feet = np.zeros(len(places)), self._feet(places)
        for flux in self.fluxes:
            slope += flux.evaluate(feet, time)[:, 0] / self.conductivity
        return np.asarray(-2.0 * slope * np.abs(places[:, self.axis] - self.offset))


class GridConditions:
    """Conditions of a scene on a background grid, the same on all ranks.

    planes: mirror planes, that on the axis of axisymmetry included; loads: on the particles, with all reactions.
    """

    def __init__(self, comm: MPI.Comm, scene: Scene, particle_set: ParticleSet, points: MaterialPoints):
        """points: those of the particle set. Raises SolverError on all ranks when a plane lies neither on nodes nor
        halfway between, or does not bound all bodies, and for a condition that a grid cannot obey; SceneError where
        conditions contradict one another on nodes. Collective."""
        position = particle_set.position
        self.points, self.dimension = points, scene.dimension
        self.lower = minimum(comm, position.min(axis=0, initial=np.inf))
        self.upper = maximum(comm, position.max(axis=0, initial=-np.inf))
        self.loads = Loads(comm, scene, particle_set, points)
        for key, one in self.loads.all:
            # nodes belong to all bodies; only heat through a plane and loads on surfaces go to the particles of one
            if one.body is not None and not isinstance(one, HeatFlux) and surface_load(one) is None:
                what = "a plane's temperature" if isinstance(one, PrescribedTemperature) else "a condition on nodes"
                raise SolverError(f"{key}.body: expected none, {what} is that of all bodies, found one")
        self.bearing_early = walls_that_bear_early(comm, scene, particle_set)
        self.planes = self._folded(scene)
        self.imposed: list[NodalWall | DrivenRegion] = [
            NodalWall(RigidWall(wall, scene.dimension), self.loads.reaction_of(wall)) for _, wall in self.loads.of(Wall)
        ]
        self.driven = [
            DrivenRegion(key, motion, scene, self.loads.reaction_of(motion), (self.lower, self.upper))
            for key, motion in self.loads.of(MotionCondition)
        ]
        self.imposed += self.driven
        if self.driven:
            # conditions that hold a component of a node differently, of corners of cells with particles
            d, cell, origin = self.dimension, scene.method.cell, self.points.origin[: self.dimension]
            lowest = np.unique(np.floor((position - origin) / cell), axis=0)
            corners = [lowest + corner for corner in itertools.product((0.0, 1.0), repeat=d)]
            places = origin + cell * np.unique(np.concatenate(corners), axis=0)
            chosen = [np.full(len(places), isinstance(one, Support)) for one in scene.boundaries]
            for region in self.driven:
                chosen[int(region.key.rpartition(".")[2])] = region.contains(places, cell)
            faults = contradictions(scene, places, cell, chosen, comm, "nodes")
            if faults:
                raise SceneError(faults)
        self._beside, self._seen = np.zeros(0, bool), -1

    def _folded(self, scene: Scene) -> list[FoldedPlane]:
        supports = self.loads.of(Support)
        for key, one in supports:
            if one.plane is None:
                expected = "plane in place of where, or kind = 'velocity', with this method"
                raise SolverError(f"{key}.where: expected {expected}, found {one.where!r}")
            if not one.mirror:
                raise SolverError(f"{key}.mirror: expected true with this method, found false")
        wanted = [(key, mirror_plane(scene, one)) for key, one in supports]
        given = {(plane.axis, plane.coordinate) for _, plane in wanted}
        near = self.lower[0] < 4.0 * scene.method.cell
        if self.points.axisymmetric and (0, 0.0) not in given and near:
            wanted.append(("method.geometry", MirrorPlane(0, 0.0, "roller")))
        for key, plane in wanted:
            lower, upper = self.lower[plane.axis], self.upper[plane.axis]
            if lower < plane.coordinate < upper:
                raise SolverError(
                    f"{key}: expected a plane that bounds all bodies, "
                    f"found particles from {'XYZ'[plane.axis]} = {lower:g} to {upper:g}"
                )
        return [FoldedPlane(plane, self._mirror(key, plane.axis, plane.coordinate)) for key, plane in wanted]

    def _mirror(self, key: str, axis: int, offset: float) -> Mirror:
        """The plane by its index; raises SolverError, naming the scene's `key`, when it is not on or between nodes."""
        place = 2.0 * (offset - self.points.origin[axis]) / self.points.settings.cell
        if abs(place - round(place)) > 2.0 * _NEAR:
            raise SolverError(
                f"{key}: expected a plane on nodes of the grid or half-way between (method.origin, method.cell), "
                f"found {'XYZ'[axis]} = {offset:g}, {0.5 * place:.6g} cells from the origin"
            )
        return Mirror(axis, round(place), 1 if self.lower[axis] >= offset else -1)

    def impose(self, nodes: Nodes, array: np.ndarray, time: float) -> tuple[float, float]:
        """Let velocities of nodes, nodes.motion or nodes.remapped, obey at a time [s]; the work that this takes, and
        what is lost [J]."""
        supplied, lost, d = 0.0, 0.0, self.dimension
        for region in self.driven if array is nodes.motion else ():
            region.follow(time)
        for one in self.imposed:
            observed = one.reaction is not None and array is nodes.motion
            before = array[: nodes.count, :d].copy() if observed else None
            work, caught = one.impose(nodes, array, time)
            supplied, lost = supplied + work, lost + caught
            if before is not None and one.reaction is not None:
                mass = nodes.share * array[: nodes.count, 3]
                # empty nodes, of which a restart has fewer, would change the last bits of sums
                here = np.flatnonzero(mass)
                impulse = mass[here, None] * (array[: nodes.count, :d] - before)[here]
                work = float(np.sum(impulse * one.moving(nodes)[here]))
                one.reaction.add(nodes.places[here, :d].T, impulse.T, work)
        nodes.unfold(array)
        return supplied, lost

    def keep_slopes_beside_driven(self, nodes: Nodes) -> None:
        """Clear the slopes of FLIP's particles without a driven node in their stencil.

        Without slopes the nodes' velocities before they are driven are not those of the particles even where these move
        as the nodes are driven to, and what changes them in every step drifts into the particles.
        """
        if not self.driven or self.points.settings.transfer != "flip":
            return
        cells, slopes = nodes.grid.cells, self.points.storage("velocity_slope")
        if self._seen != nodes.changes:
            self._seen, driven = nodes.changes, np.zeros(nodes.count, bool)
            for region in self.driven:
                driven[region.choose(nodes)] = True
            self._beside = np.asarray(driven[cells.stencil].any(axis=1))
        beside = cells.order[: cells.start[-1]][np.repeat(self._beside, np.diff(cells.start))]
        kept = slopes[beside]
        slopes[: self.points.owned] = 0.0
        slopes[beside] = kept

    @property
    def rows_before_planes(self) -> tuple[tuple[int, int], ...]:
        """Axes and directions (1 or -1) from moving planes into bodies, where nodes follow those of the next row."""
        planes = [region.plane for region in self.driven if region.plane is not None and not region.stays]
        return tuple(dict.fromkeys((axis, -int(side)) for axis, side, _ in planes))

    def badly_held(self) -> list[tuple[str, str]]:
        """Keys of planes at rest whose nodes behind are no mirror images of what swings before them, and why."""
        settings, found = self.points.settings, []
        for region in self.driven:
            if region.plane is None or not region.stays:
                continue
            axis, _, offset = region.plane
            place = 2.0 * (offset - self.points.origin[axis]) / settings.cell
            if settings.basis == "linear":
                found.append((region.key, "with linear weights"))
            elif abs(place - round(place)) > 2.0 * _NEAR:
                found.append(
                    (region.key, "neither on nodes of the grid nor half-way between (method.origin, method.cell)")
                )
        return found

    def thermal_planes(self, conductivity: float | None) -> list[ThermalPlane]:
        """Mirror planes of the motion and planes at given temperatures, those through which heat enters first.

        conductivity [W/(m K)]: of all matter. Where there is more than one (None), or where heat enters one body alone,
        the temperatures of an image are not known, and the plane is a surface like others.
        """
        result, heated = [], []
        for key, one in self.loads.of(PrescribedTemperature):
            mirror = self._mirror(key, one.plane.axis, float(one.plane.offset))
            result.append(ThermalPlane(mirror, one.plane, one.prescribed))
        held = [plane.mirror for plane in result]
        for fold in self.planes:
            if fold.mirror in held:
                continue
            plane = Plane(fold.plane.axis, float(fold.plane.coordinate))
            entering = [one for _, one in self.loads.of(HeatFlux) if one.plane == plane]
            if not entering:
                result.append(ThermalPlane(fold.mirror, plane))
            elif conductivity and all(one.body is None for one in entering):
                fluxes = [one.prescribed for one in entering]
                heated.append(ThermalPlane(fold.mirror, plane, None, fluxes, conductivity))
        return heated + result


def walls_that_bear_early(comm: MPI.Comm, scene: Scene, particle_set: ParticleSet) -> list[tuple[str, float]]:
    """Walls that bear a body from the start though it is apart, as nodes behind them are in its reach: key, and gap
    [m]. Raises SolverError on all ranks for a wall with a body behind it; collective."""
    count, d, cell, early = len(scene.bodies), scene.dimension, scene.method.cell, []
    displacement = initial_displacement(scene, particle_set.body, particle_set.position, particle_set.regions)
    start = particle_set.position if displacement is None else particle_set.position + displacement
    lower, upper = np.full((count, d), np.inf), np.full((count, d), -np.inf)
    np.minimum.at(lower, particle_set.body, start)
    np.maximum.at(upper, particle_set.body, start)
    half = 0.5 * maximum(comm, particle_set.spacing.max(axis=0, initial=0.0))
    comm.Allreduce(MPI.IN_PLACE, lower, op=MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, upper, op=MPI.MAX)
    for i, wall in enumerate(scene.boundaries):
        if not isinstance(wall, Wall):
            continue
        axis, place, margin = wall.plane.axis, wall.plane.offset, _NEAR * cell
        above = wall.side == "above"
        beyond = lower[:, axis] < place - margin if above else upper[:, axis] > place + margin
        if beyond.any():
            body = int(np.argmax(beyond))
            raise SolverError(
                f"boundaries.{i}.plane: expected a wall with all bodies {wall.side} it, found particles of "
                f"bodies.{body} from {'XYZ'[axis]} = {lower[body, axis]:g} to {upper[body, axis]:g}"
            )
        gaps = (lower[:, axis] - place if above else place - upper[:, axis]) - half[axis]
        near = gaps[(gaps > _APART * cell) & (gaps + half[axis] < 0.5 * scene.method.reach(half)[axis])]
        early += [(f"boundaries.{i}", float(gap)) for gap in near]
    return early
