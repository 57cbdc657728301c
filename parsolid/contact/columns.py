"""State of candidates, kept in fields of their particles with a column for each other body that is near."""

from typing import Any

import numpy as np

from parsolid.collective import raise_together
from parsolid.contact.search import Search
from parsolid.kernels import kernel


@kernel
def assign_columns(row, other, partner, column, fresh):
    """Assign each candidate (n,) the column of its particle's fields that holds the state against the other body.

    row, other (n,): particle, and number of the other body; all candidates of a particle are among them. partner
    (particles, columns): other body of each column, updated here. Results: column (n,), and fresh (n,): whether the
    column is new. Returns whether there were enough columns.
    """
    kept, enough = np.zeros(partner.shape, np.bool_), True
    for m in range(len(row)):
        column[m], fresh[m] = -1, False
        for k in range(partner.shape[1]):
            if partner[row[m], k] == other[m]:
                kept[row[m], k], column[m] = True, k
    for m in range(len(row)):
        if column[m] < 0:
            fresh[m] = True
            for k in range(partner.shape[1]):
                if column[m] < 0 and not kept[row[m], k]:
                    kept[row[m], k], column[m], partner[row[m], k] = True, k, other[m]
            enough = enough and column[m] >= 0
    return enough


class Columns:
    """Where the candidates of a search have their state. fresh (owned,): whether a candidate has none yet."""

    def __init__(self, comm: Any, search: Search, most: int) -> None:
        """most: number of columns; raises SolverError on all ranks where a particle needs more. Collective."""
        self._search, self.fresh, enough = search, np.zeros(search.owned, np.bool_), True
        # for each segment, places in fields of `most` columns a particle
        self._slots = []
        for segment in search.segments:
            partner = segment.particles.storage("contact_partner").reshape(-1, most)
            column, other = np.zeros(len(segment.rows), np.int64), search.broad_phase.other[segment.pair]
            enough = assign_columns(segment.rows, other, partner, column, self.fresh[segment.here]) and enough
            self._slots.append(segment.rows * most + column)
        fault = f"contact: expected at most {most} bodies within reach of one particle, found more"
        raise_together(comm, None if enough else fault)

    def read(self, name: str, width: int) -> np.ndarray:
        """Values (owned, width) of the candidates in a field with `width` numbers a column."""
        result = np.zeros((self._search.owned, width))
        for segment, slots in zip(self._search.segments, self._slots):
            result[segment.here] = segment.particles.storage(name).reshape(-1, width)[slots]
        return result

    def write(self, name: str, values: np.ndarray) -> None:
        """Write values (owned, width) of the candidates to a field."""
        for segment, slots in zip(self._search.segments, self._slots):
            segment.particles.storage(name).reshape(-1, values.shape[1])[slots] = values[segment.here]
