"""The energy ledger: what went where, summed on each rank as it happens and over ranks only when it is written."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from parsolid.scene import Scene
from parsolid.scene.contact import CONTACT_TERMS

ACCUMULATED = ("dissipation_internal", "dissipation_numerical", "work_external")
COLUMNS = ("kinetic", "stored", *ACCUMULATED, "balance")


@dataclass
class Ledger:
    """Time integrals of one rank [J]: `values` in the order of ACCUMULATED and then of `terms`, a method's own.

    terms: name -> sign in the balance: 1 for energy that has left, -1 for energy supplied, 0 for what is only shown.
    `initial` is the total at time 0, over all ranks.
    """

    terms: dict[str, int] = field(default_factory=dict)
    initial: float | None = None

    def __post_init__(self) -> None:
        self.values = np.zeros(len(ACCUMULATED) + len(self.terms))
        self._place = {name: len(ACCUMULATED) + i for i, name in enumerate(self.terms)}

    @property
    def columns(self) -> list[str]:
        """Names of what `row` gives, in order."""
        return [*COLUMNS[:-1], *self.terms, COLUMNS[-1]]

    def add_term(self, name: str, energy: float) -> None:
        """Add to one of the method's own terms [J]."""
        self.values[self._place[name]] += energy

    def add(self, weight: float, internal: float, numerical: float, external: float) -> None:
        """Add rates [W] times a weight [s]."""
        self.values[0] += weight * internal
        self.values[1] += weight * numerical
        self.values[2] += weight * external

    def row(self, comm: Any, kinetic: float, stored: float) -> dict[str, float]:
        """The ledger over all ranks from this rank's kinetic and stored energy [J]; collective.

        balance = kinetic + stored + dissipation - external work - initial total, with the method's own terms by their
        signs: zero but for the time integration.
        """
        total = np.empty(2 + len(self.values))
        comm.Allreduce(np.concatenate(([kinetic, stored], self.values)), total)
        result = dict(zip(self.columns, map(float, total)))
        energy = result["kinetic"] + result["stored"] + result["dissipation_internal"] + result["dissipation_numerical"]
        energy -= result["work_external"]
        energy += sum(sign * result[name] for name, sign in self.terms.items())
        if self.initial is None:
            self.initial = energy
        result["balance"] = energy - self.initial
        return result


def viscous_terms_of(scene: Scene) -> tuple[str, ...]:
    """The entries of a row that artificial viscosity fills, of all methods of a scene."""
    return tuple(dict.fromkeys(name for system in scene.systems for name in system.settings.viscous_terms))


def terms_of(scene: Scene) -> dict[str, int]:
    """The energy terms that the methods and contacts of a scene add, with their signs."""
    terms = {name: sign for system in scene.systems for name, sign in system.settings.ledger_terms.items()}
    return terms | (CONTACT_TERMS if scene.contact or scene.tools else {})
