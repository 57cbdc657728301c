"""Interface of contact, ties and rigid tools: forces between the particles of any systems."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from parsolid.methods.protocol import EnergyLedger

# numbers of two bodies and a place (d,) [m]
Meeting = tuple[int, int, np.ndarray]


class Interaction:
    """Contact, ties or tools, as a simulation sees them.

    In a step all systems advance their positions, interactions add their forces at the new positions, and systems
    complete the step. Forces [N] are added to the field `boundary.conditions.EXTERNAL_FORCE`, which is zero before;
    corrections of the impulse [N s] of a step in which contact begins or ends are added to EXTERNAL_IMPULSE. Rows of
    particles change only while systems advance, see `ParticleSystem.placements`.

    energy_scale: energy [J], the same on all ranks, whose round-off the energy balance may have.
    terms: energy terms that it adds to the ledger, with their signs, see `simulation.ledger.Ledger`.
    rebuild_needed: whether this rank needs new lists. It is reduced over ranks together with the next step, so that
    all ranks act on `rebuild_anywhere` at the step after that.
    roughness: energy [J] of all ranks below which contact forces in implicit steps are round-off of the faces.
    ahead: time [s] from the kept state to the next trials, where it is known.
    rubs: whether it has friction, whose forces have no potential. closes: whether particles that just touch press in
    `change_along`, as they do after a state and not before it.
    met: bodies without a contact that have met, and where [m], the same on all ranks; the loop empties it.
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
        """Add the forces of the state at time 0 or of a restart [s]; collective."""

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Before systems advance by a step [s], which may be 0, from a time [s]; collective if `rebuild_anywhere`."""

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Add the forces at the positions at the end of a step [s] at a time [s], book energies, set
        `rebuild_needed`."""
        raise NotImplementedError

    _last_stored: Mapping[str, float] = {}

    def book_stored(self, ledger: EnergyLedger | None, **stored: float) -> None:
        """Book the changes of stored energies [J], by their terms, since the last call; without a ledger, only start
        from them."""
        if ledger is not None:
            for term, energy in stored.items():
                ledger.add_term(term, energy - self._last_stored.get(term, 0.0))
        self._last_stored = stored

    # --- implicit and static steps, of a single system; all collective --------------------------------------------

    def try_forces(self, time: float, over: float, still: bool = False, mean: bool = False) -> None:
        """Add the forces at trial positions, a time `over` [s] after the kept state at a time [s]; nothing is booked.

        still: nothing has moved since then. mean: also add the impulse [N s] by which the mean of the forces before and
        after the step is that over the step.
        """

    def linearise(self) -> None:
        """Find the tangent of the forces of the last trial."""

    def stiffness(self) -> np.ndarray | float:
        """Diagonal (owned, d) [N/m] of the tangent of `linearise`, of forces that depend on the particle's own place
        alone."""
        return 0.0

    def change_along(self, change: np.ndarray, ahead: float) -> tuple[np.ndarray | float, float]:
        """Changes of the forces (owned, d) [N] of the last trial and of this rank's `power` [W], for a change of places
        (owned, d) [m] within a time `ahead` [s].

        With ahead 0 the change of the forces alone, linear in the change of places.
        """
        return 0.0, 0.0

    def keep(self, ledger: EnergyLedger | None) -> None:
        """Take the last trial, or the present state, as that from which the next trials start; book its energies unless
        the ledger is None."""

    def settle(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Add the forces at the end of a step [s] at a time [s] whose state has been kept."""
        self.evaluate(time, step, ledger)

    def power(self) -> float:
        """Power [W] of prescribed motion on this rank's particles in the last trial."""
        return 0.0

    def lost(self) -> float:
        """Energy [J] that friction dissipates on this rank in the last trial."""
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
        """Its columns of the history."""
        return []

    def sample(self) -> list[float]:
        """Values of the columns; collective where there are any."""
        return []

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank, besides those of systems."""
        return 0.0, 0.0

    def state(self) -> dict[str, Any]:
        """State for a restart besides checkpointed fields, in types of JSON, the same on all ranks; collective."""
        return {}

    def set_state(self, state: dict[str, Any]) -> None:
        """Restore the state of a checkpoint, before `begin`."""

    def handed_on(self) -> dict[str, Any]:
        """State by name for another run that starts from this one's results, the same on all ranks."""
        return {}

    def sound(self) -> bool:
        """Whether the state of this rank is finite after the last step."""
        return True
