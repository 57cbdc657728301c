"""Bodies whose particles are the nodes of a lattice: boxes, whose sums run along their axes (`pairs.box_sweeps`), and
perforated boxes, whose cells give weights to pair lists (`pairs.cell_weights`)."""

from collections.abc import Callable, Iterator
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from decomposition.boxes import BoxOfNodes, cut_boxes, owners
from parsolid.collective import SolverError, maximum, minimum, raise_together
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.viscoelastic.maxwell import total_modulus
from parsolid.methods.tlsph.body_weights import ON_LATTICES, weights_of_bodies
from parsolid.pairs.box_stable_step import BoxWaves, feeds_waves, feeds_waves_of_volume, most_change
from parsolid.pairs.box_weights import REACH, Axis, lengths_of, shares_of
from parsolid.pairs.cell_weights import Cells, cells_around
from parsolid.particles.fillings import filling_of
from parsolid.particles.particle_set import ParticleSet

# part of the highest frequency of a cell by which small free bodies at Poisson's ratio 0.4999 bound a step of leapfrog
_LEAPFROG = 0.56
# highest frequency of one cell with steps of 1 m and waves of 1 m/s, along an axis: it bounds any union of cells
_ONE_CELL = 2.0
# least length of a node over the least distance of nodes of a graded axis: 17/48 at the ends of even ones
_THINNEST = 0.2
# of axes of fourth order, which alone have it
_FED = "with them method.dissipation would feed waves; more particles change slower, or less of it"
# over the offset of the farthest neighbour
_WIDENED = 1.02
# Poisson's ratios, and the parts of their energy without which nodes where a clamp meets a free face leave no error of
# the leading order in the spacing: a bar in plane strain that is pulled, 16 against 32 nodes across with fourth-order
# weights (benchmarks/clamp_edges.py)
_POISSONS_RATIOS = (0.0, 0.15, 0.25, 0.3, 0.35, 0.4, 0.45, 0.48, 0.49)
_EDGE_PARTS = (0.0, 0.058, 0.154, 0.221, 0.308, 0.427, 0.606, 0.78, 0.88)
# ratio of spacings up to which these hold, and the fewest nodes along an axis: less reduced corners give way in large
# strain
_EVEN, _EDGES_APART = 1.5, 6
_NO_EDGES = "method.clamp_edges: expected 0 unless a fixed plane meets a free face of a box on a lattice, found {:g}"
# least planes of a rank's part at the end of a box: of fourth order its nodes reach three planes, and stand together
_END_PLANES = {"fourth-order": 4, "cells": 2}


class LatticeBody(NamedTuple):
    """A body of nodes: its number, its axes in space, whether those with room are of fourth order, whether it is a box,
    the number of its first particle, rows (k,) of this rank's nodes where a clamp meets a free face, ascending, and the
    part of their stress energy that they do without, volumes (n,) [m^3] of the cells of this rank's nodes of a box, and
    the cells around those of a body that is no box."""

    body: int
    axes: tuple[Axis, ...]
    fourth_order: bool
    box: bool
    first_identifier: int
    clamp_edges: np.ndarray
    edge_part: float
    cell_volume: np.ndarray
    cells: Cells | None

    @property
    def reach(self) -> float:
        """Distance of the farthest neighbour in spacings, and a little more."""
        return _WIDENED * (REACH if self.fourth_order else 1)

    @property
    def least_mass(self) -> float:
        """The least mass of a node on a face over that of its cell."""
        lengths = [
            (lengths_of(axis, self.fourth_order and axis.has_room), lengths_of(axis, False)) for axis in self.axes
        ]
        return min(float((own / cells).min()) for own, cells in lengths)

    def signal_speed(self, settings: Any) -> Callable[[float, float], float]:
        """Least spacing over the largest step of leapfrog [m/s], by the speeds of pressure and of shear waves [m/s].

        Of any union of cells w^2 dt^2 + 2 b dt = 4 with the highest frequency, which has a little damping, and that of
        the wave that alternates from node to node.
        """
        if self.box:
            return BoxWaves(
                self.axes, self.fourth_order, settings.dissipation_of("kernel"), settings.reconstruction
            ).signal_speed
        # less dissipation than the usual does not make the step longer
        most, d = max(1.0, settings.dissipation_of("kernel")), len(self.axes)
        least = min(axis.step for axis in self.axes)
        frequency = float(np.linalg.norm([_ONE_CELL * least / axis.step for axis in self.axes]))
        return partial(_weighted, most * max(1.0, _LEAPFROG * frequency), most * (d - 1))


