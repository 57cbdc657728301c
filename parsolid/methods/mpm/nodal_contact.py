"""Contact on the nodes of the background grid: fields of velocity that may neither pass through each other nor stick.

Where both fields have mass, their velocities after the forces of a step lose what would close more than the gap between
their particles, in an inelastic impact of the node's two masses, and of the tangential part what Coulomb's law allows
(Bardenhagen, Guilkey, Roessig, Brackbill, Witzel, Foster, CMES 2 (2001) 509). Fields part freely. `contact_normals` has
the normals and gaps.
"""

from typing import Any

import numpy as np

from decomposition.shared_nodes import SharedNodes
from parsolid.methods.interaction import Interaction
from parsolid.methods.mpm import contact_normals as kernels
from parsolid.methods.mpm.conditions import sum_in_order
from parsolid.methods.mpm.contact_normals import FIT, MATRIX, FieldParticles, Seen
from parsolid.methods.mpm.transfer import grid_to_particles
from parsolid.methods.protocol import EnergyLedger
from parsolid.scene.contact import GRID_TERMS

# of the square of the steepness of a fit a cell; steps of Newton's method at most, and its tolerance; the factor on
# extents of particles, without which a corner on a face would see a plane between its sides (7 degrees at its edge)
_PENALTY, _ITERATIONS, _TOLERANCE, _SHRUNK = 1e-6, 20, 1e-9, 0.8
# factor on the penalty from 1 on, a step, lest one goes too far; steps until it is eased
_EASING = 0.25
_EASED = int(np.ceil(np.log(_PENALTY) / np.log(_EASING)))
# columns of what nodes of both fields know of each: mass, momentum, weight
_OF_FIELD = 5
_UPPER = np.triu_indices(FIT)


