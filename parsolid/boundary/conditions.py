"""All boundary conditions and loads of a scene on one rank's particles."""

from dataclasses import dataclass, field

import numpy as np

from parsolid.boundary.mirror_planes import ON_PLANE, MirrorCodes, MirrorPlane, check_sides
from parsolid.collective import anywhere, minimum, raise_together
from parsolid.methods.tlsph import momentum as motion
from parsolid.scene.boundaries import Support
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.regions import selected


@dataclass
class Prescribed:
    """Velocity components that follow formulas: entries (k,) of particles and components, all with one formula."""

    particles: np.ndarray
    component: int
    positions: np.ndarray
    formula: object


@dataclass
class Load:
    """An acceleration scale * formula(X, t) of some particles [m/s^2]; constant in time where the formula is."""

    particles: np.ndarray
    positions: np.ndarray
    scale: np.ndarray
    formulas: object
    component: int | None = None


@dataclass
class BoundarySet:
    """What the momentum equation needs of a scene's boundaries and loads; arrays are of this rank's owned particles."""

    planes: list[MirrorPlane]
    codes: MirrorCodes | None
    clamp: np.ndarray | None
    prescribed: list[Prescribed] = field(default_factory=list)
    constant_load: np.ndarray | None = None
    changing_loads: list[Load] = field(default_factory=list)
    entries: tuple | None = None
    held_energy: float = 0.0

    def plane_count(self, particle_set) -> np.ndarray:
        """On how many mirror planes each particle lies (n,)."""
        return plane_count(self.planes, particle_set)

    def loads_at(self, time: float) -> np.ndarray | None:
        """Accelerations (n, 4) of body forces and tractions [m/s^2]; None without loads."""
        if not self.changing_loads:
            return self.constant_load
        result = self.constant_load.copy()
        for load in self.changing_loads:
            _add_load(result, load, time)
        return result

    def prescribe(self, time: float, kinematics: np.ndarray) -> None:
        """Set prescribed velocity components to their values at a time [s]."""
        if not self.prescribed:
            return
        values = [entry.formula.evaluate(entry.positions, time) for entry in self.prescribed]
        particles, components = self.entries
        motion.prescribe(particles, components, np.concatenate(values), kinematics)

    def prescribed_power(self, kinematics, force, mass, share, loads) -> float:
        """Power [W] against pair forces and loads; see `momentum.prescribed_power`."""
        if not self.prescribed:
            return 0.0
        return motion.prescribed_power(*self.entries, kinematics, force, mass, share, loads)

    def prescribed_energy_gain(self, kinematics, mass, share) -> float:
        """Kinetic energy [J] that prescribed components gained since the last call."""
        if not self.prescribed:
            return 0.0
        particles, components = self.entries
        energy = float(np.sum(0.5 * mass[particles] * share[particles] * kinematics[particles, components] ** 2))
        gain, self.held_energy = energy - self.held_energy, energy
        return gain


def _add_load(result: np.ndarray, load: Load, time: float) -> None:
    values = load.formulas.evaluate(load.positions, time)
    result[load.particles, : values.shape[1]] += load.scale[:, None] * values


def build_boundaries(comm, scene, particle_set, density: np.ndarray) -> BoundarySet:
    """Boundaries and loads of a scene for this rank's particle_set; density (n,) [kg/m^3]; collective.

    Raises SolverError on all ranks when a region holds no particle or a mirror plane cuts a body.
    """
    planes, held = supports_of(comm, scene, particle_set)
    prescribed, loads = [], []
    for index, boundary in enumerate(scene.boundaries):
        if isinstance(boundary, Support):
            continue
        chosen = selected(scene, boundary, particle_set, comm)
        need_particles(comm, chosen, f"boundaries.{index}")
        if boundary.kind == "velocity":
            prescribed += _prescribed(boundary, chosen, particle_set)
        else:
            loads.append(_traction(boundary, chosen, particle_set, density))
    loads += _body_loads(scene, particle_set, density)
    result = BoundarySet(planes, mirror_codes(comm, planes, particle_set), _clamp(comm, held), prescribed)
    _install_loads(result, loads, len(particle_set.position))
    if prescribed:
        last_one_holds(prescribed)
        components = [np.full(len(entry.particles), entry.component) for entry in prescribed]
        result.entries = (np.concatenate([entry.particles for entry in prescribed]), np.concatenate(components))
    return result


