"""The field table: what a particle carries, and what each generic operation does with it.

Allocation, halo exchange, checkpoint, restart, output and `check` are loops over this table.
"""

from dataclasses import dataclass, field

import numpy as np


@dataclass(frozen=True)
class Field:
    """One quantity of every particle.

    evolved: integrated in time; exchanged: sent to ghosts in every stage; checkpointed: needed to restart;
    shown: written to the fields file unless the scene chooses otherwise.
    """

    name: str
    components: int
    unit: str
    evolved: bool = False
    exchanged: bool = False
    checkpointed: bool = False
    shown: bool = False

    @property
    def roles(self) -> str:
        """The roles as words."""
        names = ("evolved", "exchanged", "checkpointed", "shown")
        return " ".join(name for name in names if getattr(self, name))


@dataclass
class FieldTable:
    """Fields of a rank's particles with their arrays, whose first `owned` rows belong to the rank.

    layout counts how often particles were re-ordered, came or left: what has looked up a particle's row must do so anew.
    """

    owned: int
    fields: dict[str, Field] = field(default_factory=dict)
    arrays: dict[str, np.ndarray] = field(default_factory=dict)
    layout: int = 0

    def add(self, declared: Field, array: np.ndarray) -> None:
        """Register an array of shape (capacity,) or (capacity, components), possibly a view."""
        self.fields[declared.name] = declared
        self.arrays[declared.name] = array

    def owned_rows(self, name: str) -> np.ndarray:
        """The owned particles' values of a field."""
        return self.arrays[name][: self.owned]

    def checkpointed(self) -> dict[str, np.ndarray]:
        """Everything a restart needs."""
        return {name: self.owned_rows(name) for name, declared in self.fields.items() if declared.checkpointed}

    def restore(self, values: dict[str, np.ndarray]) -> None:
        """Put checkpointed values back."""
        for name, array in self.checkpointed().items():
            array[...] = values[name].reshape(array.shape)
