"""What acts between the particles of systems besides their own steps, as impulses between the steps of all systems."""

from collections.abc import Mapping
from typing import Any

from parsolid.methods.protocol import EnergyLedger


class Interaction:
    """Contact or the like, between the particles of any systems; what a simulation asks of it.

    Strang's splitting: half a kick with the forces at the present places before the systems advance, half a kick with
    the forces at the new places after it, by `ParticleSystem.kick`. It is of second order and touches no method's step.
    Rows of particles change only while systems advance: `ParticleSystem.placements` tells.

    energy_scale: an energy [J], the same on all ranks, of which the balance has the round-off in any case.
    terms: the energy terms it adds to the ledger, with their signs, see `simulation.ledger.Ledger`.
    news: whether this rank has found, by the end of a step, what all ranks must act on at the step after the next one,
    such as lists used up; it travels with the minimum of the next step. news_anywhere: whether any rank had.
    """

    terms: Mapping[str, int] = {}
    energy_scale: float = 0.0
    news: bool = False
    news_anywhere: bool = False

    def begin(self, time: float) -> None:
        """Forces of the state at hand, at time 0 or at that of a restart [s]; collective."""

    def before(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Half a kick before a step [s] from a time [s], of length 0 too. Collective only where `news_anywhere`.

        Energy that it supplies or takes goes to the ledger.
        """
        raise NotImplementedError

    def after(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Half a kick after a step [s] that has ended at a time [s]; sets `news`."""
        raise NotImplementedError

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
