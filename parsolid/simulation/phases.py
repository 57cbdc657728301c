"""Where a run's time goes: each rank adds up its own, and all ranks hear of it at the end."""

from typing import Any

import numpy as np

# in the order in which they are told
PHASES = ("set_up", "first_step", "forces", "communication", "contact", "output")


class Phases:
    """Seconds of this rank, without those of the first step, which also loads or compiles kernels.

    waiting: for the one agreement of all ranks in a step; contact: between steps, of contact and tools, with the
    messages of their own; output: history, fields, checkpoints.
    """

    def __init__(self) -> None:
        # until the first step begins; None before that
        self.set_up: float | None = None
        self.waiting, self.contact, self.output = 0.0, 0.0, 0.0
        # in messages: of systems in their steps, on the wall; of all that acts in a step, of the processor
        self.sent, self.sent_processor = 0.0, 0.0

    def begin(self) -> None:
        """Count steps and messages from now on; what has been written stays counted."""
        self.waiting, self.contact, self.sent, self.sent_processor = 0.0, 0.0, 0.0, 0.0

    def seconds(self, first_step: float, loop: float) -> list[float]:
        """This rank's seconds by phase; loop: in all steps, the first one too, without waiting for other ranks."""
        forces = max(0.0, loop - first_step - self.contact - self.sent)
        return [self.set_up or 0.0, first_step, forces, self.sent + self.waiting, self.contact, self.output]


def of_all_ranks(comm: Any, mine: list[float], wall: float, work_processor: float = 0.0) -> dict[str, Any]:
    """Entries of the summary from each rank's seconds by phase and from the wall time [s]; collective, one message.

    work_processor: seconds [s] of this rank's processor in forces and contact, without messages and the first step.

    phases: means over ranks, "other" being what is left of the wall time; phases_by_rank: each rank's; load_imbalance:
    work of the busiest rank over the mean, work being forces and contact; communication_share: of the time in steps.
    """
    every = np.empty((comm.size, len(PHASES) + 1))
    comm.Allgather(np.array([*mine, work_processor]), every)
    table, processor = every[:, :-1], every[:, -1]
    means = dict(zip(PHASES, table.mean(axis=0).tolist()))
    work = means["forces"] + means["contact"]
    busiest = (table[:, PHASES.index("forces")] + table[:, PHASES.index("contact")]).max()
    steps = work + means["communication"]
    return {
        "phases": {**means, "other": max(0.0, wall - sum(means.values()))},
        "phases_by_rank": {name: column.tolist() for name, column in zip(PHASES, table.T)},
        "work_processor_seconds_by_rank": processor.tolist(),
        "load_imbalance": float(busiest) / work if work > 0.0 else None,
        "communication_share": means["communication"] / steps if steps > 0.0 else None,
    }
