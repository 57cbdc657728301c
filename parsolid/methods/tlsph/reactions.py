"""Force, moment and work of the conditions of a scene that tell them, mean over a step."""

from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.reactions import moments
from parsolid.methods.tlsph.settings import FIXED_WALLS


class Taken(NamedTuple):
    """Arrays of a stage before the motion is advanced: pair forces (n, 8) [N] of whole particles with what holds those
    of slides, their masses and tributary shares, accelerations of loads or None, time [s]."""

    force: np.ndarray
    mass: np.ndarray
    share: np.ndarray
    loads: np.ndarray | None
    supports: list[np.ndarray]
    time: float
    before: bool


# rows (k,) and forces (k, d) [N] on their tributary parts
Found = tuple[np.ndarray, np.ndarray]


@dataclass
class Reaction:
    """One condition: force and moment [N, N m] on the body about a point, mean over a step, and the step's work [J].

    find: its forces at a stage; driven: whether velocities are prescribed, so that inertia is part of the force.
    """

    name: str
    about: np.ndarray
    find: Callable[[Taken], Found]
    driven: Callable[[], Found] | None = None
    force: np.ndarray = field(default_factory=lambda: np.zeros(0))
    moment: np.ndarray = field(default_factory=lambda: np.zeros(0))
    work: float = 0.0
    begun: np.ndarray = field(default_factory=lambda: np.zeros(0))
    pending: list[Found] = field(default_factory=list)


def held_against(stage: Taken, rows: np.ndarray, components: np.ndarray) -> np.ndarray:
    """Forces (k, d) [N] that hold components (k, d) of particles at rows against pair forces and loads."""
    d = components.shape[1]
    resisted = stage.force[rows, :d] + stage.force[rows, 4 : 4 + d]
    if stage.loads is not None:
        resisted = resisted + stage.mass[rows, None] * stage.loads[rows, :d]
    return np.asarray(-stage.share[rows, None] * resisted * components)


class Reactions:
    """Of all conditions that tell them; walls: `fixed_walls.FixedWalls`, whose work is told, too, or None."""

    def __init__(self, particles: Any, reactions: list[Reaction], walls: Any = None):
        self.particles, self.all, self.walls = particles, reactions, walls

    def begin(self) -> None:
        """Of a step."""
        velocity = self.particles.owned_rows("velocity")
        if self.walls is not None:
            self.walls.work = 0.0
        for one in self.all:
            d = velocity.shape[1]
            one.force, one.moment, one.work = np.zeros(d), np.zeros(1 if d == 2 else 3), 0.0
            if one.driven is not None:
                one.begun = velocity[one.driven()[0]].copy()

    def find(self, stage: Taken) -> None:
        """Forces of a stage, before the arrays change."""
        if self.walls is not None:
            self.walls.meet(stage.before)
        for one in self.all:
            one.pending = [one.find(stage)]

    def book(self, weight: float, duration: float) -> None:
        """Count what was found with a weight, and its work over a duration [s] with the present velocities."""
        of = self.particles.owned_rows
        if self.walls is not None:
            self.walls.book(duration)
        for one in self.all:
            for rows, forces in one.pending:
                self._count(one, rows, weight * forces)
                one.work += duration * float(np.sum(forces * of("velocity")[rows]))

    def _count(self, one: Reaction, rows: np.ndarray, forces: np.ndarray) -> None:
        arms = self.particles.owned_rows("position")[rows] - one.about
        one.force += forces.sum(axis=0)
        one.moment += moments(arms, forces)

    def finish(self, step: float, mass: np.ndarray, share: np.ndarray, ledger: Any) -> None:
        """Add the inertia of what is driven, and tell the ledger of the work of a step [s]."""
        velocity = self.particles.owned_rows("velocity")
        if self.walls is not None:
            ledger.add_term(FIXED_WALLS, self.walls.work)
        for one in self.all:
            if one.driven is not None and step > 0.0:
                rows, components = one.driven()
                tributary = (mass[rows] * share[rows])[:, None] * components
                self._count(one, rows, tributary * (velocity[rows] - one.begun) / step)
                one.work += 0.5 * float(np.sum(tributary * (velocity[rows] ** 2 - one.begun**2)))
            ledger.add_term(f"{one.name}.work", one.work)

    def told(self, name: str) -> np.ndarray | None:
        """Force (d,) and moment (1 or 3,) of this rank's particles, None for a condition that is not here."""
        for one in self.all:
            if one.name == name:
                d = self.particles.owned_rows("position").shape[1]
                none = np.zeros(d + (1 if d == 2 else 3))
                return np.concatenate([one.force, one.moment]) if len(one.force) else none
        return None
