"""Rows of particles to which conditions and loads refer, looked up anew when particles have changed their rows."""

from collections.abc import Callable
from typing import Any, Protocol

import numpy as np

from parsolid.particles.declaration import Field


class HasRows(Protocol):
    """Where `rows` are."""

    @property
    def rows(self) -> np.ndarray:
        """(k,) int64, rising."""


class FixedParticles:
    """A rank's particles whose rows never change, with what conditions ask of `particles.container.Particles`."""

    layout = 0

    def __init__(self, particle_set):
        names = ("body", "volume", "spacing", "area")
        self._values = {"reference_position": particle_set.position}
        self._values |= {name: getattr(particle_set, name) for name in names}
        self.owned = len(particle_set)

    def owned_rows(self, name: str) -> np.ndarray:
        """The particles' values of a field."""
        return self._values[name]

    def declare(self, field: Field, values=0) -> None:
        """Keep a value of each particle, (n,)."""
        self._values[field.name] = np.array(values)

    def selection(self, mask: np.ndarray) -> HasRows:
        """The particles where mask (n,) is true."""
        return Chosen(self, lambda: mask)


class Chosen:
    """The particles that a condition on their fields chooses: those of every rank, wherever they are."""

    def __init__(self, particles: Any, choose: Callable[[], np.ndarray]):
        """choose: a mask (owned,) from fields that travel with the particles."""
        self.particles, self.choose, self._layout = particles, choose, -1

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles."""
        if self._layout != self.particles.layout:
            self._layout, self._rows = self.particles.layout, np.flatnonzero(self.choose())
        return self._rows


class Everywhere:
    """All particles of a rank."""

    rows = slice(None)


def keep(particles: Any, name: str, values: np.ndarray) -> Callable[[Any], np.ndarray]:
    """Let values (owned,) travel with their particles; gives them at rows."""
    particles.declare(Field(name, 1, "1"), values)
    return lambda rows: particles.owned_rows(name)[rows]