def _weighted(fast: float, slow: float, pressure: float, shear: float) -> float:
    return fast * pressure + slow * shear


def find_lattice_bodies(
    comm: Any, scene: Any, particle_set: ParticleSet, kinds: list[str], planes: Any, held: np.ndarray, laws: Any
) -> list[LatticeBody]:
    """The bodies with weights of lattices by their kinds (`body_weights`); collective.

    planes: mirror planes; held (n, d): components of the particles that supports hold; laws: of the bodies. Sets volume
    and area of the bodies' particles in the particle_set; `without_edges` gives the volumes that store energy.
    Raises SolverError on all ranks where a mirror plane lies beside the nodes, for boxes without room, for gradings
    that the dissipation does not bear, and for `clamp_edges` without any.
    """
    settings, d = scene.method, particle_set.position.shape[1]
    first, found, fault = _first_identifiers(comm, len(kinds), particle_set), [], None
    for body in (i for i, kind in enumerate(kinds) if kind in ON_LATTICES):
        rows = np.flatnonzero(particle_set.body == body)
        filling: Any = filling_of(scene.bodies[body], d)
        try:
            axes = _axes(filling, [plane for plane in planes if plane.body in (None, body)])
            fourth_order = kinds[body] == "fourth-order" and any(axis.has_room for axis in axes)
            if settings.weights == kinds[body] == "fourth-order" and not fourth_order:
                expected = 'for "fourth-order" an axis with 4 nodes or more, 8 with images or where spacings differ'
                counts = [axis.nodes for axis in axes]
                raise SolverError(f"method.weights: expected {expected}, found particles = {counts} in bodies.{body}")
            index = filling.nodes(particle_set.identifier[rows] - int(first[body]))
            # which ends of axes stand still
            free = ~held[rows].all(axis=1)
            ends = [(i == end) & free for axis, i in zip(axes, index) for end in (0, axis.nodes - 1)]
            moves = maximum(comm, np.array([float(end.any()) for end in ends])).reshape(-1, 2)
            axes = [axis._replace(held=(not low, not high)) for axis, (low, high) in zip(axes, moves)]
            # distances that change so fast that a node would have no volume, or waves would grow
            ratio = float(np.sqrt(speed_ratio(laws[body])))
            fed, dissipation = fourth_order and settings.reconstruction, settings.dissipation_of("kernel")
            for k, axis in enumerate(axes):
                if not axis.places:
                    continue
                length = lengths_of(axis, fourth_order and axis.has_room)
                if (length < _THINNEST * axis.step * np.diff(axis.places).min()).any():
                    raise SolverError(_too_fast(body, k, axis, "more particles change slower"))
                if fed and axis.has_room and feeds_waves(axis, True, dissipation):
                    raise SolverError(_too_fast(body, k, axis, _FED))
                if fed and axis.has_room and feeds_waves_of_volume(axis, dissipation, ratio):
                    raise SolverError(_too_fast(body, k, axis, f"where volume hardly changes, {_FED}"))
        except SolverError as error:
            # on all ranks
            fault = fault or str(error)
            continue
        cell_volume = _volume_and_area(index, axes, False)[0]
        cells, edges, part, box = None, np.zeros(len(rows), bool), 0.0, scene.bodies[body].shape.kind == "box"
        if box:
            particle_set.volume[rows], particle_set.area[rows] = _volume_and_area(index, axes, fourth_order)
            part = _edge_part_of(laws[body], axes) if settings.clamp_edges is None else settings.clamp_edges
            edges = on_clamp_edges(axes, index) & (part > 0.0)
        else:
            cells = cells_around(index, axes, filling.holds_cells)
            particle_set.volume[rows], particle_set.area[rows] = cells.volume, cells.area
        stated = body, tuple(axes), fourth_order, box, int(first[body]), np.sort(rows[edges]), part
        found.append(LatticeBody(*stated, cell_volume, cells))
    edges_anywhere = not settings.clamp_edges or any(one.box and _have_clamp_edges(one.axes) for one in found)
    if kinds and set(kinds) & set(ON_LATTICES):
        raise_together(comm, fault or (None if edges_anywhere else _NO_EDGES.format(settings.clamp_edges)))
    return found


