"""Impulses before a step of stages, as the forces that they are half of."""

from typing import Any

import numpy as np


class CarriedImpulses:
    """Impulses F dt/2 that contact gives before a step of stages.

    Given at once, velocities within the step of what rests under F and the stresses would swing between F dt/2m and
    -F dt/2m, and damping would take from that: a block at rest on a plane had .2 of its energy out of balance in 900
    steps. So F acts in all stages, and F dt/2 is taken back at the end, where contact gives half of the new force: the
    same step where nothing else acts, v' = v + dt (F + F')/2m, x' = x + dt v + dt^2 F/2m.
    """

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`."""
        self.system = system
        self.waiting: list[tuple[np.ndarray, np.ndarray]] = []

    def take(self, impulse: np.ndarray, rows: np.ndarray) -> None:
        """Impulses (k, d) [N s] on the parts of rows (k,) on this side of mirror planes."""
        self.waiting.append((impulse.copy(), rows.copy()))

    def begin(self) -> None:
        """Of several steps of its own in a common one, the first has the impulses."""
        while self.waiting and self.system.substeps > 1:
            self.system.kick(*self.waiting.pop(0))

    def act(self, force: np.ndarray, step: float) -> None:
        """Add the forces to those of a stage of a step [s], (n, 8), on whole particles [N].

        Held components have none: contact books itself what it takes to hold them.
        """
        held = self.system.held_components()
        for impulse, rows in self.waiting:
            acting = impulse if held is None else np.where(held[rows], 0.0, impulse)
            force[rows, : impulse.shape[1]] += acting * (2.0 / step / self.system.share[rows, None])

    def end(self) -> None:
        """Take back what the closing half has of the first force, after the last stage."""
        while self.waiting:
            impulse, rows = self.waiting.pop(0)
            self.system.kick(-impulse, rows)
