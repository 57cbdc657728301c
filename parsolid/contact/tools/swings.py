"""What leapfrog's kinetic energy has at the end of a step of the swings from its middle, where tools press."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.contact.swings import book_swings
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.particles.declaration import Field

# place [m] and velocity [m/s] at the start of a step and force of all tools [N], a row a particle
_START = "tool_start"


def declare_swing(system: ParticleSystem) -> None:
    """What particles of a system that tools touch keep of the start of a step, where it swings."""
    if system.verlet is not None:
        system.particles.declare(Field(_START, 3 * system.dimension, "1"))


class Swing:
    """All tools on one system on this rank, see `contact.swings`."""

    def __init__(self, system: ParticleSystem, touches: Sequence[Any]) -> None:
        """touches: `touch.Touch` of the system."""
        self.system, self.touches = system, touches
        self.begun, self._layout = False, -1

    def begin(self) -> None:
        """Keep the start of a step, before any tool kicks."""
        system = self.system
        self.begun = system.verlet is not None and any(touch.greatest_square > 0.0 for touch in self.touches)
        self._layout = system.particles.layout
        if not self.begun:
            return
        rows, d = system.particles.owned_rows, system.dimension
        start = rows(_START)
        start[:, :d], start[:, d : 2 * d], start[:, 2 * d :] = rows("position"), rows("velocity"), 0.0
        for touch in self.touches:
            start[touch.rows, 2 * d :] += touch.forces[0]

    def end(self, step: float, ledger: EnergyLedger) -> None:
        """Into the ledger what there is more of them than at the start of a step [s]; after all tools have kicked."""
        system, d = self.system, self.system.dimension
        # what has come to a rank that none touches has its start with it
        here = self.begun or (system.verlet is not None and self._layout != system.particles.layout)
        if not here:
            return
        owned = system.particles.owned_rows
        start, now, more = owned(_START), np.zeros((system.owned, d)), np.zeros((system.owned, d))
        for touch in self.touches:
            now[touch.rows] += touch.forces[0]
            more[touch.rows] += touch.forces[1]
        rows = np.flatnonzero(start[:, 2 * d :].any(axis=1) | now.any(axis=1))
        pressed = start[rows, 2 * d :]
        # a rank to which a particle goes later shall not take this for a force of its step
        start[rows, 2 * d :] = 0.0
        if step == 0.0 or not len(rows):
            return
        share = np.ascontiguousarray(system.share[: system.owned][rows])
        # the forces are those on parts of particles
        forces = np.stack((pressed, now[rows], more[rows])) / share[:, None]
        held = system.held_components()
        held = None if held is None or not held[rows].any() else held[rows]
        kept = np.ascontiguousarray(start[rows, : 2 * d])
        book_swings(ledger, system, rows, step, forces, held, kept)
