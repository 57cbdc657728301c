"""Bodies whose particles are the nodes of a lattice: their pair weights in closed form, with their own volumes and
areas."""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import SolverError, maximum, minimum, raise_together
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.viscoelastic.maxwell import total_modulus
from parsolid.methods.tlsph.body_weights import ON_LATTICES
from parsolid.pairs.axis_waves import Lattice, feeds_waves, feeds_waves_of_volume, most_change, signal
from parsolid.pairs.lattice_pairs import Lattices
from parsolid.pairs.lattice_stencils import WIDEST, Axis, Stencils, box_stencils, cell_stencils, lengths_of
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.fillings import filling_of

# what bounds a step: on the axes of frequencies and of damping the region of three-stage Runge-Kutta schemes ends here
_RK3_FREQUENCY, _RK3_DAMPING = 1.7320, 2.5127
# of leapfrog, twice as many steps, and the damping of small free bodies at Poisson's ratio 0.4999
_LEAPFROG = 0.56
# part of a bound that is used
_SAFETY = 0.95
# highest frequency of cells along an axis with steps of 1 m and waves of 1 m/s: of one cell, which bounds any union of
# them, and of two or more in a row
_ONE_CELL, _MORE_CELLS = 2.0, 1.5
# damping of the wave that alternates from node to node along an axis, over that of cells: twice the largest weight
_DAMPING = {"cells": 1.0, "fourth-order": 4.0 / 3.0}
# least length of a node over the least distance of nodes of a graded axis: 17/48 at the ends of even ones
_THINNEST = 0.2
# of axes of fourth order, which alone have it
_FED = "with them method.dissipation would feed waves; more particles change slower, or less of it"
_NO_EDGES = "method.clamp_edges: expected 0 unless a fixed plane meets a free face of a box on a lattice, found {:g}"
# a hair more than the offset of the farthest neighbour
_HAIR = 1.02


class LatticeBodies(NamedTuple):
    """lattices: those of a rank's particles; reach (n,): distance of the farthest neighbour in spacings, 0 on none.

    frequency, damping: greatest of all bodies, of pressure waves and of the dissipation, in units of the spacing, the
    wave speed and, for the damping, of that of cells. signals: of each body the speed that takes a spacing in the
    largest step of leapfrog, by those of pressure and shear waves. even (n, d): places [m] with even steps in bodies
    whose steps are graded, None where no body's are.
    """

    lattices: Lattices
    reach: np.ndarray
    frequency: float
    damping: float
    signals: list[Callable[[float, float], float]]
    even: np.ndarray | None = None

    def largest_step(self, pressure: float, shear: float, dissipation: float) -> float:
        """Largest step, in spacings, of SSP-RK3 for waves of these speeds and a factor on the dissipation.

        The dissipation acts on nearest neighbours with the impedances of both waves: a velocity that alternates from
        node to node along every axis decays at the rate 2 [c_p + (d - 1) c_s] times `damping`. Less dissipation than
        the usual does not make the step longer.
        """
        decay = 2.0 * self.damping * max(1.0, dissipation) * (pressure + (self.lattices.spacing.shape[1] - 1) * shear)
        return _SAFETY * min(_RK3_FREQUENCY / (self.frequency * pressure), _RK3_DAMPING / decay)


