"""Sweeps over the boxes of a rank: their arrays, and the messages between ranks (kernels: `pairs.box_planes`).

Fields of the particles have the nodes of this rank alone, arrays of boxes (velocity, position, velocity gradient,
stress, half impedances) have the ghosts, too.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from decomposition.boxes import GHOST_PLANES, GhostExchange, Link, Transfer, links_of, with_ghosts
from parsolid.kernels import aligned_zeros, kernel
from parsolid.pairs.box_on_rank import BoxOnRank, part_of_box
from parsolid.pairs.box_planes import (
    PAIR_WINDOW,
    STRESS_WINDOW,
    Box,
    PlaneScratch,
    Window,
    divergence_pass,
    gradient_pass,
    place_of,
    plane_scratch,
)
from parsolid.pairs.box_weights import REACH


@kernel
def copy_to_box(box, field, array):
    """Copy the own nodes of a field (c, n) into an array (c, places) with all planes of a box."""
    row, n = box.first, box.last_node - box.first_node
    for i in range(box.first_plane, box.last_plane):
        to, start = np.uintp(place_of(box.motion, i) + box.first_node), np.uintp(row)
        for c in range(field.shape[0]):
            for p in range(np.uintp(n)):
                array[c, to + p] = field[c, start + p]
        row += n


# --- the boxes of a rank ------------------------------------------------------------------------------------------


class BoxSweeps:
    """Sweeps over all boxes of this rank, with the arrays and messages that they need.

    boxes: `Box` of each box of the scene, None where this rank has no part of it. v, x, G, P, Z: arrays of
    `box_planes`; without ghosts on this rank v and x are the fields of the particles themselves, else copies with
    ghosts (a copy of both takes 2 to 3 % of a step, ghosts within fields would make the particles of a rank no
    contiguous range). Planes that need no ghosts may be `inner` ones, whose G, P and Z take turns in a ring of planes
    that all boxes share; all others are `edges`, which need places of their own.
    """

    def __init__(
        self,
        comm: Any,
        boxes: Sequence[BoxOnRank],
        dimension: int,
        upwind: bool,
        in_turn: bool = False,
    ) -> None:
        """upwind: whether anything dissipates; in_turn: whether inner planes have their forces as soon as the planes
        around them have stresses; else there are none. Exchanges are made, so that all ranks make their sweeps
        together."""
        d = dimension
        bounds = [with_ghosts(one.parts, comm.rank, one.nodes.shape) for one in boxes]
        own = [one.parts[comm.rank] for one in boxes]
        self.has_ghosts = any(not np.array_equal(one, whole) for one, whole in zip(own, bounds))
        parts = [
            None if np.any(part[0] >= part[1]) else part_of_box(one, part, bound)
            for one, part, bound in zip(boxes, own, bounds)
        ]
        found = {box.first: _inner_planes(box) if in_turn else (0, 0) for box in parts if box is not None}
        self._inner = {row: [planes] if planes[0] < planes[1] else [] for row, planes in found.items()}
        in_ring = max([0, *(box.nodes for box in parts if box is not None and self.inner(box))])
        self.in_turn = in_ring > 0
        self.boxes: list[Box | None] = []
        at, of_stresses, of_pairs = 0, STRESS_WINDOW * in_ring, PAIR_WINDOW * in_ring
        for one, box in zip(boxes, parts):
            if box is not None:
                motion = box.motion._replace(kept=at if self.has_ghosts else one.first)
                stresses = pairs = motion
                if self.in_turn:
                    stresses = self._window(box, of_stresses, REACH, STRESS_WINDOW)
                    pairs = self._window(box, of_pairs, 1, PAIR_WINDOW)
                box = box._replace(motion=motion, stresses=stresses, pairs=pairs)
                at, of_stresses, of_pairs = at + box.planes * box.nodes, stresses.end, pairs.end
            self.boxes.append(box)
        # parts on this rank
        self.here = [box for box in self.boxes if box is not None]
        self.places = max([0, *(box.motion.end for box in self.here)])
        self.P = aligned_zeros((d * d, of_stresses))
        self.G = aligned_zeros((d * d, of_pairs))
        self.Z = aligned_zeros((2, of_pairs)) if upwind else None
        self.v, self.x = np.zeros((2, d, self.places if self.has_ghosts else 0))
        self._scratch = {box.first: plane_scratch(box, d) for box in self.here}
        self._motion, self._stress = self._exchanges(comm, boxes, d)

    def _window(self, box: Box, kept: int, reach: int, ring: int) -> Window:
        """A window with places of their own, from `kept` on, for ghost planes and planes that edges reach."""
        for first, last in self.inner(box):
            low, high = first + reach if first > 0 else 0, last - reach if last < box.planes else box.planes
            if low < high:
                return Window(kept, box.planes, box.nodes, low, high, ring)
        return box.motion._replace(kept=kept)

    def inner(self, box: Box) -> list[tuple[int, int]]:
        """First plane, and the one after the last, of the inner planes of a box, if there are any."""
        return self._inner[box.first]

    def edges(self, box: Box) -> list[tuple[int, int]]:
        """First plane, and the one after the last, of the edge planes on either side."""
        own = box.first_plane, box.last_plane
        for first, last in self.inner(box):
            return [(a, b) for a, b in ((own[0], first), (last, own[1])) if a < b]
        return [own]

    def _exchanges(self, comm: Any, boxes: Sequence[BoxOnRank], d: int) -> tuple[GhostExchange, GhostExchange]:
        """Exchanges of v (two planes deep) and x (one); of the columns along the axis of P (two), G and of Z (one)."""
        motion, stress = [], []
        for one, box in zip(boxes, self.boxes):
            for link in links_of(one.parts, comm.rank, one.nodes.shape):
                assert box is not None
                of_axis = slice(one.nodes.axes[link.axis], None, d)
                motion.append(box_transfer(box.motion, link, self.v, slice(None), 2))
                stress.append(box_transfer(box.stresses, link, self.P, of_axis, 2))
                if self.Z is not None:
                    motion.append(box_transfer(box.motion, link, self.x, slice(None), 1))
                    stress.append(box_transfer(box.pairs, link, self.G, of_axis, 1))
                    stress.append(box_transfer(box.pairs, link, self.Z, slice(None), 1))
        return GhostExchange(comm, motion), GhostExchange(comm, stress)

    def exchange_motion(self, velocity: np.ndarray, position: np.ndarray) -> None:
        """Take v and x of the fields (d, n) of the particles, and of the ghosts; collective."""
        if not self.has_ghosts:
            self.v, self.x = velocity, position
            return
        for box in self.here:
            copy_to_box(box, velocity, self.v)
            copy_to_box(box, position, self.x)
        self._motion.start()
        self._motion.finish()

    def send_stress(self) -> None:
        """Send P, G and Z of the edges, while inner planes are swept; collective."""
        self._stress.start()

    def receive_stress(self) -> None:
        """Take P, G and Z of the ghosts; collective."""
        self._stress.finish()

    def scratch(self, box: Box) -> PlaneScratch:
        """For kernels that go from plane to plane of a box."""
        return self._scratch[box.first]

    def gradient(self) -> np.ndarray:
        """Gradients of v (d d, places), for what is not fused with an update of the particles: G, or where that has not
        all planes another array."""
        G = np.zeros((len(self.v) ** 2, self.places)) if self.in_turn else self.G
        for box in self.here:
            gradient_pass(box, self.scratch(box), self.v, G)
        return G

    def divergence(self, force: np.ndarray, dissipation: np.ndarray, heat: np.ndarray | None = None) -> None:
        """Put the forces [N] of the stresses and of the dissipation on edges into fields (d, n) of the particles, and
        what the latter takes [W] into heat (1, n)."""
        for box in self.here:
            arrays = self.P, self.v, self.x, self.G, self.Z
            for planes in self.edges(box):
                divergence_pass(box, self.scratch(box), *planes, *arrays, force, dissipation, heat)

    @property
    def bytes_sent(self) -> int:
        return self._motion.bytes_sent + self._stress.bytes_sent

    def arrays(self) -> list[np.ndarray]:
        return [self.G, self.P, *([] if self.Z is None else [self.Z]), *([self.v, self.x] if self.has_ghosts else [])]


def _inner_planes(box: Box) -> tuple[int, int]:
    """First plane, and the one after the last, of those that need no ghosts: none where rows of a plane are cut."""
    if box.last_node - box.first_node < box.nodes:
        return 0, 0
    return (
        box.first_plane + (GHOST_PLANES if box.first_plane > 0 else 0),
        box.last_plane - (GHOST_PLANES if box.last_plane < box.planes else 0),
    )


def box_transfer(window: Window, link: Link, array: np.ndarray, rows: slice, depth: int) -> Transfer:
    """Some rows of a box array beside a cut, so many planes deep, which its window keeps."""
    kept = array[rows, window.kept : window.end].reshape(-1, window.low + window.planes - window.high, window.nodes)
    views = []
    for planes, nodes in (link.inside[depth], link.outside[depth]):
        shift = 0 if planes.stop <= window.low else window.low - window.high
        views.append(kept[:, planes.start + shift : planes.stop + shift, nodes])
    return Transfer(link.rank, *views)
