"""Rows of particles to which conditions and loads refer, looked up anew when particles have changed their rows."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from parsolid.particles.declaration import Field
from parsolid.particles.particle_set import ParticleSet

# values (k,) at rows
OfRows = Callable[[np.ndarray | slice], np.ndarray]


class HasRows(Protocol):
    """Some particles, wherever they are."""

    @property
    def rows(self) -> np.ndarray:
        """Rows (k,) of this rank's particles, rising."""


class HasParticles(Protocol):
    """What conditions ask of `particles.container.Particles`; layout: changes when rows do; owned: number of rows."""

    layout: int

    @property
    def owned(self) -> int:
        """Number of this rank's particles."""

    def owned_rows(self, name: str) -> np.ndarray:
        """Their values of a field, among them reference_position, body, spacing, area and volume."""

    def declare(self, field: Field, values: np.ndarray) -> None:
        """Let values of each particle travel with it."""

    def selection(self, mask: np.ndarray) -> HasRows:
        """The particles where mask (owned,) is true, for as long as they exist."""


class FixedParticles:
    """A rank's particles whose rows never change."""

    layout = 0

    def __init__(self, particle_set: ParticleSet):
        names = ("body", "volume", "spacing", "area")
        self._values = {"reference_position": particle_set.position}
        self._values |= {name: getattr(particle_set, name) for name in names}
        self.count = len(particle_set)

    @property
    def owned(self) -> int:
        """Number of particles."""
        return self.count

    def owned_rows(self, name: str) -> np.ndarray:
        """The particles' values of a field."""
        return self._values[name]

    def declare(self, field: Field, values: np.ndarray) -> None:
        """Keep a value of each particle, (n,)."""
        self._values[field.name] = np.array(values)

    def selection(self, mask: np.ndarray) -> HasRows:
        """The particles where mask (n,) is true."""
        return _Fixed(np.flatnonzero(mask))


@dataclass
class _Fixed:
    """Rows (k,) that stay."""

    rows: np.ndarray


class Chosen:
    """The particles that a condition on their fields chooses: those of every rank, wherever they are."""

    def __init__(self, particles: HasParticles, choose: Callable[[], np.ndarray]):
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


def keep(particles: HasParticles, name: str, values: np.ndarray) -> OfRows:
    """Let values (owned,) or (owned, components) travel with their particles; gives them at rows."""
    particles.declare(Field(name, values.shape[1] if values.ndim > 1 else 1, "1"), values)
    return lambda rows: particles.owned_rows(name)[rows]
