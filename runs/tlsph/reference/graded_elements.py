"""Reference series of small torsion and bending of a clamped block: linear elasticity by finite elements of high order,
graded towards the clamp and its edges, where stresses are singular, and exact in time, mode by mode.

    python runs/tlsph/reference/graded_elements.py bending 4 3 > runs/tlsph/reference/bending.json

order of the elements; how often the meshes are refined towards the edges. A quarter of the block is meshed, by products
of meshes of lines, so that stiffness and mass are sums of products of their matrices; K is factored layer by layer of
elements along Y. Modes of the greatest periods are found by shifted and inverted iteration.
"""

import json
import sys
from itertools import pairwise

import numpy as np
from scipy.linalg import cholesky, solve_triangular
from scipy.sparse import csr_matrix, kron
from scipy.sparse.linalg import LinearOperator, eigsh
from spectral_elements import CASES, DENSITY, POISSONS_RATIO, YOUNGS_MODULUS

MODES = 100
# components that vanish on the planes X = 0 and Z = 0
HELD = {"torsion": ((1, 2), (0, 1)), "bending": ((1, 2), (2,))}


class Line:
    """A mesh of a line, with Gauss-Lobatto-Legendre nodes and exact integrals: matrices of products of values (mass),
    slopes (stiff) and a slope with a value (mixed)."""

    def __init__(self, ends: np.ndarray, order: int) -> None:
        legendre = np.polynomial.legendre.Legendre.basis(order)
        nodes = np.concatenate(([-1.0], np.sort(legendre.deriv().roots().real), [1.0]))
        at, weight = np.polynomial.legendre.leggauss(order + 1)
        basis = [np.poly1d(np.poly(np.delete(nodes, i))) for i in range(order + 1)]
        value = np.array([one(at) / one(node) for one, node in zip(basis, nodes)])
        slope = np.array([one.deriv()(at) / one(node) for one, node in zip(basis, nodes)])
        count = (len(ends) - 1) * order + 1
        self.nodes, self.order = np.zeros(count), order
        full = np.zeros((3, count, count))
        for e, (low, high) in enumerate(pairwise(ends)):
            rows, half = slice(e * order, (e + 1) * order + 1), 0.5 * (high - low)
            self.nodes[rows] = low + half * (nodes + 1.0)
            full[0, rows, rows] += half * (value * weight) @ value.T
            full[1, rows, rows] += (slope * weight) @ slope.T / half
            full[2, rows, rows] += (slope * weight) @ value.T
        self.mass, self.stiff, self.mixed = (csr_matrix(one) for one in full)


def product(y: csr_matrix, x: csr_matrix, z: csr_matrix) -> csr_matrix:
    return kron(kron(y, x), z, format="csr")


def matrices(X: Line, Y: Line, Z: Line) -> tuple[csr_matrix, csr_matrix]:
    """Stiffness and mass of all nodes, three components each, nodes along Y the slowest."""
    shear = YOUNGS_MODULUS / 2 / (1 + POISSONS_RATIO)
    lame = 2 * shear * POISSONS_RATIO / (1 - 2 * POISSONS_RATIO)
    lines = (X, Y, Z)

    def term(i: int, j: int) -> csr_matrix:
        """Integral of d_i of a test function times d_j of another one."""
        factors = []
        for k, line in enumerate(lines):
            both = (k == i) + (k == j)
            factors.append(
                line.mass if not both else line.stiff if both == 2 else line.mixed if k == i else line.mixed.T
            )
        return product(factors[1], factors[0], factors[2])

    unit, stiffness = np.eye(3), 0
    for i in range(3):
        for j in range(3):
            block = lame * term(i, j) + shear * term(j, i)
            if i == j:
                block = block + shear * sum(term(k, k) for k in range(3))
            stiffness = stiffness + kron(block, csr_matrix(np.outer(unit[i], unit[j])), format="csr")
    mass = DENSITY * kron(product(Y.mass, X.mass, Z.mass), csr_matrix(unit), format="csr")
    return stiffness, mass


