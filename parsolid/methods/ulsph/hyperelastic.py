"""Hyperelastic solids in updated-Lagrangian SPH: particles carry the deformation gradient of their whole motion.

With L of the middle of a step, F <- (1 - L dt/2)^-1 (1 + L dt/2) F: second order, and a rotation where L is a spin, so
that the stress is objective. The Cauchy stress is that of the law at F, and the density rho0/det F, so that the power
of pair forces is the rate of the stored energy.
"""

from typing import Any

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.declaration import SOFTENING
from parsolid.materials.plastic.tile_update import DEVIATOR
from parsolid.methods.hyperelastic_particles import (
    DEFORMATION,
    HyperelasticParticles,
    deformation_at_start,
    hyperelastic_tile,
    load_particles,
    store_particles,
)
from parsolid.methods.ulsph.kinematics import (
    CARRIED,
    CORRECTION,
    GRADIENT,
    LAST,
    ROWS,
    carry_on_correction,
    find_gradients,
    load_rates,
    store_pair_stress,
)
from parsolid.particles.container import Particles
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene
from parsolid.tensors import IDENTITY, combine, determinant, inverse, matmul
from parsolid.tiles import TILE, load, load_rows, store, store_rows

# name of the field, see `state`
PRESSURE = "elastic_pressure"
# row of the pressure in a tile, behind the deviator
_PRESSURE = DEVIATOR + 6


@inlined
def rates_of_start(step, kinematics, rates):
    """(1 - L dt/2)^-1 L [1/s], by which F grows over a step [s] as `hyperelastic_tile` takes it."""
    for p in range(TILE):
        L = load(kinematics, GRADIENT * TILE + p)
        store(rates, p, matmul(inverse(combine(1.0, IDENTITY, -0.5 * step, L)), L))


@inlined
def cauchy_stress(F, tau, density, first, count, reference, stress):
    """Deviator and pressure [Pa] of the Kirchhoff stress of a tile into `stress`, rho0/J into densities."""
    for p in range(TILE):
        J = determinant(load(F, p))
        t, r = load(tau, p), 1.0 / J
        pressure = -(t[0] + t[4] + t[8]) * r / 3.0
        S = (r * t[0] + pressure, r * t[4] + pressure, r * t[8] + pressure,
             0.5 * r * (t[1] + t[3]), 0.5 * r * (t[2] + t[6]), 0.5 * r * (t[5] + t[7]))  # fmt: skip
        for c in range(6):
            stress[(DEVIATOR + c) * TILE + p] = S[c]
        stress[_PRESSURE * TILE + p] = pressure
        if p < count:
            density[0, first + p] = reference * r


@kernel
def advance_state(
    first, last, law, step, mean_step, most, centred, in_plane, rates, fields, components, deformation, field, tile,
    lost, branches,
):  # fmt: skip
    """State of particles first..last-1 after a step [s] from the sums of the first sweep; arguments as in
    `elastic_plastic.advance_state`. fields: mass, density, correction, deviator, pressure, pair_stress, sound_speed;
    components .. branches: see `HyperelasticParticles.carried`. Returns (sound, what state variables and what branches
    dissipate [J]).
    """
    mass, density, correction, deviator, pressure, pair_stress, sound_speed = fields
    kinematics, stress = np.zeros(ROWS * TILE), np.zeros((_PRESSURE + 1) * TILE)
    F, growth, tau, speed = np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(TILE)
    F[:TILE] = F[4 * TILE : 5 * TILE] = F[8 * TILE :] = 1.0
    sound, softened, relaxed_away = True, 0.0, 0.0
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_rates(rates, mass, density, in_plane, None, i, count, kinematics)
        load_rows(correction, i, count, kinematics, LAST)
        load_particles(components, deformation, field, tile, branches, i, count, F)
        find_gradients(step, most, in_plane, kinematics)
        carry_on_correction(0.5 * step if centred is not None else 0.0, mean_step, kinematics)
        rates_of_start(step, kinematics, growth)
        hyperelastic_tile(law, step, F, growth, tau, speed, tile, lost, branches)
        cauchy_stress(F, tau, density, i, count, law.density, stress)
        store_particles(components, deformation, field, tile, branches, i, count, F)
        store_rows(deviator, i, count, stress, DEVIATOR)
        store_rows(pressure, i, count, stress, _PRESSURE)
        store_rows(sound_speed, i, count, speed, 0)
        store_rows(correction, i, count, kinematics, CORRECTION)
        store_pair_stress(stress, _PRESSURE, kinematics, CARRIED, density, in_plane, i, count, pair_stress)
        for p in range(count):
            V = mass[0, i + p] / law.density
            if branches is not None:
                relaxed_away += branches.lost[p] * V
            if field is not None:
                softened += lost[p] * V
            # False for NaN
            sound = sound and density[0, i + p] > 0.0 and speed[p] > 0.0
    return sound, softened, relaxed_away


