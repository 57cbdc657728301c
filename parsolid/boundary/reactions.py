"""Force, moment and work of the conditions of a scene that report them."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.scene.boundaries import Condition


class Reaction:
    """Of one condition: its mean force and moment on the bodies over a step, and its work, on this rank.

    name, term: under which the scene asks for it, and the ledger has its work; impulses, duration: the last impulse
    [N s] and its moment (1 or 3) [N m s] about `about`, over a time [s]; sums: of the present step, impulse, its moment
    and the work [J].
    """

    def __init__(self, condition: Condition, dimension: int):
        assert condition.reports is not None
        self.condition, self.name, self.term = condition, condition.reports, f"{condition.reports}.work"
        self.about = np.array(getattr(condition, "moment_about", None) or [0.0] * dimension, float)
        self.impulses: Sequence[float] | np.ndarray = [0.0] * (3 if dimension == 2 else 6)
        self.duration = 1.0
        self.sums = np.zeros(len(self.impulses) + 1)

    @property
    def values(self) -> np.ndarray:
        """Force (d,) [N] and moment (1 or 3,) [N m]."""
        return np.asarray(self.impulses) / self.duration

    def add(self, places: np.ndarray, impulses: np.ndarray, work: float) -> None:
        """Impulses (d, k) [N s] at places (d, k) [m] in a step, and their work [J]."""
        self.sums[:-1] += self._resultant(places, impulses)
        self.sums[-1] += work

    def set(self, places: np.ndarray, forces: np.ndarray, work: float) -> None:
        """Forces (d, k) [N] at the end of a step in place of their mean, and the work [J] of the step."""
        self.impulses, self.duration = self._resultant(places, forces), 1.0
        self.sums[:-1] = 0.0
        self.sums[-1] += work

    def _resultant(self, places: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Sum and moment of vectors (d, k) at places (d, k)."""
        arm = places - self.about[:, None]
        if len(arm) == 2:
            return np.array([*vectors.sum(axis=1), arm[0] @ vectors[1] - arm[1] @ vectors[0]])
        return np.concatenate([vectors.sum(axis=1), np.cross(arm, vectors, axis=0).sum(axis=1)])


def report_equilibrium(
    conditions: Any,
    places: np.ndarray,
    change: np.ndarray,
    reaction: np.ndarray,
    work: np.ndarray,
    time: float,
    step: float,
) -> None:
    """Let the reactions of `Conditions` take their forces at the end of a step [s] from a time [s], and their works.

    places (d, n) [m]: of the particles at its end; change (n, d) [m]: of their displacement; reaction (n, d) [N]: what
    holds components that do not follow forces, at the end; work (n, d) [J]: what that has done.
    """
    for holder in conditions.holders:
        rows, components = holder.find()
        needed = np.where(components, reaction[rows], 0.0)
        holder.reaction.set(places[:, rows], needed.T, float(np.sum(components * work[rows])))
    of_loads: dict[Reaction, np.ndarray] = {}
    for load, reported_by in conditions.loads_of:
        if reported_by is not None:
            ends = of_loads.setdefault(reported_by, np.zeros((2, *places.shape)))
            for end, (moment, before_jump) in zip(ends, ((time, step == 0.0), (time + step, step > 0.0))):
                rows, values = load.forces(moment, before_jump)
                end[: len(values), rows] += values
    for reported_by, (first, last) in of_loads.items():
        if time == step == 0.0:
            # what held the bodies' start lets go as the first loads come
            first[:] = 0.0
        reported_by.set(places, last, float(np.sum(0.5 * (first + last) * change.T)))
