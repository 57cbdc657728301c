"""Fields of several systems: a file a system, and one that shows them all as the blocks of a temporal collection.

Source: VTKHDF specification, version 2.2, "Partitioned dataset collection". Readers take the times from the
first block, which is therefore written last.
"""

import re
from pathlib import Path
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import maximum, minimum
from parsolid.output import vtkhdf
from parsolid.output.errors import together
from parsolid.output.fields import Fields, FieldSeries


class FieldBlocks:
    """Writes steps of several blocks; each has a `FieldSeries` of its own beside the file at `path`."""

    def __init__(self, comm: Any, path: Path, names: list[str], capacity: int, resume_at: float | None = None):
        """names: of the blocks, each with another; the rest as in `FieldSeries`."""
        self._comm, self.path = comm, path
        self._files = {_plain(name): path.with_name(f"{path.stem}_{_plain(name)}{path.suffix}") for name in names}
        self.series = [
            FieldSeries(comm, file, capacity, resume_at, index=number)
            for number, file in enumerate(self._files.values())
        ]
        # of each block the first identifier of every body and its row, found at the first write
        self._firsts: list[tuple[np.ndarray, np.ndarray] | None] = [None] * len(names)

    def write(self, time: float, number: int, position: np.ndarray, varying: Fields, constant: Fields) -> None:
        """Add a step [s] of one block; constant: "identifier" (n,), those of a body in one piece, "body" (n,) and more.

        Collective; raises OutputError on all ranks.
        """
        series, identifier, body = self.series[number], constant["identifier"], constant["body"]
        firsts = self._firsts[number] or self._first_of_bodies(identifier, body)
        self._firsts[number] = firsts
        series.write(time, identifier - firsts[0][body] + firsts[1][body], position, varying, constant)

    def collect(self) -> None:
        """Write the file that shows the blocks, once they are there; collective."""
        with together(self._comm, f"cannot write {self.path}"):
            if self._comm.rank == 0 and (not self.path.exists() or vtkhdf.collected(self.path) != self._files):
                partial = self.path.with_name(self.path.name + ".partial")
                vtkhdf.collect(partial, self._files)
                partial.replace(self.path)

    def _first_of_bodies(self, identifier: np.ndarray, body: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """First identifier and first row of every body; collective."""
        count = maximum(self._comm, int(body.max(initial=-1))) + 1
        least = np.full(count, np.iinfo(np.int64).max)
        np.minimum.at(least, body, identifier)
        first = minimum(self._comm, least)
        sizes = sums(self._comm, np.bincount(body, minlength=count))
        order = np.argsort(first, kind="stable")
        rows = np.zeros(count, np.int64)
        rows[order[1:]] = np.cumsum(sizes[order])[:-1]
        return first, rows


def _plain(name: str) -> str:
    """A name that files and groups may have."""
    return re.sub(r"[^A-Za-z0-9_-]", "_", name)
