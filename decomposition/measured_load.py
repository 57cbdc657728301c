"""Shares of ranks in a system's particles by which all take as long in the steps of all systems, as measured."""

from typing import Any

import numpy as np

from decomposition.timer import COMMUNICATION

# a new partition must be able to bring the busiest rank so much nearer to the mean
_WORTH = 0.03


class MeasuredLoad:
    """work: this rank's seconds in the steps of each system, kept by the loop; number: of the system among them.

    imbalance: of the busiest rank over the mean in each interval between looks. A particle's cost [s] and the seconds
    of the other systems on each rank are, half of them, those of the last interval, the rest of those before it.
    """

    def __init__(self, comm: Any, work: list[float], number: int) -> None:
        self.comm, self.work, self.number = comm, work, number
        self.imbalance: list[float] = []
        self._seen, self._cost, self._others = np.array(work), np.zeros(comm.size), np.zeros(comm.size)

    def summary(self) -> dict[str, Any]:
        """The imbalance of the first interval and of the last."""
        found = self.imbalance
        return {"measured_imbalance": {"first": found[0], "last": found[-1]}} if found else {}

    def look(self, owned: int) -> np.ndarray | None:
        """Shares (ranks,) of all particles, of which this rank has `owned`, or None where a new partition is not worth
        its price; collective, the same on all ranks."""
        now = np.array(self.work)
        spent, self._seen = now - self._seen, now
        table = np.empty((self.comm.size, 3))
        with COMMUNICATION:
            self.comm.Allgather(np.array([spent[self.number], spent.sum(), owned]), table)
        own, total, count = table.T
        if not total.sum() > 0.0 or not count.sum() > 0.0:
            return None
        self.imbalance.append(float(total.max() / total.mean()))
        # a rank without particles knows no cost of its own
        cost, others = np.where(count > 0.0, own / np.maximum(count, 1.0), own.sum() / count.sum()), total - own
        first = len(self.imbalance) == 1
        self._cost = cost if first else 0.5 * (self._cost + cost)
        self._others = others if first else 0.5 * (self._others + others)
        return shares_of(self._cost, self._others, count)


def shares_of(cost: np.ndarray, others: np.ndarray, count: np.ndarray) -> np.ndarray | None:
    """Shares (ranks,) of particles that bring ranks with `count` (ranks,) of them, which cost them `cost` (ranks,) [s]
    each, and seconds `others` (ranks,) half of the way to equal times; None where they are even."""
    busy, free = cost * count + others, np.zeros(len(count))
    # ranks that are busy enough without any particle get none
    using = cost > 0.0
    for _ in range(len(count)):
        each = np.where(using, 1.0 / np.where(using, cost, 1.0), 0.0)
        level = (count.sum() + (each * others).sum()) / max(each.sum(), 1e-300)
        free = each * (level - others)
        if (free >= 0.0).all():
            break
        using &= free > 0.0
    wanted = 0.5 * (count + free)
    if not using.any() or (cost * wanted + others).max() > busy.max() - 0.5 * _WORTH * busy.mean():
        return None
    return np.asarray(wanted / wanted.sum())
