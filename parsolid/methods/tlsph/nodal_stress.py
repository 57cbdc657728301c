"""Stress at the nodes of meshes.

With the weights of a mesh a particle's F, and so its stress, is the mean over the elements around its node weighted by
the node's own function: it belongs to the place X' = int N X / int N, which at a surface is inside the body. The second
Piola-Kirchhoff stress S and F at nodes are recovered from patches (`pairs.patch_recovery`). On free and loaded surfaces
the traction t is known, the force of loads, contact and tools over the area, and so is F along the surface, from the
positions of the nodes: what F is across it then follows from P(F) N = t, with the reference normal N and the inner
variables of branches recovered like S. Where the law flows or a component of the traction is not known, S is changed as
little as F S N = t allows.
"""

from typing import Any

import numpy as np
from scipy import sparse

from decomposition.halo import REACH_MARGIN, Halo
from decomposition.migration import migrate
from parsolid.boundary.conditions import EXTERNAL_FORCE
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.methods.tlsph.state import deformation_gradients
from parsolid.pairs.patch_recovery import Patches

# components of symmetric tensors by dimension; in the plane the last one is out of it
_COMPONENTS = {2: ((0, 0), (1, 1), (0, 1), (2, 2)), 3: ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))}
# part of a face's size below which an area is none
_ROUNDING = 1e-9
# iterations for F across a surface, and the change of F by which derivatives of the stress are found
_ITERATIONS, _CHANGE = 6, 1e-6


