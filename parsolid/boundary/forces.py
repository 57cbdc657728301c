"""Loads on particles: body forces, tractions, pressure that follows the surface, springs and dashpots.

A load gives forces [N] on the parts of particles on this side of mirror planes. A new kind of load is a class of its
keys in `scene/boundaries.py` and a class here, entered with `@load_of`; all methods then apply it, account for its work
and report its force.
"""

from collections.abc import Callable
from typing import Any, TypeVar

import numpy as np

from parsolid.boundary.kernels import deformed_areas, spring_forces
from parsolid.boundary.surface import Surface
from parsolid.materials.registry import laws_of
from parsolid.particles.container import Particles, Selection
from parsolid.scene.boundaries import Condition, Pressure, Spring, Traction
from parsolid.scene.load_histories import LoadHistory, SpaceTimeFunction
from parsolid.scene.schema import Scene

# rows of some particles, or all of them
Rows = np.ndarray | slice
# of the largest stable step of a spring or dashpot alone
_SAFETY = 0.8


class Load:
    """Forces on some particles of a rank.

    constant: whether they depend on the reference configuration alone; on_surface: whether they are those on a surface;
    times [s]: at which they jump.
    """

    constant, on_surface = False, True
    times: tuple[float, ...] = ()

    def __init__(self, particles: Particles):
        self.particles, self._layout = particles, -1

    @property
    def largest_step(self) -> float:
        """The largest stable step [s] of its particles under this load alone; infinite but for springs and dashpots."""
        return np.inf

    def forces(self, time: float, before_jump: bool) -> tuple[Rows, np.ndarray]:
        """Rows and forces (d, k) [N] at a time [s]; at a jump those before it, or after it."""
        raise NotImplementedError

    def keep_deformation(self) -> None:
        """Use the present deformation for the forces that are asked for next."""

    def masses_changed(self) -> None:
        """Find what follows from the particles anew at the next call, after some were deleted."""
        self._layout = -1

    def _follow_layout(self) -> None:
        """Find what follows from the particles anew after these have changed their rows."""
        if self._layout != self.particles.layout:
            self._layout = self.particles.layout
            self._find_rows()

    def _find_rows(self) -> None:
        """Find rows, and what follows from the particles in them."""
        raise NotImplementedError


class DistributedLoad(Load):
    """scale(rows) * function(X, t): a load that depends on reference positions and time alone."""

    def __init__(
        self,
        particles: Particles,
        selection: Selection | None,
        scale: Callable[[Rows], np.ndarray],
        function: SpaceTimeFunction,
        plane: Any = None,
    ):
        """selection: the particles, None for all; scale(rows) (k,): from fields that travel with the particles; plane:
        where the function is evaluated, at the particles' own places unless given."""
        super().__init__(particles)
        self.selection, self.scale, self.plane = selection, scale, plane
        self.on_surface = selection is not None
        self.function, self.constant = function, not function.depends_on_time
        self.times, self._two_sided = tuple(function.jump_times), function.two_sided_times
        # forces found last, and for what time
        self._forces, self._found_at = np.zeros((0, 0)), (np.nan, False)

    def forces(self, time: float, before_jump: bool) -> tuple[Rows, np.ndarray]:
        """See `Load`; found once for each time, and void when another one is asked for."""
        self._follow_layout()
        moment = 0.0 if self.constant else time, before_jump and time in self._two_sided
        if moment != self._found_at:
            with np.errstate(all="ignore"):
                values = self._values(*moment)
            if self._forces.shape != (len(values), len(self._scale)):
                self._forces = np.empty((len(values), len(self._scale)))
            for of_component, one in zip(self._forces, values):
                np.multiply(self._scale, one, out=of_component)
            self._found_at = moment
        return self._rows, self._forces

    def _find_rows(self) -> None:
        self._rows: Rows = slice(None) if self.selection is None else self.selection.rows
        self._scale = self.scale(self._rows)
        places = np.array(self.particles.owned_rows("reference_position")[self._rows], order="C")
        if self.plane is not None:
            places[:, self.plane.axis] = self.plane.offset
        self._values = self.function.at(places)
        self._found_at = np.nan, False


class ManufacturedBodyForce(SpaceTimeFunction):
    """The acceleration [m/s^2] under which an exact solution holds."""

    def __init__(self, scene: Scene):
        # the import takes half a second, which a run without it is spared
        from parsolid.exact import SOLUTIONS

        assert scene.reference is not None and scene.reference.exact is not None
        solutions: dict[str, Any] = SOLUTIONS
        self.solution = solutions[scene.reference.exact].of_scene(scene)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """(k, d) at reference positions (k, d) [m] and a time [s]."""
        return np.asarray(self.solution.body_force(points, time))


def tributary_mass(particles: Particles, rows: Rows) -> np.ndarray:
    """Mass (k,) [kg] of particles on this side of mirror planes."""
    mass = particles.owned_rows("mass")[rows]
    return np.asarray(mass * particles.owned_rows("share")[rows] if "share" in particles else mass)


