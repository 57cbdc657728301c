"""What a method or a law says of a quantity that every particle has.

`particles.container` does what follows from it.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np


@dataclass(frozen=True)
class Rows:
    """An array (capacity, width) of its own, a row a particle: what neighbours or nodes read; width: the components
    unless given.

    A scalar of one component without a width is (capacity,).
    """

    width: int | None = None


@dataclass(frozen=True)
class Columns:
    """An array (components, capacity) of its own, for kernels that take four neighbouring particles at once."""


@dataclass(frozen=True)
class Within:
    """Components first .. first + components - 1 of another field, the record."""

    record: str
    first: int


@dataclass(frozen=True)
class Field:
    """One quantity of every particle.

    ghosts: "forward" where ghosts take their owner's values, "reverse" where owners add up what their ghosts have
    gathered, in the message of that name; checkpointed: needed to restart; shown: written to the fields file unless the
    scene chooses otherwise;
    mirror: how a mirror image's value follows; carried: travels with a particle to another rank (False for what a step
    fills anew);
    padding: a row that rows beyond the owned ones hold, so that kernels of four lanes find a sound particle there;
    whole: integers.
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
        """The roles as words."""
        roles = {"exchanged": self.ghosts is not None, "checkpointed": self.checkpointed, "shown": self.shown}
        return " ".join(name for name, holds in roles.items() if holds)

    def kind(self, dimension: int) -> str | None:
        """ "scalar", "vector" or "tensor", by which a scene may name the field; None of a record, or of bits."""
        if self.unit in ("", "bits"):
            return None
        if self.mirror == "tensor":
            return "tensor" if self.components == dimension**2 else None
        if self.components == dimension and (dimension > 1 or self.mirror == "vector"):
            return "vector"
        return "scalar" if self.components == 1 else None

    @property
    def dtype(self) -> type:
        """Whole numbers have 8 bytes, too, so that every field can travel."""
        return np.int64 if self.whole else np.float64
