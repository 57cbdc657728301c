"""Lists of pairs that each lie along one axis of a lattice in space.

Such a pair needs one column of every matrix, where `pairs.passes` takes three, and a pair over two spacings, which does
not dissipate, nothing but that of the stress. A particle owns its pairs with the next and the second next node along
each axis, and has the row of a small table in place of six weights: a lattice has few different ones. What is no such
pair (three spacings, ghosts) stands in a list of its own.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.compiled import compiled
from parsolid.numerics.lanes import WIDTH, aligned_zeros
from parsolid.pairs.block_lists import InnerBlocks, neighbours_in_blocks, pairs_in_blocks
from parsolid.pairs.lattice_pairs import Lattices, lattice_place
from parsolid.pairs.lists import InnerList, OneSidedList

AXES = 3
# first columns of what a table says of the axes: g_ab of the next node [m^2], k_ab [m^2], the step X_b - X_a [m], g_ab
# of the second next node
NEXT, JUMP, STEP, SECOND = 0, WIDTH, 2 * WIDTH, 3 * WIDTH
# more different rows than this are no lattice's
_MOST = 1 << 15
# k_ab that differs from S |g_ab| by no more than rounding is that: of places, where a body is 1e6 spacings from 0
_ROUNDING = 1e-9


class Edges(NamedTuple):
    """Pairs one by one: first, second, axis (m,) int32; weight (m, 4): g_ab along the axis, k_ab, X_b - X_a, 0."""

    first: np.ndarray
    second: np.ndarray
    axis: np.ndarray
    weight: np.ndarray


class InnerAxes(NamedTuple):
    """Each pair of owned particles once, both receive.

    neighbour (n, 6) int32: the next node along the three axes, then the second next ones; the particle itself, with
    weight 0, where there is none. kind (n,) int32: rows of table (kinds, 16). others: pairs with other nodes.
    """

    neighbour: np.ndarray
    kind: np.ndarray
    table: np.ndarray
    others: Edges


class OneSidedAxes(NamedTuple):
    """Pairs of owned particles, first, with ghosts: the owned particle alone receives."""

    edges: Edges


def is_along_axes(pairs: Any) -> bool:
    """Whether a list is one of this module."""
    return isinstance(pairs, InnerAxes | OneSidedAxes)


def pairs_in(pairs: Any) -> int:
    """How many pairs a list of any kind has."""
    if isinstance(pairs, InnerAxes):
        return int(np.sum(pairs.neighbour != np.arange(len(pairs.neighbour))[:, None])) + len(pairs.others.first)
    if isinstance(pairs, InnerBlocks):
        return pairs_in_blocks(pairs)
    return len(pairs.edges.first if isinstance(pairs, OneSidedAxes) else pairs.neighbour)


def neighbours_in(pairs: Any, owned: int) -> np.ndarray:
    """How many neighbours (owned,) particles have in a list of any kind of pairs of owned ones."""
    if isinstance(pairs, InnerBlocks):
        return neighbours_in_blocks(pairs, owned)
    if not isinstance(pairs, InnerAxes):
        return np.diff(pairs.start) + np.bincount(pairs.neighbour, minlength=owned)
    there = pairs.neighbour != np.arange(owned)[:, None]
    ends = pairs.neighbour[there], pairs.others.first, pairs.others.second
    return np.asarray(there.sum(axis=1) + np.bincount(np.concatenate(ends), minlength=owned))


def arrays_of(pairs: Any) -> list[np.ndarray]:
    """The arrays of a list of any kind, but those of images."""
    if isinstance(pairs, InnerAxes):
        return [*pairs[:3], *pairs.others]
    if isinstance(pairs, InnerBlocks):
        return [pairs.block, *pairs.patterns, *pairs.others[:3]]
    return list(pairs.edges if isinstance(pairs, OneSidedAxes) else pairs[:3])


def _edges(pairs: int) -> Edges:
    """Room for so many."""
    first, second, axis = np.zeros((3, pairs), np.int32)
    return Edges(first, second, axis, aligned_zeros((pairs, WIDTH)))


def no_ghosts() -> OneSidedAxes:
    """An empty list."""
    return OneSidedAxes(_edges(0))


@compiled
def _jump_of(pairs: Any, k: int, axis: int, dissipation: float) -> float:
    jump, plain = pairs.weight[k, AXES], dissipation * abs(pairs.weight[k, axis])
    return plain if abs(jump - plain) < _ROUNDING * plain else jump


@compiled
def _apart(lattices: Lattices, positions: np.ndarray, a: int, b: int, axis: int, steps: int) -> float:
    """X_b - X_a [m] of particles so many steps apart."""
    return positions[b, axis] - positions[a, axis] if lattices.graded else steps * lattices.spacing[a, axis]


@compiled
def _put_in_slots(
    lattices: Lattices,
    pairs: InnerList,
    even: np.ndarray,
    positions: np.ndarray,
    dissipation: float,
    neighbour: np.ndarray,
    rows: np.ndarray,
    others: Edges,
) -> int:
    """Fill neighbour (n, 6), rows (n, 16) and others; how many others there are, or -1 where pairs are on no axis."""
    count = 0
    for a in range(neighbour.shape[0]):
        neighbour[a] = a
        for axis in range(AXES):
            rows[a, STEP + axis] = lattices.spacing[a, axis]
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            axis, steps = lattice_place(lattices, even, a, b)
            if lattices.number[a] < 0 or axis < 0:
                return -1
            # a pair is its lower particle's
            low, high, weight = (a, b, pairs.weight[k, axis]) if steps > 0 else (b, a, -pairs.weight[k, axis])
            jump = _jump_of(pairs, k, axis, dissipation)
            if abs(steps) == 1:
                neighbour[low, axis] = high
                rows[low, NEXT + axis], rows[low, JUMP + axis] = weight, jump
                rows[low, STEP + axis] = _apart(lattices, positions, low, high, axis, 1)
            elif abs(steps) == 2 and jump == 0.0:
                neighbour[low, AXES + axis], rows[low, SECOND + axis] = high, weight
            else:
                others.first[count], others.second[count], others.axis[count] = low, high, axis
                others.weight[count, 0], others.weight[count, 1] = weight, jump
                others.weight[count, 2] = _apart(lattices, positions, low, high, axis, abs(steps))
                count += 1
    return count


@compiled
def _fill_edges(
    lattices: Lattices,
    pairs: OneSidedList,
    even: np.ndarray,
    positions: np.ndarray,
    dissipation: float,
    edges: Edges,
) -> bool:
    """Fill edges with pairs of owned particles and ghosts; whether all are along axes."""
    for a in range(pairs.start.shape[0] - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            axis, steps = lattice_place(lattices, even, a, pairs.neighbour[k])
            if lattices.number[a] < 0 or axis < 0:
                return False
            edges.first[k], edges.second[k], edges.axis[k] = a, pairs.neighbour[k], axis
            edges.weight[k, 0], edges.weight[k, 1] = pairs.weight[k, axis], _jump_of(pairs, k, axis, dissipation)
            edges.weight[k, 2] = _apart(lattices, positions, a, pairs.neighbour[k], axis, steps)
    return True


def along_axes(
    lattices: Lattices, inner: InnerList, rim: OneSidedList | None, even: Any, positions: Any, factor: float
) -> Any:
    """(inner, rim) along axes, or None where not all pairs are.

    Of lists with weights g_ab and whole k_ab (`mean_impedance.whole_jump_factors`); even, positions (n, 3) [m]: by
    which pairs are told, and where particles stand; factor: on the dissipation.
    """
    n, place = len(inner.start) - 1, (even, positions, factor)
    neighbour, rows, others = np.zeros((n, 2 * AXES), np.int32), np.zeros((n, 4 * WIDTH)), _edges(len(inner.neighbour))
    count = _put_in_slots(lattices, inner, *place, neighbour, rows, others)
    # as bytes: the time does not depend on how many there are
    _, found, kind = np.unique(rows.view(f"V{rows.itemsize * rows.shape[1]}"), return_index=True, return_inverse=True)
    ghosts = None if rim is None else OneSidedAxes(_edges(len(rim.neighbour)))
    if count < 0 or len(found) > _MOST or (ghosts is not None and not _fill_edges(lattices, rim, *place, ghosts.edges)):
        return None
    kinds = aligned_zeros((max(len(found), 1), 4 * WIDTH))
    kinds[: len(found)] = rows[found]
    weight = aligned_zeros((count, WIDTH))
    weight[:] = others.weight[:count]
    first, second, axis = (array[:count].copy() for array in others[:3])
    left = Edges(first, second, axis, weight)
    return InnerAxes(neighbour, kind.ravel().astype(np.int32), kinds, left), ghosts
