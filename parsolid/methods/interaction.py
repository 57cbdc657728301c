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
    met: bodies that have met and that no table of the scene names, and where [m], until the loop has taken them; the
    same on all ranks.
    """

    terms: Mapping[str, int] = {}
    energy_scale: float = 0.0
    rebuild_needed: bool = False
    rebuild_anywhere: bool = False
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

    def add_product(self, change: np.ndarray, result: np.ndarray) -> None:
        """Add to a result (owned, d) [N], of the only system, what resists a change (owned, d) [m] of its places in the
        reference; collective. Nothing but of ties, which are linear in the displacement."""

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
