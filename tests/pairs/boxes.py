"""Boxes of nodes with their operators as dense matrices, written from the definitions alone."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.boxes import BoxOfNodes, cut_boxes
from parsolid.pairs.box_on_rank import BoxOnRank
from parsolid.pairs.box_sweeps import BoxSweeps
from parsolid.pairs.box_weights import Axis, AxisTables, axis_tables


class Case(NamedTuple):
    """A box on the ranks of a communicator; index (d, n): of this rank's nodes along the axes in space."""

    sweeps: BoxSweeps
    axes: Sequence[Axis]
    tables: Sequence[AxisTables]
    index: np.ndarray
    volume: np.ndarray

    def place(self) -> np.ndarray:
        """X (d, n) [m]."""
        return np.array([places_of(axis)[i] for axis, i in zip(self.axes, self.index)])


def places_of(axis: Axis) -> np.ndarray:
    return axis.step * (np.array(axis.places) if axis.places else np.arange(float(axis.nodes)))


def make_box(
    axes: Sequence[Axis],
    comm: MPI.Intracomm = MPI.COMM_SELF,
    fourth_order: bool = True,
    dissipation: float = 1.0,
    first: int = 0,
) -> Case:
    """first: row of the first node in the fields."""
    wide = [fourth_order and axis.has_room for axis in axes]
    tables = [axis_tables(axis, order, dissipation, True) for axis, order in zip(axes, wide)]
    slowest_first = tuple(int(k) for k in np.argsort([-axis.nodes for axis in axes], kind="stable"))
    ends = tuple((4, 4) if wide[k] else (2, 2) for k in slowest_first)
    nodes = BoxOfNodes(tuple(map(places_of, axes)), slowest_first, ends)
    parts = cut_boxes([nodes], comm.size)[0]
    sweeps = BoxSweeps(comm, [BoxOnRank(nodes, parts, tables, first)], len(axes), dissipation > 0.0)
    lower, upper = parts[comm.rank]
    in_memory = np.indices(upper - lower).reshape(len(axes), -1) + lower[:, None]
    index = np.empty_like(in_memory)
    index[list(slowest_first)] = in_memory
    volume = np.prod([table.length[i] for table, i in zip(tables, index)], axis=0)
    return Case(sweeps, axes, tables, index, volume)


def smooth_motion(X: np.ndarray, size: float = 1e-3) -> tuple[np.ndarray, np.ndarray]:
    """A velocity and a position (d, n) without symmetry."""
    d = len(X)
    v = np.array([np.sin(1.3 * X[(c + 1) % d] + 0.7 * c) + 0.4 * X[c] ** 2 for c in range(d)])
    return v, X + size * np.array([np.cos(0.9 * X[(c + 1) % d] + 0.3 * X[c]) for c in range(d)])


def dense_operator(axis: Axis, fourth_order: bool) -> tuple[np.ndarray, np.ndarray]:
    """Q (n, n), whose symmetric part is that of the ends, and H (n,) of an even axis with free ends: eq (A.1) of
    Strand with a diagonal norm, or central differences."""
    n = axis.nodes
    if not fourth_order:
        H = np.full(n, axis.step)
        H[[0, -1]] *= 0.5
        Q = 0.5 * (np.eye(n, k=1) - np.eye(n, k=-1))
        Q[0, 0], Q[-1, -1] = -0.5, 0.5
        return Q, H
    H = np.full(n, axis.step)
    H[:4] *= np.array([17 / 48, 59 / 48, 43 / 48, 49 / 48])
    H[-4:] *= np.array([49 / 48, 43 / 48, 59 / 48, 17 / 48])
    D = np.zeros((n, n))
    for i in range(4, n - 4):
        D[i, i - 2 : i + 3] = np.array([1, -8, 0, 8, -1]) / 12
    D[0, :4] = [-24 / 17, 59 / 34, -4 / 17, -3 / 34]
    D[1, :3] = [-1 / 2, 0, 1 / 2]
    D[2, :5] = [4 / 43, -59 / 86, 0, 59 / 86, -4 / 43]
    D[3, :6] = [3 / 98, 0, -59 / 98, 0, 32 / 49, -4 / 49]
    D[-4:] = -D[:4][::-1, ::-1]
    return H[:, None] * D / axis.step, H
