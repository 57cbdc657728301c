"""Linear finite elements (triangles in plane strain, tetrahedra) for comparison, by scipy alone: statics of small
strain, and motions of the law of `runs/tlsph/reference/twist_by_elements.py` with lumped mass by central differences.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from scipy import sparse
from scipy.sparse.linalg import spsolve


def at_rest(K: sparse.csr_matrix, free: np.ndarray, load: np.ndarray, held: np.ndarray | None = None) -> np.ndarray:
    """Displacements (n, d) [m]: free (n, d) bool, load [N], held [m] where not free, 0 unless given."""
    rows = np.flatnonzero(free.ravel())
    u = np.zeros(free.size) if held is None else np.where(free, 0.0, held).ravel()
    u[rows] = spsolve(K[rows][:, rows].tocsc(), (load.ravel() - K @ u)[rows])
    return u.reshape(free.shape)


def assembled(K: np.ndarray, cells: np.ndarray, count: int) -> sparse.csr_matrix:
    """Of the matrices (elements, nodes, d, nodes, d) of elements."""
    d = K.shape[2]
    place = (d * cells[:, :, None] + np.arange(d)).reshape(len(cells), -1)
    width = place.shape[1]
    rows = np.repeat(place, width, axis=1).ravel(), np.tile(place, (1, width)).ravel()
    return sparse.csr_matrix((K.ravel(), rows), (d * count, d * count))


def element_matrices(g: np.ndarray, size: np.ndarray, shear: float, lame: float) -> np.ndarray:
    """(elements, nodes, d, nodes, d) of gradients (elements, nodes, d) at a point of a weight (elements,)."""
    outer = np.einsum("enl,emk,e->enlmk", g, g, size)
    K = lame * outer + shear * outer.transpose(0, 1, 4, 3, 2)
    return K + shear * np.einsum("enk,emk,e,ij->enimj", g, g, size, np.eye(g.shape[2]))


def second_order(X: np.ndarray, cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Triangles with the middles of their edges: places, and cells with middles of 01, 12, 20 behind the corners."""
    edges = np.sort(cells[:, [[0, 1], [1, 2], [2, 0]]], axis=2).reshape(-1, 2)
    different, number = np.unique(edges, axis=0, return_inverse=True)
    places = np.concatenate([X, X[different].mean(axis=1)])
    return places, np.concatenate([cells, len(X) + number.reshape(-1, 3)], axis=1)


def quadratic_stiffness(X: np.ndarray, cells: np.ndarray, modulus: float, nu: float) -> sparse.csr_matrix:
    """Of triangles of second order with straight edges, in plane strain."""
    corners = LinearElements(X, cells[:, :3], modulus, nu)
    total = 0.0
    for at in (np.array([4.0, 1.0, 1.0]), np.array([1.0, 4.0, 1.0]), np.array([1.0, 1.0, 4.0])):
        L = at / 6.0
        # of the functions by the coordinates of the corners
        slope = np.zeros((6, 3))
        slope[range(3), range(3)] = 4.0 * L - 1.0
        for k, (a, b) in enumerate(((0, 1), (1, 2), (2, 0))):
            slope[3 + k, [a, b]] = 4.0 * L[b], 4.0 * L[a]
        g = np.einsum("nc,eck->enk", slope, corners.gradient)
        total = total + element_matrices(g, corners.volume / 3.0, corners.shear, corners.lame)
    return assembled(np.asarray(total), cells, len(X))


