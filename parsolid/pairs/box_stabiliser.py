"""Stabilising energy against motions of a box that the differences along its axes hardly see, such as motions that
alternate from node to node.

Along every axis, with the slopes s_e = (u_e+1 - u_e)/h_e of edges, the lengths H of the other axes and the shear
modulus mu, the energy of a displacement u is

    second order:    beta mu/2 sum H h- h+/(2 (h- + h+)) |s+ - s-|^2              over nodes inside
    fourth order:    gamma mu/2 sum H h/18 |s_e+1 - 2 s_e + s_e-1|^2              over edges with one on each side

On even axes these are second differences, the energy of edges less that of the nodes' slopes, and third differences,
which keep the order of both schemes. Linear fields and rotations of the body have no such energy.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.boxes import BoxOfNodes, GhostExchange, links_of, with_ghosts
from parsolid.pairs.box_planes import Box
from parsolid.pairs.box_sweeps import box_transfer
from parsolid.pairs.box_weights import Axis, lengths_of, shares_of

# beta and gamma: no rough mode is below the fifth of a block; more of second differences stiffens thin plates
PARTS = {2: 0.25, 3: 0.5}
# nodes of a difference, of which the second one is that to which it belongs
_NODES = 4


class StabilisedBox(NamedTuple):
    """A box of the scene: its nodes and parts (ranks, 2, d), see `decomposition.boxes`; this rank's part or None; its
    axes in space, whether those with room are of fourth order, and its shear modulus [Pa]."""

    nodes: BoxOfNodes
    parts: np.ndarray
    box: Box | None
    axes: tuple[Axis, ...]
    fourth_order: bool
    shear_modulus: float


def differences_along(axis: Axis, fourth_order: bool) -> tuple[np.ndarray, np.ndarray]:
    """Factors (4, n) [1/m] of the nodes i - 1 .. i + 2 in the difference of each node i, 0 where it has none, and
    weights (n,) [m] of their squares, with their part of the shear modulus."""
    n, places = axis.nodes, np.array(axis.places or range(axis.nodes)) * axis.step
    h, factors, weights = np.diff(places), np.zeros((_NODES, n)), np.zeros(n)
    third = fourth_order and axis.has_room
    for i in range(1, n - 2 if third else n - 1):
        if third:
            factors[:, i] = -1.0 / h[i - 1], 1.0 / h[i - 1] + 2.0 / h[i], -2.0 / h[i] - 1.0 / h[i + 1], 1.0 / h[i + 1]
            weights[i] = PARTS[3] * h[i - 1 : i + 2].mean() / 18.0
        else:
            factors[:3, i] = 1.0 / h[i - 1], -1.0 / h[i - 1] - 1.0 / h[i], 1.0 / h[i]
            weights[i] = PARTS[2] * h[i - 1] * h[i] / (2.0 * (h[i - 1] + h[i]))
    return factors, weights


class BoxStabiliser:
    """The stabilising forces of the boxes of a rank: -K_s u, of a stiffness that does not change."""

    def __init__(self, comm: Any, boxes: list[StabilisedBox]) -> None:
        """Exchanges are made; collective."""
        self.parts = [(one, _tables(one, comm.rank)) for one in boxes if one.box is not None]
        d = len(boxes[0].axes)
        places = max([0, *(one.box.motion.end for one, _ in self.parts if one.box is not None)])
        self.motion, self.found = np.zeros((d, places)), np.zeros((d * d, places))
        motion, found = [], []
        for one in boxes:
            for link in links_of(one.parts, comm.rank, one.nodes.shape):
                assert one.box is not None
                of_axis = slice(one.nodes.axes[link.axis], None, d)
                motion.append(box_transfer(one.box.motion, link, self.motion, slice(None), 2))
                found.append(box_transfer(one.box.motion, link, self.found, of_axis, 2))
        self._exchanges = GhostExchange(comm, motion), GhostExchange(comm, found)

    def add_product(self, change: np.ndarray, result: np.ndarray) -> None:
        """Add K_s u (owned, d) [N], on the parts of particles on this side of mirror planes, of u (owned, d) [m] to a
        result; collective."""
        for one, _ in self.parts:
            own = self._own(one, self.motion)
            own[:] = change[self._rows(one, own)].T.reshape(own.shape)
        self._send(0)
        for one, tables in self.parts:
            self._differences(one, tables)
        self._send(1)
        for one, tables in self.parts:
            d, motion, found = len(one.axes), self._whole(one, self.motion), self._whole(one, self.found)
            motion[:] = 0.0
            for k, table in enumerate(tables):
                for c in range(d):
                    for offset in range(_NODES):
                        _add(motion[c], found[d * c + one.nodes.axes[k]], k, offset - 1, table.factors[offset], True)
            own = self._own(one, self.motion)
            result[self._rows(one, own)] += own.reshape(len(own), -1).T

    def _send(self, number: int) -> None:
        self._exchanges[number].start()
        self._exchanges[number].finish()

    @staticmethod
    def _rows(one: StabilisedBox, own: np.ndarray) -> slice:
        """Rows of own nodes in the fields of the particles."""
        box: Any = one.box
        return slice(box.first, box.first + own[0].size)

    @staticmethod
    def _whole(one: StabilisedBox, array: np.ndarray) -> np.ndarray:
        """A box array with all its nodes here, (c, planes, (rows,) row)."""
        box: Any = one.box
        shape = (box.planes, box.nodes) if len(one.axes) == 2 else (box.planes, box.nodes // box.row, box.row)
        return array[:, box.motion.kept : box.motion.end].reshape(len(array), *shape)

    @staticmethod
    def _own(one: StabilisedBox, array: np.ndarray) -> np.ndarray:
        """The own nodes of a box array, (c, planes, nodes)."""
        box: Any = one.box
        planes = array[:, box.motion.kept : box.motion.end].reshape(len(array), box.planes, box.nodes)
        return planes[:, box.first_plane : box.last_plane, box.first_node : box.last_node]

    def _differences(self, one: StabilisedBox, tables: "list[Table]") -> None:
        """Weighted differences of the motion along each axis, as columns of a tensor."""
        d, motion, found = len(one.axes), self._whole(one, self.motion), self._whole(one, self.found)
        for k, table in enumerate(tables):
            for c in range(d):
                out = found[d * c + one.nodes.axes[k]]
                out[:] = 0.0
                for offset in range(_NODES):
                    _add(out, motion[c], k, offset - 1, table.factors[offset], False)
                out *= table.weights


class Table(NamedTuple):
    """Along a memory axis: factors (4, n) of `differences_along`, and weights [N m] of all nodes of the box."""

    factors: np.ndarray
    weights: np.ndarray


def _tables(one: StabilisedBox, rank: int) -> list[Table]:
    """The table of each memory axis for the nodes of this rank with ghosts."""
    bounds = with_ghosts(one.parts, rank, one.nodes.shape).T
    result, axes = [], [one.axes[axis] for axis in one.nodes.axes]
    spans = [slice(int(low), int(high)) for low, high in bounds]
    lengths = [(lengths_of(a, one.fourth_order and a.has_room) * shares_of(a))[span] for a, span in zip(axes, spans)]
    for k, axis in enumerate(axes):
        factors, weights = differences_along(axis, one.fourth_order)
        along = [weights[spans[k]] if m == k else length for m, length in enumerate(lengths)]
        product: Any = one.shear_modulus
        for m, numbers in enumerate(along):
            product = product * _along(numbers, m, len(axes))
        result.append(Table(factors[:, spans[k]], product))
    return result


def _along(numbers: np.ndarray, axis: int, dimension: int) -> np.ndarray:
    """Numbers (n,) along an axis of an array."""
    return numbers.reshape([-1 if m == axis else 1 for m in range(dimension)])


def _add(out: np.ndarray, values: np.ndarray, axis: int, offset: int, factors: np.ndarray, back: bool) -> None:
    """Add factors of node i times the value at i + offset to out at i, or with `back` factors times the value at i to
    out at i + offset; what would be outside is left out."""
    n = out.shape[axis]
    here, there = slice(max(0, -offset), n - max(0, offset)), slice(max(0, offset), n - max(0, -offset))
    at = [slice(None)] * out.ndim
    at[axis] = there if back else here
    target = out[tuple(at)]
    at[axis] = here if back else there
    target += _along(factors[here], axis, out.ndim) * values[tuple(at)]
