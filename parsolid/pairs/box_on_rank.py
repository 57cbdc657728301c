"""Set-up of the boxes of a rank: the arrays of kernels from the tables of the axes."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from decomposition.boxes import BoxOfNodes
from parsolid.kernels import aligned_zeros
from parsolid.pairs.box_planes import Box, Window
from parsolid.pairs.box_weights import AxisTables

# about how many nodes a table of weights along rows repeats over: short loops are slow, long tables leave the cache
_PERIOD = 192


class BoxOnRank(NamedTuple):
    """A box of the scene on a rank: the ranks' parts (ranks, 2, d) by `decomposition.boxes.cut_boxes`, the
    tables of the axes in space, the row of its first node here in the fields of the particles, and `full_jump` of
    `riemann.dissipation_limiter`."""

    nodes: BoxOfNodes
    parts: np.ndarray
    tables: Sequence[AxisTables]
    first: int
    full_jump: float = 0.0


def part_of_box(one: BoxOnRank, part: np.ndarray, bound: np.ndarray) -> Box:
    """A rank's part of a box, with windows that are still to be set. part, bound (2, d): first nodes and those after
    the last, without and with ghosts."""
    axes, (first, last), (low, high) = one.nodes.axes, part - bound[0], bound
    count = high - low
    # in two dimensions a plane is one row
    row, rows = int(count[-1]), int(count[1]) if len(axes) > 2 else 1
    spans = [slice(a, b) for a, b in zip(low, high)]
    period = max(1, _PERIOD // row) * row if len(axes) > 2 else row

    def by_memory_axis(name: str) -> list[np.ndarray]:
        return [getattr(one.tables[axis], name)[..., span] for axis, span in zip(axes, spans)]

    def weights(name: str) -> np.ndarray:
        """By plane, by row, and by node of rows."""
        *slow, in_row = by_memory_axis(name)
        return _aligned(np.concatenate((*slow, np.tile(in_row, period // row)), axis=-1))

    def by_node(name: str) -> list[np.ndarray]:
        """Tables of axis 0 by plane, of the others by node of a plane."""
        tables = by_memory_axis(name)
        if len(axes) > 2:
            tables[1] = np.repeat(tables[1], row, axis=-1)
        tables[-1] = np.tile(tables[-1], rows)
        return tables

    by_row = [by_memory_axis(name)[1] for name in ("gradient", "divergence")]
    own_rows = (int(first[1]), int(last[1])) if len(axes) > 2 else (0, 0)
    length, *across = by_node("length")
    nowhere = Window(0, int(count[0]), rows * row, int(count[0]), int(count[0]))
    return Box(
        first=one.first,
        planes=int(count[0]),
        nodes=rows * row,
        row=row,
        motion=nowhere,
        stresses=nowhere,
        pairs=nowhere,
        first_plane=int(first[0]),
        last_plane=int(last[0]),
        first_node=int(first[1]) * (row if len(axes) > 2 else 1),
        last_node=int(last[1]) * (row if len(axes) > 2 else 1),
        axes=axes,
        gradient=weights("gradient"),
        divergence=weights("divergence"),
        period=period,
        runs=_runs(np.concatenate(by_row), *own_rows),
        jump=_aligned(np.concatenate(by_node("jump"), axis=-1)),
        half_step=_aligned(np.concatenate(by_node("half_step"))),
        length=_aligned(length),
        area=_aligned(np.prod(across, axis=0)),
        full_jump=one.full_jump,
    )


def _aligned(table: np.ndarray) -> np.ndarray:
    result = aligned_zeros(table.shape)
    result[...] = table
    return result


def _runs(weights: np.ndarray, first: int, last: int) -> np.ndarray:
    """First and last row, that excluded, (k, 2) of runs of equal weights (.., rows) in rows first to last - 1."""
    rows = np.arange(first, last)
    differ = np.any(weights[..., rows[1:]] != weights[..., rows[:-1]], axis=(0, 1))
    bounds = np.concatenate((rows[:1], rows[1:][differ], [last][: len(rows)]))
    return np.stack((bounds[:-1], bounds[1:]), axis=1).astype(np.int64)