def supports_of(comm, scene, particle_set) -> tuple[list[MirrorPlane], np.ndarray]:
    """Mirror planes of a scene, and which components (n, d) of this rank's particles supports hold at rest; collective.

    Raises SolverError on all ranks when a mirror plane cuts a body.
    """
    dimension = particle_set.position.shape[1]
    names = {body.name: index for index, body in enumerate(scene.bodies) if body.name is not None}
    planes, held = [], np.zeros((len(particle_set.position), dimension), bool)
    for index, boundary in enumerate(scene.boundaries):
        if not isinstance(boundary, Support):
            continue
        chosen = selected(scene, boundary, particle_set, comm)
        plane = MirrorPlane(boundary.plane.axis, boundary.plane.offset, boundary.kind, names.get(boundary.body))
        if boundary.mirror:
            check_sides(comm, plane, particle_set, f"boundaries.{index}")
            planes.append(plane)
            # cell-centred particles beside the plane move; their images hold them
            chosen &= plane.contains(particle_set)
        held |= chosen[:, None] & plane.held(dimension)
    return planes, held


def mirror_codes(comm, planes: list[MirrorPlane], particle_set) -> MirrorCodes | None:
    """Every reflection that mirror planes need, None without planes; collective."""
    return MirrorCodes.of(planes, ON_PLANE * minimum(comm, float(particle_set.spacing.min(initial=np.inf))))


def plane_count(planes: list[MirrorPlane], particle_set) -> np.ndarray:
    """On how many mirror planes each particle lies (n,)."""
    count = np.zeros(len(particle_set.position))
    for plane in planes:
        count += plane.contains(particle_set)
    return count


def need_particles(comm, chosen: np.ndarray, key: str) -> None:
    fault = None
    if comm.allreduce(int(chosen.sum())) == 0:
        fault = f"{key}: expected at least one particle in the region, found none"
    raise_together(comm, fault)


def _prescribed(boundary, chosen, particle_set) -> list[Prescribed]:
    particles = np.flatnonzero(chosen)
    return [
        Prescribed(particles, i, particle_set.position[particles], formula)
        for i, formula in enumerate(boundary.velocity)
        if formula is not None
    ]


def last_one_holds(prescribed: list) -> None:
    """Leave every particle's component to the last entry that prescribes it, so that its work is counted once."""
    taken = {}
    for entry in reversed(prescribed):
        earlier = taken.get(entry.component, np.zeros(0, np.int64))
        keep = ~np.isin(entry.particles, earlier)
        taken[entry.component] = np.concatenate((earlier, entry.particles))
        entry.particles, entry.positions = entry.particles[keep], entry.positions[keep]


def _traction(boundary, chosen, particle_set, density) -> Load:
    """Traction [Pa] times tributary area over tributary mass."""
    particles = np.flatnonzero(chosen)
    area = np.abs(particle_set.area[particles, boundary.plane.axis])
    scale = area / (density[particles] * particle_set.volume[particles])
    return Load(particles, particle_set.position[particles], scale, boundary.course)


def _body_loads(scene, particle_set, density) -> list[Load]:
    everything = np.arange(len(particle_set.position))
    loads = []
    if scene.loads.body_force is not None:
        loads.append(
            Load(everything, particle_set.position, 1.0 / density, LoadHistory(scene.loads.body_force, scene.loads))
        )
    if scene.loads.acceleration is not None:
        loads.append(
            Load(
                everything,
                particle_set.position,
                np.ones(len(everything)),
                LoadHistory(scene.loads.acceleration, scene.loads),
            )
        )
    return loads


def _install_loads(result: BoundarySet, loads: list[Load], owned: int) -> None:
    if not loads:
        return
    result.constant_load = np.zeros((owned, 4))
    for load in loads:
        if load.formulas.depends_on_time:
            result.changing_loads.append(load)
        else:
            _add_load(result.constant_load, load, 0.0)


def _clamp(comm, held: np.ndarray) -> np.ndarray | None:
    """Multipliers (n, 4) of velocity components; None when no rank holds any."""
    if not anywhere(comm, held.any()):
        return None
    clamp = np.ones((len(held), 4))
    clamp[:, : held.shape[1]][held] = 0.0
    return clamp
