"""Samplers of probes: a field at a point, projected on a weight or in a region, a quantity of a method, a reaction."""

from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.observables.declared import Observables, OfRegion, Sampler, field_of
from parsolid.particles.regions import nearest_particles


class RowRange(NamedTuple):
    """Rows first..last-1 of a system and their weights (last - first,), 0 of particles that do not count: `continued`
    of motion, `bounded` of other fields."""

    system: Any
    first: int
    last: int
    continued: np.ndarray
    bounded: np.ndarray


class ProbePoint:
    """A material point: particles of its body around it, with weights that are exact for linear fields.

    A point on a particle has this one alone. To points beyond the outermost particles motion is continued. Other fields
    are taken at the nearest place between particles: they keep their bounds, and errors of stresses beside surfaces are
    not extrapolated.
    """

    def __init__(self, identifiers: np.ndarray, continued: np.ndarray, bounded: np.ndarray):
        """identifiers (k,) of the particles and their weights (k,)."""
        self.identifiers, self.continued, self.bounded = identifiers, continued, bounded
        self._layout: tuple[int, ...] | None = None
        self._ranges: list[RowRange] = []

    def find(self, watched: Observables) -> list[RowRange]:
        """Ranges of rows of this rank with particles of the point; found anew when rows have changed."""
        if watched.layout != self._layout:
            self._layout, self._ranges = watched.layout, []
            for system in watched.systems:
                own = system.particles.owned_rows("identifier")
                rows = np.flatnonzero(np.isin(own, self.identifiers))
                # a field of some more rows costs less than another call
                for some in np.split(rows, np.flatnonzero(np.diff(rows) > _GAP) + 1) if len(rows) else ():
                    number, length = np.searchsorted(self.identifiers, own[some]), some[-1] - some[0] + 1
                    weights = [np.zeros(length), np.zeros(length)]
                    for here, of_particles in zip(weights, (self.continued, self.bounded)):
                        here[some - some[0]] = of_particles[number]
                    self._ranges.append(RowRange(system, int(some[0]), int(some[-1]) + 1, *weights))
        return self._ranges

    def value(self, watched: Observables, field: str, count: int) -> np.ndarray:
        """This rank's part (count,) of the components of a field; NaN where its method has no such field."""
        moves = field.partition("_")[0] in _OF_MOTION
        result, d = np.zeros(count), watched.dimension
        for rows in self.find(watched):
            values = field_of(rows.system, field, rows.first, rows.last)
            weights = rows.continued if moves else rows.bounded
            if values is None:
                return np.full(count, np.nan)
            used = np.flatnonzero(weights)
            values = (values[:, :d, :d] if values.ndim == 3 else values)[used]
            result += weights[used] @ values.reshape(len(used), count).astype(float)
        return result


# first words of the fields that are continued to the surface, components among them
_OF_MOTION = ("displacement", "velocity", "position")
# eigenvalues of moments over the largest that count
_CUT_OFF = 1e-6
# radii around a point, in spacings, within which particles count, with the least eigenvalue that does: the first with
# weights that are exact for linear fields and not large, else the last. At the corner of a block of cells the next
# particles are 1.66 away, and farther where cells are cut and spacings short; across a row or an arc of particles a
# field is taken as constant
_REACHES = (
    *((reach, _CUT_OFF) for reach in (0.9, 1.25, 1.75, 2.5, 4.0)),
    *((2.5, least) for least in (0.01, 0.1, 2.0)),
)
# the largest radius, and that of the particles that bound the place of fields other than motion
_FARTHEST, _BESIDE = 4.0, 2.5
# least and largest distance of neighbours over the spacing of a particle, which is a mean in graded bodies
_GRADED = 0.5, 8.0
# distance over the spacing within which a point is that of a particle; sum of the sizes of weights: 4 at a corner
_SAME, _LARGEST = 1e-6, 5.0
# rows between two ranges
_GAP = 64


