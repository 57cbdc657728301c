"""Numbered rows that ranks keep in equal slices: brought to their keepers, and asked of them, by their numbers."""

from collections.abc import Callable

import numpy as np
from mpi4py import MPI

from .migration import migrate


class Slices:
    """Numbers 0 .. count - 1, of which this rank keeps first .. last - 1: those from count * rank // size on.

    Nobody holds a table of keepers: they follow from the numbers. All calls but `keepers` are collective.
    """

    def __init__(self, comm: MPI.Comm, count: int) -> None:
        self.comm, self.count = comm, count
        self.first, self.last = self.bounds(comm.rank)

    def __len__(self) -> int:
        """How many numbers this rank keeps."""
        return self.last - self.first

    def bounds(self, rank: int) -> tuple[int, int]:
        """First number that a rank keeps, and the one after its last."""
        return self.count * rank // self.comm.size, self.count * (rank + 1) // self.comm.size

    def keepers(self, numbers: np.ndarray) -> np.ndarray:
        """Ranks (n,) that keep numbers (n,)."""
        return np.asarray(((np.asarray(numbers, np.int64) + 1) * self.comm.size - 1) // max(self.count, 1))

    def deliver(self, numbers: np.ndarray, **rows: np.ndarray) -> dict[str, np.ndarray]:
        """Bring rows (n, ...) to the keepers of their numbers (n,).

        Returns what has come to this rank: "number", less its first one, and the rows by name, in the order of the
        ranks that they come from and then as they stood there.
        """
        come = migrate(self.comm, self.keepers(numbers), {"number": np.asarray(numbers, np.int64), **rows})
        come["number"] -= self.first
        return come

    def ask(
        self, numbers: np.ndarray, answer: Callable[[dict[str, np.ndarray]], np.ndarray], **rows: np.ndarray
    ) -> np.ndarray:
        """What the keepers of numbers (n,) answer to rows (n, ...): (n, ...), in the order of the numbers.

        answer: of what `deliver` gives, on every rank, an array with a row for each that was asked.
        """
        if self.comm.size == 1:
            return answer({"number": np.asarray(numbers, np.int64), **rows})
        place, rank = np.arange(len(numbers)), np.full(len(numbers), self.comm.rank)
        asked = self.deliver(numbers, place_=place, rank_=rank, **rows)
        back = migrate(self.comm, asked["rank_"], {"place": asked["place_"], "told": answer(asked)})
        result = np.empty_like(back["told"])
        result[back["place"]] = back["told"]
        return result

    def fetch(self, numbers: np.ndarray, kept: np.ndarray) -> np.ndarray:
        """Rows (n, ...) of numbers (n,) in an array of which this rank keeps its slice `kept`."""
        return self.ask(numbers, lambda asked: kept[asked["number"]])


def count_before(comm: MPI.Intracomm, count: int) -> tuple[int, int]:
    """Sum of a number over the ranks before this one, and over all; collective."""
    upto = comm.scan(count)
    return upto - count, comm.allreduce(count)