def put_on_lattices(
    comm: Any, scene: Any, particle_set: ParticleSet, boundaries: Any, kinds: list[str], laws: Any
) -> LatticeBodies | None:
    """Weights of the bodies that are on lattices by their kinds (`body_weights`), None where no body is; collective.

    boundaries: those with planes that have images, and with what is held; laws: of the bodies. Sets volume and
    area of the bodies' particles in the particle_set.
    Raises SolverError on all ranks where a mirror plane lies beside the nodes, for boxes without room, and
    for `clamp_edges` without any.
    """
    if not set(kinds) & set(ON_LATTICES):
        return None
    n, d = particle_set.position.shape
    weight, undamped = np.zeros((n, d, 2 * WIDEST + 1)), np.zeros((n, d, 2), bool)
    lattices = Lattices(np.full(n, -1), particle_set.spacing.copy(), weight, undamped)
    reach, frequency, damping, signals = np.zeros(n), 0.0, 0.0, []
    even = particle_set.position.copy() if any(body.grading is not None for body in scene.bodies) else None
    first = _first_identifiers(comm, len(kinds), particle_set)
    fault, edges = None, scene.method.clamp_edges == 0.0
    for body, kind in enumerate(kinds):
        if kind not in ON_LATTICES:
            continue
        rows = np.flatnonzero(particle_set.body == body)
        filling: Any = filling_of(scene.bodies[body], d)
        try:
            axes = _axes(filling, [plane for plane in boundaries.planes if plane.body in (None, body)])
            wide = kind == "fourth-order" and any(axis.wide for axis in axes)
            if scene.method.weights == kind == "fourth-order" and not wide:
                raise SolverError(_no_room(body, axes))
            index = filling.nodes(particle_set.identifier[rows] - int(first[body]))
            axes = _with_held_ends(comm, axes, index, boundaries.held, rows)
            _check_grading(body, axes, wide, scene.method, float(np.sqrt(speed_ratio(laws[body]))))
        except SolverError as error:
            # on all ranks
            fault = fault or str(error)
            continue
        stencils = _stencils(filling, index, axes, wide, scene.method.clamp_edges)
        if even is not None:
            even[rows] = np.stack([line.coordinate(i) for line, i in zip(filling.lines, index)], axis=1)
        lattices.number[rows], weight[rows] = body, stencils.weight
        undamped[rows] = stencils.undamped & scene.method.reconstruction
        particle_set.volume[rows], particle_set.area[rows] = stencils.volume, stencils.area
        reach[rows] = _HAIR * (WIDEST if wide else 1)
        box, most = scene.bodies[body].shape.kind == "box", _DAMPING["fourth-order" if wide else "cells"]
        edges = edges or (box and _have_clamp_edges(axes))
        frequency, damping = max(frequency, _frequency(axes, wide, box)), max(damping, most)
        signals.append(_signal(axes, wide, box, scene.method))
    raise_together(comm, fault or (None if edges else _NO_EDGES.format(scene.method.clamp_edges)))
    lattices = lattices._replace(graded=even is not None)
    return LatticeBodies(lattices, reach, frequency, damping, signals, even)


def _first_identifiers(comm: Any, bodies: int, particle_set: ParticleSet) -> np.ndarray:
    first = np.full(bodies, np.inf)
    np.minimum.at(first, particle_set.body, particle_set.identifier)
    return minimum(comm, first)


def _with_held_ends(comm: Any, axes: list[Axis], index: list[np.ndarray], held: Any, rows: np.ndarray) -> list[Axis]:
    """Axes that know which of their ends stand still; index: d arrays (n,) of the particles at rows; held (n, d):
    components of all particles; collective."""
    free = ~held[rows].all(axis=1)
    ends = [(i == end) & free for axis, i in zip(axes, index) for end in (0, axis.nodes - 1)]
    moves = maximum(comm, np.array([float(end.any()) for end in ends])).reshape(-1, 2)
    return [axis._replace(held=(not low, not high)) for axis, (low, high) in zip(axes, moves)]


def on_clamp_edges(axes: list[Axis], index: list[np.ndarray]) -> np.ndarray:
    """Which nodes (n,) of a box are where an end that stands still meets a free one; index: d arrays (n,)."""
    held, free = np.zeros(len(index[0]), bool), np.zeros(len(index[0]), bool)
    for axis, i in zip(axes, index):
        for end in (0, 1):
            there = i == (axis.nodes - 1) * end
            held |= there & axis.held[end]
            free |= there & (not axis.held[end] and not axis.mirrored[end])
    return held & free


def _have_clamp_edges(axes: list[Axis]) -> bool:
    """Whether any node of a box is on such an edge."""
    held = [any(axis.held) for axis in axes]
    free = [any(not still and not image for still, image in zip(axis.held, axis.mirrored)) for axis in axes]
    return any(held[i] and free[j] for i in range(len(axes)) for j in range(len(axes)) if i != j)