class LinearElements:
    """X (n, d) [m], simplices cells (elements, d + 1), Young's modulus [Pa], Poisson's ratio."""

    def __init__(self, X: np.ndarray, cells: np.ndarray, modulus: float, nu: float) -> None:
        self.X, self.cells = X, cells
        self.shear, self.lame = modulus / (2 + 2 * nu), modulus * nu / ((1 + nu) * (1 - 2 * nu))
        arms = (X[cells[:, 1:]] - X[cells[:, :1]]).swapaxes(1, 2)
        self.volume = np.abs(np.linalg.det(arms)) / {2: 2.0, 3: 6.0}[X.shape[1]]
        inverse = np.linalg.inv(arms)
        # of the linear functions, (elements, d + 1, d)
        self.gradient = np.concatenate([-inverse.sum(axis=1)[:, None], inverse], axis=1)
        count = cells.shape[1]
        self.of_nodes = np.bincount(cells.ravel(), np.repeat(self.volume / count, count), len(X))

    def stiffness(self) -> sparse.csr_matrix:
        """(d n, d n) [N/m]."""
        matrices = element_matrices(self.gradient, self.volume, self.shear, self.lame)
        return assembled(matrices, self.cells, len(self.X))

    def displacement(self, free: np.ndarray, load: np.ndarray, held: np.ndarray) -> np.ndarray:
        """At rest, see `at_rest`."""
        return at_rest(self.stiffness(), free, load, held)

    def stresses(self, u: np.ndarray) -> np.ndarray:
        """At nodes (n, 3, 3) [Pa]: means of the elements around by their volume."""
        d, count = self.X.shape[1], self.cells.shape[1]
        H = np.einsum("eni,enk->eik", u[self.cells], self.gradient)
        sigma = np.zeros((len(self.cells), 3, 3))
        sigma[:, :d, :d] = self.shear * (H + H.swapaxes(1, 2))
        sigma += self.lame * np.einsum("eii->e", H)[:, None, None] * np.eye(3)
        mean = np.zeros((len(self.X), 3, 3))
        part = self.volume[:, None, None] / count * sigma
        np.add.at(mean, self.cells.ravel(), np.repeat(part, count, axis=0))
        return mean / self.of_nodes[:, None, None]

    def forces(self, u: np.ndarray) -> tuple[np.ndarray, float]:
        """Forces (n, d) [N] of large displacements (n, d) [m] and the energy [J]: mu/2 (F:F - d - 2 ln J) + lambda/2
        (J - 1)^2."""
        d = self.X.shape[1]
        F = np.einsum("eni,enk->eik", u[self.cells], self.gradient) + np.eye(d)
        J = np.linalg.det(F)
        inverse = np.linalg.inv(F).swapaxes(1, 2)
        density = (
            0.5 * self.shear * (np.einsum("eij,eij->e", F, F) - d - 2 * np.log(J)) + 0.5 * self.lame * (J - 1) ** 2
        )
        P = self.shear * F + ((self.lame * (J - 1) * J) - self.shear)[:, None, None] * inverse
        pulled = np.einsum("eij,enj,e->eni", P, self.gradient, self.volume)
        force = np.stack(
            [np.bincount(self.cells.ravel(), p.ravel(), len(u)) for p in np.moveaxis(pulled, 2, 0)], axis=1
        )
        return -force, float(self.volume @ density)

    def largest_step(self, density: float, part: float) -> float:
        """A part of the stable step [s] of lumped masses at rest."""
        d, K = self.X.shape[1], self.stiffness()
        root = np.sqrt(np.repeat(density * self.of_nodes, d))
        vector = np.random.default_rng(1).normal(size=len(root))
        for _ in range(60):
            vector = (K @ (vector / root)) / root
            square = np.linalg.norm(vector)
            vector /= square
        return part * 2.0 / float(np.sqrt(square))

    def motion(
        self, density: float, v: np.ndarray, free: np.ndarray, times: np.ndarray, part: float,
        observed: Callable[[np.ndarray], float], weight: Any = 0.0,
    ) -> dict[str, np.ndarray]:  # fmt: skip
        """Kinetic and stored energy [J] and a number observed of u (n, d), at times [s] from 0 on, of bodies with
        velocities v (n, d) [m/s] under an acceleration (d,) [m/s^2]."""
        mass, u, t = (density * self.of_nodes)[:, None], np.zeros_like(v), 0.0
        v, longest = v * free, self.largest_step(density, part)
        force, energy = self.forces(u)
        rows = []
        for time in times:
            count = int(np.ceil((time - t) / longest))
            for _ in range(count):
                step = (time - t) / count
                v += 0.5 * step * free * (force / mass + weight)
                u += step * v
                force, energy = self.forces(u)
                v += 0.5 * step * free * (force / mass + weight)
            t = time
            rows.append((0.5 * float(np.sum(mass * v * v)), energy, observed(u)))
        return dict(zip(("K", "W", "observed"), np.array(rows).T))