class HyperelasticSolid:
    """Particles of one law on a rank; see `elastic_plastic.ElasticPlasticSolid`.

    softened [J]: energy that state variables have dissipated since `take_energies`.
    """

    stores_heat, speeds_change = False, True
    flows: frozenset[str] = frozenset()
    fields = frozenset({PRESSURE})

    def __init__(self, law: Any) -> None:
        self.law, self.softened = law, 0.0

    def join(self, particles: Particles, dimension: int, laws_of_bodies: list[Any]) -> None:
        """Take particles whose fields are declared."""
        self.solid = HyperelasticParticles(self.law, particles, dimension, laws_of_bodies)

    def begin(self, scene: Scene, particles: Particles, here: slice, particle_set: ParticleSet) -> None:
        """F, and the density that belongs to it, at time 0."""
        d = scene.dimension
        spacing = np.prod(particle_set.spacing, axis=1) ** (1.0 / d)
        F = deformation_at_start(scene, particle_set, spacing)[here]
        particles.owned_rows(DEFORMATION)[here, : d * d] = F.reshape(-1, d * d)
        particles.owned_rows("density")[here] = self.law.density / np.linalg.det(F)

    def advance(self, system: Any, here: slice, step: float) -> tuple[bool, float, float]:
        """The state after a step [s]: whether it is sound, energy that branches dissipate, numerical loss [J], 0."""
        names = ("mass", "density", "correction", "deviator", PRESSURE, "pair_stress", "sound_speed")
        fields = tuple(system.particles.storage(name) for name in names)
        how = step, system.kicks.viscous_heat.mean_step(step), system.most_correction, system.centred, system.in_plane
        sound, softened, relaxed_away = advance_state(
            here.start, here.stop, self.law, *how, system.neighbours.rates, fields, *self.solid.carried(step)
        )
        # energy that the strain at the start has dissipated is no loss of the run
        self.softened += softened if step > 0.0 else 0.0
        return sound, relaxed_away, 0.0

    def advance_fluxes(self, system: Any, here: slice, step: float) -> float:
        """0: there are no fluxes."""
        return 0.0

    def energies(self, particles: Particles, here: slice) -> tuple[float, float]:
        """Kinetic energy besides that of the velocity, 0, and W V0 [J]."""
        volume = particles.storage("mass")[0] / self.law.density
        return 0.0, self.solid.stored_energy(here.start, here.stop, volume)

    def stable_step(self, particles: Particles, here: slice) -> float:
        """Infinite: waves alone bound the step."""
        return float(np.inf)

    def pressures(self, particles: Particles, here: slice) -> np.ndarray:
        """p (n,) [Pa]."""
        return np.asarray(particles.owned_rows(PRESSURE)[here])

    def room(self, particles: Particles, here: slice) -> None:
        """The law holds at every density."""

    @property
    def sound_speed(self) -> float:
        """c_L [m/s] of the undeformed solid."""
        return float(np.sqrt(self.solid.wave_modulus() / self.law.density))

    def take_energies(self) -> dict[str, float]:
        """Energy that state variables have dissipated since the last call [J]."""
        result = {SOFTENING: self.softened} if self.solid.softens else {}
        self.softened = 0.0
        return result
