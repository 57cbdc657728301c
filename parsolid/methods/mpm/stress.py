"""Deformation, state and stress of material points after a step, by the kind of their law.

Kernels work on tiles of 32 particles (`parsolid.tiles`), general tensors with nine components.
"""

from functools import partial
from typing import Any

import numpy as np

from parsolid.boundary.loads import Loads
from parsolid.kernels import inlined, kernel
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.hyperelastic.functions import energy, pressure_waves, stress
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods.failed_matter import declare_failure
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.mpm.plastic_stress import SYMMETRIC_ROWS, TENSOR_ROWS, BulkViscosity, PlasticState, advance_stress
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.mpm.settings import PLASTIC_STATE
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene, initial_plastic_strain, initial_temperature, initial_zero_energy_temperature
from parsolid.scene.boundaries.thermal import PrescribedTemperature
from parsolid.tensors import (
    cofactor,
    combine,
    congruence,
    determinant,
    largest_eigenvalue_bound,
    matmul,
    matmul_transposed,
)
from parsolid.tiles import TILE, load, load_placed, store, store_placed

# fields of the container in the order of PlasticState
_STATE = (
    *("deformation_gradient", "unrotated_deviator", "plastic_strain", "internal_energy", "temperature"),
    *("damage", "criterion_damage", "strength_factor", "deleted_mass"),
)


@inlined
def load_gradient(deformation, p):
    """F of particle p, nine numbers, from 5 rows (11, 12, 21, 22, 33) in two dimensions or 9 in three."""
    if len(deformation) == 9:
        F = (deformation[0, p], deformation[1, p], deformation[2, p], deformation[3, p], deformation[4, p],
             deformation[5, p], deformation[6, p], deformation[7, p], deformation[8, p])  # fmt: skip
    else:
        F = (deformation[0, p], deformation[1, p], 0.0, deformation[2, p], deformation[3, p], 0.0,
             0.0, 0.0, deformation[4, p])  # fmt: skip
    return F


@kernel
def hyperelastic_tile(law, step, F, rates, tau, speed):
    """F after a step [s] with velocity gradients `rates` [1/s], Kirchhoff stress tau = P F^T [Pa], nine components, and
    speed of pressure waves in the present configuration [m/s]."""
    for p in range(TILE):
        new = load(F, p)
        new = combine(1.0, new, step, matmul(load(rates, p), new))
        store(F, p, new)
        H, J = cofactor(new), determinant(new)
        store(tau, p, matmul_transposed(stress(law, new, H, J), new))
        # a wave with normal n has rho0 c^2 = N.Q N with N = F^T n of the reference configuration
        waves = congruence(new, pressure_waves(law, new, H, J))
        speed[p] = (largest_eigenvalue_bound(waves) / law.density) ** 0.5


@kernel
def advance_hyperelastic(law, first, last, step, components, deformation, motion, rate, stress):
    """Advance F of particles first..last-1 by a step [s] with velocity gradients `rate`, and write V sigma and c + |v|.

    components: of nine, that rows of deformation are; motion, rate, stress: see `transfer`. Returns (sound, largest
    c + |v| [m/s]); sound is False when a Jacobian is not positive.
    """
    F, rates, tau, speed = np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(TILE)
    F[:TILE] = F[4 * TILE : 5 * TILE] = F[8 * TILE :] = 1.0
    sound, fastest = True, 0.0
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_placed(deformation, components, i, count, F, 0)
        for p in range(count):
            for a in range(3):
                for b in range(3):
                    rates[(3 * a + b) * TILE + p] = rate[np.uintp(i + p), 4 * a + b]
        hyperelastic_tile(law, step, F, rates, tau, speed)
        store_placed(deformation, components, i, count, F, 0)
        for p in range(count):
            q = np.uintp(i + p)
            V = motion[q, 7]
            t = load(tau, p)
            stress[q, 0], stress[q, 1], stress[q, 2], stress[q, 3] = V * t[0], V * t[4], V * t[8], 0.0
            stress[q, 4], stress[q, 5] = 0.5 * V * (t[5] + t[7]), 0.5 * V * (t[2] + t[6])
            stress[q, 6] = 0.5 * V * (t[1] + t[3])
            total = speed[p] + (motion[q, 4] ** 2 + motion[q, 5] ** 2 + motion[q, 6] ** 2) ** 0.5
            stress[q, 7] = total
            fastest = max(fastest, total)
            # not so for numbers that are none
            if not (determinant(load(F, p)) > 0.0 and total > 0.0):
                sound = False
    return sound, fastest


@kernel
def elastic_energy(law, first, last, deformation, motion):
    """Sum of W V0 [J] of particles first..last-1."""
    total = 0.0
    for p in range(first, last):
        F = load_gradient(deformation, p)
        total += energy(law, F, cofactor(F), determinant(F)) * motion[p, 7]
    return total


