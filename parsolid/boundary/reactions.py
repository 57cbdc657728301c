"""Force, moment and work of the conditions of a scene that report them."""

from typing import Any

import numpy as np

from parsolid.scene.boundaries.condition import Condition


class Reaction:
    """Of one condition: its mean force and moment on the bodies over a step, and its work, on this rank.

    name: under which the scene asks for it; values: force (d,) [N] and moment (1 or 3,) [N m] about `about`.
    """

    def __init__(self, condition: Condition, dimension: int):
        assert condition.reports is not None
        self.condition, self.name = condition, condition.reports
        self.about = np.array(getattr(condition, "moment_about", None) or [0.0] * dimension)
        self.values = np.zeros(dimension + (1 if dimension == 2 else 3))
        self._impulse, self._work = np.zeros_like(self.values), 0.0

    def add(self, places: np.ndarray, impulses: np.ndarray, work: float) -> None:
        """Impulses (d, k) [N s] at places (d, k) [m] in a step, and their work [J]."""
        self._impulse += self._resultant(places, impulses)
        self._work += work

    def set(self, places: np.ndarray, forces: np.ndarray, work: float) -> None:
        """Forces (d, k) [N] at the end of a step in place of their mean, and the work [J] of the step."""
        self.values = self._resultant(places, forces)
        self._impulse[:] = 0.0
        self._work += work

    def _resultant(self, places: np.ndarray, vectors: np.ndarray) -> np.ndarray:
        """Sum and moment of vectors (d, k) at places (d, k)."""
        arm = places - self.about[:, None]
        if len(arm) == 2:
            return np.array([*vectors.sum(axis=1), arm[0] @ vectors[1] - arm[1] @ vectors[0]])
        return np.concatenate([vectors.sum(axis=1), np.cross(arm, vectors, axis=0).sum(axis=1)])

    def finish(self, step: float, ledger: Any) -> None:
        """The impulses of a step [s] are its mean force; the ledger takes the work."""
        if step > 0.0 and self._impulse.any():
            self.values = self._impulse / step
        ledger.add_term(f"{self.name}.work", self._work)
        self._impulse, self._work = np.zeros_like(self.values), 0.0
