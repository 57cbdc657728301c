"""Supports, prescribed motion and loads of a peridynamic scene on one rank's particles.

A traction t on a plane with normal n acts as the forces that balance a uniform stress, f = -f_int(t (x) n), kept near the
plane ("consistent"): then a uniform stress is an exact solution on a lattice, which it is not under forces on the particles
at the face ("single-layer") or spread over the horizon ("horizon"). Irregular particles carry a uniform stress only under
small forces inside, too ("consistent-everywhere").
"""

from dataclasses import dataclass

import numpy as np

from decomposition.reduction import ordered_sum
from parsolid.boundary.conditions import Load, last_one_holds, mirror_codes, plane_count, supports_of
from parsolid.collective import maximum, minimum
from parsolid.scene.boundaries import FictitiousLayer, PrescribedDisplacement, PrescribedVelocity, Traction
from parsolid.scene.formulas import Formula
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import selected


@dataclass
class Guided:
    """One prescribed component of displacement (`course` [m]) or velocity (`velocity` [m/s]) of some particles (k,)."""

    particles: np.ndarray
    component: int
    positions: np.ndarray
    course: LoadHistory | None
    velocity: Formula | None


class PeridynamicLoads:
    """What a scene's boundaries and loads mean for peridynamics; arrays are of this rank's owned particles, d = dimension.

    codes: mirror images, None without; share (owned,): the part of a particle on this side of mirror planes; held, free
    (owned, d) bool: components at rest on supports, and components that are neither held nor guided; entries: particles and
    components (k,) of everything guided; jumps: times [s] before the end at which loads or prescribed displacements jump, with
    0 where anything is loaded. Forces [N] are those on the part of a particle on this side of mirror planes.
    """

    def __init__(self, comm, scene, particle_set, density: np.ndarray):
        """particle_set: this rank's sorted particles; density (owned,) [kg/m^3]; collective. Raises SolverError on all ranks."""
        self.comm, self.scene, self.particle_set = comm, scene, particle_set
        self.planes, self.held = supports_of(comm, scene, particle_set)
        self.codes = mirror_codes(comm, self.planes, particle_set)
        self.share = 0.5 ** plane_count(self.planes, particle_set)
        self.guided: list[Guided] = []
        for boundary in scene.boundaries:
            if isinstance(boundary, PrescribedDisplacement | PrescribedVelocity | FictitiousLayer):
                self.guided += self._guided(boundary)
        last_one_holds(self.guided)
        none = [np.zeros(0, np.int64)]
        components = [np.full(len(one.particles), one.component) for one in self.guided]
        self.entries = (
            np.concatenate(none + [one.particles for one in self.guided]),
            np.concatenate(none + components),
        )
        self.free = ~self.held
        self.free[self.entries] = False
        self.jumps = self._jump_times()
        self._loads = self._body_loads(density)
        self._constant: np.ndarray | None = None

    def _guided(self, boundary) -> list[Guided]:
        particles = np.flatnonzero(selected(self.scene, boundary, self.particle_set, self.comm))
        positions = self.particle_set.position[particles]
        if isinstance(boundary, PrescribedVelocity):
            return [
                Guided(particles, i, positions, None, one) for i, one in enumerate(boundary.velocity) if one is not None
            ]
        course, dimension = boundary.course, positions.shape[1]
        return [
            Guided(particles, i, positions, course.component(i), None) for i in range(dimension) if not course.free[i]
        ]

    def _jump_times(self) -> tuple[float, ...]:
        scene = self.scene
        acting = [
            one for one in scene.boundaries if isinstance(one, Traction | PrescribedDisplacement | FictitiousLayer)
        ]
        if scene.loads.body_force is not None or scene.loads.acceleration is not None:
            acting.append(scene.loads)
        times = {0.0} if acting else set()
        for one in acting:
            times.update(one.jump_times)
        return tuple(sorted(time for time in times if time < scene.end_time))

    def _body_loads(self, density: np.ndarray) -> list[Load]:
        loads, particle_set = self.scene.loads, self.particle_set
        everything, result = np.arange(len(particle_set)), []
        for formulas, scale in (
            (loads.body_force, particle_set.volume),
            (loads.acceleration, density * particle_set.volume),
        ):
            if formulas is not None:
                result.append(Load(everything, particle_set.position, scale, LoadHistory(formulas, loads)))
        return result

    # --- tractions -------------------------------------------------------------------------------------------

    def install_tractions(self, force, horizon: np.ndarray) -> None:
        """Find the forces of tractions; force: `BondForce` with all bonds whole; horizon (owned,) [m]; collective."""
        tractions = [boundary for boundary in self.scene.boundaries if isinstance(boundary, Traction)]
        reach = maximum(self.comm, float(horizon.max(initial=0.0)))
        kind = self.scene.method.traction
        if tractions and kind.startswith("consistent"):
            engine = force.dimension
            unit = force.of_stress(np.tile(np.eye(engine), (len(self.particle_set), 1, 1))) * self.share[:, None]
        for boundary in tractions:
            if kind.startswith("consistent"):
                depth = 2.0 * reach if kind == "consistent" else np.inf
                load = self._consistent(boundary, unit[:, boundary.plane.axis], depth)
            elif kind == "horizon":
                load = self._spread(boundary, reach)
            else:
                load = self._at_face(boundary)
            self._loads.append(load)

    def _at_face(self, boundary: Traction) -> Load:
        """Traction times area on the particles of the face."""
        particles = np.flatnonzero(selected(self.scene, boundary, self.particle_set, self.comm))
        area = np.abs(self.particle_set.area[particles, boundary.plane.axis])
        return Load(particles, self.particle_set.position[particles], area, boundary.course)

    def _spread(self, boundary: Traction, reach: float) -> Load:
        """The face's force on the volume within the horizon."""
        distance, _ = self._beneath(boundary)
        particles = np.flatnonzero(distance <= reach)
        volume = self.particle_set.volume[particles]
        depth = ordered_sum(self.comm, volume) / ordered_sum(self.comm, self._at_face(boundary).scale)
        return Load(particles, self._projected(boundary, particles), volume / depth, boundary.course)

    def _consistent(self, boundary: Traction, unit: np.ndarray, depth: float) -> Load:
        """Forces that balance the uniform stress t (x) n down to a depth [m]; unit (owned,): those of n (x) n."""
        distance, outward = self._beneath(boundary)
        within = distance <= min(depth, self._middle(boundary, distance))
        # what is left inside a regular body is rounding
        within &= np.abs(unit) > 1e-12 * maximum(self.comm, float(np.abs(unit).max(initial=0.0)))
        particles = np.flatnonzero(within)
        scale = -outward * unit[particles]
        farthest = maximum(self.comm, float(distance[np.isfinite(distance)].max(initial=0.0)))
        if depth < min(farthest, self._middle(boundary, distance)):
            # where particles are irregular the force of the face's area is not quite met
            scale *= ordered_sum(self.comm, self._at_face(boundary).scale) / ordered_sum(self.comm, scale)
        return Load(particles, self._projected(boundary, particles), scale, boundary.course)

    def _beneath(self, boundary: Traction) -> tuple[np.ndarray, float]:
        """Distance (owned,) [m] of the particles meant from the face, infinite for others; direction of the normal, -1 or 1."""
        particle_set, axis = self.particle_set, boundary.plane.axis
        meant = np.ones(len(particle_set), bool)
        if boundary.body is not None:
            meant = particle_set.body == [body.name for body in self.scene.bodies].index(boundary.body)
        offset = particle_set.position[:, axis] - boundary.plane.offset
        low = minimum(self.comm, float(offset[meant].min(initial=np.inf)))
        high = maximum(self.comm, float(offset[meant].max(initial=-np.inf)))
        return np.where(meant, np.abs(offset), np.inf), 1.0 if abs(high) < abs(low) else -1.0

    def _middle(self, boundary: Traction, distance: np.ndarray) -> float:
        """How deep consistent forces may go: to the middle of a body, beyond which they belong to the face across."""
        axis, offset = boundary.plane.axis, boundary.plane.offset
        if any(plane.axis == axis and plane.coordinate != offset for plane in self.planes):
            return np.inf
        inside = distance[np.isfinite(distance)]
        nearest = minimum(self.comm, float(inside.min(initial=np.inf)))
        farthest = maximum(self.comm, float(inside.max(initial=-np.inf)))
        return 0.5 * (nearest + farthest)

    def _projected(self, boundary: Traction, particles: np.ndarray) -> np.ndarray:
        """Places of particles moved onto the face, where its traction is evaluated."""
        positions = self.particle_set.position[particles].copy()
        positions[:, boundary.plane.axis] = boundary.plane.offset
        return positions

    # --- in time ---------------------------------------------------------------------------------------------

    @property
    def acting(self) -> bool:
        """Whether there is any load on any rank."""
        return self._constant is not None or bool(self._loads)

    def external(self, time: float, before: bool = False) -> np.ndarray:
        """Forces (owned, d) [N] of all loads at a time [s], of a jump just after, or just before it; not to be changed."""
        if self._constant is None:
            self._constant = np.zeros(self.free.shape)
            self._add([load for load in self._loads if not load.formulas.depends_on_time], self._constant, 0.0, False)
            self._loads = [load for load in self._loads if load.formulas.depends_on_time]
        if not self._loads:
            return self._constant
        result = self._constant.copy()
        self._add(self._loads, result, time, before)
        return result

    @staticmethod
    def _add(loads: list[Load], result: np.ndarray, time: float, before: bool) -> None:
        for load in loads:
            result[load.particles] += load.scale[:, None] * load.formulas.evaluate(load.positions, time, before)

    def move(self, time: float, step: float, displacement: np.ndarray) -> None:
        """Bring guided components of a displacement (owned, d) [m] from a time [s] to the end of a step [s].

        A step ends before a jump of that time, one of length 0 after it.
        """
        for one in self.guided:
            place = (one.particles, one.component)
            if one.velocity is not None:
                # Simpson's rule
                first, middle, last = (
                    one.velocity.evaluate(one.positions, time + part * step) for part in (0.0, 0.5, 1.0)
                )
                displacement[place] += step / 6.0 * (first + 4.0 * middle + last)
            else:
                displacement[place] = one.course.evaluate(one.positions, time + step, step > 0.0)[:, 0]

    def guided_velocities(self, time: float, step: float, change: np.ndarray) -> np.ndarray:
        """Velocities (k,) [m/s] of everything in `entries` at the end of a step [s] of these changes (k,) [m] of displacement."""
        result, first = change / step if step > 0.0 else np.zeros_like(change), 0
        for one in self.guided:
            last = first + len(one.particles)
            if one.velocity is not None:
                result[first:last] = one.velocity.evaluate(one.positions, time + step)
            first = last
        return result
