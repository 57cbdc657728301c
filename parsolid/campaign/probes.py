"""Probes between particles: values of coarse runs at the place of the run's particle, and what that place costs.

A probe takes the particle nearest to its place, which is another place in every run. A coarse run therefore also
records the particles around the place of a probe: of its lattice those between which values are linear along each
direction, of a mesh the vertices of the triangle or tetrahedron there.
"""

import itertools
from collections.abc import Iterator
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from parsolid.campaign.coarsening import BodyLattice, NotCoarsened, lattices_of
from parsolid.particles.meshes.imported import read_mesh
from parsolid.particles.meshes.slices import agreed
from parsolid.scene import Scene
from parsolid.scene.validation_errors import SceneError

History = dict[str, np.ndarray]
# of an interval, below which a place is that of a particle
_ROUND_OFF = 1e-6


class OfLattice(NamedTuple):
    """Particles of a lattice: where the first one is (d,) [m], and the way to the next along each direction (d,)."""

    first: tuple[float, ...]
    apart: tuple[float, ...]

    @property
    def steps(self) -> np.ndarray:
        """From the first particle to each (2^d, d), 0 or 1 along each direction."""
        return np.array(list(itertools.product(*((0, 1) if apart > 0.0 else (0,) for apart in self.apart))))

    def weights(self, place: np.ndarray) -> np.ndarray:
        """Of the particles (2^d,) in the order of their steps, for a place (d,) [m]."""
        apart = np.array(self.apart)
        share = np.where(apart > 0.0, (place - np.array(self.first)) / np.where(apart > 0.0, apart, 1.0), 0.0)
        return np.asarray(np.prod(np.where(self.steps == 1, share, 1.0 - share), axis=1))


class OfSimplex(NamedTuple):
    """Particles at the vertices (d + 1, d) [m] of a triangle or tetrahedron."""

    vertices: tuple[tuple[float, ...], ...]

    def weights(self, place: np.ndarray) -> np.ndarray:
        """Of the vertices (d + 1,), for a place (d,) [m]."""
        corners = np.array(self.vertices)
        rest = np.linalg.solve((corners[1:] - corners[0]).T, place - corners[0])
        return np.concatenate([[1.0 - rest.sum()], rest])


class Corners(NamedTuple):
    """Particles of a variant around a probe's place [m], and a probe for each; own: where the particle (d,) of the run
    is that has the probe there; displaced: whether that is another place."""

    probe: str
    between: OfLattice | OfSimplex
    names: tuple[str, ...]
    own: tuple[float, ...]
    displaced: bool

    def value(self, history: History, quantity: str, place: np.ndarray) -> np.ndarray | None:
        """A quantity's history (n,) at a place; None where the run has no such columns."""
        columns = [f"{name}.{quantity}" for name in self.names]
        if not all(column in history for column in columns):
            return None
        found: np.ndarray = self.between.weights(place) @ np.array([history[column] for column in columns])
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
    """A variant's tables with probes around the places at which it or the run has no particle, and these. Collective
    where bodies are meshes."""
    placed = [probe for probe in scene.probes if probe.at is not None]
    if placed and all(body.shape.kind == "mesh" for body in scene.bodies):
        try:
            places = [np.array(probe.at, float) for probe in placed]
            found = agreed(MPI.COMM_WORLD, lambda: [_vertices(one, places) for one in (scene, coarse)])
        except SceneError:
            # the run itself tells of a mesh that cannot be made
            return tables, ()
        around = [_in_simplex(*one) for one in zip(places, *found)]
    else:
        around = [_in_lattice(scene, coarse, np.array(probe.at, float)) for probe in placed]
    corners: list[Corners] = []
    probes = list(tables.get("probes", ()))
    for probe, one in zip(placed, around):
        if one is None:
            continue
        between, where, own, displaced = one
        names = tuple(f"{probe.name}_corner{number}" for number in range(len(where)))
        corners.append(Corners(probe.name, between, names, tuple(map(float, own)), displaced))
        table = next(one for one in probes if one["name"] == probe.name)
        probes += [table | {"name": name, "at": list(map(float, at))} for name, at in zip(names, where)]
    return (tables | {"probes": probes} if corners else tables), tuple(corners)


