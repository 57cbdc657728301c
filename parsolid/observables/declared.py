"""The declarations: names of fields and quantities, how many components they have, and what computes them."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, ClassVar, Protocol

import numpy as np

# "rotation": about the axis out of the plane in 2-D, a vector in space
KINDS = ("scalar", "vector", "tensor", "rotation")


class System(Protocol):
    """What is asked of a system of particles on one rank; see `methods.protocol.ParticleSystem`."""

    comm: Any
    dimension: int
    settings: Any
    indicated: np.ndarray | None

    @property
    def mass(self) -> np.ndarray:
        """Mass (owned,) [kg]."""

    @property
    def share(self) -> np.ndarray:
        """The part (owned,) of a particle on this side of mirror planes."""

    @property
    def owned(self) -> int:
        """Number of particles of this rank."""

    @property
    def particles(self) -> Any:
        """Their declared fields."""

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """A field that the method computes itself."""

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """A quantity that the method computes itself."""


Compute = Callable[["Rows"], np.ndarray]


@dataclass(frozen=True)
class FieldOfState:
    """A field of all methods: its kind, whether it is written unless the scene chooses, whether probes take it.

    compute(rows) gives it from other fields where the method has none of this name; None where every method has it.
    """

    kind: str
    compute: Compute | None
    usual: bool
    probed: bool


# by name, in the order in which they are written
FIELDS: dict[str, FieldOfState] = {}


def field(kind: str, usual: bool = False, probed: bool = True) -> Callable[[Compute], Compute]:
    """Declare a field under the name of the function that computes it from others, (n,), (n, d) or (n, 3, 3)."""

    def declare(compute: Compute) -> Compute:
        FIELDS[compute.__name__] = FieldOfState(kind, compute, usual, probed)
        return compute

    return declare


class Rows:
    """Fields by name of particles first..last-1 of a rank's part of a system; each is computed once."""

    def __init__(self, system: System, first: int, last: int):
        self.system, self.first, self.last = system, first, last
        self._found: dict[str, np.ndarray] = {}

    def __call__(self, name: str) -> np.ndarray:
        """(n,), (n, d) or (n, 3, 3); raises KeyError for a name that neither the method nor this room knows."""
        if name not in self._found:
            self._found[name] = self._find(name)
        return self._found[name]

    def of_method(self, name: str) -> np.ndarray | None:
        """The field where the method itself has it, else None."""
        values = self.system.shown(name, self.first, self.last)
        if values is None and name in self.system.particles.fields:
            rows: np.ndarray = self.system.particles.owned_rows(name)
            rows, d = rows[self.first : self.last], self.system.dimension
            if self.system.particles.fields[name].kind(d) != "tensor":
                return rows
            values = np.zeros((len(rows), 3, 3))
            values[:, :d, :d] = rows.reshape(len(rows), d, d)
        return values

    def _find(self, name: str) -> np.ndarray:
        values = self.of_method(name)
        if values is not None:
            return values
        declared = FIELDS.get(name)
        if declared is None or declared.compute is None:
            raise KeyError(name)
        return declared.compute(self)


def field_of(system: System, name: str, first: int = 0, last: int | None = None) -> np.ndarray | None:
    """A field of particles first..last-1 (all of this rank by default), (n,), (n, d) or (n, 3, 3).

    None where there is none.
    """
    try:
        return Rows(system, first, system.owned if last is None else last)(name)
    except KeyError:
        return None


class Watched(Protocol):
    """What a sampler sees: all systems of a run on this rank; see `simulation.observables.Observables`."""

    systems: list[Any]
    dimension: int

    @property
    def layout(self) -> tuple[int, ...]:
        """Changes when particles are re-ordered, come or go."""

    @property
    def tributary_mass(self) -> np.ndarray:
        """Mass (n,) [kg] of this rank's particles on this side of mirror planes."""

    @property
    def body(self) -> np.ndarray:
        """Number (n,) of each particle's body in the scene."""

    @property
    def tributary_volume(self) -> np.ndarray:
        """Reference volume (n,) [m^3] of this rank's particles on this side of mirror planes."""

    def field(self, name: str) -> np.ndarray:
        """A field of this rank's particles."""

    def rows(self, name: str) -> np.ndarray:
        """A declared field of this rank's particles."""


