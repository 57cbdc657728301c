"""Sweeps over the boxes of a rank: their arrays, and the messages between ranks (kernels: `pairs.box_planes`).

Fields of the particles have the nodes of this rank alone, arrays of boxes (velocity, position, velocity gradient,
stress, half impedances) have the ghosts, too.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from decomposition.boxes import GhostExchange, Link, Transfer, links_of, with_ghosts
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
    contiguous range). in_turn: whether G, P and Z have only a window of planes, in which all boxes take turns.
    """

    def __init__(
        self,
        comm: Any,
        boxes: Sequence[BoxOnRank],
        dimension: int,
        directional: bool,
        upwind: bool,
        in_turn: bool = False,
    ) -> None:
        """directional: whether impedances depend on the axis, see `flux_in_space`; upwind: whether anything dissipates;
        in_turn: whether planes have their forces as soon as the planes around them have stresses, which is for ranks
        without ghosts. Exchanges are made, so that all ranks make their sweeps together."""
        d, self.directional = dimension, True if directional else None
        bounds = [with_ghosts(one.parts, comm.rank, one.nodes.shape) for one in boxes]
        own = [one.parts[comm.rank] for one in boxes]
        self.has_ghosts = any(not np.array_equal(one, whole) for one, whole in zip(own, bounds))
        self.in_turn = in_turn and not self.has_ghosts
        self.boxes: list[Box | None] = []
        places = 0
        for one, part, bound in zip(boxes, own, bounds):
            empty = bool(np.any(part[0] >= part[1]))
            box = None if empty else part_of_box(one, part, bound)
            if box is not None:
                every = Window(places if self.has_ghosts else one.first, box.planes, box.nodes)
                stresses, pairs = (every._replace(start=0, planes=n) for n in (STRESS_WINDOW, PAIR_WINDOW))
                box = box._replace(motion=every)
                if self.in_turn:
                    box = box._replace(stresses=stresses, pairs=pairs)
                else:
                    box = box._replace(stresses=every, pairs=every)
                places += box.planes * box.nodes
            self.boxes.append(box)
        self.places = max([0, *(box.motion.end for box in self.here)])
        of_pairs = max([0, *(box.pairs.end for box in self.here)])
        self.P = aligned_zeros((d * d, max([0, *(box.stresses.end for box in self.here)])))
        self.G = aligned_zeros((d * d, of_pairs))
        self.Z = aligned_zeros((2 * d if directional else 2, of_pairs)) if upwind else None
        self.v, self.x = np.zeros((2, d, self.places if self.has_ghosts else 0))
        self._scratch = {box.first: plane_scratch(box, d) for box in self.here}
        self._motion, self._stress = self._exchanges(comm, boxes, d)

    def _exchanges(self, comm: Any, boxes: Sequence[BoxOnRank], d: int) -> tuple[GhostExchange, GhostExchange]:
        """Of v two and x one plane deep; of the columns of P along the axis two deep, of those of G and of Z one."""
        motion, stress = [], []
        for one, box in zip(boxes, self.boxes):
            for link in links_of(one.parts, comm.rank, one.nodes.shape):
                of_axis = slice(one.nodes.axes[link.axis], None, d)
                motion.append(box_transfer(box, link, self.v, slice(None), 2))
                stress.append(box_transfer(box, link, self.P, of_axis, 2))
                if self.Z is not None:
                    motion.append(box_transfer(box, link, self.x, slice(None), 1))
                    stress.append(box_transfer(box, link, self.G, of_axis, 1))
                    stress.append(box_transfer(box, link, self.Z, of_axis if self.directional else slice(None), 1))
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

    def exchange_stress(self) -> None:
        """Take P, G and Z of the ghosts; collective."""
        self._stress.start()
        self._stress.finish()

    @property
    def here(self) -> list[Box]:
        """Parts on this rank."""
        return [box for box in self.boxes if box is not None]

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
        """Put the forces of the stresses and of the dissipation [N] into fields (d, n) of the particles, and what the
        latter takes [W] into heat (1, n)."""
        for box in self.here:
            arrays = self.P, self.v, self.x, self.G, self.Z
            divergence_pass(box, self.scratch(box), *arrays, self.directional, force, dissipation, heat)

    @property
    def bytes_sent(self) -> int:
        """Of both messages of an evaluation."""
        return self._motion.bytes_sent + self._stress.bytes_sent

    def arrays(self) -> list[np.ndarray]:
        """Box arrays, for what counts memory."""
        return [self.G, self.P, *([] if self.Z is None else [self.Z]), *([self.v, self.x] if self.has_ghosts else [])]


def box_transfer(box: Any, link: Link, array: np.ndarray, rows: slice, depth: int) -> Transfer:
    """Some rows of a box array beside a cut, so many planes deep."""
    planes = array[rows, box.motion.start : box.motion.end]
    planes = planes.reshape(len(planes), box.planes, box.nodes)
    inside, outside = ((slice(None), *there[depth]) for there in (link.inside, link.outside))
    return Transfer(link.rank, planes[inside], planes[outside])
