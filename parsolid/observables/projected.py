"""Fields projected on a weight: the amplitude of a mode."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Sampler, Watched


class Projected(Sampler):
    """sum V w f / sum V w^2 over all particles, for the components of fields f and a weight w(X)."""

    def __init__(self, name: str, columns: list[str], weight: Any, fields: list[str]):
        super().__init__(name, columns)
        self.weight, self.fields = weight, fields
        self._layout: tuple[int, ...] | None = None
        self._weights = np.zeros(0)

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's sums of V w f for each component, and of V w^2."""
        if watched.layout != self._layout:
            self._layout, self._weights = watched.layout, self.weight.evaluate(watched.rows("reference_position"))
        values: list[float] = []
        measure, d = self._weights * watched.rows("volume"), watched.dimension
        for name in self.fields:
            field = watched.field(name)
            field = field[:, :d, :d] if field.ndim == 3 else field
            values += np.tensordot(measure, field, 1).ravel().tolist()
        return np.array([*values, float(measure @ self._weights)])

    def values(self, joined: np.ndarray) -> np.ndarray:
        """The amplitudes."""
        return np.asarray(joined[:-1] / joined[-1])
