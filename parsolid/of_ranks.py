"""Numbers in a state that each rank keeps for itself: written rank by rank, not gathered."""

from typing import Any

import numpy as np

_PLACE = "of_ranks"


class OfRanks:
    """Numbers of this rank, as many on all ranks, in a state that is otherwise the same on all."""

    def __init__(self, *values: float) -> None:
        self.values = values


def taken_out(state: Any) -> tuple[Any, list[float]]:
    """A state (tables and lists) with places in it where numbers of ranks stood, and these numbers of this rank."""
    numbers: list[float] = []

    def without(value: Any) -> Any:
        if isinstance(value, OfRanks):
            first = len(numbers)
            numbers.extend(map(float, value.values))
            return {_PLACE: [first, len(numbers)]}
        if isinstance(value, dict):
            return {name: without(one) for name, one in value.items()}
        return [without(one) for one in value] if isinstance(value, list) else value

    return without(state), numbers


def put_back(state: Any, rows: np.ndarray) -> Any:
    """The state with the numbers (ranks, k) of all ranks that wrote them in their places; rows: of all numbers."""
    if isinstance(state, dict):
        if state.keys() == {_PLACE}:
            first, last = state[_PLACE]
            return rows[:, first:last]
        return {name: put_back(one, rows) for name, one in state.items()}
    return [put_back(one, rows) for one in state] if isinstance(state, list) else state


def own_share(comm: Any, rows: np.ndarray) -> np.ndarray:
    """What this rank takes of sums over ranks, numbers (ranks, k): its own (k,); on other ranks the first has all."""
    if len(rows) == comm.size:
        return np.asarray(rows[comm.rank])
    return np.asarray(rows.sum(axis=0) * (comm.rank == 0))
