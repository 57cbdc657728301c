"""What is watched in a region with a name: any quantity of its particles, and statistics of fields there."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Sampler, Watched


class OfRegion:
    """The particles of a region, as samplers look at all of them; number: of the region among those with a name."""

    def __init__(self, watched: Watched, number: int):
        self.systems, self.dimension, self._all = watched.systems, watched.dimension, watched
        self._here = watched.rows("regions")[:, number] == 1

    @property
    def layout(self) -> tuple[int, ...]:
        """Changes when particles are re-ordered, come or go."""
        return self._all.layout

    @property
    def tributary_mass(self) -> np.ndarray:
        """Mass (n,) [kg] on this side of mirror planes."""
        return self._all.tributary_mass[self._here]

    @property
    def tributary_volume(self) -> np.ndarray:
        """Reference volume (n,) [m^3] on this side of mirror planes."""
        return self._all.tributary_volume[self._here]

    @property
    def body(self) -> np.ndarray:
        """Number (n,) of each particle's body in the scene."""
        return self._all.body[self._here]

    def field(self, name: str) -> np.ndarray:
        """A field of the particles."""
        return self._all.field(name)[self._here]

    def rows(self, name: str) -> np.ndarray:
        """A declared field of the particles."""
        return self._all.rows(name)[self._here]


class InRegion(Sampler):
    """Another sampler's columns, of the particles of a region alone."""

    def __init__(self, sampler: Sampler, number: int):
        super().__init__(sampler.name, sampler.columns)
        self.sampler, self.number, self.reduction = sampler, number, sampler.reduction

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's."""
        return self.sampler.part(OfRegion(watched, self.number))

    def values(self, joined: np.ndarray) -> np.ndarray:
        """As the sampler has them."""
        return self.sampler.values(joined)

    def state(self) -> Any:
        """What the sampler keeps."""
        return self.sampler.state()

    def restore(self, state: Any) -> None:
        """For the sampler."""
        self.sampler.restore(state)


class Statistic(Sampler):
    """Of the components of a field: "mean" by reference volume, "minimum", "maximum", or "integral" over that volume.

    Of a tensor the components are those in the plane or in space.
    """

    def __init__(self, name: str, columns: list[str], field: str, statistic: str):
        super().__init__(name, columns)
        self.field, self.statistic = field, statistic
        self.reduction = statistic if statistic in ("minimum", "maximum") else "sum"

    def part(self, watched: Watched) -> np.ndarray:
        """This rank's extremes, or sums of V f and of V."""
        values, d = watched.field(self.field), watched.dimension
        rows = values[:, :d, :d] if values.ndim == 3 else values
        rows = rows.reshape(len(rows), len(self.columns)).astype(float)
        if self.reduction == "minimum":
            return rows.min(axis=0, initial=np.inf)
        if self.reduction == "maximum":
            return rows.max(axis=0, initial=-np.inf)
        volume = watched.tributary_volume
        return np.append(volume @ rows, volume.sum())

    def values(self, joined: np.ndarray) -> np.ndarray:
        """Means and integrals of the sums."""
        if self.reduction != "sum":
            return joined
        return np.asarray(joined[:-1] / joined[-1] if self.statistic == "mean" else joined[:-1])
