"""Where a run's time goes: each rank adds up its own, and all ranks hear of it at the end."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.methods.protocol import ParticleSystem

# in the order in which they are told
PHASES = ("set_up", "first_step", "forces", "communication", "contact", "output")


class Phases:
    """Seconds of this rank, without those of the first step, which also loads or compiles kernels.

    waiting: for the one agreement of all ranks in a step; contact: between steps, of contact and tools, with the
    messages of their own; output: history, fields, checkpoints.
    """

    def __init__(self, systems: Sequence[ParticleSystem]) -> None:
        self._systems = systems
        # until the first step begins; None before that
        self.set_up: float | None = None
        self.waiting, self.contact, self.output, self._sent_before = 0.0, 0.0, 0.0, 0.0

    def begin(self) -> None:
        """Count steps and messages from now on; what has been written stays counted."""
        self.waiting, self.contact = 0.0, 0.0
        self._sent_before = self._sent()

    def _sent(self) -> float:
        return sum(system.communication_seconds for system in self._systems)

    def seconds(self, first_step: float, loop: float) -> list[float]:
        """This rank's seconds by phase; loop: in all steps, the first one too, without waiting for other ranks."""
        sent = self._sent() - self._sent_before
        forces = max(0.0, loop - first_step - self.contact - sent)
        return [self.set_up or 0.0, first_step, forces, sent + self.waiting, self.contact, self.output]


def of_all_ranks(comm: Any, mine: list[float], wall: float) -> dict[str, Any]:
    """Entries of the summary from each rank's seconds by phase and from the wall time [s]; collective, one message.

    phases: means over ranks, "other" being what is left of the wall time; phases_by_rank: each rank's; load_imbalance:
    work of the busiest rank over the mean, work being forces and contact; communication_share: of the time in steps.
    """
    table = np.array(comm.allgather(mine))
    means = dict(zip(PHASES, table.mean(axis=0).tolist()))
    work = means["forces"] + means["contact"]
    busiest = (table[:, PHASES.index("forces")] + table[:, PHASES.index("contact")]).max()
    steps = work + means["communication"]
    return {
        "phases": {**means, "other": max(0.0, wall - sum(means.values()))},
        "phases_by_rank": {name: column.tolist() for name, column in zip(PHASES, table.T)},
        "load_imbalance": float(busiest) / work if work > 0.0 else None,
        "communication_share": means["communication"] / steps if steps > 0.0 else None,
    }
