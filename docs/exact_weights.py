"""Weights on irregular particles that satisfy both conditions exactly, beside closure: a free block of triangles.

    python docs/exact_weights.py

A block of 1 x 3, nodes of a lattice moved by up to 20 % of a spacing, Delaunay triangles with lumped areas and the
lengths of their boundary edges; weights of Wendland C2, h/dx = .85. Of each, the error of the first frequency, that
of bending, against a fine lattice of fourth order, and the iterations of conjugate gradients (diagonal preconditioner)
that the weights take to 1e-8; of the exact ones what is left of closure and how much the weights change.
"""

import numpy as np
from scipy.linalg import eigh
from scipy.sparse import coo_matrix, diags
from scipy.sparse.linalg import cg
from scipy.spatial import Delaunay, cKDTree

from parsolid.pairs.box_weights import Axis, lengths_of, operator_of

NU, LENGTH, SMOOTHING = 0.3, 3.0, 0.85


def block(cells: int, jitter: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes (n, 2), areas of nodes (n,), outward lengths (n, 2); those on the boundary move along it not at all."""
    shape = cells + 1, round(LENGTH * cells) + 1
    X = np.stack(np.meshgrid(*(np.arange(k) / cells for k in shape), indexing="ij"), -1).reshape(-1, 2)
    inside = (X > 1e-9).all(1) & (np.array([1.0, LENGTH]) - X > 1e-9).all(1)
    X[inside] += np.random.default_rng(1).uniform(-jitter, jitter, (inside.sum(), 2)) / cells
    triangles = Delaunay(X).simplices
    edges = X[triangles[:, 1:]] - X[triangles[:, :1]]
    area = 0.5 * np.abs(np.linalg.det(edges))
    triangles, area = triangles[area > 1e-9], area[area > 1e-9]
    volume = np.bincount(triangles.ravel(), np.repeat(area / 3.0, 3), len(X))
    outward = np.zeros_like(X)
    for k, end in enumerate((1.0, LENGTH)):
        for face, sign in ((X[:, k] < 1e-9, -1.0), (X[:, k] > end - 1e-9, 1.0)):
            rest = X[face][:, 1 - k]
            corner = (rest < 1e-9) | (rest > (LENGTH, 1.0)[k] - 1e-9)
            outward[face, k] = sign * np.where(corner, 0.5, 1.0) / cells
    return X, volume, outward


def kernel_pairs(X: np.ndarray, volume: np.ndarray, reach: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First, second, g_ab of pairs."""
    a, b = cKDTree(X).query_pairs(reach, output_type="ndarray").T
    step = X[b] - X[a]
    q = 2.0 * np.linalg.norm(step, axis=1) / reach
    # -W'/r of Wendland C2, up to a factor that the moments settle
    g = (volume[a] * volume[b] * (1.0 - 0.5 * q) ** 3)[:, None] * step
    return a, b, g


def moments(X: np.ndarray, a: np.ndarray, b: np.ndarray, g: np.ndarray) -> np.ndarray:
    result = np.zeros((len(X), 2, 2))
    product = g[:, :, None] * (X[b] - X[a])[:, None]
    np.add.at(result, a, product)
    np.add.at(result, b, product)
    return result


def solved(A: coo_matrix, right: np.ndarray) -> tuple[np.ndarray, int]:
    """Least squares of A^T x = right by its normal equations A^T A; the iterations."""
    count = [0]
    scale = diags(1.0 / np.maximum(A.diagonal(), 1e-300))

    def told(_: np.ndarray) -> None:
        count[0] += 1

    x, _ = cg(A, right, rtol=1e-8, maxiter=20000, M=scale, callback=told)
    return x, count[0]


def closed(X, V, A, a, b, g, passes: int = 12):
    """Potentials as docs/irregular-particles.md says, L_a anew in each pass; (g, L, iterations)."""
    n, r, iterations = len(X), np.linalg.norm(X[b] - X[a], axis=1), 0
    for _ in range(passes):
        L = np.linalg.inv(moments(X, a, b, g) / V[:, None, None])
        both = L[a] + L[b]
        force = np.einsum("kij,kj->ki", both, g)
        c = np.zeros((n, 2))
        np.add.at(c, a, force)
        np.add.at(c, b, -force)
        w = np.linalg.norm(g, axis=1) * r
        rows = np.concatenate((a, b, a, b)), np.concatenate((b, a, a, b))
        laplacian = coo_matrix((np.concatenate((-w, -w, w, w)), rows), (n, n)).tocsr()
        p = np.zeros((n, 2))
        for i in range(2):
            right = -A[:, i] - c[:, i]
            p[:, i], more = solved(laplacian, right - right.mean())
            iterations += more
        mean = 0.5 * np.trace(both, axis1=1, axis2=2)
        g = g + (w / mean)[:, None] * (p[a] - p[b])
    return g, np.linalg.inv(moments(X, a, b, g) / V[:, None, None]), iterations


def exact(X, V, A, a, b, g, spacing: float):
    """Least change for sum g = -A/2 and moments V 1, by components; (g, iterations, residual over a face, change)."""
    scale = V.sum() * 2.0 / np.trace(moments(X, a, b, g), axis1=1, axis2=2).sum()
    g, n, m = g * scale, len(X), len(a)
    step = (X[b] - X[a]) / spacing
    root = np.sqrt(np.linalg.norm(g, axis=1) * np.linalg.norm(step, axis=1))
    # columns: pairs; rows: closure, then both moments, of every particle
    values = [root, -root] + [root * step[:, j] for j in range(2) for _ in range(2)]
    rows = [a, b] + [n * (1 + j) + end for j in range(2) for end in (a, b)]
    C = coo_matrix((np.concatenate(values), (np.concatenate(rows), np.tile(np.arange(m), 6))), (3 * n, m)).tocsr()
    result, iterations = np.zeros_like(g), 0
    for i in range(2):
        wanted = np.concatenate([-0.5 * A[:, i]] + [(V if i == j else 0.0 * V) / spacing for j in range(2)])
        start = C @ (g[:, i] / root)
        x, more = solved((C @ C.T).tocsr(), wanted - start)
        result[:, i], iterations = g[:, i] + root * (C.T @ x), iterations + more
    c = np.zeros_like(A)
    np.add.at(c, a, result)
    np.add.at(c, b, -result)
    change = np.linalg.norm(result - g) / np.linalg.norm(g)
    return result, iterations, np.abs(c + 0.5 * A).max() / spacing, change


def reference(cells: int) -> float:
    """Of a lattice of fourth order."""
    axes = [Axis(k, 1.0 / cells) for k in (cells + 1, round(LENGTH * cells) + 1)]
    norms, slopes = [lengths_of(axis, True) for axis in axes], []
    for axis, norm in zip(axes, norms):
        q, n = operator_of(axis, True), axis.nodes
        Q = np.array([[q[i, j - i + 3] if abs(j - i) <= 3 else 0.0 for j in range(n)] for i in range(n)])
        slopes.append((Q - np.diag(Q.sum(axis=1))) / norm[:, None])
    one = [np.eye(len(norm)) for norm in norms]
    D = [np.kron(slopes[0], one[1]), np.kron(one[0], slopes[1])]
    return lowest(D, np.kron(*norms), np.zeros((len(D[0]),) * 2))


def lowest(D, V: np.ndarray, form: np.ndarray) -> float:
    """First frequency of a free body, that of bending, by its gradients; form: what keeps checkerboards away."""
    mu, lame = 1.0, 2.0 * NU / (1.0 - 2.0 * NU)
    W = V[:, None]
    square = sum(one.T @ (W * one) for one in D)
    blocks = [[lame * D[i].T @ (W * D[j]) + mu * D[j].T @ (W * D[i]) for j in range(2)] for i in range(2)]
    for i in range(2):
        blocks[i][i] = blocks[i][i] + mu * square + form
    values = eigh(np.block(blocks), np.diag(np.tile(V, 2)), eigvals_only=True, subset_by_index=(3, 3))
    return float(np.sqrt(values[0]))


def lowest_of(X, V, a, b, g, L, spacing: float) -> float:
    """Of a free body of pairs, with a little of the form of their jumps."""
    n = len(X)
    D = np.zeros((2, n, n))
    for one, other, sign in ((a, b, 1.0), (b, a, -1.0)):
        weight = sign * np.einsum("kij,kj->ki", L[one], g) / V[one][:, None]
        for k in range(2):
            np.add.at(D[k], (one, other), weight[:, k])
            np.add.at(D[k], (one, one), -weight[:, k])
    jump = np.zeros((len(a), n))
    k = np.arange(len(a))
    jump[k, b], jump[k, a] = 1.0, -1.0
    jump -= 0.5 * sum((X[b] - X[a])[:, [i]] * (D[i][a] + D[i][b]) for i in range(2))
    form = 0.1 * jump.T @ ((np.linalg.norm(g, axis=1) / spacing)[:, None] * jump)
    return lowest(D, V, form)


def main() -> None:
    wanted = reference(16)
    for jitter, cells in ((0.1, 8), (0.1, 12), (0.2, 8), (0.2, 12)):
        X, V, A = block(cells, jitter)
        a, b, kernel = kernel_pairs(X, V, 2.0 * SMOOTHING / cells)
        eye = np.tile(np.eye(2), (len(X), 1, 1))
        plain = np.linalg.inv(moments(X, a, b, kernel) / V[:, None, None])
        one, L, few = closed(X, V, A, a, b, kernel)
        other, many, left, change = exact(X, V, A, a, b, kernel, 1.0 / cells)
        found = {"kernel": (kernel, plain, 0), "closure": (one, L, few), "exact": (other, eye, many)}
        for name, (g, correction, iterations) in found.items():
            error = lowest_of(X, V, a, b, g, correction, 1.0 / cells) / wanted - 1.0
            print(f"jitter {jitter}, {cells} cells, {name}: bending {error:+.1e}, {iterations} iterations")
        print(f"    exact: left {left:.1e} of a face, weights change by {change:.2f} of themselves")


if __name__ == "__main__":
    main()
