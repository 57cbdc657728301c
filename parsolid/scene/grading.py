"""Nodes whose distance changes along a line, slowly and smoothly."""

from functools import lru_cache

import numpy as np


@lru_cache(maxsize=64)
def graded_shares(count: int, grading: tuple[float, ...]) -> np.ndarray:
    """Places (count,) of nodes on a line from 0 to 1, which they meet exactly.

    grading: what spacings at equal parts of the node numbers, the first and the last among them, are to one another;
    between them the logarithm of the spacing is a parabola of the node number, or linear.
    """
    knots = np.linspace(0.0, 1.0, len(grading))
    logarithms = np.polynomial.Polynomial.fit(knots, np.log(grading), len(grading) - 1)
    spacings = np.exp(logarithms((np.arange(count - 1) + 0.5) / (count - 1)))
    places = np.concatenate(([0.0], np.cumsum(spacings)))
    result: np.ndarray = places / places[-1]
    # every caller has the same array
    result.flags.writeable = False
    return result
