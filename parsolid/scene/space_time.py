"""Values of place and time as sums of products of both, of which only the factors in time are found anew."""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import numpy as np


class Mode(NamedTuple):
    """What a factor in time (by its number; None: 1) is multiplied by in one component: a number, or (n,)."""

    component: int
    factor: int | None
    values: Any


class Separated(NamedTuple):
    """A course at some places: each component is the sum of its modes times their factors.

    factors(time, before): at a time [s], of a jump just after it or just before; pointwise: whether each is (n,), of
    what is no such product, else it is a number. Warnings of numpy are the caller's to silence.
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


def evaluated(course: Any, points: np.ndarray, time: float, before: bool) -> np.ndarray:
    """Values (n, components) of a course with a method `separated` at points (n, d) [m] and a time [s]."""
    with np.errstate(all="ignore"):
        values = course.separated(points).values(time, before)
    result = np.empty((len(points), len(values)))
    for i, one in enumerate(values):
        result[:, i] = one
    return result
