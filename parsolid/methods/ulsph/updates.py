"""The state of the particles of each kind of law: what it declares, how it advances between the passes and after them.

A kind of law is a class with what `MicroInertiaUpdate` has, and a line of `_KINDS`.
"""

from typing import Any

import numpy as np

from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.plastic.micro_inertia import MicroInertia, heat_time_step
from parsolid.materials.plastic.micro_inertia_solve import increments_of
from parsolid.methods.ulsph import micro_inertia_update
from parsolid.methods.ulsph.fields import Body, body_of
from parsolid.methods.ulsph.terms import HeatFlux, MicroAndHeatFlux, MicroFlux


class MicroInertiaUpdate:
    """The kind of laws with micro-velocity and micro-stress."""

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
            "energy": None,
        }
        return {name for name, value in present.items() if value is None}

    def __init__(self, system: Any):
        """system: `system.UpdatedLagrangianSPH`."""
        self.system = system

    def begin(self, block: MaterialBlock, body: Body) -> None:
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
        return float(
            micro_inertia_update.advance_gradients(
                system.space, *here, increments_of(block.law, step), system.carried, system.heating, body
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
    def sound_speed(law: MicroInertia) -> float:
        """c_L [m/s] of the undeformed solid."""
        return float(micro_inertia_update.speed_of_sound(law))


Update = MicroInertiaUpdate
_KINDS: dict[type, type[Update]] = {MicroInertia: MicroInertiaUpdate}


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
