"""The state of the particles of each kind of law: what it declares, how it advances between the passes and after them.

A kind of law is a class with what `MicroInertiaUpdate` has, and a line of `_KINDS`.
"""

from typing import Any

import numpy as np

from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.micro_inertia_lanes import MicroInertia, heat_time_step, increments_of
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.ulsph import micro_inertia_update, plastic_update
from parsolid.methods.ulsph.fields import OF_FAILURE, Body, body_of
from parsolid.methods.ulsph.terms import HeatFlux, MicroAndHeatFlux, MicroFlux
from parsolid.scene import Scene, initial_zero_energy_temperature


class MicroInertiaUpdate:
    """The kind of laws with micro-velocity and micro-stress.

    stores_heat: whether the stored energy holds heat, that of the viscosity too; speeds_change: whether c follows the
    state.
    """

    stores_heat = speeds_change = False

    @staticmethod
    def lacks(law: MicroInertia) -> set[str]:
        """Names of `fields.Body` that a law does without."""
        micro = (law.energetic_length, law.hardening_length, law.dissipative_length)
        present = {
            "micro_curl": law.hardening_length,
            "micro_gradient": next((length for length in micro if length is not None), None),
            "energetic_flux": law.energetic_length,
            "dissipative_flux": law.dissipative_length,
            "heat_flux": law.conductivity,
            **dict.fromkeys(("energy", *OF_FAILURE)),
        }
        return {name for name, value in present.items() if value is None}

    def __init__(self, system: Any):
        """system: `system.UpdatedLagrangianSPH`."""
        self.system = system

    def begin(self, scene: Scene, block: MaterialBlock, body: Body) -> None:
        """The state at time 0; its temperatures are set."""
        body.micro_stress[0, block.first : block.last] = block.law.initial_micro_stress

    def advance(self, block: MaterialBlock, step: float, body: Body) -> tuple[bool, float, float]:
        """From the sums of the first pass to the records of the second: sound, plastic heat and numerical loss [J]."""
        system, here = self.system, (block.first, block.last, block.law)
        sound, heat, lost = micro_inertia_update.advance_state(
            system.space, *here, increments_of(block.law, step), system.carried, system.correction, body
        )
        return sound, heat, lost

    def advance_gradients(self, block: MaterialBlock, step: float, body: Body) -> float:
        """Fluxes from the sums of the second pass; what of them is dissipated [J]."""
        system, here = self.system, (block.first, block.last, block.law)
        warming = system.heating if system.settings.viscous_heating else None
        return float(
            micro_inertia_update.advance_gradients(
                system.space, *here, increments_of(block.law, step), system.carried, warming, body
            )
        )

    def energies(self, block: MaterialBlock, body: Body) -> tuple[float, float]:
        """Kinetic energy of the micro-velocity, and stored energy [J]."""
        system = self.system
        kinetic, stored = micro_inertia_update.energies(system.space, block.first, block.last, block.law, body)
        return kinetic, stored

    def stable_step(self, block: MaterialBlock, body: Body) -> float:
        """What fluxes allow [s]."""
        law = block.law
        shortest = float(body.smoothing_length[0, block.first : block.last].min())
        step = heat_time_step(law, shortest)
        if law.energetic_length is not None or law.dissipative_length is not None:
            step = min(
                step, micro_inertia_update.least_micro_step(block.first, block.last, law, self.system.space, body)
            )
        return float(step)

    @staticmethod
    def pressures(block: MaterialBlock, body: Body, first: int, last: int) -> np.ndarray:
        """p (n,) [Pa] of particles first..last-1."""
        result = np.empty(last - first)
        micro_inertia_update.pressures(first, last, block.law, body.density, result)
        return result

    @staticmethod
    def room(block: MaterialBlock, body: Body) -> None:
        """The law holds at every density."""

    @staticmethod
    def sound_speed(law: MicroInertia) -> float:
        """c_L [m/s] of the undeformed solid."""
        return float(micro_inertia_update.speed_of_sound(law))