def body_loads(scene: Scene, particles: Particles) -> list[Load]:
    """Loads of a scene on all bodies: force per reference volume, acceleration, that of an exact solution."""
    density = np.array([law.density for law in laws_of(scene)])
    loads, result = scene.loads, list[Load]()

    def volume(rows: Rows) -> np.ndarray:
        return np.asarray(tributary_mass(particles, rows) / density[particles.owned_rows("body")[rows]])

    def mass(rows: Rows) -> np.ndarray:
        return tributary_mass(particles, rows) / scene.method.inertia_factor

    if loads.body_force is not None:
        result.append(DistributedLoad(particles, None, volume, LoadHistory(loads.body_force, loads)))
    if loads.acceleration is not None:
        result.append(DistributedLoad(particles, None, mass, LoadHistory(loads.acceleration, loads)))
    if loads.manufactured:
        result.append(DistributedLoad(particles, None, mass, ManufacturedBodyForce(scene)))
    return result


# the class of the load that a condition means
_LOADS: dict[type[Condition], Callable[[Any, Surface], Load]] = {}
_Class = TypeVar("_Class", bound=Callable[..., Any])


def load_of(condition: type[Condition]) -> Callable[[_Class], _Class]:
    """Enter the load, made of (condition, surface), that conditions of a type mean."""

    def enter(load: _Class) -> _Class:
        _LOADS[condition] = load
        return load

    return enter


def surface_load(condition: Condition) -> Callable[[Any, Surface], Load] | None:
    """The class of the load of a condition, None where it means none."""
    return next((_LOADS[kind] for kind in type(condition).__mro__ if kind in _LOADS), None)


@load_of(Traction)
class TractionLoad(DistributedLoad):
    """A traction per reference area."""

    def __init__(self, condition: Traction, surface: Surface):
        super().__init__(surface.particles, surface.selection, surface.areas, condition.prescribed)


@load_of(Pressure)
class PressureLoad(Load):
    """A pressure on the deformed surface: -p cof(F) dA."""

    def __init__(self, condition: Pressure, surface: Surface):
        super().__init__(surface.particles)
        self.pressure, self.surface = condition.prescribed, surface
        self.times = tuple(self.pressure.jump_times)
        self._area: np.ndarray | None = None

    def keep_deformation(self) -> None:
        self._area = self._deformed_areas()

    def forces(self, time: float, before_jump: bool) -> tuple[Rows, np.ndarray]:
        """See `Load`; by the present deformation gradients, or those of the last `keep_deformation`."""
        area = self._deformed_areas() if self._area is None else self._area
        with np.errstate(all="ignore"):
            (pressure,) = self._pressure(time, before_jump)
        return self._rows, -pressure * area

    def _deformed_areas(self) -> np.ndarray:
        """cof(F) dA (d, k) [m^2]."""
        self._follow_layout()
        areas = np.empty(self._vectors.T.shape)
        deformed_areas(self._rows, self.particles.owned_rows("deformation_gradient").T, self._vectors, areas)
        return areas

    def _find_rows(self) -> None:
        self._rows = self.surface.selection.rows
        places = np.ascontiguousarray(self.particles.owned_rows("reference_position")[self._rows])
        self._pressure, self._vectors = self.pressure.at(places), self.surface.vectors(self._rows)


@load_of(Spring)
class SpringLoad(Load):
    """Springs and dashpots from the surface to rest: -k u - c v per reference area, or the part along its normal."""

    def __init__(self, condition: Spring, surface: Surface):
        super().__init__(surface.particles)
        self.stiffness, self.damping = float(condition.stiffness), float(condition.damping)
        self.along_normal = condition.along == "normal"
        self.surface = surface

    def forces(self, time: float, before_jump: bool) -> tuple[Rows, np.ndarray]:
        """See `Load`; by the present positions and velocities, void when others are asked for."""
        self._follow_layout()
        of = self.particles.owned_rows
        state = of("position").T, self._start, of("velocity").T
        spring_forces(self._rows, self.stiffness, self.damping, self._areas, self._normals, *state, self._forces)
        return self._rows, self._forces

    @property
    def largest_step(self) -> float:
        """Largest stable step [s] of the particles' mass on springs and dashpots alone."""
        self._follow_layout()
        return self._largest_step

    def _find_rows(self) -> None:
        self._rows = self.surface.selection.rows
        self._areas = self.surface.areas(self._rows)
        self._normals = self.surface.normals(self._rows) if self.along_normal else None
        self._start = np.array(self.particles.owned_rows("reference_position")[self._rows].T, order="C")
        self._forces = np.empty(self._start.shape)
        per_mass = self._areas / tributary_mass(self.particles, self._rows)
        rate = np.sqrt(self.stiffness * per_mass) + self.damping * per_mass
        self._largest_step = float(_SAFETY * 1.7 / rate.max(initial=1e-300))
