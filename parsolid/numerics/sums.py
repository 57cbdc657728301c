"""Sums whose bits do not depend on zeros among what is summed."""

import numpy as np


def in_turn(values: np.ndarray) -> float:
    """The sum of an array, one number after the other; numpy's own, of pairs, has other bits with zeros in between."""
    return float(np.cumsum(values)[-1]) if values.size else 0.0