def _first_identifiers(comm: Any, bodies: int, particle_set: ParticleSet) -> np.ndarray:
    first = np.full(bodies, np.inf)
    np.minimum.at(first, particle_set.body, particle_set.identifier)
    return minimum(comm, first)


def _volume_and_area(index: list[np.ndarray], axes: list[Axis], fourth_order: bool) -> tuple[np.ndarray, np.ndarray]:
    """Volumes (n,) and outward area vectors (n, d) of nodes of a box, of its part on this side of mirror planes; index:
    d arrays (n,)."""
    own = [(lengths_of(axis, fourth_order and axis.has_room) * shares_of(axis))[i] for axis, i in zip(axes, index)]
    sides = [(i == axis.nodes - 1).astype(float) - (i == 0) for axis, i in zip(axes, index)]
    area = np.zeros((len(index[0]), len(axes)))
    for k, side in enumerate(sides):
        area[:, k] = side * np.prod([length for j, length in enumerate(own) if j != k], axis=0)
    return np.prod(own, axis=0), area


def _axes(filling: Any, planes: list[Any]) -> list[Axis]:
    """The axes of a body with the mirror planes at their ends; planes: those meant for it."""
    result = []
    for k, line in enumerate(filling.lines):
        mirrors = ["", ""]
        for plane in planes:
            if plane.axis != k:
                continue
            distance = np.abs(np.array([line.lower, line.upper]) - plane.coordinate) / line.step
            for end in (0, 1):
                mirrors[end] = plane.kind if distance[end] <= 1e-6 else mirrors[end]
            if 1e-6 < distance.min() < REACH:
                raise SolverError(
                    f"boundaries: expected mirror planes through nodes of bodies on lattices or far from them, found "
                    f"{'XYZ'[k]} = {plane.coordinate:g} at {distance.min():.3g} spacings from the nearest end"
                )
        places = () if line.shares is None else tuple((line.shares * (line.count - 1)).tolist())
        result.append(Axis(line.count, line.step, (mirrors[0], mirrors[1]), places))
    return result


def _edge_part_of(law: Any, axes: list[Axis]) -> float:
    """Part of their stress energy that nodes where a clamp meets a free face do without by default.

    It is given by Poisson's ratio at rest, on which the singular stress there depends. It is 0 for elastic-plastic
    bodies, which bound that stress, where spacings differ, for which no part fits all loads, and for few nodes.
    """
    spacings = np.concatenate([axis.step * (np.diff(axis.places) if axis.places else np.ones(1)) for axis in axes])
    few = min(axis.with_images for axis in axes) < _EDGES_APART
    if isinstance(law, ElasticPlastic) or few or spacings.max() > _EVEN * spacings.min():
        return 0.0
    shear, lame = elastic_moduli(law)
    return float(np.interp(0.5 * lame / (lame + shear), _POISSONS_RATIOS, _EDGE_PARTS))


def without_edges(volume: np.ndarray, bodies: list[LatticeBody]) -> np.ndarray:
    """Volumes (n,) [m^3] that count for stress and stored energy: `clamp_edges` take a part away."""
    result = volume.copy()
    for one in bodies:
        result[one.clamp_edges] *= 1.0 - one.edge_part
    return result


