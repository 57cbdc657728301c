"""What exact solutions have in common: how a run is compared with them."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

import numpy as np

# an exact field below this share of its scale vanishes but for rounding
_NOTHING = 1e-12


@dataclass
class View:
    """A run on one rank, as a solution looks at it: fields of its owned particles, their reference positions and
    volumes.
    """

    comm: Any
    observables: Any

    @property
    def positions(self) -> np.ndarray:
        """Reference positions (n, d) [m]."""
        return self.observables.rows("reference_position")

    @property
    def volume(self) -> np.ndarray:
        """Tributary reference volumes (n,) [m^3]."""
        return self.observables.rows("volume")

    def field(self, name: str) -> np.ndarray:
        """A field of the run."""
        return self.observables.field(name)

    def sums(self, *values: np.ndarray) -> np.ndarray:
        """Volume-weighted sums of arrays over all particles; collective."""
        # of any number of particles, none included
        mine = [np.sum(self.volume * value.sum(axis=tuple(range(1, value.ndim)))) for value in values]
        return self.comm.allreduce(np.array(mine))


class Solution:
    """An exact solution; `fields(positions, time)` gives arrays (n, ...) by name.

    offsets   what is taken off a field before it is the scale of its own error (a temperature at the start)
    scales    size of the fields of which a run may be compared at every step: the largest over time of rms(error) /
    scale
    """

    offsets: Mapping[str, float] = MappingProxyType({})
    scales: Mapping[str, float] = MappingProxyType({})

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """Fields by name at reference positions (n, d) [m] and a time [s]."""
        raise NotImplementedError

    def error_names(self, dimension: int) -> tuple[str, ...]:
        """Names of the errors at a time."""
        return tuple(self.fields(np.zeros((1, dimension)), 0.0))

    def errors(self, view: View, time: float) -> dict[str, float]:
        """Relative L2 errors by name; over its scale, or 1, where the exact field vanishes. Collective."""
        result = {}
        for name, wanted in self.fields(view.positions, time).items():
            difference, scale = _like(view.field(name), wanted) - wanted, self.scales.get(name, 1.0)
            sums = view.sums(difference**2, (wanted - self.offsets.get(name, 0.0)) ** 2, np.full(len(wanted), scale**2))
            vanishes = sums[1] <= _NOTHING**2 * sums[2]
            result[name] = float(np.sqrt(sums[0] / sums[2 if vanishes else 1]))
        return result

    def history_columns(self) -> list[str]:
        """Columns of the history from which a run is judged, besides time and dt; the scene must have the probes for
        some.
        """
        return []

    def history_names(self) -> list[str]:
        """Names of the errors that `history_errors` finds."""
        return []

    def history_errors(self, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Errors by name of a run's history: its columns (rows,) by name."""
        raise NotImplementedError

    def rms_errors(self, view: View, time: float) -> dict[str, float]:
        """rms(error) / scale by name, of the fields that have a scale; collective."""
        exact, result = self.fields(view.positions, time), {}
        for name, scale in self.scales.items():
            error, volume = view.sums((view.field(name) - exact[name]) ** 2, np.ones(len(view.volume)))
            result[name] = float(np.sqrt(error / volume)) / scale
        return result


def _like(values: np.ndarray, wanted: np.ndarray) -> np.ndarray:
    """A tensor field (n, 3, 3) cut to the components that are wanted."""
    return values[:, : wanted.shape[1], : wanted.shape[2]] if wanted.ndim == 3 else values