def _signal(axes: list[Axis], wide: bool, box: bool, settings: Any) -> Callable[[float, float], float]:
    """Of `pairs.axis_waves` for boxes; of any union of cells w^2 dt^2 + 2 b dt = 4 with the highest frequency, which
    has a little damping, and that of the wave that alternates from node to node."""
    if box:
        return partial(signal, Lattice(tuple(axes), wide, float(settings.dissipation), settings.reconstruction))
    # less dissipation than the usual does not make the step longer
    most, damping = max(1.0, float(settings.dissipation)), _DAMPING["cells"]
    fast, slow = max(damping, _LEAPFROG * _frequency(axes, wide, box)), damping * (len(axes) - 1)
    return lambda pressure, shear: most * (fast * pressure + slow * shear)


def _frequency(axes: list[Axis], wide: bool, box: bool) -> float:
    """Of pressure waves along all axes at once, times the least step."""
    least, found = min(axis.step for axis in axes), []
    for axis in axes:
        single = not box or (axis.nodes == 2 and not any(axis.mirrored))
        cells = _ONE_CELL if single else _MORE_CELLS
        found.append((axis.highest_frequency if wide else cells) * least / axis.step)
    return float(np.linalg.norm(found))


def _no_room(body: int, axes: list[Axis]) -> str:
    counts = [axis.nodes for axis in axes]
    return (
        'method.weights: expected for "fourth-order" an axis with 8 nodes or more, those beyond mirror planes counted, '
        f"found particles = {counts} in bodies.{body}"
    )


def _check_grading(body: int, axes: list[Axis], wide: bool, settings: Any, ratio: float) -> None:
    """Raise SolverError where distances change so fast that a node would have no volume, or waves would grow; ratio:
    of the speeds of shear and pressure waves."""
    fed, dissipation = wide and settings.reconstruction, float(settings.dissipation)
    for k, axis in enumerate(axes):
        if not axis.places:
            continue
        if (lengths_of(axis, wide and axis.wide) < _THINNEST * axis.step * np.diff(axis.places).min()).any():
            raise SolverError(_too_fast(body, k, axis, "more particles change slower"))
        if fed and axis.wide and feeds_waves(axis, True, dissipation):
            raise SolverError(_too_fast(body, k, axis, _FED))
        if fed and axis.wide and feeds_waves_of_volume(axis, dissipation, ratio):
            raise SolverError(_too_fast(body, k, axis, f"where volume hardly changes, {_FED}"))


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


def _stencils(filling: Any, index: list[np.ndarray], axes: list[Axis], wide: bool, part: float) -> Stencils:
    """index: d arrays (n,); part: of their volume that nodes on the edges of a clamp of a box do without. Corrections
    L_a follow the volume, so that gradients stay exact and the force of the stress there is less by that part."""
    if wide or any(axis.places for axis in axes):
        result = box_stencils(index, axes, wide)
    else:
        result = cell_stencils(index, axes, filling.holds_cells)
    if filling.body.shape.kind == "box":
        result.volume[on_clamp_edges(axes, index)] *= 1.0 - part
    return result


def _axes(filling: Any, planes: list[Any]) -> list[Axis]:
    """The lattice of a body, and which of its ends are mirrored; planes: those meant for it."""
    result = []
    for k, line in enumerate(filling.lines):
        ends = [False, False]
        for plane in planes:
            if plane.axis != k:
                continue
            distance = np.abs(np.array([line.lower, line.upper]) - plane.coordinate) / line.step
            for end in (0, 1):
                ends[end] = ends[end] or bool(distance[end] <= 1e-6)
            if 1e-6 < distance.min() < WIDEST:
                raise SolverError(
                    f"boundaries: expected mirror planes through nodes of bodies on lattices or far from them, found "
                    f"{'XYZ'[k]} = {plane.coordinate:g} at {distance.min():.3g} spacings from the nearest end"
                )
        places = () if line.shares is None else tuple((line.shares * (line.count - 1)).tolist())
        result.append(Axis(line.count, line.step, (ends[0], ends[1]), places))
    return result