@dataclass(frozen=True)
class Key:
    """A key that a sampler adds to the tables of probes: one of some words, or a point of the scene [m] where None."""

    description: str
    words: tuple[str, ...] | None = None


class Sampler:
    """One thing that a probe watches: each rank gives its part, `reduction` joins the parts, columns are made of that.

    name: of the probe; columns: names of what it fills in the history. One is made for each run, on every rank.
    reduction: "sum", "minimum" or "maximum", the same on all ranks at the latest when `part` returns.
    keys: of its own in a probe's table, refused in the tables of others; a quantity that has some is made as
    `Sampler(name, columns, probe)`.
    """

    reduction = "sum"
    keys: ClassVar[dict[str, Key]] = {}

    @staticmethod
    def faults(stated: dict[str, Any], dimension: int) -> list[tuple[str, str, object]]:
        """What is wrong with its keys in a probe's table: (key, what was expected, what was found or None)."""
        return []

    def __init__(self, name: str, columns: list[str]):
        self.name, self.columns = name, columns

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's numbers, as many on every rank."""
        raise NotImplementedError

    def values(self, joined: np.ndarray) -> np.ndarray:
        """What the columns get, from the numbers of all ranks joined."""
        return joined

    def state(self) -> Any:
        """What a restart needs, as JSON has it, the same on all ranks; None where nothing is kept."""
        return None

    def restore(self, state: Any) -> None:
        """Take back what `state` gave."""


@dataclass(frozen=True)
class Quantity:
    """A number or vector of all particles: its kind, and the sampler that finds it."""

    kind: str
    sampler: type[Sampler]


QUANTITIES: dict[str, Quantity] = {}


def quantity(name: str, kind: str) -> Callable[[type[Sampler]], type[Sampler]]:
    """Declare a class of samplers as what finds the quantity of this name."""

    def declare(sampler: type[Sampler]) -> type[Sampler]:
        QUANTITIES[name] = Quantity(kind, sampler)
        return sampler

    return declare


# fields of a probe at a particle that need more than the particle's present state: name -> (kind, sampler class)
PARTICLE_SAMPLERS: dict[str, tuple[str, Callable[..., Sampler]]] = {}


def particle_sampler(name: str, kind: str) -> Callable[[type[Sampler]], type[Sampler]]:
    """Declare samplers, made as `Sampler(name, columns, place, probe)`, for a field of a probe at a particle."""

    def declare(sampler: type[Sampler]) -> type[Sampler]:
        PARTICLE_SAMPLERS[name] = (kind, sampler)
        return sampler

    return declare


def field_kinds() -> dict[str, str]:
    """Name -> kind of the fields that probes at a particle take."""
    return {name: declared.kind for name, declared in FIELDS.items() if declared.probed} | {
        name: kind for name, (kind, _) in PARTICLE_SAMPLERS.items()
    }


def shown_kinds() -> dict[str, str]:
    """Name -> kind of the fields that can be written."""
    return {name: declared.kind for name, declared in FIELDS.items()}


def quantity_kinds() -> dict[str, str]:
    """Name -> kind of the quantities of all particles."""
    return {name: declared.kind for name, declared in QUANTITIES.items()}


def samplers_with_keys() -> dict[str, type[Sampler]]:
    """Name of a field or quantity -> its sampler, of those that add keys to the tables of probes."""
    found: dict[str, Any] = {name: sampler for name, (_, sampler) in PARTICLE_SAMPLERS.items()}
    found |= {name: declared.sampler for name, declared in QUANTITIES.items()}
    return {name: sampler for name, sampler in found.items() if sampler.keys}
