"""What computes the fields and quantities that `scene.observed` names."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np


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


# what computes a field of `scene.observed.FIELDS` from others where the method has none of this name
FIELDS: dict[str, Compute] = {}


def field(compute: Compute) -> Compute:
    """Declare what computes the field of this function's name, (n,), (n, d) or (n, 3, 3)."""
    FIELDS[compute.__name__] = compute
    return compute


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
        return FIELDS[name](self) if name in FIELDS else self._component(name)

    def _component(self, name: str) -> np.ndarray:
        """(n,) of a vector or tensor, by its name in the history."""
        field, _, axes = name.rpartition("_")
        if not field or not axes or set(axes) - set("xyz"):
            raise KeyError(name)
        values, place = self(field), ["xyz".index(axis) for axis in axes]
        if values.ndim != 1 + len(place) or max(place) >= values.shape[-1]:
            raise KeyError(name)
        return np.asarray(values[:, place[0]] if len(place) == 1 else values[:, place[0], place[1]])


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


class Sampler:
    """One thing that a probe watches: each rank gives its part, `reduction` joins the parts, columns are made of that.

    name: of the probe; columns: names of what it fills in the history. One is made for each run, on every rank.
    reduction: "sum", "minimum" or "maximum", the same on all ranks at the latest when `part` returns.
    """

    reduction = "sum"

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


# what finds a quantity of `scene.observed.QUANTITIES`
QUANTITIES: dict[str, type[Sampler]] = {}


def quantity(name: str) -> Callable[[type[Sampler]], type[Sampler]]:
    """Declare a class of samplers as what finds the quantity of this name."""

    def declare(sampler: type[Sampler]) -> type[Sampler]:
        QUANTITIES[name] = sampler
        return sampler

    return declare


# of `scene.observed.FIELDS_OF_PROBES`, made as `Sampler(name, columns, place, probe)`
PARTICLE_SAMPLERS: dict[str, Callable[..., Sampler]] = {}


def particle_sampler(name: str) -> Callable[[type[Sampler]], type[Sampler]]:
    """Declare samplers for a field of a probe at a particle."""

    def declare(sampler: type[Sampler]) -> type[Sampler]:
        PARTICLE_SAMPLERS[name] = sampler
        return sampler

    return declare
