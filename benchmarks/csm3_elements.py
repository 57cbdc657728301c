"""Turek and Hron's CSM3 by triangles of second order and the trapezoidal rule.

python benchmarks/csm3_elements.py SIZE STEP

Lengths of edges [m] and steps [s], say .012 .005, to 10 s. Prints mean and amplitude of both displacements of A in each
period: higher modes drift away from the first one, so that they differ from period to period by more than the meshes.
Independent of this package but for the mesh; Saint-Venant-Kirchhoff, plane strain. Needs the extra "cad".
"""

import sys
from itertools import pairwise
from typing import Any

import numpy as np
from linear_elements import second_order
from real_parts import meshed
from scipy import sparse
from scipy.sparse.linalg import splu

E, NU, DENSITY, GRAVITY, END = 1.4e6, 0.4, 1000.0, -2.0, 10.0
SHEAR, LAME = E / (2 + 2 * NU), E * NU / ((1 + NU) * (1 - 2 * NU))
# six points of degree four on a triangle (Dunavant 1985)
A, B = 0.445948490915965, 0.091576213509771
POINTS = [(A, A), (1 - 2 * A, A), (A, 1 - 2 * A), (B, B), (1 - 2 * B, B), (B, 1 - 2 * B)]
WEIGHTS = np.repeat([0.223381589678011, 0.109951743655322], 3) / 2


class Quadratic:
    """Forces and their derivative on triangles of second order: X (n, 2), cells (e, 6)."""

    def __init__(self, X: np.ndarray, cells: np.ndarray):
        self.cells, self.dof = cells, (2 * cells[:, :, None] + np.arange(2)).reshape(len(cells), 12)
        self.shape, slopes = np.zeros((6, 6)), np.zeros((6, 6, 2))
        for q, (r, s) in enumerate(POINTS):
            L, dL = np.array([1 - r - s, r, s]), np.array([[-1, -1], [1, 0], [0, 1]])
            self.shape[q] = [*(L * (2 * L - 1)), *(4 * L[a] * L[b] for a, b in ((0, 1), (1, 2), (2, 0)))]
            slopes[q] = [
                *(dL * (4 * L[:, None] - 1)),
                *(4 * (L[a] * dL[b] + L[b] * dL[a]) for a, b in ((0, 1), (1, 2), (2, 0))),
            ]
        J = np.einsum("eai,qak->eqik", X[cells], slopes)
        self.G = np.einsum("qak,eqki->eqai", slopes, np.linalg.inv(J))
        self.W = WEIGHTS * np.linalg.det(J)
        self.place = np.repeat(self.dof, 12, axis=1).ravel(), np.tile(self.dof, (1, 12)).ravel()
        self.size = 2 * len(X)

    def matrix(self, blocks: np.ndarray) -> Any:
        """Of blocks (e, 6, 2, 6, 2)."""
        return sparse.csr_matrix((blocks.ravel(), self.place), shape=(self.size, self.size))

    def mass(self) -> Any:
        """Consistent."""
        blocks = np.einsum("eq,qa,qb->eab", DENSITY * self.W, self.shape, self.shape)
        return self.matrix(np.einsum("eab,ij->eaibj", blocks, np.eye(2)))

    def forces(self, u: np.ndarray) -> tuple[np.ndarray, Any]:
        """Internal forces of displacements u (2 n,), and their derivative."""
        G, W = self.G, self.W
        F = np.einsum("eai,eqaj->eqij", u.reshape(-1, 2)[self.cells], G) + np.eye(2)
        green = 0.5 * (np.einsum("eqki,eqkj->eqij", F, F) - np.eye(2))
        S = 2 * SHEAR * green + LAME * np.trace(green, axis1=2, axis2=3)[..., None, None] * np.eye(2)
        force = np.zeros(self.size)
        np.add.at(force, self.dof, np.einsum("eq,eqij,eqaj->eai", W, F @ S, G).reshape(len(self.cells), 12))
        FG, left = np.einsum("eqij,eqaj->eqai", F, G), np.einsum("eqik,eqjk->eqij", F, F)
        blocks = LAME * np.einsum("eq,eqai,eqbj->eaibj", W, FG, FG)
        blocks += SHEAR * np.einsum("eq,eqij,eqak,eqbk->eaibj", W, left, G, G, optimize=True)
        blocks += SHEAR * np.einsum("eq,eqbi,eqaj->eaibj", W, FG, FG)
        blocks += np.einsum("eq,eqak,eqkl,eqbl,ij->eaibj", W, G, S, G, np.eye(2), optimize=True)
        return force, self.matrix(blocks)


def motion(size: float, step: float) -> np.ndarray:
    """Rows of t and both displacements of A."""

    def draw(occ: Any) -> None:
        occ.cut([(2, occ.addRectangle(0.2, 0.19, 0, 0.4, 0.02))], [(2, occ.addDisk(0.2, 0.2, 0, 0.05, 0.05))])
        occ.fragment([(2, 1)], [(0, occ.addPoint(0.6, 0.2, 0))])

    X, cells = second_order(*meshed(draw, 2, size))
    body = Quadratic(X, cells)
    M = body.mass()
    load = M @ np.tile([0.0, GRAVITY], len(X))
    # middles of edges on the round lie on chords
    free = np.flatnonzero(np.repeat(np.hypot(*(X - 0.2).T) > 0.05 + 1e-9, 2))
    at, inner = int(np.argmin(np.hypot(*(X - [0.6, 0.2]).T))), M[free][:, free].tocsc()
    u, v, a = np.zeros((3, body.size))
    a[free] = splu(inner).solve((load - body.forces(u)[0])[free])
    rows = [(0.0, 0.0, 0.0)]
    for n in range(round(END / step)):
        begun, new = u + step * v + step**2 / 4 * a, u + step * v
        for _ in range(12):
            force, K = body.forces(new)
            change = splu((K[free][:, free] + 4 / step**2 * inner).tocsc()).solve(
                -(4 / step**2 * (M @ (new - begun)) + force - load)[free]
            )
            new[free] += change
            if np.abs(change).max() < 1e-11:
                break
        after = 4 / step**2 * (new - begun)
        u, v, a = new, v + step / 2 * (a + after), after
        rows.append(((n + 1) * step, u[2 * at], u[2 * at + 1]))
    return np.array(rows)


if __name__ == "__main__":
    t, x, y = motion(*map(float, sys.argv[1:3])).T
    least = [i for i in range(1, len(y) - 1) if y[i] < min(y[i - 1], -0.1) and y[i] <= y[i + 1]]
    print(f"{(len(least) - 1) / (t[least[-1]] - t[least[0]]):.4f} Hz")
    for first, last in pairwise(least):
        told = [(np.mean([s.min(), s.max()]), np.ptp(s) / 2) for s in (y[first : last + 1], x[first : last + 1])]
        print(f"t {t[first]:6.2f} s", *(f"{1e3 * mean:.3f} +- {1e3 * swing:.3f} mm" for mean, swing in told))