def probe_points(comm: Any, watched: Observables, points: np.ndarray) -> list[ProbePoint]:
    """The material points (m, d) [m], by reference positions; the same on all ranks. Collective."""
    identifier, X, body = watched.rows("identifier"), watched.rows("reference_position"), watched.body
    winner, _ = nearest_particles(comm, identifier, X, points)
    # the body, the place, the spacings and the own axes of the nearest particles
    d, axes = X.shape[1], np.concatenate([_axes(system.particles) for system in watched.systems])
    of_nearest = np.full((len(points), 1 + 2 * d + d * d), -np.inf)
    for i, name in enumerate(winner):
        for row in np.flatnonzero(identifier == name):
            of_nearest[i] = [body[row], *X[row], *watched.rows("spacing")[row], *axes[row]]
    comm.Allreduce(MPI.IN_PLACE, of_nearest, op=MPI.MAX)
    same, place, spacing = body == of_nearest[:, :1], of_nearest[:, 1 : 1 + d], of_nearest[:, 1 + d : 1 + 2 * d]
    frames = of_nearest[:, 1 + 2 * d :].reshape(-1, d, d)
    # spacings differ from place to place and by direction in graded bodies and meshes, whose particles have a mean
    steps = np.array([_steps((X[here] - at) @ own.T) for here, at, own in zip(same, place, frames)])
    comm.Allreduce(MPI.IN_PLACE, steps, op=MPI.MIN)
    steps = np.where(steps < _GRADED[1] * spacing, np.maximum(steps, _GRADED[0] * spacing), spacing)
    found: list[tuple[int, int, tuple[float, ...]]] = []
    for i, (point, here, own, step) in enumerate(zip(points, same, frames, steps)):
        apart = (X - point) @ own.T / step
        rows = np.flatnonzero(here & ((apart**2).sum(axis=1) < _FARTHEST**2) | (identifier == winner[i]))
        # not what a crack parts from the nearest particle
        rows = rows[~np.any([system.parted(place[i], X[rows]) for system in watched.systems], axis=0)]
        found += [(i, int(identifier[row]), tuple(apart[row])) for row in rows]
    # a few particles a point; sorted, so that weights do not depend on which rank has which
    found = sorted(comm.allreduce(found))
    return [point_among([one[1:] for one in found if one[0] == i]) for i in range(len(points))]


def _axes(particles: Any) -> np.ndarray:
    """The particles' own axes (owned, d * d), those of space unless they have some."""
    d = particles.owned_rows("reference_position").shape[1]
    own = "axes" in particles
    return np.asarray(particles.owned_rows("axes") if own else np.tile(np.eye(d).ravel(), (particles.owned, 1)))


def _steps(away: np.ndarray) -> np.ndarray:
    """Along each axis the distance (d,) of the nearest of particles at (n, d) [m] that lie rather along it than across,
    infinite where there is none."""
    size = np.abs(away)
    along = (size == size.max(axis=1, keepdims=True)) & (size > 0.0)
    return np.asarray(np.where(along, size, np.inf).min(axis=0, initial=np.inf))


def point_among(particles: list[tuple[int, tuple[float, ...]]]) -> ProbePoint:
    """A point among particles, each with its identifier and how far it is along its axes in spacings."""
    identifiers = np.array([name for name, _ in particles])
    apart = np.array([away for _, away in particles])
    r2 = (apart**2).sum(axis=1)
    near = apart[r2 <= max(_BESIDE**2, r2.min())]
    inside = np.clip(0.0, near.min(axis=0), near.max(axis=0))
    continued, between = _weights(apart), np.maximum(_weights(apart - inside), 0.0)
    used = (continued != 0.0) | (between != 0.0)
    return ProbePoint(identifiers[used], continued[used], between[used] / between.sum())


def _weights(apart: np.ndarray) -> np.ndarray:
    """Weights (k,) of moving least squares that interpolate (Lancaster and Salkauskas 1981, Math. Comp. 37, 141),
    exact for linear fields, of particles at distances (k, d) from the point."""
    r2 = (apart**2).sum(axis=1)
    if r2.min() < _SAME**2:
        return (np.arange(len(r2)) == np.argmin(r2)).astype(float)
    found = weight = 1.0 / r2
    for reach, least in _REACHES:
        near = np.maximum(1.0 / r2 - 1.0 / reach**2, 0.0)
        # a nearest particle that is farther than the last reach stands alone
        if near.any():
            weight = near
        # about the centre, so that weights add up to 1 also where particles lie in a line: a field is taken to be the
        # same across it
        share = weight / weight.sum()
        centre = share @ apart
        off = apart - centre
        moments = off.T @ (share[:, None] * off)
        found = share * (1.0 - off @ (np.linalg.pinv(moments, rcond=least, hermitian=True) @ centre))
        exact = least > _CUT_OFF or np.abs(found @ apart).max() < _SAME
        if exact and np.abs(found).sum() < _LARGEST:
            break
    return np.asarray(found)


class ParticleField(Sampler):
    """Components of a field at a material point; a tensor has those of the plane in 2-D."""

    def __init__(self, name: str, columns: list[str], place: ProbePoint, field: str):
        super().__init__(name, columns)
        self.place, self.field = place, field

    def part(self, watched: Observables) -> np.ndarray:
        return self.place.value(watched, self.field, len(self.columns))


# NaN of a system without such a value, as of the tip of no crack, does not count
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

    A tensor has the components of the plane in 2-D.
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
