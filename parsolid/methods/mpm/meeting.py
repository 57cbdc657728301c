"""Two fields of material points on one lattice where they meet: nodes of both, normals, gaps and impulses.

Normals: logistic regression of the particles of both fields around a node (Nairn, Hammerquist, Smith, Comput. Methods
Appl. Mech. Engrg. 362 (2020) 112859), each field of weight 1, with a slight penalty on the steepness, which has no
bound where a plane parts the fields. Gaps: of the particles' deformed domains along the normal.
"""

from typing import Any

import numpy as np

from decomposition.shared_nodes import SharedNodes
from parsolid.methods.mpm import meeting_kernels as kernels
from parsolid.methods.mpm.gather import gather
from parsolid.methods.mpm.grid import Flip
from parsolid.methods.mpm.meeting_kernels import FIT, FORM, Cloud, Points
from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.sums import in_turn

# of the square of the steepness of a fit a cell; steps of Newton's rule at most, and what they may leave; the factor on
# extents of particles, without which a corner on a face would see a plane between its sides (7 degrees at its edge)
_PENALTY, _ITERATIONS, _LEFT, _SHRUNK = 1e-6, 20, 1e-9, 0.8
# factor on the penalty from 1 on, a step, lest one goes too far; steps until it is eased
_EASING = 0.25
_EASED = int(np.ceil(np.log(_PENALTY) / np.log(_EASING)))
# columns of what nodes of both fields know of each: mass, momentum, weight
_OF_FIELD = 5
_SQUARE = np.triu_indices(FIT)


