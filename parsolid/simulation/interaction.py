"""What acts between two systems of a simulation."""

from typing import Protocol

from parsolid.methods.protocol import EnergyLedger


class Interaction(Protocol):
    """Contact or the like between a pair of systems, which it holds.

    The loop asks every interaction before the systems advance, in every step, those of length 0 too. An interaction in
    the stages of a step would need systems that hand out their stages, which none does yet.
    """

    def act(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Change the velocities of both systems' particles for the step that starts at `time` [s]; collective.

        Energy that it supplies or takes goes to the ledger.
        """
