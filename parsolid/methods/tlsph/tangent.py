"""The tangent of total-Lagrangian SPH: what the forces of a small change of the displacement are, by the same sweeps.

    dF = grad du,   dP = A : dF,   K du = - V Div dP

A = d2W/dF dF is found once for a state, from differences of the law's stress, and kept as its upper triangle; a product
then knows no law. Of flow it is the symmetric part, from which A differs by stresses alone. K is symmetric in the plain
inner product, as both sweeps are adjoint, and is minus the derivative of the force, the stabilisers included: that of
meshes is in their sweeps, that of boxes beside them.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.hyperelastic.functions import elastic_moduli, stress
from parsolid.methods.tlsph.list_update import find_gradients, store_stresses
from parsolid.methods.tlsph.point_update import TILE, law_in, load, load_values, store
from parsolid.methods.tlsph.tile_fields import copy_in, copy_out, tiles_in
from parsolid.pairs.box_planes import gradient_in_plane, place_of, reduce_edges, stress_forces_in_plane
from parsolid.pairs.box_weights import REACH
from parsolid.tensors import cofactor, combine, determinant

# of F; five-point differences have an error of its fourth power, and 1e-16 over it of rounding
_STEP = 1e-3


class Volumes(NamedTuple):
    """Of particles whose pressures are unknowns, of others H is 0: cofactor H (d d, n), change dp of the pressure (n,)
    [Pa], and strain (n,), to which H : dF is added."""

    cofactor: np.ndarray
    pressure: np.ndarray
    strain: np.ndarray


def packed(d: int) -> np.ndarray:
    """Places (d d, d d) of the entries of a symmetric matrix in its upper triangle, row by row."""
    n = d * d
    result = np.zeros((n, n), np.int64)
    result[np.triu_indices(n)] = np.arange(n * (n + 1) // 2)
    return np.maximum(result, result.T)


@inlined
def stress_at(law, F):
    """P [Pa] of a deformation gradient alone."""
    return stress(law, F, cofactor(F), determinant(F))


@kernel
def add_slopes(law, places, index, F, P, i, n, moduli, values):
    """Add dP/dF of n particles of a tile to their moduli (entries, particles) from row i on; P: a scratch tile; values:
    `ParticleValues` or None."""
    for j in range(places.size):
        c = places[j]
        for p in range(TILE):
            law_here, here = law_in(law, values, p), load(F, p)
            unit = (1.0 * (c == 0), 1.0 * (c == 1), 1.0 * (c == 2), 1.0 * (c == 3), 1.0 * (c == 4),
                    1.0 * (c == 5), 1.0 * (c == 6), 1.0 * (c == 7), 1.0 * (c == 8))  # fmt: skip
            a, b = combine(1.0, here, _STEP, unit), combine(1.0, here, -_STEP, unit)
            far_a, far_b = combine(1.0, here, 2.0 * _STEP, unit), combine(1.0, here, -2.0 * _STEP, unit)
            near = combine(1.0, stress_at(law_here, a), -1.0, stress_at(law_here, b))
            far = combine(1.0, stress_at(law_here, far_a), -1.0, stress_at(law_here, far_b))
            store(P, p, combine(2.0 / (3.0 * _STEP), near, -1.0 / (12.0 * _STEP), far))
        for k in range(places.size):
            # entries beside the diagonal are found twice, which are the same but for rounding
            part, first, row = 1.0 if j == k else 0.5, places[k] * TILE, index[j, k]
            for p in range(n):
                moduli[row, i + p] += part * P[first + p]


@kernel
def find_moduli(law, first, last, tensor, index, gradient, tiles, moduli, values):
    """Moduli d2W/dF dF [Pa] (entries, particles), see `packed`, of particles first .. last - 1 with the deformation
    gradients (d d, particles); values: `ParticleValues` or None."""
    tiles = tiles_in(tiles)
    F, P = tiles.F, tiles.P
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        copy_in(F, tensor, gradient, i, n)
        for c in range(moduli.shape[0]):
            for p in range(i, i + n):
                moduli[c, p] = 0.0
        if values is not None:
            load_values(values, i, n)
        add_slopes(law, tensor, index, F, P, i, n, moduli, values)


@kernel
def change_stresses(places, index, moduli, given, volumes, i, n, G, P):
    """dP = A : dF of n particles from row i on, and stresses given (d d, particles) besides, or None, and dp H of
    `Volumes`, or None; G, P: tiles of dF and dP."""
    for j in range(places.size):
        to = np.uintp(places[j] * TILE)
        for p in range(np.uintp(TILE)):
            P[to + p] = 0.0
        if given is not None:
            for p in range(np.uintp(n)):
                P[to + p] = given[j, np.uintp(i) + p]
        for k in range(places.size):
            start, row, at = np.uintp(places[k] * TILE), index[j, k], np.uintp(i)
            for p in range(np.uintp(n)):
                P[to + p] += moduli[row, at + p] * G[start + p]
        if volumes is not None:
            H, dp, strain = volumes
            for p in range(np.uintp(n)):
                P[to + p] += H[j, np.uintp(i) + p] * dp[np.uintp(i) + p]
                strain[np.uintp(i) + p] += H[j, np.uintp(i) + p] * G[to + p]


@kernel
def change_records(d, first, last, places, index, moduli, given, volumes, pairs, motion, operator, record, tiles):
    """Records with the changes of stress of particles first .. last - 1 in a pair list, from rows of the motion that
    have du in place of the velocity; see `list_update.advance_step`."""
    tiles = tiles_in(tiles)
    G, P, Z = tiles.G, tiles.P, tiles.impedance
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        find_gradients(d, pairs, i, n, motion, 0.0, operator, None, record, G)
        change_stresses(places, index, moduli, given, volumes, i, n, G, P)
        store_stresses(d, i, n, P, Z, operator, record)


@kernel
def change_box(
    box, scratch, begin, end, in_turn, places, index, moduli, given, volumes, v, G, P, tiles, force, edges, left,
):  # fmt: skip
    """Changes of stress of the nodes of planes begin to end - 1 of a box from v, which is du; force (d, n) [N]: their
    forces, filled in turn; see `box_bodies.advance_box`. edges, left: see `reduce_edges`."""
    tiles = tiles_in(tiles)
    row, tile_G, tile_P = box.first + (begin - box.first_plane) * (box.last_node - box.first_node), tiles.G, tiles.P
    for i in range(begin, end):
        of_pairs, of_stresses = place_of(box.pairs, i), place_of(box.stresses, i)
        gradient_in_plane(box, i, v, scratch.values, G, of_pairs + box.first_node)
        for a in range(box.first_node, box.last_node, TILE):
            n = min(TILE, box.last_node - a)
            copy_in(tile_G, places.tensor, G, of_pairs + a, n)
            change_stresses(places.tensor, index, moduli, given, volumes, row, n, tile_G, tile_P)
            copy_out(P, of_stresses + a, n, tile_P, places.tensor)
            row += n
        plane_row = row - box.last_node + box.first_node
        reduce_edges(edges, left, plane_row, row, of_stresses + box.first_node, P)
        if in_turn and i - REACH >= begin:
            stress_forces_in_plane(box, i - REACH, P, scratch.values, force)
    if in_turn:
        for i in range(max(begin, end - REACH), end):
            stress_forces_in_plane(box, i, P, scratch.values, force)


def isotropic_moduli(shear: float, lame: float, d: int) -> np.ndarray:
    """Entries of A [Pa] of a solid at rest with these constants [Pa], see `packed`."""
    one = np.eye(d)
    A = lame * np.einsum("iJ,kL->iJkL", one, one)
    A += shear * (np.einsum("ik,JL->iJkL", one, one) + np.einsum("iL,kJ->iJkL", one, one))
    return np.asarray(A.reshape(d * d, d * d)[np.triu_indices(d * d)])


class Tangent:
    """K = - df/du of one rank's particles at the state that `linearise` has found; all methods are collective.

    Vectors are (owned, d). Forces are those on the parts of particles on this side of mirror planes, so that K is
    symmetric; where bodies share nodes each particle of a node has its part of the node's force, and moves must be the
    same for all of them. free (owned, d) bool: components that no condition holds or prescribes; mass (owned,) [kg]: of
    the parts; stabiliser: `BoxStabiliser`, None without boxes.
    """

    def __init__(self, system: Any, flows: bool = False, pressures: Any = None) -> None:
        """system: `system.TotalLagrangianSPH`, set up; flows: whether elastic-plastic bodies may flow; pressures: those
        that are unknowns, of which K is for the displacement alone."""
        self.system, self.comm, self.pressures, d = system, system.comm, pressures, system.dimension
        constrained = system.conditions.constrained
        self.free = np.ones((system.owned, d), bool) if constrained is None else ~constrained
        self.stabiliser = None if system.boxes is None else system.boxes.stabiliser(flows)
        self.index = packed(d)
        self.moduli = np.zeros((d * d * (d * d + 1) // 2, system.owned))
        self._fields = np.zeros((2, *system.particles.storage("velocity").shape))

    @property
    def mass(self) -> np.ndarray:
        """Mass (owned,) [kg] of this side's part."""
        return np.asarray(self.system.mass * self.system.share)

    @property
    def laws(self) -> list[tuple[int, int, float, float, float]]:
        """First and last row of those that share a law, its shear and Lame's first modulus [Pa], density [kg/m^3]."""
        blocks = self.system.blocks
        return [(one.first, one.last, *elastic_moduli(one.law), one.law.density) for one in blocks]

    def linearise(self, history: Any = None) -> None:
        """Take the moduli of the present deformation; history: `LoadHistory` of what it comes from, None where bodies
        deform from rest at once."""
        system = self.system
        for block in system.blocks:
            block.find_moduli(self.index, self.moduli, history)
        for bodies in system.sweeps:
            added = getattr(bodies, "added_stress", "initial_stress")
            if added in system.particles:
                self._add_stress(system.particles.owned_rows(added), bodies.blocks)
        if self.pressures is not None:
            self.pressures.linearise(self.moduli, self.index)
        for one in system.interactions:
            one.linearise()

    def force_of(self, stress: np.ndarray, displacement: np.ndarray) -> np.ndarray:
        """Forces (owned, d) [N] of first Piola-Kirchhoff stresses (owned, d d) [Pa], and those of the stabilisers at a
        displacement (owned, d) [m]; the state is to be linearised anew then."""
        self.moduli[:] = 0.0
        if self.system.meshes is not None:
            stabilising = self.system.particles.owned_rows(self.system.meshes.added_stress)
            self._add_stress(stabilising, self.system.meshes.blocks)
        return -self.product(displacement, np.ascontiguousarray(stress.T))

    def _add_stress(self, added: np.ndarray, blocks: list[Any]) -> None:
        """That of a second Piola-Kirchhoff stress (owned, d d) [Pa] that adds F S to the stress."""
        d = self.system.dimension
        for block in blocks:
            own = slice(block.first, block.last)
            for i in range(d):
                for J in range(d):
                    for L in range(J, d):
                        self.moduli[self.index[d * i + J, d * i + L], own] += added[own, d * L + J]

    def product(
        self, change: np.ndarray, given: np.ndarray | None = None, volumes: Volumes | None = None
    ) -> np.ndarray:
        """K du (owned, d) [N] of a change du (owned, d) [m], all of whose components count, less the forces of stresses
        given (d d, owned) [Pa], with which contact and ties have no part, and of changes of pressure."""
        force, scratch = self._fields
        for bodies in self.system.sweeps:
            bodies.change_forces(change, self.index, self.moduli, (force, scratch), given, volumes)
        self.share(force)
        result = np.ascontiguousarray(-force[:, : self.system.owned].T) * self.system.share[:, None]
        if self.stabiliser is not None:
            self.stabiliser.add_product(change, result)
        for one in self.system.interactions if given is None else ():
            result -= one.change_along(change, 0.0)[0]
        return result

    def share(self, force: np.ndarray) -> None:
        """Give each particle of a node that bodies share its part of the force (d, n)."""
        meshes = self.system.meshes
        if meshes is not None and meshes.shared is not None:
            meshes.shared.share(force)

    def share_moves(self, change: np.ndarray) -> None:
        """Let all particles of a node that bodies share move as one in a change (owned, d)."""
        meshes = self.system.meshes
        if meshes is not None and meshes.shared is not None:
            moved = np.ascontiguousarray(change.T)
            meshes.shared.move_as_one(moved)
            change[:] = moved.T

    def diagonal(self) -> np.ndarray:
        """D (owned, d) [N/m] of about the size of the diagonal of K at rest, the same for all components."""
        system = self.system
        result = np.zeros_like(self._fields[0])
        for bodies in system.sweeps:
            bodies.add_stiffness(result)
        self.share(result)
        return np.ascontiguousarray(result[:, : system.owned].T) * system.share[:, None]
