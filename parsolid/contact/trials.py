"""Contact in implicit and static steps: trials from the kept state, and their derivatives by differences."""

from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.collective import maximum, minimum
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem

# shares of a spacing: displacement of particles in differences, and change of their depth then, see
# `Interaction.closes`
_PART, _DEEPER = 1e-7, 2e-7

# of a spacing, the roughness of the faces of lattices
ROUGH = 3e-4


class Trial(NamedTuple):
    """What a trial evaluates; time, over [s], still, mean: see `Interaction.try_forces`.

    In differences, deeper [m] is added to the depth of all particles; later [s]: time for which tools have moved on
    with their present velocity.
    """

    time: float
    over: float
    still: bool
    mean: bool
    deeper: float = 0.0
    later: float = 0.0


class TriedContact(Interaction):
    """Contact of a single system, evaluated at trial positions, which need not be in equilibrium.

    local: whether the force on a particle depends on its own position alone; other forces are differenced along each
    change, see `fix_branches`. difference: share of a spacing by which differences move particles at most.
    """

    comm: Any
    systems: list[ParticleSystem]
    local: bool = True
    difference: float = _PART
    _trial = Trial(0.0, 0.0, still=True, mean=False)

    def evaluate_trial(self, trial: Trial) -> None:
        """Add forces, and impulses if `trial.mean`."""
        raise NotImplementedError

    def memory(self) -> list[np.ndarray]:
        """Fields of the state of contact, which trials change."""
        raise NotImplementedError

    def fastest(self) -> float:
        """The greatest speed [m/s] of tools."""
        return 0.0

    def keep(self, ledger: EnergyLedger | None) -> None:
        """See `Interaction`."""
        if ledger is not None:
            self.book(ledger)
        self.kept_memory = [field.copy() for field in self.memory()]

    def book(self, ledger: EnergyLedger) -> None:
        """Book the energies of the last forces."""
        raise NotImplementedError

    def recall(self, values: list[np.ndarray]) -> None:
        """Set the state of contact to earlier values."""
        for field, value in zip(self.memory(), values):
            field[:] = value

    def try_forces(self, time: float, over: float, still: bool = False, mean: bool = False) -> None:
        """See `Interaction`."""
        self._trial = Trial(time, over, still, mean)
        self._places = self.systems[0].particles.owned_rows("position").copy()
        self.evaluate_trial(self._trial)

    def fix_branches(self, trial: Trial) -> None:
        """Fix which particles press and slip in differences as in the last trial, so that differences are linear."""

    def linearise(self) -> None:
        """See `Interaction`."""
        if not self.local:
            self.fix_branches(self._trial)
            return
        h, axes = self.difference * self.narrowest, np.eye(self._places.shape[1])
        moves = [np.broadcast_to(h * axis, self._places.shape) for axis in axes]
        self._slopes = np.stack([self._differences(move, 0.0)[0] / h for move in moves], axis=2)

    def stiffness(self) -> np.ndarray | float:
        """See `Interaction`."""
        return np.maximum(-np.einsum("nii->ni", self._slopes), 0.0) if self.local else 0.0

    def change_along(self, change: np.ndarray, ahead: float) -> tuple[np.ndarray, float]:
        """See `Interaction`; results of a trial other than forces are overwritten."""
        if ahead == 0.0 and self.local:
            return np.einsum("nij,nj->ni", self._slopes, change), 0.0
        own = max(float(np.abs(change).max(initial=0.0)), abs(ahead) * self.fastest())
        most = maximum(self.comm, own)
        if most == 0.0:
            return np.zeros(change.shape), 0.0
        part = self.difference * self.narrowest / most
        force, power = self._differences(part * change, part * ahead)
        return force / part, power / part

    @cached_property
    def narrowest(self) -> float:
        """The least spacing [m]; collective."""
        return minimum(self.comm, float(self.systems[0].particles.owned_rows("spacing").min(initial=np.inf)))

    def _differences(self, move: np.ndarray, ahead: float) -> tuple[np.ndarray, float]:
        """Half the differences of the forces (owned, d) [N] and of this rank's power [W] between displacements of plus
        and minus `move` (owned, d) [m], and of times of plus and minus `ahead` [s], from the last trial; collective."""
        of, trial = self.systems[0].particles.owned_rows, self._trial
        deeper = _DEEPER * self.narrowest * (1.0 if self.closes else -1.0)
        fields = [of(name) for name in ("position", EXTERNAL_FORCE, EXTERNAL_IMPULSE)]
        kept, forces, powers = [field.copy() for field in fields], [], []
        for sign in (1.0, -1.0):
            fields[0][:] = self._places + sign * move
            fields[1][:], fields[2][:] = 0.0, 0.0
            self.evaluate_trial(trial._replace(still=False, deeper=deeper, later=sign * ahead))
            # the mean force of a step contains half the force at its end
            forces.append(fields[1] + (2.0 / trial.over * fields[2] if trial.mean else 0.0))
            powers.append(self.power())
        for field, values in zip(fields, kept):
            field[:] = values
        return 0.5 * (forces[0] - forces[1]), 0.5 * (powers[0] - powers[1])

    def settle(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """See `Interaction`."""
        self.ahead = 0.0
        self.try_forces(time, 0.0, still=True)
