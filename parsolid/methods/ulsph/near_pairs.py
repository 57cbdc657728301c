"""The pairs of a Verlet list that are within the support or nearly so, for some steps.

Half of the pairs of a list with a skin are beyond the support. Each rank leaves them out of the sweeps until a particle
has moved so far that one might have come within it (dual lists: Pall and Hess, Comput. Phys. Commun. 184, 2013). Sums
are the same to the bit: those pairs would add nothing to them.
"""

import numpy as np

from parsolid.kernels import kernel
from parsolid.pairs.verlet_list import Pairs

# of the support that is listed besides it
_MARGIN = 0.08


@kernel
def have_moved(rows, before, first, motion, most):
    """Whether any of the rows has moved against the first one by `most` or more from a place (rows, d), or is not a
    number; places are columns first.. of motion."""
    for a in range(rows):
        square = 0.0
        for c in range(before.shape[1]):
            square += (motion[a, first + c] - before[a, c] - (motion[0, first + c] - before[0, c])) ** 2
        if not square < most * most:
            return True
    return False


@kernel
def select_near(pairs, weights, dimension, first, length, reach, motion, start, neighbour, near_weights):
    """Write pairs closer than reach h of a pair into start and neighbour, and their weights, if there are some; lengths
    are in a column of motion."""
    count = 0
    for a in range(pairs[0].shape[0] - 1):
        start[a] = count
        for k in range(pairs[0][a], pairs[0][a + 1]):
            b = pairs[1][k]
            h, square = 0.5 * (motion[a, length] + motion[b, length]), 0.0
            for c in range(first, first + dimension):
                square += (motion[b, c] - motion[a, c]) ** 2
            # without a branch, which would be mispredicted at every other pair
            neighbour[count] = b
            if weights is not None:
                near_weights[count] = weights[k]
            count += np.int64(square < (reach * h) ** 2)
    start[-1] = count


class NearPairs:
    """A list of pairs of the first rows of motion, and the near ones of them with their weights."""

    def __init__(self, pairs: Pairs, weights: np.ndarray | None, rows: int, dimension: int, support: float) -> None:
        """weights (pairs,): a number for each pair, or None; support: of the kernel, over the smoothing length."""
        self._all, self._weights, self._rows = pairs, weights, rows
        self._dimension, self._support = dimension, support
        # columns of places and smoothing lengths, see `sweeps`
        self._first, self._length = (2, 5) if dimension == 2 else (4, 7)
        # the last one takes what is no pair
        room = len(pairs.neighbour) + 1
        self._near = Pairs(np.empty_like(pairs.start), np.empty(room, pairs.neighbour.dtype))
        self._near_weights = None if weights is None else np.empty(room)
        self._before: np.ndarray | None = None
        self._most = 0.0

    def find(self, motion: np.ndarray) -> tuple[Pairs, np.ndarray | None]:
        """The pairs that may be within the support, and their weights."""
        if self._before is None or have_moved(self._rows, self._before, self._first, motion, self._most):
            # until a particle has moved by nearly half of the margin
            rows, first = self._rows, self._first
            self._before = motion[:rows, first : first + self._dimension].copy()
            self._most = 0.499 * _MARGIN * self._support * float(motion[:rows, self._length].min(initial=np.inf))
            columns = self._dimension, first, self._length, (1.0 + _MARGIN) * self._support
            select_near(self._all, self._weights, *columns, motion, *self._near, self._near_weights)
        return self._near, self._near_weights

    def arrays(self) -> list[np.ndarray]:
        """For what counts memory."""
        all_of_them = [self._before, *self._near, self._weights, self._near_weights]
        return [one for one in all_of_them if one is not None]
