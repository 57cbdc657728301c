"""Whether energy is kept: the ledger's balance against the largest energy a run has shown."""

from collections.abc import Mapping

import numpy as np

# share of the largest energy beyond which no stable run is off
_BROKEN = 0.2
# of the methods' energy scale, what rounding leaves
_ROUND_OFF = 1e-12


class EnergyBalance:
    """Judges rows of the ledger.

    largest: the largest kinetic or stored energy or external work so far [J]; broken: the first balance [J] that was
    beyond what any stable run shows, None while there was none.
    """

    def __init__(self) -> None:
        self.largest = 0.0
        self.broken: float | None = None

    def judge(self, row: Mapping[str, float], scale: float) -> None:
        """Take a row in; scale: the energy [J] of which the balance has the round-off in any case."""
        self.largest = max(self.largest, *(abs(row[name]) for name in ("kinetic", "stored", "work_external")))
        allowed = _BROKEN * self.largest + _ROUND_OFF * scale + np.finfo(float).tiny
        if not abs(row["balance"]) <= allowed:
            self.broken = row["balance"]

    def relative(self, balance: float, scale: float) -> float | None:
        """A balance [J] over the largest energy, over the scale where that is round-off of it.

        None where there is neither.
        """
        over = self.largest if self.largest > _ROUND_OFF * scale else scale
        return balance / over if over > 0.0 else None