# what is around a place: between which particles it is, where these are, where the particle of the run is, and whether
# that is another place
_Around = tuple[OfLattice | OfSimplex, np.ndarray, np.ndarray, bool]


def _in_lattice(scene: Scene, coarse: Scene, place: np.ndarray) -> _Around | None:
    own, lattice = box_of(scene, place), box_of(coarse, place)
    if own is None or lattice is None:
        return None
    off = [float(np.abs(one.offsets(place, one.intervals)).max()) for one in (own, lattice)]
    if max(off) <= _ROUND_OFF:
        return None
    counts, ends = np.array(lattice.intervals), np.array(lattice.ends)
    step, particles = (lattice.upper - lattice.lower) / counts, counts + ends
    where = (place - lattice.lower) / step - 0.5 * (1 - ends)
    below = np.clip(np.floor(where + _ROUND_OFF), 0, np.maximum(particles - 2, 0))
    first = lattice.lower + (below + 0.5 * (1 - ends)) * step
    apart = np.where(particles > 1, step, 0.0)
    between = OfLattice(tuple(map(float, first)), tuple(map(float, apart)))
    return between, first + between.steps * apart, nearest(own, place), off[0] > _ROUND_OFF


def _in_simplex(
    place: np.ndarray, of_run: tuple[np.ndarray, Any], of_variant: tuple[np.ndarray, np.ndarray | None]
) -> _Around | None:
    own, (vertex, corners) = of_run[0], of_variant
    if corners is None:
        return None
    room = _ROUND_OFF * np.linalg.norm(corners[1] - corners[0])
    off = [float(np.linalg.norm(one - place)) for one in (own, vertex)]
    if max(off) <= room:
        return None
    return OfSimplex(tuple(tuple(map(float, one)) for one in corners)), corners, own, bool(off[0] > room)


def _vertices(scene: Scene, places: list[np.ndarray]) -> list[tuple[np.ndarray, np.ndarray | None]]:
    """Of a scene of meshes, for each place (d,) [m] the nearest vertex, and the vertices (d + 1, d) of the triangle or
    tetrahedron in which it is, or which is nearest; None where there are others alone. Raises SceneError."""
    cells = list[np.ndarray]()
    for stated in (body.shape.model for body in scene.bodies):
        mesh, first = read_mesh(stated.file, scene.dimension, stated), 0
        for _, block in mesh.blocks:
            kept = np.ones(len(block), bool)
            if stated.group is not None:
                kept = np.isin(first + np.arange(len(block)), mesh.groups.elements.get(stated.group, ()))
            cells.append(stated.scale * mesh.points[block[kept]])
            first += len(block)
    simplices = [one for one in cells if one.shape[1] == scene.dimension + 1 and len(one)]
    result = []
    for place in places:
        apart = [np.linalg.norm(one - place, axis=2) for one in cells]
        least = int(np.argmin([one.min(initial=np.inf) for one in apart]))
        vertex = cells[least].reshape(-1, scene.dimension)[np.argmin(apart[least])]
        # beyond that the place is outside of all of them
        best, around = -0.5, None
        for corners in simplices:
            arms = (corners[:, 1:] - corners[:, :1]).transpose(0, 2, 1)
            rest = np.linalg.solve(arms, (place - corners[:, 0])[:, :, None])[:, :, 0]
            inside = np.minimum(rest.min(axis=1), 1.0 - rest.sum(axis=1))
            if inside.max() > best:
                best, around = float(inside.max()), corners[np.argmax(inside)]
        result.append((vertex, around))
    return result


def at_particles(scene: Scene, history: History, corners: tuple[Corners, ...]) -> tuple[History, History]:
    """The history of a variant with probes where the run's particles are, and how much its columns differ between there
    and where the probes are requested, of those that no particle of the run has.
    """
    result, apart = dict(history), dict[str, np.ndarray]()
    for one, place, columns in _requested(scene, corners):
        for column in columns:
            quantity = column.partition(".")[2]
            there, requested = one.value(history, quantity, np.array(one.own)), one.value(history, quantity, place)
            if there is not None and requested is not None:
                result[column] = there
                apart |= {column: requested - there} if one.displaced else {}
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
