"""What an iterative solver gives back."""

from typing import NamedTuple

import numpy as np


class Solution(NamedTuple):
    """value (n, d): the solution on this rank; residual: the 2-norm of what is left over all ranks; reason: why it
    stopped early.
    """

    value: np.ndarray
    iterations: int
    residual: float
    converged: bool
    reason: str = ""
