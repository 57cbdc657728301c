"""The energy ledger: what went where, summed on each rank as it happens and over ranks only when it is written."""

from dataclasses import dataclass, field

import numpy as np

ACCUMULATED = ("dissipation_internal", "dissipation_numerical", "work_external")
COLUMNS = ("kinetic", "stored", *ACCUMULATED, "balance")


@dataclass
class Ledger:
    """Time integrals of one rank [J]; `values` is in the order of ACCUMULATED. `initial` is the total at time 0, over all ranks."""

    values: np.ndarray = field(default_factory=lambda: np.zeros(len(ACCUMULATED)))
    initial: float | None = None

    def add(self, weight: float, internal: float, numerical: float, external: float) -> None:
        """Add rates [W] times a weight [s]."""
        self.values[0] += weight * internal
        self.values[1] += weight * numerical
        self.values[2] += weight * external

    def row(self, comm, kinetic: float, stored: float) -> dict[str, float]:
        """The ledger over all ranks from this rank's kinetic and stored energy [J]; collective.

        balance = kinetic + stored + dissipation - external work - initial total: zero but for the time integration.
        """
        total = np.empty(2 + len(ACCUMULATED))
        comm.Allreduce(np.concatenate(([kinetic, stored], self.values)), total)
        result = dict(zip(COLUMNS, map(float, total)))
        energy = result["kinetic"] + result["stored"] + result["dissipation_internal"] + result["dissipation_numerical"]
        energy -= result["work_external"]
        if self.initial is None:
            self.initial = energy
        result["balance"] = energy - self.initial
        return result
