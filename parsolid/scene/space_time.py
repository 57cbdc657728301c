"""Functions of place and time, which loads and prescribed motion follow.

Most are sums of products of a function of time and one of place, of which only the former are found anew.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np


class SpaceTimeFunction:
    """Values (components) at reference places and times."""

    @property
    def depends_on_time(self) -> bool:
        """Whether they change."""
        return True

    @property
    def jump_times(self) -> Sequence[float]:
        """Times [s] at which they jump."""
        return ()

    @property
    def two_sided_times(self) -> frozenset[float]:
        """Times [s] at which the values just before and just after differ."""
        return frozenset(self.jump_times)

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        """Values (n, components) at points (n, d) [m] and a time [s]; where they jump just after, or just before it."""
        raise NotImplementedError

    def at(self, points: np.ndarray) -> Callable[[float, bool], Sequence[Any]]:
        """The components at points (n, d) [m] as a function of `time` and `before`, see `evaluate`: (n,), or a number
        where it is the same at all points. Warnings of numpy are the caller's to silence."""
        return lambda time, before: list(self.evaluate(points, time, before).T)


class Mode(NamedTuple):
    """What a factor in time (by its number; None: 1) is multiplied by in one component: a number, or (n,)."""

    component: int
    factor: int | None
    values: Any


class Separated(NamedTuple):
    """A function at some places: each component is the sum of its modes times their factors.

    factors(time, before): at a time [s], see `SpaceTimeFunction.evaluate`; pointwise: whether each is (n,), of what is
    no such product, else it is a number.
    """

    components: int
    factors: Callable[[float, bool], Sequence[Any]]
    pointwise: list[bool]
    modes: list[Mode]

    def values(self, time: float, before: bool) -> list[Any]:
        """Of each component a number, where it is the same at all places, or (n,)."""
        factors = self.factors(time, before)
        result: list[Any] = [0.0] * self.components
        for component, number, values in self.modes:
            result[component] = result[component] + (values if number is None else factors[number] * values)
        return result


class SeparatedFunction(SpaceTimeFunction):
    """A function that is known by its factors and modes."""

    def separated(self, points: np.ndarray) -> Separated:
        """The values at points (n, d) [m]."""
        raise NotImplementedError

    def evaluate(self, points: np.ndarray, time: float = 0.0, before: bool = False) -> np.ndarray:
        with np.errstate(all="ignore"):
            values = self.separated(points).values(time, before)
        result = np.empty((len(points), len(values)))
        for i, one in enumerate(values):
            result[:, i] = one
        return result

    def at(self, points: np.ndarray) -> Callable[[float, bool], Sequence[Any]]:
        with np.errstate(all="ignore"):
            return self.separated(points).values
