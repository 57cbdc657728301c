"""Numbers in a checkpointed state that differ between ranks: written rank by rank as rows, not gathered on one."""

from typing import Any

import numpy as np

# the key that stands in a header for such numbers, with the columns in which they are
_COLUMNS = "of_ranks"


class PerRank:
    """Numbers of this rank, as many on all ranks, in a state that is otherwise the same on all."""

    def __init__(self, *values: float) -> None:
        self.values = values


def split_per_rank(state: Any) -> tuple[Any, list[float]]:
    """A state (tables and lists) with columns in place of numbers of ranks, and the row of this rank's numbers."""
    row: list[float] = []

    def without(value: Any) -> Any:
        if isinstance(value, PerRank):
            first = len(row)
            row.extend(map(float, value.values))
            return {_COLUMNS: [first, len(row)]}
        if isinstance(value, dict):
            return {name: without(one) for name, one in value.items()}
        return [without(one) for one in value] if isinstance(value, list) else value

    return without(state), row


def join_per_rank(state: Any, rows: np.ndarray) -> Any:
    """The state that `split_per_rank` took apart, with the numbers (ranks, k) of all ranks that wrote it.

    rows: (ranks, all numbers).
    """
    if isinstance(state, dict):
        if state.keys() == {_COLUMNS}:
            first, last = state[_COLUMNS]
            return rows[:, first:last]
        return {name: join_per_rank(one, rows) for name, one in state.items()}
    return [join_per_rank(one, rows) for one in state] if isinstance(state, list) else state


def own_share(comm: Any, rows: np.ndarray) -> np.ndarray:
    """This rank's part (k,) of numbers (ranks, k) that are summed over ranks.

    On as many ranks as wrote them its own row; on another number the first rank has the sum, the others zero.
    """
    if len(rows) == comm.size:
        return np.asarray(rows[comm.rank])
    return np.asarray(rows.sum(axis=0) * (comm.rank == 0))
