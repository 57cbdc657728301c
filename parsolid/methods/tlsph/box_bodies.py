"""Boxes of a rank: velocity gradients along their axes and the new state, plane by plane while the plane is in the
cache, with the messages between ranks."""

from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.methods.tlsph.lattice_bodies import BoxCuts, LatticeBody
from parsolid.methods.tlsph.leapfrog import StepBound
from parsolid.methods.tlsph.mesh_bodies import stabilising_modulus
from parsolid.methods.tlsph.plastic import RIEMANN_HEAT
from parsolid.methods.tlsph.point_update import TILE, add_initial_stress, update_tile
from parsolid.methods.tlsph.tangent import change_box
from parsolid.methods.tlsph.tile_fields import (
    copy_branches_in,
    copy_branches_out,
    copy_in,
    copy_out,
    energy_lost,
    store_waves,
    tiles_in,
)
from parsolid.pairs.box_on_rank import BoxOnRank
from parsolid.pairs.box_planes import (
    PlaneScratch,
    box_in,
    dissipative_forces_in_plane,
    gradient_in_plane,
    place_of,
    reduce_edges,
    stress_forces_in_plane,
    unnamed,
    weights_along,
)
from parsolid.pairs.box_stabiliser import BoxStabiliser, StabilisedBox
from parsolid.pairs.box_sweeps import BoxSweeps
from parsolid.pairs.box_weights import REACH, axis_tables
from parsolid.pairs.riemann import SMALL_JUMP


