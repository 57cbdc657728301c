"""Declarations of the fields of particles; `container.Particles` allocates, exchanges and stores them."""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Rows:
    """An array (capacity, width), one row a particle; width: the number of components unless given.

    A scalar without a width is (capacity,).
    """

    width: int | None = None


@dataclass(frozen=True)
class Columns:
    """An array (components, capacity), for kernels that take several neighbouring particles at once."""


@dataclass(frozen=True)
class Within:
    """Components first .. first + components - 1 of another field, the record."""

    record: str
    first: int


@dataclass(frozen=True)
class Field:
    """One quantity of every particle.

    ghosts: "forward" where ghosts take their owners' values, "reverse" where owners add up their ghosts' values, in the
    message of that name; checkpointed: needed to restart; shown: written to the fields file unless the scene chooses
    otherwise; mirror: how the value of a mirror image follows; carried: travels with a particle to another rank (False
    for values that every step computes); padding: row of values beyond the owned rows, for kernels that take several
    particles at once; whole: integers.
    """

    name: str
    components: int
    unit: str
    ghosts: Literal["forward", "reverse"] | None = None
    message: str = "state"
    checkpointed: bool = False
    shown: bool = False
    mirror: Literal["scalar", "vector", "tensor"] = "scalar"
    layout: Rows | Columns | Within = Rows()
    carried: bool = True
    padding: tuple[float, ...] = ()
    whole: bool = False

    @property
    def roles(self) -> str:
        """The roles in words."""
        roles = {"exchanged": self.ghosts is not None, "checkpointed": self.checkpointed, "shown": self.shown}
        return " ".join(name for name, holds in roles.items() if holds)

    def kind(self, dimension: int) -> str | None:
        """ "scalar", "vector" or "tensor" for a field that a scene may name; None for a record or bits."""
        if self.unit in ("", "bits"):
            return None
        if self.mirror == "tensor":
            return "tensor" if self.components == dimension**2 else None
        if self.components == dimension and (dimension > 1 or self.mirror == "vector"):
            return "vector"
        return "scalar" if self.components == 1 else None

    @property
    def dtype(self) -> type:
        """int64 or float64: messages take types of 8 bytes."""
        return np.int64 if self.whole else np.float64
