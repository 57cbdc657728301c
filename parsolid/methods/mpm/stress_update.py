"""Deformation, state and stress of the particles after a step: every law's by the update of its kind.

A kind of law is a class with what `HyperelasticUpdate` has, and a line of `_KINDS`; a law of a known kind needs nothing
here.
"""

import functools
from typing import Any, cast

import numpy as np

from decomposition.recalled import RecalledEach
from parsolid.boundary.declarations import Declarations, Declared, TemperaturePlane
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods.failed_matter import declare_failure
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.mpm.grid import CauchyStress
from parsolid.methods.mpm.hyperelastic_update import advance_elastic_stress, elastic_energy
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.plastic_state import PLASTIC_STATE
from parsolid.methods.mpm.plastic_update import (
    DEVIATOR_ROWS,
    BulkViscosity,
    CentredViscosity,
    MaterialState,
    advance_stress,
    note_plastic_rise,
)
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene, initial_plastic_strain, initial_temperature, initial_zero_energy_temperature

# fields of the container in the order of MaterialState
_STATE = (
    *("deformation_gradient", "unrotated_deviator", "plastic_strain", "internal_energy", "temperature"),
    *("damage", "criterion_damage", "strength_factor", "deleted_mass"),
)


class HyperelasticUpdate:
    """The kind of laws whose stress follows from F alone."""

    def __init__(self, scene: Scene, points: MaterialPoints):
        self.points = points
        # rows of a block and the step are other numbers at every step
        self._advance = RecalledEach(advance_elastic_stress, free=(1, 2, 4))

    def centre(self) -> None:
        """There is no viscosity."""

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """There is no state but F."""

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        """Sound, largest c + |v| [m/s] and terms of the ledger [J] of one law's particles after a step [s]."""
        points, storage = self.points, self.points.storage
        deformation, rate = storage("deformation_gradient"), storage("velocity_gradient")
        arrays = (deformation, points.motion, rate, storage("stress_and_volume"))
        here = (points.space, block.first, block.last, block.law)
        sound, fastest = self._advance(id(block.law), *here, step, *arrays)
        return sound, fastest, {}

    def stored_energy(self, block: MaterialBlock) -> float:
        """W V0 [J] of one law's particles."""
        points = self.points
        F = points.storage("deformation_gradient")
        return float(elastic_energy(points.space, block.first, block.last, block.law, F, points.motion))


class ElasticPlasticUpdate:
    """The kind of laws with an equation of state, plastic flow and heat."""

    def __init__(self, scene: Scene, points: MaterialPoints):
        self.points, self._advance = points, RecalledEach(advance_stress, free=(1, 2, 4))
        viscosity, cell = scene.method.viscosity, float(scene.method.cell)
        self.viscosity: BulkViscosity | CentredViscosity = BulkViscosity(
            float(viscosity.linear), float(viscosity.quadratic), cell
        )
        kept = functools.partial(Field, checkpointed=True, layout=Columns())
        points.declare(kept("unrotated_deviator", DEVIATOR_ROWS[points.dimension], "Pa"))
        for field in PLASTIC_STATE:
            points.declare(field)
        # planes at a temperature take up the plastic heat of the particles beside them, see `Conduction`
        if scene.method.conduction and Declarations(scene, Declared).of(TemperaturePlane):
            points.declare(kept("plastic_rise", 1, "K"))
        declare_failure(points, points.laws)

    def centre(self) -> None:
        """See `StressUpdate.centre`."""
        self.viscosity = CentredViscosity(*self.viscosity)

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
        points, storage, here = self.points, self.points.storage, (block.first, block.last)
        state = points.kept(("material state",), lambda: MaterialState(*map(cast(Any, points.find), _STATE)))
        rise = points.find("plastic_rise")
        before = None if rise is None else state.plastic_strain[0].copy()
        arrays = (points.motion, storage("velocity_gradient"), storage("stress_and_volume"))
        sound, fastest, plastic, viscous, released = self._advance(
            id(block.law), points.space, *here, block.law, step, self.viscosity, state, *arrays
        )
        if rise is not None:
            note_plastic_rise(*here, points.space, block.law, state, before, rise)
        terms = {"plastic_work": plastic, "viscous_work": viscous}
        return sound, fastest, terms if block.law.failure is None else terms | {FAILURE_DISSIPATION: released}

    def stored_energy(self, block: MaterialBlock) -> float:
        """E V0 [J] of one law's particles."""
        here = slice(block.first, block.last)
        return float(self.points["internal_energy"][here] @ self.points.motion[here, 7])


# by the class of the law; all others are hyperelastic
Update = HyperelasticUpdate | ElasticPlasticUpdate
_KINDS: dict[type, type[Update]] = {ElasticPlastic: ElasticPlasticUpdate}


class StressUpdate:
    """The updates of all laws of a scene, on one rank.

    slowness [s/m]: of this rank's fastest particle, 1 / (c + |v|); plastic_work [J]: of all steps; stretch: 1, as steps
    are not by reference place.
    """

    stretch = 1.0

    def __init__(self, scene: Scene, points: MaterialPoints):
        """points: `MaterialPoints`, to which the updates add the fields of their laws."""
        self.points, self.fastest, self.plastic_work = points, 0.0, 0.0
        kinds = [_KINDS.get(type(law), HyperelasticUpdate) for law in points.laws]
        self.updates = {kind: kind(scene, points) for kind in dict.fromkeys(kinds)}
        self._kind_of_law = dict(zip(points.laws, kinds))

    def _of(self, law: Any) -> Update:
        return self.updates[self._kind_of_law[law]]

    def centre(self) -> None:
        """Let heat of the viscosity be what its forces do, where velocities of one time count, see `waiting`."""
        for update in self.updates.values():
            update.centre()

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
            good, speed, more = self._of(block.law).advance(block, step)
            sound, self.fastest = sound and good, max(self.fastest, speed)
            for name, energy in more.items():
                terms[name] = terms.get(name, 0.0) + energy
        self.plastic_work += terms["plastic_work"]
        return sound, terms

    @property
    def slowness(self) -> float:
        """See above."""
        return 1.0 / self.fastest if self.fastest > 0.0 else np.inf

    @property
    def on_nodes(self) -> CauchyStress:
        """What the particles give to the nodes' forces."""
        return CauchyStress(self.points.storage("stress_and_volume"))

    def resume(self) -> None:
        """The stress is among the fields that were put back."""

    def stored_energy(self) -> float:
        """Internal energy [J] of this rank's particles."""
        return sum((self._of(block.law).stored_energy(block) for block in self.points.blocks), 0.0)