class HyperelasticUpdate:
    """Laws whose stress follows from F alone."""

    def __init__(self, scene: Scene, points: MaterialPoints, loads: Loads):
        self.points = points

    def centre_viscosity(self) -> None:
        """There is none."""

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """There is no state but F."""

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        """Sound, largest c + |v| [m/s] and terms of the ledger [J] of one law's particles after a step [s]."""
        points, storage = self.points, self.points.storage
        arrays = (
            storage("deformation_gradient"),
            points.motion,
            storage("velocity_gradient"),
            storage("stress_and_volume"),
        )
        here = block.law, block.first, block.last, step, TENSOR_ROWS[points.dimension]
        sound, fastest = advance_hyperelastic(*here, *arrays)
        return sound, fastest, {}

    def stored_energy(self, block: MaterialBlock) -> float:
        """W V0 [J] of one law's particles."""
        F, motion = self.points.storage("deformation_gradient"), self.points.motion
        return float(elastic_energy(block.law, block.first, block.last, F, motion))


class ElasticPlasticUpdate:
    """Laws with an equation of state, plastic flow and heat."""

    def __init__(self, scene: Scene, points: MaterialPoints, loads: Loads):
        self.points, viscosity = points, scene.method.viscosity
        self.viscosity = BulkViscosity(float(viscosity.linear), float(viscosity.quadratic), float(scene.method.cell))
        kept = partial(Field, checkpointed=True, layout=Columns())
        points.declare(kept("unrotated_deviator", SYMMETRIC_ROWS[points.dimension], "Pa"))
        for field in PLASTIC_STATE:
            points.declare(field)
        # planes at a temperature take up the plastic heat of the particles beside them, see `heat.Conduction`
        if scene.method.conduction and loads.of(PrescribedTemperature):
            points.declare(kept("plastic_rise", 1, "K"))
        declare_failure(points, points.laws)

    def centre_viscosity(self) -> None:
        """See `StressUpdate.centre_viscosity`."""
        self.viscosity = self.viscosity._replace(centred=True)

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Temperatures of the bodies' formulas and the internal energy that belongs to them."""
        points, rows = self.points, self.points.owned_rows
        laws = [points.laws[number] for number in points.law_of_body]
        usual = np.array([getattr(law, "reference_temperature", 0.0) for law in laws])
        rows("temperature")[:] = initial_temperature(
            scene, particle_set.body, particle_set.position, usual, particle_set.regions
        )
        place = (scene, particle_set.body, particle_set.position, particle_set.regions)
        rows("plastic_strain")[:] = initial_plastic_strain(*place)
        for block in points.warm_blocks:
            here = slice(block.first, block.last)
            warm, reference = rows("temperature")[here], block.law.reference_temperature
            cold = initial_zero_energy_temperature(scene, rows("body")[here], warm, reference)
            rows("internal_energy")[here] = block.law.internal_energy(warm, cold)

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        """See `HyperelasticUpdate.advance`."""
        points, storage = self.points, self.points.storage
        state = PlasticState(*map(points.find, _STATE))  # type: ignore[arg-type]
        here = points.dimension, block.first, block.last, block.law
        arrays = points.motion, storage("velocity_gradient"), storage("stress_and_volume"), points.find("plastic_rise")
        sound, fastest, plastic, viscous, released = advance_stress(*here, step, self.viscosity, state, *arrays)
        terms = {"plastic_work": plastic, "viscous_work": viscous}
        return sound, fastest, terms if block.law.failure is None else terms | {FAILURE_DISSIPATION: released}

    def stored_energy(self, block: MaterialBlock) -> float:
        """E V0 [J] of one law's particles."""
        here = slice(block.first, block.last)
        return float(self.points["internal_energy"][here] @ self.points.motion[here, 7])


class StressUpdate:
    """The updates of all laws of a scene, on one rank.

    fastest [m/s]: largest c + |v| of this rank's particles; plastic_work [J]: of all steps.
    """

    def __init__(self, scene: Scene, points: MaterialPoints, loads: Loads):
        """Declares the fields of the laws."""
        self.points, self.fastest, self.plastic_work = points, 0.0, 0.0
        self._kinds = [
            ElasticPlasticUpdate if isinstance(law, ElasticPlastic) else HyperelasticUpdate for law in points.laws
        ]
        self.updates: dict[Any, Any] = {kind: kind(scene, points, loads) for kind in dict.fromkeys(self._kinds)}

    def _of(self, block: MaterialBlock) -> Any:
        return self.updates[self._kinds[self.points.laws.index(block.law)]]

    def centre_viscosity(self) -> None:
        """Let heat of the viscosity be what its forces do where external forces act, see `external_forces`."""
        for update in self.updates.values():
            update.centre_viscosity()

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """The state of all materials at time 0."""
        for update in self.updates.values():
            update.begin(scene, particle_set)

    def advance(self, step: float) -> tuple[bool, dict[str, float]]:
        """All particles' state and stress after a step [s] with the velocity gradients that they have.

        Returns whether all are sound, and what this rank's laws tell the ledger [J].
        """
        sound, self.fastest, terms = True, 0.0, {"plastic_work": 0.0, "viscous_work": 0.0}
        for block in self.points.blocks:
            good, speed, more = self._of(block).advance(block, step)
            sound, self.fastest = sound and good, max(self.fastest, speed)
            for name, found in more.items():
                terms[name] = terms.get(name, 0.0) + found
        self.plastic_work += terms["plastic_work"]
        return sound, terms

    def stored_energy(self) -> float:
        """Internal energy [J] of this rank's particles."""
        return sum((self._of(block).stored_energy(block) for block in self.points.blocks), 0.0)