class BoxBodies(StepBound):
    """The boxes of a system on one rank, with what `list_bodies.ListBodies` offers for other bodies.

    nodes: `BoxOfNodes` of every box of the scene; blocks: the `state.LawBlock` of each box with particles here, in the
    order of the boxes; sweeps: `BoxSweeps`.
    """

    def __init__(self, system: Any, cuts: BoxCuts, bodies: list[LatticeBody], blocks: dict[int, Any]) -> None:
        """system: `system.TotalLagrangianSPH` with its fields declared; bodies: the boxes among the lattice bodies;
        blocks: by number of the body. Collective."""
        self.system, self.particles, self.dimension = system, system.particles, system.dimension
        self.nodes, self._cuts, self._bodies = cuts.nodes, cuts.parts, bodies
        settings = system.settings
        dissipation = settings.dissipation_of("kernel")
        boxes = []
        for one, nodes, parts in zip(bodies, cuts.nodes, cuts.parts):
            tables = [
                axis_tables(axis, one.fourth_order and axis.has_room, dissipation, settings.reconstruction)
                for axis in one.axes
            ]
            first = blocks[one.body].first if one.body in blocks else 0
            modulus, density = system.wave_modulus(one.body)
            full_jump = SMALL_JUMP * float(np.sqrt(modulus / density)) if settings.limits_dissipation else 0.0
            boxes.append(BoxOnRank(nodes, parts, tables, first, full_jump))
        self.sweeps = BoxSweeps(system.comm, boxes, self.dimension, dissipation > 0.0, in_turn=True)
        self.parts = [(box, blocks[one.body]) for one, box in zip(bodies, self.sweeps.boxes) if box is not None]
        self.blocks = [block for _, block in self.parts]
        # rows of nodes on edges of clamps, and the part of their stresses that counts
        edges = [(one.clamp_edges, 1.0 - one.edge_part) for one in bodies]
        self._edges = [of_box for of_box, box in zip(edges, self.sweeps.boxes) if box is not None]

    def advance_step(self, step: float, relaxing: float | None = None) -> tuple[bool, float, float]:
        """Deformation and stress after a step [s] of leapfrog: (whether all Jacobians are positive, energy [J] that
        branches have dissipated, the stable step [s] of the new state). relaxing [s]: for which branches relax, if that
        is another time."""
        stored, leapfrog = self.particles.storage, self.system.leapfrog
        self.sweeps.exchange_motion(stored("velocity"), stored("position"))
        sound, dissipated, stable = True, 0.0, np.inf
        carried = []
        for block in self.blocks:
            block.branches(step if relaxing is None else relaxing)
            carried.append(block.carried_fields(step, leapfrog.kicks.last_step))
        edges, inner = self.particles.kept(("arrays of boxes", self), self._arrays_of_planes)
        for planes in (edges, inner):
            for number, block, arguments in planes:
                positive, lost, signal = advance_box(step, leapfrog.signals, carried[number], *arguments)
                sound, dissipated = sound and positive and block.sound, dissipated + lost
                stable = min(stable, leapfrog.step_of(block.law, signal))
            if planes is edges:
                self.sweeps.send_stress()
        return sound, dissipated, stable

    def _arrays_of_planes(self) -> tuple[list[Any], list[Any]]:
        """Of edges and of inner planes: number of the block, the block, and what `advance_box` takes in each step."""
        stored, sweeps = self.particles.storage, self.sweeps
        initial = stored("initial_stress") if "initial_stress" in self.particles else None
        edges, inner = [], []
        for number, (box, block) in enumerate(self.parts):
            arrays = (
                block.solid, self.dimension, block.of_branches, *block.places, sweeps.v, stored("deformation_gradient"),
                stored("jacobian")[0], block.branch_field, stored("volume")[0], initial, sweeps.G, sweeps.P, sweeps.Z,
                block.tiles, block.A, block.branch_sum, sweeps.x, stored("stress_force"), stored("dissipative_force"),
                self._heat, *self._edges[number],
            )  # fmt: skip
            of_box = unnamed((box, sweeps.scratch(box)))
            edges += [(number, block, (*of_box, *one, False, *arrays)) for one in sweeps.edges(box)]
            inner += [(number, block, (*of_box, *one, True, *arrays)) for one in sweeps.inner(box)]
        return edges, inner

    def find_forces(self) -> None:
        """T and D [N] in the fields stress_force and dissipative_force, where `advance_step` has not found them."""
        self.sweeps.receive_stress()
        stored = self.particles.storage
        self.sweeps.divergence(stored("stress_force"), stored("dissipative_force"), self._heat)

    def change_forces(
        self,
        change: np.ndarray,
        index: Any,
        moduli: Any,
        fields: tuple[Any, Any],
        given: np.ndarray | None = None,
        volumes: Any = None,
    ) -> None:
        stored, sweeps = self.particles.storage, self.sweeps
        motion = np.zeros_like(stored("velocity"))
        motion[:, : self.particles.owned] = change.T
        sweeps.exchange_motion(motion, stored("position"))
        for in_turn, planes_of in ((False, sweeps.edges), (True, sweeps.inner)):
            for (box, block), clamp_edges in zip(self.parts, self._edges):
                for planes in planes_of(box):
                    change_box(
                        box, sweeps.scratch(box), *planes, in_turn, block.places, index, moduli, given, volumes,
                        sweeps.v, sweeps.G, sweeps.P, block.tiles, fields[0], *clamp_edges,
                    )  # fmt: skip
            if not in_turn:
                sweeps.send_stress()
        sweeps.receive_stress()
        sweeps.divergence(*fields)

    def add_stiffness(self, result: np.ndarray) -> None:
        """See `ListBodies.add_stiffness`; of differences along the axes."""
        volume = self.particles.storage("volume")[0]
        spacing = self.particles.owned_rows("spacing")
        for block in self.blocks:
            own, (shear, lame) = slice(block.first, block.last), elastic_moduli(block.law)
            over = 1.0 / spacing[own].T ** 2
            result[:, own] += volume[own] * (shear * over.sum(axis=0) + (lame + shear) * over)

    def stabiliser(self, flows: bool = False) -> BoxStabiliser:
        """What resists rough motions, which the sweeps hardly see; flows: whether elastic-plastic bodies may flow.
        Collective."""
        found = zip(self._bodies, self.nodes, self._cuts, self.sweeps.boxes)
        shear = [stabilising_modulus(law) if flows else elastic_moduli(law)[0] for law in self.system.laws]
        boxes = [
            StabilisedBox(nodes, parts, box, one.axes, one.fourth_order, shear[one.body])
            for one, nodes, parts, box in found
        ]
        return BoxStabiliser(self.system.comm, boxes)

    @property
    def _heat(self) -> np.ndarray | None:
        """The field of what the dissipation takes, None where it heats nothing."""
        return self.particles.storage(RIEMANN_HEAT) if RIEMANN_HEAT in self.particles else None

    def displacement_gradient(self, result: np.ndarray) -> None:
        """Fill grad u of the nodes of boxes into result (owned, d, d) by the scheme's own operator; collective."""
        stored, of = self.particles.storage, self.particles.owned_rows
        displacement = np.zeros_like(stored("velocity"))
        displacement[:, : self.particles.owned] = (of("position") - of("reference_position")).T
        self.sweeps.exchange_motion(displacement, stored("position"))
        gradient = self.sweeps.gradient()
        for box, block in self.parts:
            planes = gradient[:, box.motion.kept : box.motion.end].reshape(-1, box.planes, box.nodes)
            own = planes[:, box.first_plane : box.last_plane, box.first_node : box.last_node]
            result[block.first : block.last] = own.reshape(len(own), -1).T.reshape(-1, self.dimension, self.dimension)

    @property
    def ghosts(self) -> int:
        """Nodes of other ranks that this one knows, corners included."""
        own = sum(block.last - block.first for block in self.blocks)
        return sum(box.planes * box.nodes for box, _ in self.parts) - own

    @property
    def directed_pairs(self) -> int:
        """Interactions counted once a particle: nodes that have a weight in the gradient of another one."""
        total = 0
        for box, _ in self.parts:
            planes, nodes = box.last_plane - box.first_plane, box.last_node - box.first_node
            in_row = min(box.row, nodes)
            # first and number of own planes, rows and nodes of a row in the table, and how often each is met
            parts = [(box.first_plane, planes, nodes)]
            if self.dimension == 3:
                parts.append((box.planes + box.first_node // box.row, nodes // box.row, planes * box.row))
            parts.append((weights_along(box, self.dimension - 1), in_row, planes * nodes // in_row))
            for first, count, times in parts:
                weights = box.gradient[0, :, first : first + count]
                total += times * int(np.count_nonzero(np.delete(weights, REACH, axis=0)))
        return total

    def arrays(self) -> list[np.ndarray]:
        return self.sweeps.arrays()

    def bytes_a_step(self) -> int:
        """Bytes that this rank sends in one evaluation."""
        return self.sweeps.bytes_sent


@kernel
def take_extremes(n, J, signal, least, most):
    """Least J and greatest signal so far of n places of tiles, one by one, which vectorises; what is not a number
    stays."""
    for p in range(np.uintp(n)):
        least[p] = least[p] if (least[p] <= J[p]) | (least[p] != least[p]) else J[p]
        most[p] = most[p] if (most[p] >= signal[p]) | (most[p] != most[p]) else signal[p]


@kernel
def store_numbers(field, row, n, numbers):
    """Numbers of a tile into a field (n,) from a row on."""
    first = np.uintp(row)
    for p in range(np.uintp(n)):
        field[first + p] = numbers[p]


@kernel
def advance_box(
    step, signals, carried, box, scratch, begin, end, in_turn, law, d, branches, tensor, symmetric, v, gradient,
    jacobian, field_A, volume, initial, G, P, Z, tiles, A, branch_sum, x, force, dissipation, heat, edges, left,
):  # fmt: skip
    """Leapfrog: state of the nodes of planes begin to end - 1 of a box after a step [s] with their velocity gradients
    in its middle.

    box, scratch: tuples without names (`unnamed`); tensor, symmetric: see `tile_fields.Places`. Fields
    (components, n): gradient, the deformation gradient F, jacobian (n,), field_A of the branches, volume (n,) [m^3],
    initial stress [Pa]; box arrays: v, and G, P, Z, which are filled. Z: None without dissipation. force, dissipation
    (d, n) [N]: fields of V Div P and V D, which are filled while stresses are in the cache, if the planes take turns.
    heat: see `dissipative_forces_in_plane`. edges, left: see `reduce_edges`.
    Otherwise as in `list_update.advance_step`, as is what is returned.
    """
    box, scratch = box_in(box), PlaneScratch(*scratch)
    values, least, most, dissipated = scratch.values, np.ones(TILE), np.zeros(TILE), 0.0
    row = box.first + (begin - box.first_plane) * (box.last_node - box.first_node)
    # out of their tuples once: each time costs a count of references
    tiles = tiles_in(tiles)
    tile_F, tile_G, tile_P, tile_J, tile_Z = tiles.F, tiles.G, tiles.P, tiles.J, tiles.impedance
    slow_Z, signal, lost, stress = tile_Z[TILE:], tiles.signal, tiles.lost, tiles.initial
    third = 0.0 if d == 2 else 1.0
    if d == 2:
        tile_G[:] = 0.0
    for i in range(begin, end):
        of_pairs, of_stresses = place_of(box.pairs, i), place_of(box.stresses, i)
        gradient_in_plane(box, i, v, values, G, of_pairs + box.first_node)
        for a in range(box.first_node, box.last_node, TILE):
            n, place = min(TILE, box.last_node - a), of_pairs + a
            copy_in(tile_G, tensor, G, place, n)
            copy_in(tile_F, tensor, gradient, row, n)
            if A is not None:
                copy_branches_in(A, symmetric, field_A, row, n)
            update_tile(
                law, step, third, signals, branches, tile_F, tile_G, A, branch_sum, None, tile_J, tile_P, tile_Z,
                signal, lost, carried, row, n,
            )  # fmt: skip
            if initial is not None:
                copy_in(stress, tensor, initial, row, n)
                add_initial_stress(tile_F, stress, tile_P)
            copy_out(gradient, row, n, tile_F, tensor)
            copy_out(P, of_stresses + a, n, tile_P, tensor)
            if Z is not None:
                store_waves(Z, place, n, tile_Z, slow_Z)
            if A is not None:
                copy_branches_out(field_A, row, n, A, symmetric)
                dissipated += energy_lost(n, lost, volume, row)
            store_numbers(jacobian, row, n, tile_J)
            take_extremes(n, tile_J, signal, least, most)
            row += n
        plane_row = row - box.last_node + box.first_node
        reduce_edges(edges, left, plane_row, row, of_stresses + box.first_node, P)
        if Z is not None:
            reduce_edges(edges, left, plane_row, row, of_pairs + box.first_node, Z)
        if in_turn:
            if Z is not None and i > begin:
                dissipative_forces_in_plane(box, scratch, i - 1, begin, v, x, G, Z, dissipation, heat)
            if i - REACH >= begin:
                stress_forces_in_plane(box, i - REACH, P, values, force)
    if in_turn:
        if Z is not None:
            dissipative_forces_in_plane(box, scratch, end - 1, begin, v, x, G, Z, dissipation, heat)
        for i in range(max(begin, end - REACH), end):
            stress_forces_in_plane(box, i, P, values, force)
    sound, greatest = True, 0.0
    for p in range(TILE):
        sound = sound and least[p] > 0.0
        # max gives its second argument where either is not a number
        greatest = max(greatest, most[p])
    return sound, dissipated, greatest
