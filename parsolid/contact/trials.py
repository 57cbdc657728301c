"""Contact in steps that are solved for: trials from the state that was kept, and their derivatives by differences."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.collective import maximum
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem

# of a spacing, by what differences move particles, and by what they count as deeper then, see `Interaction.closes`
_PART, _DEEPER = 1e-7, 2e-7


class TriedContact(Interaction):
    """Contact of the only system whose forces are asked for in places that may be no equilibrium.

    Parts: `find(over, still, mean)` adds forces, and impulses where `mean`, a time over [s] after the kept state, with
    all particles deeper by `deeper` [m], after what moves by itself has gone on for a time `later` [s] with its present
    velocity, of which `fastest()` is the greatest [m/s].
    """

    comm: Any
    systems: list[ParticleSystem]
    deeper: float = 0.0
    later: float = 0.0

    def find(self, over: float, still: bool, mean: bool) -> None:
        """See above."""
        raise NotImplementedError

    def fastest(self) -> float:
        """See above."""
        return 0.0

    def try_forces(self, time: float, over: float, still: bool = False, mean: bool = False) -> None:
        """See `Interaction`."""
        self._time, self._trial = time, (over, mean)
        self._places = self.systems[0].particles.owned_rows("position").copy()
        self.find(over, still, mean)

    def change_along(self, change: np.ndarray, ahead: float) -> tuple[np.ndarray, float]:
        """See `Interaction`; what a trial has besides forces is lost."""
        system, (over, mean) = self.systems[0], self._trial
        of = system.particles.owned_rows
        own = max(float(np.abs(change).max(initial=0.0)), abs(ahead) * self.fastest() if ahead else 0.0)
        most, narrowest = maximum(self.comm, np.array([own, -float(of("spacing").min(initial=np.inf))]))
        if most == 0.0:
            return np.zeros(change.shape), 0.0
        part, self.deeper = -_PART * narrowest / most, -_DEEPER * narrowest * (1.0 if self.closes else -1.0)
        fields = [of(name) for name in ("position", EXTERNAL_FORCE, EXTERNAL_IMPULSE)]
        kept, forces, powers = [field.copy() for field in fields], [], []
        for sign in (part, -part):
            fields[0][:] = self._places + sign * change
            fields[1][:], fields[2][:] = 0.0, 0.0
            self.later = sign * ahead
            self.find(over, False, mean)
            # the mean of a step has half the force at its end
            forces.append(fields[1] + (2.0 / over * fields[2] if mean else 0.0))
            powers.append(self.power())
        for field, values in zip(fields, kept):
            field[:] = values
        self.deeper = self.later = 0.0
        return (forces[0] - forces[1]) / (2.0 * part), (powers[0] - powers[1]) / (2.0 * part)

    def settle(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """See `Interaction`."""
        self.try_forces(time, 0.0, still=True)
