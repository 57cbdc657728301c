"""What acts between the particles of systems besides their own forces: contact, tools and ties."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from parsolid.methods.protocol import EnergyLedger

# numbers of two bodies and a place (d,) [m]
Meeting = tuple[int, int, np.ndarray]


class Interaction:
    """Contact or the like, between the particles of any systems; what a simulation asks of it.

    In a step all systems advance their positions, interactions find their forces there, and systems complete the step
    with them. Forces are added to the particles' field `boundary.conditions.EXTERNAL_FORCE`, which is zero before, and
    which integrators take as they take gravity; what a force of the middle of the step would have done besides, where
    contact has begun or ended, to EXTERNAL_IMPULSE. Rows of particles change only while systems advance:
    `ParticleSystem.placements` tells.

    energy_scale: an energy [J], the same on all ranks, of which the balance has the round-off in any case.
    terms: the energy terms it adds to the ledger, with their signs, see `simulation.ledger.Ledger`.
    rebuild_needed: whether this rank has found, by the end of a step, what all ranks must act on at the step after the
    next one, such as lists used up; it travels with the minimum of the next step. rebuild_anywhere: whether any
    rank had.
    roughness: an energy [J] of all ranks below which its forces say nothing in steps that are solved for.
    ahead: how long [s] after the state that was kept last the next trials are, where that is known.
    rubs: whether it has friction, whose forces have no potential. closes: whether what just touches presses in
    `change_along`, as it does after a state and not before it.
    met: bodies that have met and that no table of the scene names, and where [m], until the loop has taken them; the
    same on all ranks.
    """

    terms: Mapping[str, int] = {}
    energy_scale: float = 0.0
    roughness: float = 0.0
    rebuild_needed: bool = False
    rebuild_anywhere: bool = False
    ahead: float = 0.0
    rubs: bool = False
    closes: bool = True
    met: Sequence[Meeting] = ()

    def begin(self, time: float) -> None:
        """Forces of the state at hand, at time 0 or at that of a restart [s], added as in a step; collective."""

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Before systems advance by a step [s] from a time [s], of length 0 too; collective if `rebuild_anywhere`."""

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces in the positions at the end of a step [s] at a time [s]; sets `rebuild_needed`.

        Energy that it stores, dissipates or supplies goes to the ledger.
        """
        raise NotImplementedError

    # --- in steps that are solved for, of the only system; all collective -----------------------------------------

    def try_forces(self, time: float, over: float, still: bool = False, mean: bool = False) -> None:
        """Forces in the present places, a time `over` [s] after the state at a time [s] that was kept last; nothing is
        booked. still: nothing has moved since then. mean: the impulse [N s] besides, too, that makes the mean of the
        forces before and after the step that of all of it."""

    def linearise(self) -> None:
        """Find the tangent of the forces of the last trial."""

    def stiffness(self) -> np.ndarray | float:
        """Diagonal (owned, d) [N/m] of the tangent that `linearise` has found, of forces on a particle that depend on
        its own place alone."""
        return 0.0

    def change_along(self, change: np.ndarray, ahead: float) -> tuple[np.ndarray | float, float]:
        """By how much the forces (owned, d) [N] of the last trial and this rank's `power` [W] change where places
        change by (owned, d) [m] while a time `ahead` [s] passes; where none passes, the forces alone, linear in the
        change, at the trial that `linearise` has taken."""
        return 0.0, 0.0

    def keep(self, ledger: EnergyLedger | None) -> None:
        """Take the last trial, or the present state, as that from which the next trials go; with what the ledger needs
        of it, unless that is None."""

    def settle(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces at the end of a step [s] at a time [s] whose state has been kept."""
        self.evaluate(time, step, ledger)

    def power(self) -> float:
        """What prescribed motion supplies [W] to this rank's particles in the last trial."""
        return 0.0

    def lost(self) -> float:
        """What friction has taken [J] of this rank's particles in the last trial."""
        return 0.0

    def clearances(self) -> np.ndarray:
        """The least gap [m] of each contact that is open as a whole, after the last trial, on this rank."""
        return np.zeros(0)

    # --------------------------------------------------------------------------------------------------------------

    def stable_step(self) -> float:
        """Largest step [s] that it allows on this rank, known before a step."""
        return float("inf")

    @property
    def columns(self) -> list[str]:
        """Of the history."""
        return []

    def sample(self) -> list[float]:
        """Values of the columns; collective where there are any."""
        return []

    def energies(self) -> tuple[float, float]:
        """This rank's kinetic and stored energy [J] that no system has; part of those sums of the ledger."""
        return 0.0, 0.0

    def state(self) -> dict[str, Any]:
        """What a restart needs besides checkpointed fields, as JSON has it, the same on all ranks; collective."""
        return {}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave, before `begin`."""

    def handed_on(self) -> dict[str, Any]:
        """By name, what another run that starts from this one's state may take, the same on all ranks."""
        return {}

    def sound(self) -> bool:
        """Whether the last step left this rank's part as it can be."""
        return True
