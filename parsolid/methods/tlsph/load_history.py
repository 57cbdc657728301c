"""What bodies that flow or relax remember of their way from equilibrium to equilibrium.

A trial begins from the state of the last equilibrium, whatever has been tried before; what it ends with is remembered
once it is an equilibrium. Where no time passes, as in a jump of the loads, branches do not relax, and plastic flow is
as slow as its law knows.
"""

from typing import Any

import numpy as np

from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods.plastic_fields import BACK_STRESS, PLASTIC_STATE, VOLUME_FLOW
from parsolid.methods.plastic_particles import ACTING, METRIC_FIELD

_REMEMBERED = (
    "displacement",
    "deformation_gradient",
    "jacobian",
    "branches",
    METRIC_FIELD,
    *(field.name for field in PLASTIC_STATE),
    ACTING,
    BACK_STRESS,
    VOLUME_FLOW,
)
# time [s] in which plastic flow is slow; a power of 2, so that rates times it are what they were made of
_SLOW = 2.0**60


class LoadHistory:
    """The state of one rank's particles at the last equilibrium, of which `storage` gives the fields.

    relaxes: whether any body of the scene has branches; elapsed [s]: the time from it to the trial; step [s]: that of
    kernels; lost [J]: what this rank's branches dissipate in it.
    """

    def __init__(self, system: Any) -> None:
        self.particles, self.relaxes = system.particles, any(law.branch_moduli for law in system.laws)
        self.elapsed = self.lost = 0.0
        self._names = [name for name in _REMEMBERED if name in self.particles]
        self.remember()

    @staticmethod
    def of(system: Any) -> "LoadHistory | None":
        """That of a system, None where no law has any."""
        has = any(isinstance(law, ElasticPlastic) or law.branch_moduli for law in system.laws)
        return LoadHistory(system) if has else None

    def remember(self) -> None:
        """Take the present state as that of an equilibrium."""
        self._kept = {name: self.particles.storage(name).copy() for name in self._names}

    def recall(self) -> None:
        """Go back to it."""
        for name, values in self._kept.items():
            self.particles.storage(name)[:] = values

    def __contains__(self, name: str) -> bool:
        return name in self.particles

    def storage(self, name: str) -> np.ndarray:
        """A field as `Particles.storage` gives it, of the last equilibrium if it is remembered."""
        kept = self._kept.get(name)
        return self.particles.storage(name) if kept is None else kept

    @property
    def relaxing(self) -> float:
        """Time [s] in which branches relax."""
        return self.elapsed

    @property
    def step(self) -> float:
        """Time [s] that kernels take for the one that has elapsed."""
        return self.elapsed if self.elapsed > 0.0 else _SLOW

    def rate(self, displacement: np.ndarray) -> np.ndarray:
        """Velocity (owned, d) [m/s] that leads to a displacement (owned, d) [m] in a step."""
        return np.asarray((displacement - self._kept["displacement"][:, : len(displacement)].T) / self.step)
