"""Probes between particles: values of coarse runs at the place of the run's particle, and what that place costs.

A probe takes the particle nearest to its place, which is another place in every run. A coarse run therefore also
records the particles of its lattice around the place of a probe, between which values are linear along each direction.
"""

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np

from parsolid.campaign.coarsening import BodyLattice, NotCoarsened, lattices_of
from parsolid.scene import Scene

History = dict[str, np.ndarray]
# of an interval, below which a place is that of a particle
_ROUND_OFF = 1e-6


class Corners(NamedTuple):
    """Particles of a variant around a probe's place [m]: the first one (d,), the way to the next along each direction
    (d,), and a probe for each, named in the order of itertools.product.
    """

    probe: str
    first: tuple[float, ...]
    apart: tuple[float, ...]
    names: tuple[str, ...]

    def weights(self, place: np.ndarray) -> np.ndarray:
        """Of the corners (2^d,), for a place (d,) [m]."""
        apart = np.array(self.apart)
        share = np.where(apart > 0.0, (place - np.array(self.first)) / np.where(apart > 0.0, apart, 1.0), 0.0)
        picks = itertools.product(*(((0, 1) if step > 0.0 else (0,)) for step in apart))
        return np.array([np.prod([s if bit else 1.0 - s for s, bit in zip(share, bits)]) for bits in picks])

    def value(self, history: History, quantity: str, place: np.ndarray) -> np.ndarray | None:
        """A quantity's history (n,) at a place; None where the run has no such columns."""
        columns = [f"{name}.{quantity}" for name in self.names]
        if not all(column in history for column in columns):
            return None
        found: np.ndarray = self.weights(place) @ np.array([history[column] for column in columns])
        return found


def box_of(scene: Scene, place: np.ndarray) -> BodyLattice | None:
    """The lattice of the one box that has a place; None where that is no box of even particles, or several."""
    try:
        lattices = lattices_of(scene)
    except NotCoarsened:
        return None
    if not lattices:
        return None
    room = 1e-9 * np.ptp([bound for one in lattices for bound in (one.lower, one.upper)])
    found = [one for one in lattices if (place >= one.lower - room).all() and (place <= one.upper + room).all()]
    if len(found) != 1:
        return None
    body = scene.bodies[found[0].number]
    return found[0] if body.shape.kind == "box" and body.jitter == 0.0 else None


def nearest(lattice: BodyLattice, place: np.ndarray) -> np.ndarray:
    """Where the particle nearest to a place (d,) is [m]."""
    step = (lattice.upper - lattice.lower) / np.array(lattice.intervals)
    result: np.ndarray = place - lattice.offsets(place, lattice.intervals) * step
    return result


def with_corners(scene: Scene, coarse: Scene, tables: dict[str, Any]) -> tuple[dict[str, Any], tuple[Corners, ...]]:
    """A variant's tables with probes around the places at which it or the run has no particle, and these."""
    corners: list[Corners] = []
    probes = list(tables.get("probes", ()))
    for probe in scene.probes:
        if probe.at is None:
            continue
        place = np.array(probe.at, float)
        own, other = box_of(scene, place), box_of(coarse, place)
        if own is None or other is None:
            continue
        off = max(float(np.abs(one.offsets(place, one.intervals)).max()) for one in (own, other))
        if off > _ROUND_OFF:
            table = next(one for one in probes if one["name"] == probe.name)
            found, more = _around(probe.name, other, place, table)
            corners.append(found)
            probes += more
    return (tables | {"probes": probes} if corners else tables), tuple(corners)


def _around(
    name: str, lattice: BodyLattice, place: np.ndarray, table: dict[str, Any]
) -> tuple[Corners, list[dict[str, Any]]]:
    counts, ends = np.array(lattice.intervals), np.array(lattice.ends)
    step, particles = (lattice.upper - lattice.lower) / counts, counts + ends
    where = (place - lattice.lower) / step - 0.5 * (1 - ends)
    below = np.clip(np.floor(where + _ROUND_OFF), 0, np.maximum(particles - 2, 0))
    first = lattice.lower + (below + 0.5 * (1 - ends)) * step
    apart = np.where(particles > 1, step, 0.0)
    picks = list(itertools.product(*(((0, 1) if one > 0.0 else (0,)) for one in apart)))
    names = tuple(f"{name}_corner{number}" for number in range(len(picks)))
    tables = [table | {"name": one, "at": list(first + np.array(bits) * apart)} for one, bits in zip(names, picks)]
    return Corners(name, tuple(map(float, first)), tuple(map(float, apart)), names), tables


def at_particles(scene: Scene, history: History, corners: tuple[Corners, ...]) -> tuple[History, History]:
    """The history of a variant with probes where the run's particles are, and how much its columns differ between there
    and where the probes are requested, of those that no particle of the run has.
    """
    result, apart = dict(history), dict[str, np.ndarray]()
    for one, place, columns in _requested(scene, corners):
        lattice = box_of(scene, place)
        if lattice is None:
            continue
        here, off = nearest(lattice, place), np.abs(lattice.offsets(place, lattice.intervals)).max() > _ROUND_OFF
        for column in columns:
            quantity = column.partition(".")[2]
            there, requested = one.value(history, quantity, here), one.value(history, quantity, place)
            if there is not None and requested is not None:
                result[column] = there
                apart |= {column: requested - there} if off else {}
    return result, apart


def at_requested(scene: Scene, history: History, corners: tuple[Corners, ...]) -> History:
    """A history with probes at the places that the scene requests, between the particles recorded around them."""
    result = dict(history)
    if not history:
        return result
    for one, place, columns in _requested(scene, corners):
        for column in columns:
            value = one.value(history, column.partition(".")[2], place)
            if value is not None:
                result[column] = value
        result = {name: values for name, values in result.items() if name.partition(".")[0] not in one.names}
    return result


def _requested(scene: Scene, corners: tuple[Corners, ...]) -> Iterator[tuple[Corners, np.ndarray, list[str]]]:
    """Corners with the place (d,) [m] and the columns of their probe, of those that the scene has."""
    probes = {probe.name: probe for probe in scene.probes if probe.at is not None}
    for one in corners:
        if one.probe in probes:
            probe = probes[one.probe]
            yield one, np.array(probe.at, float), list(probe.columns(scene.dimension))
