"""What probes watch: a field at one particle, on a weight or in a region, a method's own quantity, a reaction."""

from typing import Any

import numpy as np

from parsolid.observables.declared import Observables, OfRegion, Sampler, field_of


class Place:
    """Where a particle is: of which system and in which row, if it is on this rank.

    Found anew when rows have changed.
    """

    def __init__(self, identifier: int):
        self.identifier = identifier
        self._layout: tuple[int, ...] | None = None
        self._found: tuple[Any, int] | None = None

    def find(self, watched: Observables) -> tuple[Any, int] | None:
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

    def part(self, watched: Observables) -> np.ndarray:
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


# a system in which there is no such thing says NaN, as of the tip of no crack
_JOIN = {"sum": np.add, "minimum": np.fmin, "maximum": np.fmax}


class MethodQuantity(Sampler):
    """A quantity of the systems whose method knows it, by the name in a scene."""

    def __init__(self, name: str, columns: list[str], wanted: str):
        super().__init__(name, columns)
        self.wanted = wanted

    def part(self, watched: Observables) -> np.ndarray:
        """This rank's part, of all its systems; may be collective."""
        result: np.ndarray | None = None
        for system in watched.systems:
            if self.wanted in system.settings.extra_quantities:
                self.reduction, values = system.measure(self.wanted)
                values = np.atleast_1d(values)
                result = values if result is None else _JOIN[self.reduction](result, values)
        if result is None:
            raise KeyError(self.wanted)
        return result


class Projected(Sampler):
    """sum V w f / sum V w^2 over all particles, for the components of fields f and a weight w(X)."""

    def __init__(self, name: str, columns: list[str], weight: Any, fields: list[str]):
        super().__init__(name, columns)
        self.weight, self.fields = weight, fields
        self._layout: tuple[int, ...] | None = None
        self._weights = np.zeros(0)

    def part(self, watched: Observables) -> np.ndarray:
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
        return np.asarray(joined[:-1] / joined[-1])


class ReactionForce(Sampler):
    """Force [N] and moment [N m] of a condition on the bodies, mean over the last step; columns of a boundary's name.

    In 2-D they are per metre of thickness, and the moment is about the axis out of the plane.
    """

    def part(self, watched: Observables) -> np.ndarray:
        systems: list[Any] = watched.systems
        found = [system.reaction(self.name) for system in systems]
        return np.asarray(sum((one for one in found if one is not None), np.zeros(len(self.columns))))


class InRegion(Sampler):
    """Another sampler's columns, of the particles of a region alone."""

    def __init__(self, sampler: Sampler, number: int):
        super().__init__(sampler.name, sampler.columns)
        self.sampler, self.number, self.reduction = sampler, number, sampler.reduction

    def part(self, watched: Observables) -> np.ndarray:
        return self.sampler.part(OfRegion(watched, self.number))

    def values(self, joined: np.ndarray) -> np.ndarray:
        return self.sampler.values(joined)

    def state(self) -> Any:
        return self.sampler.state()

    def restore(self, state: Any) -> None:
        self.sampler.restore(state)


class Statistic(Sampler):
    """Of the components of a field: "mean" by reference volume, "minimum", "maximum", or "integral" over that volume.

    Of a tensor the components are those in the plane or in space.
    """

    def __init__(self, name: str, columns: list[str], field: str, statistic: str):
        super().__init__(name, columns)
        self.field, self.statistic = field, statistic
        self.reduction = statistic if statistic in ("minimum", "maximum") else "sum"

    def part(self, watched: Observables) -> np.ndarray:
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
