"""Growth of waves in boxes of graded axes: eigenvalues of all motions, by their parities along the axes."""

from functools import reduce
from itertools import product

import numpy as np

from parsolid.pairs.box_stable_step import BoxWaves


def growth_rate(lattice: BoxWaves, parts: list[tuple[np.ndarray, ...]], pressure: float, shear: float) -> float:
    """Of the motion that grows most in short steps of a free box with axes that are the same from both ends; parts: of
    each axis norm, gradient and jumps as `test_box_stable_step.gradient_and_jumps` has them."""
    d, found = len(parts), []
    speeds = np.full((d, d), shear) + (pressure - shear) * np.eye(d)
    lame, mu = pressure**2 - 2.0 * shear**2, shear**2
    axes = [_by_parity(*part) for part in parts]
    for parities in product((0, 1), repeat=d):
        # a component along an axis has the other parity along it
        own = [[p ^ (i == j) for j, p in enumerate(parities)] for i in range(d)]

        def along(i: int, k: int, what: str) -> np.ndarray:
            sizes = [len(axes[j][own[i][j]]["root"]) for j in range(d)]
            return reduce(np.kron, [axes[j][own[i][j]][what] if j == k else np.eye(sizes[j]) for j in range(d)])

        G = [[along(i, k, "slope") for k in range(d)] for i in range(d)]
        stiffness = [[lame * G[i][i].T @ G[j][j] + mu * G[i][j].T @ G[j][i] for j in range(d)] for i in range(d)]
        for i in range(d):
            stiffness[i][i] = stiffness[i][i] + mu * sum(G[i][k].T @ G[i][k] for k in range(d))
        damping = [sum(speeds[i, k] * along(i, k, "jumps") for k in range(d)) for i in range(d)]
        found.append(_rate(np.block(stiffness), damping, lattice.dissipation))
    return max(found)


def _by_parity(norm: np.ndarray, slope: np.ndarray, jumps: np.ndarray) -> list[dict[str, np.ndarray]]:
    """Even and odd parts of the matrices of an axis, over the root of the norm."""
    n, root = len(norm), np.sqrt(norm)
    lower = np.eye(n)[: n // 2]
    odd, even = ((lower + sign * lower[:, ::-1]).T / np.sqrt(2.0) for sign in (-1.0, 1.0))
    even = np.column_stack((even, np.eye(n)[:, n // 2 : n - n // 2]))
    slope, jumps = root[:, None] * slope / root, jumps / root[:, None] / root
    pairs = ((even, odd), (odd, even))
    return [{"slope": b.T @ slope @ a, "jumps": a.T @ jumps @ a, "root": a.T @ root} for a, b in pairs]


def _rate(stiffness: np.ndarray, damping: list[np.ndarray], dissipation: float) -> float:
    size = len(stiffness)
    B, at = np.zeros((size, size)), 0
    for block in damping:
        B[at : at + len(block), at : at + len(block)] = dissipation * block
        at += len(block)
    both = np.block([[np.zeros((size, size)), np.eye(size)], [-stiffness, -B]])
    return float(np.linalg.eigvals(both).real.max())