class ElasticPlasticUpdate:
    """The kind of laws with an equation of state of density and internal energy, plastic flow and heat.

    plastic_work, viscous_heat, released (by failure) [J]: of this rank's particles since `Updates.taken` was asked.
    """

    stores_heat = speeds_change = True

    def __init__(self, system: Any):
        """system: `system.UpdatedLagrangianSPH`."""
        self.system, self.plastic_work, self.viscous_heat, self.released = system, 0.0, 0.0, 0.0

    @staticmethod
    def lacks(law: ElasticPlastic) -> set[str]:
        """Names of `fields.Body` that a law does without."""
        flux = {"heat_flux"} if law.conductivity is None else set()
        flux |= set(OF_FAILURE) if law.failure is None else set()
        return {name for name in Body._fields if name.startswith(("micro_", "energetic", "dissipative"))} | flux

    def begin(self, scene: Scene, block: MaterialBlock, body: Body) -> None:
        """The internal energy that belongs to the temperatures at time 0."""
        here = slice(block.first, block.last)
        number, warm = self.system.particles.owned_rows("body")[here], body.temperature[0, here]
        cold = initial_zero_energy_temperature(scene, number, warm, block.law.reference_temperature)
        body.energy[0, here] = block.law.internal_energy(warm, cold)

    def advance(self, block: MaterialBlock, step: float, body: Body) -> tuple[bool, float, float]:
        """See `MicroInertiaUpdate.advance`; the stored energy holds the plastic heat."""
        system, here = self.system, (block.first, block.last, block.law)
        sound, work, heat, released = plastic_update.advance_state(
            system.space, *here, step, system.halves.mean(step), system.carried, system.heating, system.correction, body
        )
        self.plastic_work += work
        self.viscous_heat += heat
        self.released += released
        return sound, 0.0, 0.0

    def advance_gradients(self, block: MaterialBlock, step: float, body: Body) -> float:
        """The flux of heat after the second pass; nothing is dissipated."""
        system = self.system
        if system.carried is not None:
            here = (block.first, block.last, block.law)
            plastic_update.advance_heat_flux(system.space, *here, system.carried, body)
        return 0.0

    def energies(self, block: MaterialBlock, body: Body) -> tuple[float, float]:
        """0, and E V0 [J]."""
        here = slice(block.first, block.last)
        return 0.0, float(body.energy[0, here] @ body.mass[0, here]) / block.law.density

    def stable_step(self, block: MaterialBlock, body: Body) -> float:
        """rho C_v h^2/(2 kappa) [s] of conduction by Fourier, see `heat_time_step`."""
        law, here = block.law, slice(block.first, block.last)
        if law.conductivity is None:
            return float(np.inf)
        least = float((body.density[0, here] * body.smoothing_length[0, here] ** 2).min())
        return float(0.5 * law.specific_heat * least / law.conductivity)

    @staticmethod
    def pressures(block: MaterialBlock, body: Body, first: int, last: int) -> np.ndarray:
        """P (n,) [Pa] of particles first..last-1."""
        return plastic_evaluation.pressure(
            block.law, block.law.density / body.density[0, first:last], body.energy[0, first:last]
        )

    @staticmethod
    def room(block: MaterialBlock, body: Body) -> np.ndarray:
        """Room (n,) that the equation of state leaves to compress the particles, see `plasticity.room_to_compress`."""
        here = slice(block.first, block.last)
        return plastic_evaluation.room_to_compress(block.law, block.law.density / body.density[0, here])

    @staticmethod
    def sound_speed(law: ElasticPlastic) -> float:
        """c_L [m/s] of the undeformed solid at the reference temperature."""
        mu = plastic_evaluation.shear_modulus(law, 1.0, 0.0, law.reference_temperature)
        bulk = plastic_evaluation.isentropic_bulk_modulus(law, 1.0, 0.0)
        return float(np.sqrt((bulk + 4.0 / 3.0 * mu) / law.density))


# by the class of the law
Update = MicroInertiaUpdate | ElasticPlasticUpdate
_KINDS: dict[type, type[Update]] = {MicroInertia: MicroInertiaUpdate, ElasticPlastic: ElasticPlasticUpdate}


class Updates:
    """The updates of all laws of a scene, on one rank."""

    def __init__(self, system: Any, laws: list[Any]):
        self.system = system
        self.of_kind = {kind: _KINDS[kind](system) for kind in dict.fromkeys(type(law) for law in laws)}
        self.lacking = {law: frozenset(_KINDS[type(law)].lacks(law)) for law in laws}
        self._names: tuple[Any, ...] = ()
        self._bodies: dict[Any, Body] = {}

    @property
    def lacks(self) -> frozenset[str]:
        """What no law has."""
        return frozenset.intersection(*self.lacking.values())

    @property
    def storing(self) -> list[bool]:
        """Of every law whether its stored energy holds heat, the same on all ranks."""
        return [_KINDS[type(law)].stores_heat for law in self.lacking]

    @property
    def speeds_change(self) -> bool:
        """Whether any speed of sound follows the state, the same on all ranks."""
        return any(update.speeds_change for update in self.of_kind.values())

    def taken(self) -> dict[str, float]:
        """Plastic work, viscous heat and what failure released [J], all in stored energies, since this was asked."""
        update = self.of_kind.get(ElasticPlastic)
        if not isinstance(update, ElasticPlasticUpdate):
            return {}
        result = {"plastic_work": update.plastic_work, "viscous_heat": update.viscous_heat}
        if "damage" in self.system.particles:
            result[FAILURE_DISSIPATION] = update.released
        update.plastic_work = update.viscous_heat = update.released = 0.0
        return result

    @property
    def carried(self) -> MicroFlux | HeatFlux | MicroAndHeatFlux | None:
        """What flows between particles, by type."""
        micro, heat = "micro_gradient" not in self.lacks, "heat_flux" not in self.lacks
        if micro and heat:
            return MicroAndHeatFlux()
        return MicroFlux() if micro else HeatFlux() if heat else None

    def each(self) -> list[tuple[Update, MaterialBlock, Body]]:
        """Every law of this rank's particles, with its update and the arrays that it has."""
        particles = self.system.particles
        if self._names != (particles.growths, particles.layout):
            # arrays are others only after particles came
            self._names = (particles.growths, particles.layout)
            self._bodies = {law: body_of(particles, lacks) for law, lacks in self.lacking.items()}
        return [(self.of_kind[type(b.law)], b, self._bodies[b.law]) for b in self.system.blocks]


def density_of(laws: list[Any], law_of_body: np.ndarray, body: np.ndarray) -> np.ndarray:
    """Densities (n,) [kg/m^3] of particles by their bodies (n,)."""
    return np.array([law.density for law in laws])[law_of_body[body]]
