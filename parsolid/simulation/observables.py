"""All systems of a run on one rank, as probes, field output and exact solutions look at them."""

from collections.abc import Iterable, Sequence

import numpy as np

from parsolid.methods.previous_state import state_rows, state_variable_names
from parsolid.methods.protocol import ALWAYS_WRITTEN, ParticleSystem
from parsolid.observables.declared import field_of
from parsolid.scene.observed import FIELDS, USUAL_FIELDS
from parsolid.scene.previous_results import STATE


class Observables:
    """Fields by name of this rank's particles, those of one system after those of another.

    Every field is an array (n,), (n, d) or (n, 3, 3): those that systems declare, and those of `parsolid.observables`.
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
        return _joined([system.mass[: system.owned] * system.share[: system.owned] for system in self.systems])

    @property
    def tributary_volume(self) -> np.ndarray:
        """Reference volume (n,) [m^3] on this side of mirror planes."""
        shares = _joined([system.share[: system.owned] for system in self.systems])
        return np.asarray(self.rows("volume") * shares)

    @property
    def body(self) -> np.ndarray:
        """Number (n,) of each particle's body in the scene."""
        own = [system.particles.owned_rows("body") for system in self.systems]
        return _joined([np.asarray(system.bodies, np.int32)[body] for system, body in zip(self.systems, own)])

    def rows(self, name: str) -> np.ndarray:
        """A declared field that all systems have."""
        return _joined([system.particles.owned_rows(name) for system in self.systems])

    def field(self, name: str) -> np.ndarray:
        """Values of all particles of this rank, not numbers where a method has no such field.

        Raises KeyError if none has it.
        """
        find = state_rows if name.startswith(STATE) else field_of
        pieces = [find(system, name) for system in self.systems]
        shape = next((piece.shape[1:] for piece in pieces if piece is not None), None)
        if shape is None:
            raise KeyError(name)
        return _joined(
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

    def usual_fields(self) -> list[str]:
        """What is written unless the scene chooses: fields declared as shown, and the usual ones of all methods."""
        declared = [
            name
            for system in self.systems
            for name, field in system.particles.fields.items()
            if field.shown and name not in FIELDS and name not in ALWAYS_WRITTEN
        ]
        own = [name for system in self.systems for name in system.usual_fields]
        return [*dict.fromkeys(declared), *USUAL_FIELDS, *dict.fromkeys(own)]


def _joined(pieces: list[np.ndarray]) -> np.ndarray:
    """Arrays one after the other; of one it is the array itself."""
    return pieces[0] if len(pieces) == 1 else np.concatenate(pieces)