class Meeting:
    """Two systems that share no velocities; friction between them. impulse (n, d) [N s] on the second field at the
    nodes of both in the present step, normal (n, d), rubbed (n,) [J]: what friction takes in its blow, slots: of the
    nodes in each system, -1 where it has none."""

    def __init__(self, comm: Any, systems: tuple[Any, Any], friction: float) -> None:
        self.systems, self.friction = systems, friction
        self.nodes = SharedNodes(comm, (systems[0].grid, systems[1].grid))
        self.dimension = systems[0].dimension
        self._changes: list[int] = []
        self.impulse = self.normal = np.zeros((0, self.dimension))
        self.rubbed = np.zeros(0)
        self.slots: list[np.ndarray] = []

    def act(self, step: float) -> float:
        """Let velocities of nodes, as they are after forces of a step [s], obey contact; talks to ranks near by. What
        of the heat of friction is stored [J]."""
        changes = [system.nodes.changes for system in self.systems]
        if self.nodes.follow() or changes != self._changes:
            self._changes = changes
            self._rebuild()
        if not len(self.nodes.words):
            return 0.0
        d, fields = self.dimension, self._fields()
        mass = fields[:, :, 0]
        self.active = (mass > self._least).all(axis=1) & self.inside & (fields[:, :, 4] > 0.0).all(axis=1)
        velocity = fields[:, :, 1 : 1 + d] / np.where(mass > 0.0, mass, 1.0)[:, :, None]
        relative = velocity[:, 0] - velocity[:, 1]
        gap = self._gaps_of_normals(fields[:, :, 4], np.linalg.norm(relative, axis=1) * step)
        self.impulse, self.rubbed = self._impulses(mass, relative, gap, step)
        warmed = sum(self._warm(number, mass[:, number]) for number in range(2)) if self.friction else 0.0
        for number, system in enumerate(self.systems):
            here = self.slots[number] >= 0
            slot, change = self.slots[number][here], self.impulse[here] / np.maximum(mass[here, number, None], 1e-300)
            change *= (-1.0, 1.0)[number]
            system.nodes.motion[slot, :d] += change
            system.nodes.motion[slot, 4 : 4 + d] += change
        return warmed

    def _warm(self, number: int, mass: np.ndarray) -> float:
        """Half of what friction takes at the nodes to the particles of a field by their parts of its masses (n,) [kg]
        there; what of it is stored [J], where there are temperatures."""
        system, here = self.systems[number], (self.slots[number] >= 0) & (self.rubbed > 0.0)
        if not system.takes_heat:
            return 0.0
        nodes, points = system.nodes, system.points
        a_mass, probe = aligned_zeros(nodes.motion.shape), aligned_zeros(points.motion.shape)
        a_mass[self.slots[number][here], 4] = 0.5 * self.rubbed[here] / mass[here]
        for _, behind, images, _ in reversed(nodes.mirrored):
            a_mass[behind, 4] = a_mass[images, 4]
        gather(nodes.interpolation, a_mass, probe, 0.0, Flip(1.0), None, None, None)
        heat = points.motion[: system.owned, 3] * probe[: system.owned, 4]
        rows = np.flatnonzero(heat)
        return float(system.take_heat(heat[rows], rows))

    def _impulses(
        self, mass: np.ndarray, relative: np.ndarray, gap: np.ndarray, step: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """On the second field (n, d) [N s]: closing velocities (n, d) [m/s] lose what closes more than the gap; and
        what the tangential part takes in its blow (n,) [J], which is never negative."""
        both = mass.prod(axis=1) / np.maximum(mass.sum(axis=1), 1e-300)
        closing = (relative * self.normal).sum(axis=1)
        pressed = np.where(self.active, both * np.maximum(closing - np.maximum(gap, 0.0) / step, 0.0), 0.0)
        sliding = relative - closing[:, None] * self.normal
        speed = np.linalg.norm(sliding, axis=1)
        rubbed = np.minimum(both * speed, self.friction * pressed)
        impulse = pressed[:, None] * self.normal + (rubbed / np.where(speed > 0.0, speed, 1.0))[:, None] * sliding
        return np.asarray(impulse), rubbed * (speed - 0.5 * rubbed / np.where(both > 0.0, both, 1.0))

    def _rebuild(self) -> None:
        """Nodes of both fields, and where particles of each count."""
        word, shared = self.nodes.words, self.nodes
        count, d = len(word), self.dimension
        self.slots = [system.grid.cells.slots(word) for system in self.systems]
        self.inside, self._counted = np.ones(count, bool), []
        self._maps = [self._map(number) for number in range(2)]
        for number, system in enumerate(self.systems):
            first = np.ones(system.nodes.count, bool)
            for rank, slots in zip(system.grid.sharing.neighbours, system.grid.sharing.shared):
                if rank < system.comm.rank:
                    first[slots] = False
            here = self.slots[number] >= 0
            counted = np.zeros(count, bool)
            counted[here] = first[self.slots[number][here]]
            self._counted.append(counted)
        self._least = min(system.nodes.least_mass for system in self.systems)
        self._table, self._fits = np.zeros((count, 2 * _OF_FIELD)), np.zeros((count, FIT + FORM))
        self._reach = np.zeros((count, 2))
        # nodes of which other ranks see particles, too
        self._shared = np.zeros(count, bool)
        for slots in shared.sharing.shared:
            self._shared[slots] = True
        # of the constant hardly any, so that no matrix is singular where all particles are far on their side
        kinds = np.array([1e-3, *[1.0] * d, *[0.0] * (FIT - 1 - d)])
        easing = np.maximum(_PENALTY, _EASING ** np.arange(_ITERATIONS))[:, None]
        self._penalties = np.where(kinds > 0.0, kinds * easing, 1.0)
        self.normal = self.impulse = np.zeros((count, d))
        self.rubbed = np.zeros(count)
        self._sums = shared.sum(self._table, 0), shared.sum(self._fits, 1)
        self._largest = shared.largest(self._reach, 2)

    def _map(self, number: int) -> tuple[np.ndarray, ...]:
        """Cells, node, signs and on_plane of `Cloud`."""
        nodes, slots = self.systems[number].nodes, self.slots[number]
        node, signs = np.full(nodes.count, -1, np.int64), np.ones((nodes.count, 3))
        here = slots >= 0
        node[slots[here]] = np.flatnonzero(here)
        image, on_plane = np.arange(nodes.count), np.zeros(nodes.count, np.int64)
        for axis, behind, images, on in nodes.mirrored:
            to = np.arange(nodes.count)
            to[behind] = images
            signs[np.isin(image, behind), axis] *= -1.0
            image = to[image]
            on_plane[on] |= 1 << axis
        behind = image != np.arange(nodes.count)
        self.inside[node[behind & (node >= 0)]] = False
        node = node[image]
        cells = np.flatnonzero((node[self.systems[number].grid.cells.stencil] >= 0).any(axis=1))
        return cells, node, signs, on_plane

    def _clouds(self) -> list[Cloud]:
        result = []
        for number, system in enumerate(self.systems):
            nodes, points = system.nodes, system.points
            grid, (cells, node, signs, on_plane) = nodes.interpolation.grid, self._maps[number]
            lists = cells, grid.start, grid.order, grid.stencil
            where = nodes.places, grid.inverse_spacing, points.motion
            result.append(Cloud(*lists, *where, node, signs, on_plane, (-1.0, 1.0)[number]))
        return result

    def _fields(self) -> np.ndarray:
        """Mass [kg], momentum [kg m/s] and weight of each field (n, 2, 5) over all ranks."""
        table = self._table
        table[:] = 0.0
        for number, (system, cloud) in enumerate(zip(self.systems, self._clouds())):
            first, mine = number * _OF_FIELD, self._counted[number]
            node = system.nodes.motion[self.slots[number][mine]]
            table[mine, first] = node[:, 3]
            table[mine, first + 1 : first + 4] = node[:, 3:4] * node[:, :3]
            kernels.add_weights(cloud, self.dimension, table[:, first + 4])
        self._sums[0].start()
        self._sums[0].finish()
        return table.reshape(-1, 2, _OF_FIELD)

    def _gaps_of_normals(self, weights: np.ndarray, closing: np.ndarray) -> np.ndarray:
        """Between the domains of the particles of both fields around each node (n,) [m], along `normal`, which is
        found. A node is not active where the first step towards it parts the fields by more than closes (n,) [m]: they
        do not meet, whatever plane is best; weights (n, 2)."""
        self._gather(weights)
        fit = np.zeros((len(weights), FIT))
        self._turn(fit, 0)
        self._point_along(fit)
        self.active &= self._gaps() <= closing
        alone = self.active & ~self._shared
        kernels.find_fits(self._points, _SHRUNK, self._penalties[1:], _EASED - 1, _LEFT, alone, fit)
        if self._shared.any():
            for turn in range(1, _ITERATIONS):
                self._turn(fit, turn)
        self._point_along(fit)
        return self._gaps()

    def _gather(self, weights: np.ndarray) -> None:
        """What active nodes see of both fields."""
        clouds, count = self._clouds(), np.zeros(len(weights), np.int64)
        for cloud in clouds:
            kernels.count_points(cloud, self.dimension, self.active, count)
        start = np.concatenate([[0], np.cumsum(count)])
        self._points = Points(start, *(np.zeros((start[-1], *shape)) for shape in ((3,), (), (), (6,))))
        free = start[:-1].copy()
        for number, cloud in enumerate(clouds):
            total = weights[:, number].copy()
            kernels.put_points(cloud, self.dimension, *self._domains(number), total, self.active, free, self._points)

    def _turn(self, fit: np.ndarray, turn: int) -> None:
        """A step of Newton's rule with what other ranks see, of all nodes or, later, of those shared with any."""
        moving, fits = self.active & (self._shared | (turn == 0)), self._fits
        fits[:] = 0.0
        kernels.add_fits(self._points, _SHRUNK, fit, moving, fits)
        self._sums[1].start()
        self._sums[1].finish()
        at = np.flatnonzero(moving)
        matrix = np.zeros((len(at), FIT, FIT))
        matrix[:, _SQUARE[0], _SQUARE[1]] = matrix[:, _SQUARE[1], _SQUARE[0]] = fits[at, FIT:]
        penalty = np.diag(self._penalties[turn])
        slope = fits[at, :FIT] + fit[at] @ penalty
        fit[at] -= np.linalg.solve(matrix + penalty, slope[:, :, None])[:, :, 0]

    def _point_along(self, fit: np.ndarray) -> None:
        """Directions (n, d) from the first field to the second."""
        vector = fit[:, 1 : 1 + self.dimension]
        length = np.linalg.norm(vector, axis=1)
        self.active &= length > 0.0
        self.normal = vector / np.where(length > 0.0, length, 1.0)[:, None]

    def _gaps(self) -> np.ndarray:
        """Between the domains of the particles of both fields around each node along its normal (n,) [m]."""
        reach, normal = self._reach, np.zeros((len(self._reach), 3))
        reach[:] = -np.inf
        normal[:, : self.dimension] = self.normal
        kernels.find_extremes(self._points, normal, self.active, self.systems[0].nodes.spacing, reach)
        self._largest.find()
        return np.asarray(-np.where(self.active[:, None], reach, 0.0).sum(axis=1))

    def _domains(self, number: int) -> tuple[np.ndarray, np.ndarray]:
        """Deformation gradients and spacings [m] of a field's particles."""
        storage = self.systems[number].points.storage
        return storage("deformation_gradient"), storage("spacing")

    def losses(self) -> tuple[float, float]:
        """Energy [J] that the impulses of the step have taken from this rank's part of both fields, besides friction,
        and by friction; after the step.

        Particles have gained J . (u + u')/2 with the velocities u of the nodes before the step and those u' that they
        bring back to them, by which matter is strained. Of that friction has the part of its blow, by which it warms.
        """
        taken, d = np.zeros(2), self.dimension
        for number, system in enumerate(self.systems):
            here = self.slots[number] >= 0 if self.slots else np.zeros(0, bool)
            nodes, slot = system.nodes, self.slots[number][here]
            before = nodes.motion[slot, :d] - nodes.motion[slot, 4 : 4 + d]
            after = nodes.again[slot, :d] if system.settings.order == "musl" else nodes.motion[slot, :d]
            mean = 0.5 * (before + after) * nodes.share[slot, None]
            taken[0] += (1.0, -1.0)[number] * in_turn(self.impulse[here] * mean)
            if number == 0:
                taken[1] = in_turn(nodes.share[slot] * self.rubbed[here])
        return float(taken[0] - taken[1]), float(taken[1])