class NodalStress:
    """Of the nodes of a rank's meshes; made once, when it is first asked for.

    stress (owned, 3, 3) [Pa]: Cauchy stresses as they were found last.
    """

    def __init__(self, bodies: Any) -> None:
        """bodies: `mesh_bodies.MeshBodies`. Collective."""
        self.bodies, self.system, self.particles = bodies, bodies.system, bodies.particles
        self.owned, self.dimension = bodies.near.owned, bodies.dimension
        comm, d = self.system.comm, self.dimension
        identifier = self.particles.owned_rows("identifier")[: self.owned]
        first, second = _pairs_with_ghosts(comm, bodies.near, identifier)
        X = np.ascontiguousarray(bodies.near.positions[: self.owned])
        halo = Halo(comm, X, 2.0 * bodies.extent * REACH_MARGIN)
        everyone = halo.with_ghosts(identifier)
        self.halo = halo.subset(np.isin(everyone[self.owned :], np.concatenate([first, second])))
        everyone = self.halo.with_ghosts(identifier)
        order, count = np.argsort(everyone), len(everyone)
        ends = [order[np.searchsorted(everyone, some, sorter=order)] for some in (first, second)]
        ends = [np.concatenate([some, np.arange(count)]) for some in ends]
        near = sparse.csr_matrix((np.ones(len(ends[0])), tuple(ends)), (count, count))
        places = self.halo.with_ghosts(np.concatenate([X, bodies.near.centres, bodies.mirrored], axis=1))
        nodes, centres, mirrored = (np.ascontiguousarray(places[:, i * d : i * d + d]) for i in range(3))
        self._find_conditions()
        self._find_weights(Patches(near, nodes, mirrored > 0.0), near, nodes, centres)

    def _find_conditions(self) -> None:
        """Reference normals (owned, d) of free and loaded surfaces, 0 elsewhere; areas (owned,) [m^2]; and which
        components (owned, d) of the tractions there are known."""
        conditions, rows, d = self.system.conditions, slice(0, self.owned), self.dimension
        vectors = self.particles.owned_rows("area")[rows]
        self.area = np.linalg.norm(vectors, axis=1)
        # inside, areas are rounding
        surface = self.area > _ROUNDING * self.bodies.near.volume[rows] ** (1.0 - 1.0 / d)
        self.area[~surface] = 0.0
        self.normal = np.where(surface[:, None], vectors / np.where(surface, self.area, 1.0)[:, None], 0.0)
        free = np.ones((self.owned, d), bool)
        if conditions.free is not None:
            free = conditions.free[:, rows].T > 0.0
        for roller in conditions.rollers:
            free[roller.rows[roller.rows < self.owned]] = False
        self.known = free & surface[:, None]

    def _find_weights(self, patches: Any, near: sparse.csr_matrix, nodes: np.ndarray, centres: np.ndarray) -> None:
        """Matrices for values at nodes by the signs of mirror images, and for slopes of displacements at surfaces."""
        d, flip = self.dimension, 1.0 - 2.0 * np.eye(self.dimension, 3)
        self._signs = {(i, j): tuple(flip[:, i] * flip[:, j]) for i in range(3) for j in range(3)}
        reached = near[: self.owned] @ self.halo.with_ghosts((self.area > 0.0).astype(float))
        # particles of bodies without a mesh share an element with none but themselves
        meshed = np.diff(near.indptr)[: self.owned] > 1
        # inside, one layer tells as much
        parts = [(np.flatnonzero(meshed & (reached > 0.0)), True), (np.flatnonzero(meshed & (reached == 0.0)), False)]
        found = sparse.vstack([patches.weights(rows, centres, np.ones(d), wide)[0] for rows, wide in parts])
        rows = np.concatenate([rows for rows, _ in parts])
        at_rows = sparse.csr_matrix((np.ones(len(rows)), (rows, np.arange(len(rows)))), (self.owned, len(rows)))
        self._weights = at_rows @ found
        # on planes of symmetry, of components that change their sign there
        self._mirrored = np.flatnonzero(meshed & patches.mirrored[: self.owned].any(axis=1))
        odd = [signs for signs in set(self._signs.values()) if min(signs) < 0.0]
        self._odd_weights = {
            signs: patches.weights(self._mirrored, centres, np.array(signs), True)[0] for signs in sorted(odd)
        }
        told = (self.known | patches.mirrored[: self.owned]).all(axis=1) & self.known.any(axis=1)
        self._surfaces = []
        for block in self.bodies.blocks:
            if not isinstance(block.law, ElasticPlastic):
                rows = block.first + np.flatnonzero(told[block.first : block.last])
                slopes = [patches.weights(rows, nodes, flip[:, i], False, slopes=True) for i in range(d)]
                self._surfaces.append((block, rows, slopes))

    def _at_nodes(self, at: tuple[int, int], values: np.ndarray) -> np.ndarray:
        """Values (owned,) at nodes of a component of tensors at particles, those of other ranks among them."""
        result: np.ndarray = self._weights @ values
        odd = self._odd_weights.get(self._signs[at])
        if odd is not None:
            result[self._mirrored] = odd @ values
        return result

    def find(self, time: float) -> None:
        """Stresses of the state at a time [s]; collective."""
        d, of = self.dimension, self.particles.owned_rows
        F = deformation_gradients(self.particles, 0, self.owned)
        S = np.linalg.solve(F, self.system.shown("first_piola_kirchhoff_stress", 0, self.owned))
        values = [0.5 * (S[:, i, j] + S[:, j, i]) for i, j in _COMPONENTS[d]]
        values += [F[:, i, j] - float(i == j) for i in range(d) for j in range(d)]
        values += list((of("position") - of("reference_position"))[: self.owned].T)
        values += list(self.particles.storage("branches")[:, : self.owned]) if "branches" in self.particles else []
        columns = self.halo.with_ghosts(np.stack(values, axis=1)).T
        first = len(_COMPONENTS[d]) + d * d
        for at, column in zip(_COMPONENTS[d], columns):
            S[:, at[0], at[1]] = S[:, at[1], at[0]] = self._at_nodes(at, column)
        for at, column in zip(np.ndindex(d, d), columns[len(_COMPONENTS[d]) : first]):
            F[:, at[0], at[1]] = self._at_nodes(at, column) + float(at[0] == at[1])
        traction = self._tractions(time)
        S += self._correction(F, S, traction)
        self.stress = F @ S @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]
        for block, rows, slopes in self._surfaces:
            if len(rows):
                H = [[one @ u for one in of_axis] for of_axis, u in zip(slopes, columns[first : first + d])]
                along, A = F[rows], self._branches_at(block, rows, columns[first + d :])
                along[:, :d, :d] = np.eye(d) + np.array(H).transpose(2, 0, 1)
                found, sound = self._of_law(block, rows, along, F[rows], A, traction[rows])
                self.stress[rows[sound]] = found[sound]

    def _branches_at(self, block: Any, rows: np.ndarray, columns: np.ndarray) -> np.ndarray | None:
        """Inner variables (components, k) of the block's branches at nodes, None without."""
        if not len(block.moduli):
            return None
        places = [at for at in _COMPONENTS[self.dimension] if max(at) < self.dimension] * len(block.moduli)
        return np.array([self._at_nodes(at, column)[rows] for at, column in zip(places, columns)])

    def _tractions(self, time: float) -> np.ndarray:
        """Forces over reference areas (owned, d) [Pa], 0 off the surface."""
        rows = slice(0, self.owned)
        force = self.system.conditions.surface_forces(time)[:, rows]
        if EXTERNAL_FORCE in self.particles:
            force = force + self.particles.storage(EXTERNAL_FORCE)[:, rows]
        return np.asarray((force / np.where(self.known.any(axis=1), self.area, np.inf)).T)

    def _correction(self, F: np.ndarray, S: np.ndarray, traction: np.ndarray) -> np.ndarray:
        """The least change (owned, 3, 3) [Pa] of S by which known components of F S N are those of the traction."""
        d, result = self.dimension, np.zeros_like(S)
        rows = np.flatnonzero(self.known.any(axis=1))
        known, N = self.known[rows], np.zeros((len(rows), 3))
        N[:, :d] = self.normal[rows]
        direction = F[rows, :d, :, None] * N[:, None, None, :]
        direction = 0.5 * (direction + direction.swapaxes(2, 3)) * known[:, :, None, None]
        gram = np.einsum("nijk,nljk->nil", direction, direction) + np.eye(d) * ~known[:, None, :]
        lacking = known * traction[rows] - np.einsum("nijk,njk->ni", direction, S[rows])
        result[rows] = np.einsum("ni,nijk->njk", np.linalg.solve(gram, lacking[:, :, None])[:, :, 0], direction)
        return result

    def _of_law(
        self, block: Any, rows: np.ndarray, along: np.ndarray, start: np.ndarray, A: np.ndarray | None,
        traction: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:  # fmt: skip
        """Cauchy stresses (k, 3, 3) [Pa] at surfaces and whether they have the known components of the traction (k, d)
        [Pa]; along, start (k, 3, 3): F that holds along the surface, and that of which what it is across it is the
        first guess; A: inner variables."""
        normal, known = self.normal[rows], self.known[rows]
        d = self.dimension
        q = np.einsum("nij,nj->ni", (start - along)[:, :d, :d], normal) * known

        def stretched(q: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
            F = along.copy()
            F[:, :d, :d] += q[:, :, None] * normal[:, None, :]
            P = block.stresses_of(rows, F, A)
            return F, P, known * (np.einsum("nij,nj->ni", P[:, :d, :d], normal) - traction)

        F, P, rest = stretched(q)
        for _ in range(_ITERATIONS):
            slope = np.stack([(stretched(q + _CHANGE * e * known)[2] - rest) / _CHANGE for e in np.eye(d)], axis=2)
            slope += np.eye(d) * ~known[:, None, :]
            tried = q - np.linalg.solve(slope, rest[:, :, None])[:, :, 0]
            F_tried, P_tried, rest_tried = stretched(tried)
            better = np.linalg.norm(rest_tried, axis=1) < np.linalg.norm(rest, axis=1)
            q, rest = np.where(better[:, None], tried, q), np.where(better[:, None], rest_tried, rest)
            F, P = (np.where(better[:, None, None], new, old) for new, old in ((F_tried, F), (P_tried, P)))
        sound = np.linalg.norm(rest, axis=1) <= 1e-6 * np.abs(P).max(axis=(1, 2), initial=1e-300)
        return np.asarray(P @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]), sound


def _pairs_with_ghosts(comm: Any, near: Any, identifier: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Pairs of nodes that share an element, in both orders, by identifiers (m,): those of this rank's nodes and of
    their neighbours on other ranks. Collective."""
    everyone = near.halo.with_ghosts(identifier)
    one = np.concatenate(near.rows_of_pairs)
    other = np.concatenate([pairs.neighbour.astype(np.int64) for pairs in near.lists])
    inside = other < near.owned
    one, other = np.concatenate([one, other[inside]]), np.concatenate([other, one[inside]])
    told = [np.isin(one, rows) for rows in near.halo.plan.send_rows]
    to = [np.full(int(some.sum()), rank) for rank, some in zip(near.halo.plan.neighbours, told)]
    chosen = np.concatenate([np.zeros(0, np.int64), *(np.flatnonzero(some) for some in told)])
    pairs = {"one": everyone[one[chosen]], "other": everyone[other[chosen]]}
    come = migrate(comm, np.concatenate([np.zeros(0, np.int64), *to]), pairs)
    return np.concatenate([everyone[one], come["one"]]), np.concatenate([everyone[other], come["other"]])
