"""The energy ledger: what went where, summed on each rank as it happens and over ranks only when it is written."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from parsolid.methods.protocol import EnergyLedger
from parsolid.scene import Scene
from parsolid.scene.contact import TIE_TERMS, energy_terms
from parsolid.scene.observation import STRAIN_ENERGY, stored_column

ACCUMULATED = ("material_dissipation", "numerical_dissipation", "external_work")


@dataclass
class Ledger:
    """Time integrals of one rank [J]: `values` in the order of ACCUMULATED and then of `terms`, a method's own.

    terms: name -> sign in the balance: 1 for energy that has left, -1 for energy supplied, 0 for what is only shown.
    `initial` is the total at time 0, over all ranks; `last_work`: the external work of the last step, over all ranks,
    by the last `row` [J]; stored: what stored energy is called, see `scene.observation.stored_column`.
    """

    terms: dict[str, int] = field(default_factory=dict)
    initial: float | None = None
    stored: str = STRAIN_ENERGY

    def __post_init__(self) -> None:
        self.values = [0.0] * (len(ACCUMULATED) + len(self.terms))
        self._work_before, self.last_work = 0.0, 0.0
        self._place = {name: len(ACCUMULATED) + i for i, name in enumerate(self.terms)}

    @property
    def columns(self) -> list[str]:
        """Names of what `row` gives, in order."""
        return ["kinetic", self.stored, *ACCUMULATED, *self.terms, "energy_error"]

    def of(self, names: dict[str, str]) -> EnergyLedger:
        """The ledger for a system, whose own terms have these names here."""
        return self if all(name == here for name, here in names.items()) else OfSystem(self, names)

    def begin_step(self) -> None:
        """Let the work of a step begin."""
        self._work_before = self.values[2]

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

        energy_error = kinetic + stored + dissipation - external work - initial total, with the method's own terms by
        their signs: zero but for the time integration.
        """
        total = np.empty(3 + len(self.values))
        comm.Allreduce(np.concatenate(([kinetic, stored], self.values, [self.values[2] - self._work_before])), total)
        self.last_work = float(total[-1])
        result = dict(zip(self.columns, map(float, total)))
        energy = result["kinetic"] + result[self.stored]
        energy = energy + result["material_dissipation"] + result["numerical_dissipation"] - result["external_work"]
        energy += sum(sign * result[name] for name, sign in self.terms.items())
        if self.initial is None:
            self.initial = energy
        result["energy_error"] = energy - self.initial
        return result


class OfSystem:
    """The ledger as one system fills it, whose terms have other names there."""

    def __init__(self, ledger: Ledger, names: dict[str, str]) -> None:
        self.add, self._add_term, self._names = ledger.add, ledger.add_term, names

    def add_term(self, name: str, energy: float) -> None:
        """Add to one of the method's own terms [J]."""
        self._add_term(self._names.get(name, name), energy)


def ledger_of(scene: Scene) -> Ledger:
    """The empty ledger of a scene."""
    return Ledger(terms_of(scene), stored=stored_column(body.material for body in scene.bodies))


def names_of_terms(scene: Scene) -> list[dict[str, str]]:
    """For each system its method's energy terms -> names in the ledger.

    A term that an earlier method counts with another sign has the method's kind in its name.
    """
    signs: dict[str, int] = {}
    names = []
    for system in scene.systems:
        terms, kind = system.settings.energy_terms(scene, system.bodies), system.settings.kind
        own = {name: name if signs.get(name, sign) == sign else f"{name}_{kind}" for name, sign in terms.items()}
        signs |= {own[name]: sign for name, sign in terms.items()}
        names.append(own)
    return names


def viscous_terms_of(scene: Scene) -> tuple[str, ...]:
    """The entries of a row that artificial viscosity fills, of all methods of a scene."""
    found = dict[str, None]()
    for system, names in zip(scene.systems, names_of_terms(scene)):
        found |= dict.fromkeys(names[term] for term in system.settings.viscous_terms if term in names)
    return tuple(found)


def terms_of(scene: Scene) -> dict[str, int]:
    """The energy terms that the methods and contacts of a scene and their bodies' materials add, with their signs."""
    terms: dict[str, int] = {}
    for system, names in zip(scene.systems, names_of_terms(scene)):
        own = system.settings.energy_terms(scene, system.bodies)
        terms |= {names[name]: sign for name, sign in own.items()}
    works = {f"{one.reports}.work": 0 for one in scene.boundaries if one.reports is not None}
    met = energy_terms(scene.contact, scene.tools, [body.material for body in scene.bodies]) | (
        TIE_TERMS if scene.tie else {}
    )
    return terms | met | works