class NodalContact(Interaction):
    """All contacts on nodes of a scene.

    The systems' particles give to the nodes first, contact changes the velocities of nodes, and the rest of each
    system's step goes on from these.
    """

    terms = GRID_TERMS

    def __init__(self, comm: Any, pairs: list[tuple[tuple[Any, Any], float]]) -> None:
        """pairs: two systems and the friction between them, each."""
        self.pairs = [FieldPair(comm, systems, friction) for systems, friction in pairs]
        self.systems = list({id(one): one for systems, _ in pairs for one in systems}.values())
        self.warms = any(friction and any(one.takes_heat for one in systems) for systems, friction in pairs)

    def start_step(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Velocities of the nodes after the step's forces and contact."""
        if step == 0.0:
            return
        for system in self.systems:
            system.accelerate_nodes(time, step)
        warmed = [pair.apply(step) for pair in self.pairs]
        if self.warms:
            ledger.add_term("friction_heat", sum(warmed))

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Book the energy that contact has taken."""
        if step == 0.0:
            return
        for pair in self.pairs:
            pressed, rubbed = pair.losses()
            # systems do not know what kept their particles from gaining what their forces did
            ledger.add(1.0, 0.0, -pressed - rubbed, 0.0)
            ledger.add_term("contact_dissipation", pressed)
            ledger.add_term("friction_dissipation", rubbed)


class FieldPair:
    """Contact between two systems with grids on one lattice.

    Of the nodes of both in the present step: slots: in each system, -1 where it has none; normal (n, d) from the first
    field to the second; impulse (n, d) [N s] on the second; rubbed (n,) [J]: what friction takes.
    """

    def __init__(self, comm: Any, systems: tuple[Any, Any], friction: float) -> None:
        self.systems, self.friction = systems, friction
        self.nodes = SharedNodes(comm, (systems[0].grid, systems[1].grid))
        self.dimension = systems[0].dimension
        self._changes: list[int] = []
        self.impulse = self.normal = np.zeros((0, self.dimension))
        self.rubbed = np.zeros(0)
        self.slots: list[np.ndarray] = []

    def apply(self, step: float) -> float:
        """Let the velocities of nodes, as they are after the forces of a step [s], obey contact; talks to ranks near
        by. What of the heat of friction is stored [J]."""
        changes = [system.nodes.changes for system in self.systems]
        if self.nodes.follow() or changes != self._changes:
            self._changes = changes
            self._rebuild()
        if not len(self.nodes.words):
            return 0.0
        # mass [kg], momentum [kg m/s] and weight of each field (n, 2, 5) over all ranks
        table = self._table
        table[:] = 0.0
        for number, (system, field) in enumerate(zip(self.systems, self._particles())):
            first, mine = number * _OF_FIELD, self._counted[number]
            node = system.nodes.motion[self.slots[number][mine]]
            table[mine, first] = node[:, 3]
            table[mine, first + 1 : first + 4] = node[:, 3:4] * node[:, :3]
            kernels.add_weights(field, self.dimension, table[:, first + 4])
        self._sums[0].now()
        d, fields = self.dimension, table.reshape(-1, 2, _OF_FIELD)
        mass, weight = fields[:, :, 0], fields[:, :, 4]
        self.active = (mass > self._least).all(axis=1) & self.inside & (weight > 0.0).all(axis=1)
        velocity = fields[:, :, 1 : 1 + d] / np.where(mass > 0.0, mass, 1.0)[:, :, None]
        relative = velocity[:, 0] - velocity[:, 1]
        # a node is not active where the first step of Newton's method parts the fields by more than closes: they do not
        # meet, whatever plane is best
        self._see(weight)
        fit = np.zeros((len(weight), FIT))
        self._improve(fit, 0)
        self._set_normals(fit)
        self.active &= self._gaps() <= np.linalg.norm(relative, axis=1) * step
        alone = self.active & ~self._shared
        kernels.find_fits(self._seen, _SHRUNK, self._penalties[1:], _EASED - 1, _TOLERANCE, alone, fit)
        if self._shared.any():
            for turn in range(1, _ITERATIONS):
                self._improve(fit, turn)
        self._set_normals(fit)
        gap = self._gaps()
        self._find_impulses(mass, relative, gap, step)
        warmed = sum(self._warm(number, mass[:, number]) for number in range(2)) if self.friction else 0.0
        for number, system in enumerate(self.systems):
            here = self.slots[number] >= 0
            slot, change = self.slots[number][here], self.impulse[here] / np.maximum(mass[here, number, None], 1e-300)
            change *= (-1.0, 1.0)[number]
            system.nodes.motion[slot, :d] += change
            system.nodes.motion[slot, 4 : 4 + d] += change
        return warmed

    def _find_impulses(self, mass: np.ndarray, relative: np.ndarray, gap: np.ndarray, step: float) -> None:
        """Closing velocities lose what closes more than the gap; friction takes energy in the impact, and never
        gives."""
        both = mass.prod(axis=1) / np.maximum(mass.sum(axis=1), 1e-300)
        closing = (relative * self.normal).sum(axis=1)
        pressed = np.where(self.active, both * np.maximum(closing - np.maximum(gap, 0.0) / step, 0.0), 0.0)
        sliding = relative - closing[:, None] * self.normal
        speed = np.linalg.norm(sliding, axis=1)
        rubbed = np.minimum(both * speed, self.friction * pressed)
        self.impulse = pressed[:, None] * self.normal + (rubbed / np.where(speed > 0.0, speed, 1.0))[:, None] * sliding
        self.rubbed = rubbed * (speed - 0.5 * rubbed / np.where(both > 0.0, both, 1.0))

    def _warm(self, number: int, mass: np.ndarray) -> float:
        """Half of what friction takes at the nodes to the particles of a field by their parts of its masses (n,) [kg]
        there; what of it is stored [J], where there are temperatures."""
        system, here = self.systems[number], (self.slots[number] >= 0) & (self.rubbed > 0.0)
        if not system.takes_heat:
            return 0.0
        nodes, points = system.nodes, system.points
        # heat a mass at the nodes as if it were a change of velocity
        heat_a_mass, probe = np.zeros(nodes.motion.shape), np.zeros(points.motion.shape)
        probe[:, :3] = points.motion[:, :3]
        heat_a_mass[self.slots[number][here], 4] = 0.5 * self.rubbed[here] / mass[here]
        for _, behind, images, _ in reversed(nodes.mirrored):
            heat_a_mass[behind, 4] = heat_a_mass[images, 4]
        grid_to_particles(points.basis, nodes.cells, heat_a_mass, None, 0.0, probe, 1.0, None, None, None)
        heat = points.motion[: system.owned, 3] * probe[: system.owned, 4]
        rows = np.flatnonzero(heat)
        return float(system.take_heat(heat[rows], rows))

    # --- nodes of both fields -----------------------------------------------------------------------------------------

    def _rebuild(self) -> None:
        """Nodes of both fields, and where particles of each count."""
        word, shared = self.nodes.words, self.nodes
        count, d = len(word), self.dimension
        self.slots = [system.grid.cells.slots(word) for system in self.systems]
        self.inside, self._counted = np.ones(count, bool), []
        self._maps = [self._map(number) for number in range(2)]
        for number, system in enumerate(self.systems):
            first = np.ones(system.nodes.count, bool)
            for rank, slots in zip(system.grid.shared.neighbours, system.grid.shared.send_rows):
                if rank < system.comm.rank:
                    first[slots] = False
            here = self.slots[number] >= 0
            counted = np.zeros(count, bool)
            counted[here] = first[self.slots[number][here]]
            self._counted.append(counted)
        self._least = min(system.nodes.least_mass for system in self.systems)
        self._table, self._fits = np.zeros((count, 2 * _OF_FIELD)), np.zeros((count, FIT + MATRIX))
        self._reach = np.zeros((count, 2))
        # nodes of which other ranks see particles, too
        self._shared = np.zeros(count, bool)
        for slots in shared.plan.send_rows:
            self._shared[slots] = True
        # of the constant hardly any, so that no matrix is singular where all particles are far on their side
        kinds = np.array([1e-3, *[1.0] * d, *[0.0] * (FIT - 1 - d)])
        easing = np.maximum(_PENALTY, _EASING ** np.arange(_ITERATIONS))[:, None]
        self._penalties = np.where(kinds > 0.0, kinds * easing, 1.0)
        self.normal = self.impulse = np.zeros((count, d))
        self.rubbed = np.zeros(count)
        self._sums = shared.plan.sum(self._table), shared.plan.sum(self._fits)
        self._largest = shared.plan.largest(self._reach)

    def _map(self, number: int) -> tuple[np.ndarray, ...]:
        """Cells, node, signs and on_plane of `FieldParticles`."""
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

    def _particles(self) -> list[FieldParticles]:
        result = []
        for number, system in enumerate(self.systems):
            nodes, cells = system.nodes, system.nodes.cells
            here, node, signs, on_plane = self._maps[number]
            lists, where = (here, cells.start, cells.order, cells.stencil), (nodes.places, 1.0 / nodes.spacing)
            result.append(
                FieldParticles(*lists, *where, system.points.motion, node, signs, on_plane, (-1.0, 1.0)[number])
            )
        return result

    # --- normals ------------------------------------------------------------------------------------------------------

    def _see(self, weights: np.ndarray) -> None:
        """Find the particles of both fields near active nodes."""
        fields, count = self._particles(), np.zeros(len(weights), np.int64)
        for field in fields:
            kernels.count_seen(field, self.dimension, self.active, count)
        start = np.concatenate([[0], np.cumsum(count)])
        self._seen = Seen(start, *(np.zeros((start[-1], *shape)) for shape in ((3,), (), (), (6,))))
        free = start[:-1].copy()
        for system, field, total in zip(self.systems, fields, weights.T):
            storage = system.points.storage
            domains = storage("deformation_gradient"), storage("spacing")
            kernels.put_seen(field, self.dimension, *domains, total.copy(), self.active, free, self._seen)

    def _improve(self, fit: np.ndarray, turn: int) -> None:
        """A step of Newton's method with what other ranks see, of all nodes or, later, of those shared with any."""
        moving, fits = self.active & (self._shared | (turn == 0)), self._fits
        fits[:] = 0.0
        kernels.add_fits(self._seen, _SHRUNK, fit, moving, fits)
        self._sums[1].now()
        at = np.flatnonzero(moving)
        matrix = np.zeros((len(at), FIT, FIT))
        matrix[:, _UPPER[0], _UPPER[1]] = matrix[:, _UPPER[1], _UPPER[0]] = fits[at, FIT:]
        penalty = np.diag(self._penalties[turn])
        slope = fits[at, :FIT] + fit[at] @ penalty
        fit[at] -= np.linalg.solve(matrix + penalty, slope[:, :, None])[:, :, 0]

    def _set_normals(self, fit: np.ndarray) -> None:
        vector = fit[:, 1 : 1 + self.dimension]
        length = np.linalg.norm(vector, axis=1)
        self.active &= length > 0.0
        self.normal = vector / np.where(length > 0.0, length, 1.0)[:, None]

    def _gaps(self) -> np.ndarray:
        """Between the domains of the particles of both fields around each node along its normal (n,) [m]."""
        reach, normal = self._reach, np.zeros((len(self._reach), 3))
        reach[:] = -np.inf
        normal[:, : self.dimension] = self.normal
        kernels.find_extremes(self._seen, normal, self.active, self.systems[0].nodes.spacing, reach)
        self._largest.now()
        return np.asarray(-np.where(self.active[:, None], reach, 0.0).sum(axis=1))

    def losses(self) -> tuple[float, float]:
        """Energy [J] that the impulses of the step have taken from this rank's part of both fields, besides friction,
        and by friction; after the step.

        Particles have gained J . (u + u')/2 with the velocities u of the nodes before the step and those u' that they
        bring back to them, by which matter is strained. Friction has the part of its impact, by which it warms.
        """
        taken, d = np.zeros(2), self.dimension
        for number, system in enumerate(self.systems):
            here = self.slots[number] >= 0 if self.slots else np.zeros(0, bool)
            nodes, slot = system.nodes, self.slots[number][here]
            before = nodes.motion[slot, :d] - nodes.motion[slot, 4 : 4 + d]
            after = nodes.remapped[slot, :d] if system.settings.order == "musl" else nodes.motion[slot, :d]
            mean = 0.5 * (before + after) * nodes.share[slot, None]
            taken[0] += (1.0, -1.0)[number] * sum_in_order(self.impulse[here] * mean)
            if number == 0:
                taken[1] = sum_in_order(nodes.share[slot] * self.rubbed[here])
        return float(taken[0] - taken[1]), float(taken[1])