class Factored:
    """K, block tridiagonal in layers of elements along Y, whose last nodes alone meet the next layer."""

    def __init__(self, K: csr_matrix, starts: np.ndarray, last: np.ndarray) -> None:
        """starts: first row of each layer, and the number of rows; last: rows on each layer's last nodes."""
        self.starts, self.last, self.layers = starts, last, []
        couple = None
        for j in range(len(starts) - 1):
            rows = slice(starts[j], starts[j + 1])
            S = K[rows, rows].toarray()
            if couple is not None:
                S -= couple.T @ couple
            L = cholesky(S, lower=True, overwrite_a=True, check_finite=False)
            self.layers.append((L, couple))
            if j + 2 < len(starts):
                B = K[starts[j + 1] : starts[j + 2], starts[j + 1] - last[j] : starts[j + 1]].toarray()
                couple = solve_triangular(L[-last[j] :, -last[j] :], B.T, lower=True, check_finite=False)

    def __call__(self, f: np.ndarray) -> np.ndarray:
        parts, before = [], None
        for j, (L, couple) in enumerate(self.layers):
            own = f[self.starts[j] : self.starts[j + 1]].copy()
            if couple is not None:
                own -= couple.T @ before[-len(couple) :]
            before = solve_triangular(L, own, lower=True, check_finite=False)
            parts.append(before)
        after = None
        for j in reversed(range(len(parts))):
            own = parts[j].copy()
            if after is not None:
                couple = self.layers[j + 1][1]
                own[-len(couple) :] -= couple @ after
            after = parts[j] = solve_triangular(self.layers[j][0], own, lower=True, trans="T", check_finite=False)
        return np.concatenate(parts)


def graded(length: float, size: float, refinements: int) -> np.ndarray:
    """Ends of elements of about a size, the first of which is cut `refinements` times at a quarter from 0."""
    ends = np.linspace(0.0, length, max(1, round(length / size)) + 1)
    for _ in range(refinements):
        ends = np.concatenate((ends[:1], [0.25 * ends[1]], ends[1:]))
    return ends


def rounded(number: float) -> float:
    return float(f"{number:.8g}")


def series(case: str, order: int, refinements: int, samples: int = 200) -> dict:
    """Energies and the corner's motion at equal times."""
    (length, end, start), fixed = CASES[case], HELD[case]
    across = 0.5 - graded(0.5, 0.5, refinements)[::-1]
    X, Y, Z = Line(across, order), Line(graded(length, 0.5, refinements), order), Line(across, order)
    K, M = matrices(X, Y, Z)
    y, x, z = (one.ravel() for one in np.meshgrid(Y.nodes, X.nodes, Z.nodes, indexing="ij"))
    free = np.ones((len(y), 3), bool)
    free[y == 0.0] = False
    for plane, components in zip((x, z), fixed):
        for c in components:
            free[plane == 0.0, c] = False
    # the layer of elements that a node belongs to, and whether the next layer has it, too
    node = np.repeat(np.arange(len(Y.nodes)), len(X.nodes) * len(Z.nodes))
    layer = np.repeat((np.maximum(node, 1) - 1) // order, 3).reshape(-1, 3)[free]
    top = np.repeat(node % order == 0, 3).reshape(-1, 3)[free]
    v = np.stack(start(x, y, z), axis=-1)[free]
    corner = np.zeros((2, *free.shape))
    there = (x == X.nodes[-1]) & (y == length) & (z == Z.nodes[-1])
    corner[0, there] = (1.0, 0.0, -1.0)
    corner[1, there, 0] = 1.0
    K, M, told = K[free.ravel()][:, free.ravel()], M[free.ravel()][:, free.ravel()], corner[:, free]
    layers = range(int(layer.max()) + 1)
    starts = np.concatenate(([0], np.cumsum([np.sum(layer == j) for j in layers])))
    inverse = Factored(K, starts, np.array([np.sum(top & (layer == j)) for j in layers]))
    operator = LinearOperator(K.shape, matvec=inverse, dtype=float)
    squares, modes = eigsh(K, MODES, M, sigma=0.0, OPinv=operator, v0=v)
    omega, part, initial = np.sqrt(squares), modes.T @ (M @ v), 0.5 * v @ (M @ v)
    t = np.linspace(0.0, end, samples + 1)
    phase = np.outer(t, omega)
    # of the whole block; what modes of shorter periods have of the energy stays kinetic in the mean and is left out
    kinetic = 4.0 * 0.5 * (np.cos(phase) * part) ** 2 @ np.ones(MODES)
    stored = 4.0 * 0.5 * (np.sin(phase) * part) ** 2 @ np.ones(MODES)
    twist, along = ((np.sin(phase) / omega * part) @ (one @ modes) for one in told)
    missing = 1.0 - 0.5 * part @ part / initial
    print(f"{K.shape[0]} unknowns, slowest {omega[:3]}, energy in no mode {missing:.2e}", file=sys.stderr)
    names = ("K", "W", "twist", "ux")
    values = (kinetic, stored, twist, along)
    said = (
        f"small {case} of a clamped 1 x {length:g} x 1 block, elements of order {order} graded {refinements} times "
        f"towards the clamp and the edges, {MODES} modes"
    )
    columns = {name: list(map(rounded, one)) for name, one in zip(names, values)}
    where = {"method": f"graded elements, p = {order}", "case": case, "description": said}
    return {**where, "t": list(map(rounded, t)), "E0": rounded(4.0 * initial), "series": columns}


if __name__ == "__main__":
    print(json.dumps(series(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))))
