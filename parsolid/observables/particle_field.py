"""A field at one particle."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Sampler, Watched, field_of


class Place:
    """Where a particle is: of which system and in which row, if it is on this rank.

    Found anew when rows have changed.
    """

    def __init__(self, identifier: int):
        self.identifier = identifier
        self._layout: tuple[int, ...] | None = None
        self._found: tuple[Any, int] | None = None

    def find(self, watched: Watched) -> tuple[Any, int] | None:
        """(system, row), or None on ranks that do not have it."""
        if watched.layout != self._layout:
            self._layout, self._found = watched.layout, None
            for system in watched.systems:
                mine = np.flatnonzero(system.particles.owned_rows("identifier") == self.identifier)
                if len(mine):
                    self._found = system, int(mine[0])
        return self._found


class ParticleField(Sampler):
    """Components of a field; of a tensor those in the plane or in space."""

    def __init__(self, name: str, columns: list[str], place: Place, field: str):
        super().__init__(name, columns)
        self.place, self.field = place, field

    def part(self, watched: Watched) -> np.ndarray:
        """The values on the rank that has the particle, zeros elsewhere.

        Not numbers where its method has no such field.
        """
        found = self.place.find(watched)
        if found is None:
            return np.zeros(len(self.columns))
        system, row = found
        values, d = field_of(system, self.field, row, row + 1), watched.dimension
        if values is None:
            return np.full(len(self.columns), np.nan)
        return np.ravel(values[0, :d, :d] if values.ndim == 3 else values[0]).astype(float)