def on_clamp_edges(axes: list[Axis], index: list[np.ndarray]) -> np.ndarray:
    """Which nodes (n,) of a box are where an end that stands still meets a free one; index: d arrays (n,)."""
    still, free = np.zeros(len(index[0]), bool), np.zeros(len(index[0]), bool)
    for axis, i in zip(axes, index):
        for end in (0, 1):
            there = i == (axis.nodes - 1) * end
            still |= there & axis.held[end]
            free |= there & (not axis.held[end] and not axis.mirrors[end])
    return still & free


def _have_clamp_edges(axes: tuple[Axis, ...]) -> bool:
    """Whether any node of a box is on such an edge."""
    held = [any(axis.held) for axis in axes]
    free = [any(not still and not mirror for still, mirror in zip(axis.held, axis.mirrors)) for axis in axes]
    return any(held[i] and free[j] for i in range(len(axes)) for j in range(len(axes)) if i != j)


def _too_fast(body: int, k: int, axis: Axis, remedy: str) -> str:
    return (
        f"bodies.{body}.grading.{k}: expected spacings that change less from one to the next, found "
        f"{most_change(axis):.3g} times; {remedy}"
    )


def speed_ratio(law: Any) -> float:
    """Square of the speed of shear waves at rest over that of pressure waves."""
    shear, lame = elastic_moduli(law)
    shear += total_modulus(law.branch_moduli)
    return float(shear / (lame + 2.0 * shear))


# --- boxes on many ranks --------------------------------------------------------------------------------------------


class BoxCuts:
    """The boxes of a scene and the parts of them that ranks have; every rank computes the same.

    bodies: their numbers; nodes: `BoxOfNodes` of each; parts (boxes, ranks, 2, d).
    """

    def __init__(self, scene: Any, ranks: int) -> None:
        kinds = weights_of_bodies(scene.method.pair_weights, scene)
        self.bodies, self._every = boxes_of(scene, kinds), len(kinds)
        self.nodes = [_box_of_nodes(filling_of(scene.bodies[i], scene.dimension), kinds[i]) for i in self.bodies]
        self.parts = cut_boxes(self.nodes, ranks)

    def owners(self, comm: Any, particle_set: ParticleSet) -> np.ndarray:
        """Rank (n,) int32 of the nodes of boxes, -1 of other particles; collective."""
        owner = np.full(len(particle_set), -1, np.int32)
        for rows, index, nodes, parts in self._places(comm, particle_set):
            owner[rows] = owners(parts, nodes.axes, index)
        return owner

    def order(self, comm: Any, particle_set: ParticleSet, order: np.ndarray, group: np.ndarray) -> np.ndarray:
        """Order (n,) by group, and within it along the memory axes of a box, else as in `order`; group (n,): every box
        has one of its own; collective."""
        within = np.empty(len(order), np.int64)
        within[order] = np.arange(len(order))
        for rows, index, nodes, _ in self._places(comm, particle_set):
            within[rows] = np.ravel_multi_index([index[axis] for axis in nodes.axes], nodes.shape)
        return np.lexsort((within, group))

    def _places(self, comm: Any, particle_set: ParticleSet) -> Iterator[tuple[Any, ...]]:
        """Of each box: rows (n,) of the particles here, their d indices (n,) along the axes in space, nodes, parts."""
        first = _first_identifiers(comm, self._every, particle_set)
        for body, nodes, parts in zip(self.bodies, self.nodes, self.parts):
            rows = np.flatnonzero(particle_set.body == body)
            shape = tuple(len(places) for places in nodes.places)
            yield rows, list(np.unravel_index(particle_set.identifier[rows] - int(first[body]), shape)), nodes, parts


def boxes_of(scene: Any, kinds: list[str]) -> list[int]:
    """Bodies that are boxes with weights of lattices."""
    return [i for i, kind in enumerate(kinds) if kind in ON_LATTICES and scene.bodies[i].shape.kind == "box"]


def _box_of_nodes(filling: Any, kind: str) -> BoxOfNodes:
    places = tuple(line.place(np.arange(line.count)) for line in filling.lines)
    slowest_first = tuple(int(k) for k in np.argsort([-len(one) for one in places], kind="stable"))
    return BoxOfNodes(places, slowest_first, ((_END_PLANES[kind],) * 2,) * len(places))
