"""Registers of the functions that compute fields and quantities of `scene.observed`, and the particles they read."""

from collections.abc import Callable, Iterable, Sequence
from typing import Any

import numpy as np

from parsolid.methods.previous_state import state_rows, state_variable_names
from parsolid.methods.protocol import ALWAYS_WRITTEN, ParticleSystem
from parsolid.scene import observed
from parsolid.scene.observed import USUAL_FIELDS
from parsolid.scene.previous_results import STATE

Compute = Callable[["Rows"], np.ndarray]

# name in `scene.observed.FIELDS` -> function that computes the field from others, for methods without it
FIELDS: dict[str, Compute] = {}


def field(compute: Compute) -> Compute:
    """Declare a function that computes the field of its name, (n,), (n, d) or (n, 3, 3)."""
    FIELDS[compute.__name__] = compute
    return compute


class Rows:
    """Fields by name of particles first..last-1 of a rank's part of a system; each is computed once."""

    def __init__(self, system: ParticleSystem, first: int, last: int):
        self.system, self.first, self.last = system, first, last
        self._found: dict[str, np.ndarray] = {}

    def __call__(self, name: str) -> np.ndarray:
        """(n,), (n, d) or (n, 3, 3); raises KeyError for a name that neither the method nor this folder knows."""
        if name not in self._found:
            values = self.of_method(name)
            if values is None:
                values = FIELDS[name](self) if name in FIELDS else self._component(name)
            self._found[name] = values
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

    def _component(self, name: str) -> np.ndarray:
        """(n,) of a vector or tensor, by its name in the history."""
        field, _, axes = name.rpartition("_")
        if not field or not axes or set(axes) - set("xyz"):
            raise KeyError(name)
        values, place = self(field), ["xyz".index(axis) for axis in axes]
        if values.ndim != 1 + len(place) or max(place) >= values.shape[-1]:
            raise KeyError(name)
        return np.asarray(values[:, place[0]] if len(place) == 1 else values[:, place[0], place[1]])


def field_of(system: ParticleSystem, name: str, first: int = 0, last: int | None = None) -> np.ndarray | None:
    """A field of particles first..last-1 (all of this rank by default), (n,), (n, d) or (n, 3, 3).

    None where there is none.
    """
    try:
        return Rows(system, first, system.owned if last is None else last)(name)
    except KeyError:
        return None


class Observables:
    """Fields by name of this rank's particles, system after system: arrays (n,), (n, d) or (n, 3, 3) of the fields
    that systems declare and of those of this folder.
    """

    def __init__(self, systems: Sequence[ParticleSystem]):
        self.systems = list(systems)
        self.dimension = systems[0].dimension

    @property
    def layout(self) -> tuple[int, ...]:
        """Changes when particles are re-ordered, come or go."""
        return tuple(system.particles.layout for system in self.systems)

    @property
    def tributary_mass(self) -> np.ndarray:
        """Mass (n,) [kg] on this side of mirror planes."""
        return self._joined([system.mass[: system.owned] * system.share[: system.owned] for system in self.systems])

    @property
    def tributary_volume(self) -> np.ndarray:
        """Reference volume (n,) [m^3] on this side of mirror planes."""
        volumes = [system.particles.owned_rows("volume") for system in self.systems]
        return self._joined([one * system.share[: system.owned] for one, system in zip(volumes, self.systems)])

    @property
    def body(self) -> np.ndarray:
        """Number (n,) of each particle's body in the scene."""
        own = [system.particles.owned_rows("body") for system in self.systems]
        return self._joined([np.asarray(system.bodies, np.int32)[body] for system, body in zip(self.systems, own)])

    def rows(self, name: str) -> np.ndarray:
        """A declared field that all systems have."""
        return self._joined([system.particles.owned_rows(name) for system in self.systems])

    def field(self, name: str) -> np.ndarray:
        """Values of all particles of this rank, NaN where a method has no such field. Raises KeyError if no method has
        it.
        """
        find = state_rows if name.startswith(STATE) else field_of
        pieces = [find(system, name) for system in self.systems]
        shape = next((piece.shape[1:] for piece in pieces if piece is not None), None)
        if shape is None:
            raise KeyError(name)
        return self._joined(
            [
                np.full((system.owned, *shape), np.nan) if piece is None else piece
                for system, piece in zip(self.systems, pieces)
            ]
        )

    def prepare(self, names: Iterable[str], time: float) -> None:
        """Let systems exchange what fields of these names need in the state at a time [s]; collective."""
        for system in self.systems:
            system.prepare_fields(names, time)

    def has(self, name: str) -> bool:
        """Whether any system has such a field."""
        if name.startswith(STATE):
            return any(state_rows(system, name) is not None for system in self.systems)
        return any(field_of(system, name, 0, 0) is not None for system in self.systems)

    def written(self, chosen: list[str] | None) -> list[str]:
        """Names of the fields to write that some system has; chosen: of a scene, the usual ones unless given."""
        names = self.usual_fields() if chosen is None else list(chosen)
        if "state" in names:
            names.remove("state")
            for system in self.systems:
                system.bring_state_up_to_date()
                names += ["displacement", "velocity", *(STATE + name for name in state_variable_names(system))]
        return [name for name in dict.fromkeys(names) if self.has(name)]

    def _joined(self, pieces: list[np.ndarray]) -> np.ndarray:
        """Arrays of the systems one after the other; of one it is the array itself."""
        return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)

    def usual_fields(self) -> list[str]:
        """What is written unless the scene chooses: fields declared as shown, and the usual ones of all methods."""
        declared = [
            name
            for system in self.systems
            for name, field in system.particles.fields.items()
            if field.shown and name not in observed.FIELDS and name not in ALWAYS_WRITTEN
        ]
        own = [name for system in self.systems for name in system.usual_fields]
        return [*dict.fromkeys(declared), *USUAL_FIELDS, *dict.fromkeys(own)]


class OfRegion(Observables):
    """The particles of a region; number: its index among the regions with a name."""

    def __init__(self, whole: Observables, number: int):
        super().__init__(whole.systems)
        self._here = whole.rows("regions")[:, number] == 1

    def _joined(self, pieces: list[np.ndarray]) -> np.ndarray:
        return super()._joined(pieces)[self._here]


class Sampler:
    """Values of a probe: each rank gives its part, `reduction` joins the parts, `values` makes the columns.

    name: of the probe; columns: names of its columns of the history. Made once a run, on every rank.
    reduction: "sum", "minimum" or "maximum", the same on all ranks at the latest when `part` returns.
    """

    reduction = "sum"

    def __init__(self, name: str, columns: list[str]):
        self.name, self.columns = name, columns

    def part(self, watched: Observables) -> np.ndarray:
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


# name in `scene.observed.QUANTITIES` -> class of its sampler
QUANTITIES: dict[str, type[Sampler]] = {}


def quantity(name: str) -> Callable[[type[Sampler]], type[Sampler]]:
    """Declare the class of samplers of a quantity."""

    def declare(sampler: type[Sampler]) -> type[Sampler]:
        QUANTITIES[name] = sampler
        return sampler

    return declare


# name in `scene.observed.FIELDS_OF_PROBES` -> its sampler, made as `Sampler(name, columns, place, probe)`
PARTICLE_SAMPLERS: dict[str, Callable[..., Sampler]] = {}


def particle_sampler(name: str) -> Callable[[type[Sampler]], type[Sampler]]:
    """Declare samplers for a field of a probe at a particle."""

    def declare(sampler: type[Sampler]) -> type[Sampler]:
        PARTICLE_SAMPLERS[name] = sampler
        return sampler

    return declare
