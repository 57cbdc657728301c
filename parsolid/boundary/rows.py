"""Rows of particles to which conditions and loads refer, looked up anew when particles have changed their rows."""

from collections.abc import Callable
from typing import Protocol

import numpy as np

from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field

# values (k,) at rows
OfRows = Callable[[np.ndarray | slice], np.ndarray]


class HasRows(Protocol):
    """Some particles, wherever they are."""

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles, rising."""


class Chosen:
    """The particles that a condition on their fields chooses: those of every rank, wherever they are."""

    def __init__(self, particles: Particles, choose: Callable[[], np.ndarray]):
        """choose: a mask (owned,) from fields that travel with the particles."""
        self.particles, self.choose = particles, choose
        self._layout, self._rows = -1, np.zeros(0, np.int64)

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles."""
        if self._layout != self.particles.layout:
            self._layout, self._rows = self.particles.layout, np.flatnonzero(self.choose())
        return self._rows


class Everywhere:
    """All particles of a rank."""

    rows = slice(None)


class Components:
    """Some components of particles' vectors, wherever the particles are."""

    def __init__(self, particles: Particles, mask: np.ndarray):
        """mask (owned, d) bool; all ranks choose alike."""
        self.particles, self._layout, self._mask = particles, particles.layout, mask
        self._chosen = [particles.selection(column) for column in mask.T]

    @property
    def mask(self) -> np.ndarray:
        """(owned, d) bool."""
        if self._layout != self.particles.layout:
            self._layout, self._mask = self.particles.layout, np.zeros((self.particles.owned, len(self._chosen)), bool)
            for i, one in enumerate(self._chosen):
                self._mask[one.rows, i] = True
        return self._mask


def keep(particles: Particles, name: str, values: np.ndarray) -> OfRows:
    """Let values (owned,) or (owned, components) travel with their particles; gives them at rows."""
    particles.declare(Field(name, values.shape[1] if values.ndim > 1 else 1, "1"), values)
    return lambda rows: particles.owned_rows(name)[rows]
