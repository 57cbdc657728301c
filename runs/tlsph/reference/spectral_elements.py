"""Reference series of small torsion and bending of a clamped block: linear elasticity by spectral elements in space,
central differences in time.

    python runs/tlsph/reference/spectral_elements.py torsion 6 > runs/tlsph/reference/torsion.json

Cubes with sides of half the block's width, Gauss-Lobatto-Legendre nodes of the given order in each direction.
"""

import json
import sys

import numpy as np

DENSITY, YOUNGS_MODULUS, POISSONS_RATIO = 1100.0, 17e6, 0.45
SIDE = 0.5
# length of the block [m], end of the series [s], initial velocity [m/s] of places (X, Y, Z), what is observed
CASES = {
    "torsion": (
        6.0,
        0.25,
        lambda X, Y, Z: (0.1 * np.sin(np.pi * Y / 12) * Z, 0 * Y, -0.1 * np.sin(np.pi * Y / 12) * X),
    ),
    "bending": (3.0, 0.5, lambda X, Y, Z: (0.1 * (1 - np.cos(np.pi * Y / 6)), 0 * Y, 0 * Y)),
}


def gauss_lobatto(order: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Nodes and weights (order + 1,) on [-1, 1], and the matrix of derivatives of the Lagrange polynomials."""
    legendre = np.polynomial.legendre.Legendre.basis(order)
    nodes = np.concatenate(([-1.0], np.sort(legendre.deriv().roots().real), [1.0]))
    value = legendre(nodes)
    weights = 2.0 / (order * (order + 1) * value**2)
    step = nodes[:, None] - nodes[None, :]
    np.fill_diagonal(step, 1.0)
    derivative = value[:, None] / value[None, :] / step
    np.fill_diagonal(derivative, 0.0)
    derivative[0, 0], derivative[-1, -1] = -order * (order + 1) / 4, order * (order + 1) / 4
    return nodes, weights, derivative


class Block:
    """Nodes of all elements, numbered once where elements share them."""

    def __init__(self, length: float, order: int) -> None:
        nodes, weights, derivative = gauss_lobatto(order)
        cells, n = (2, round(length / SIDE), 2), order + 1
        self.slope, self.elements = derivative * 2.0 / SIDE, int(np.prod(cells))
        lines = [np.arange(count)[:, None] * order + np.arange(n) for count in cells]
        counts = [count * order + 1 for count in cells]
        grid = np.ravel_multi_index(np.ix_(*(line.ravel() for line in lines)), counts).reshape(
            cells[0], n, cells[1], n, cells[2], n
        )
        self.of_element = grid.transpose(0, 2, 4, 1, 3, 5).reshape(self.elements, n, n, n)
        self.weight = np.einsum("i,j,k->ijk", weights, weights, weights) * (SIDE / 2) ** 3
        self.total = int(np.prod(counts))
        self.mass = DENSITY * self.gathered(np.broadcast_to(self.weight, self.of_element.shape))
        steps = [SIDE * (line + 0.0) for line in (np.arange(count) for count in cells)]
        ends = [(step[:, None] + SIDE * (nodes + 1) / 2)[:, :order].ravel() for step in steps]
        axes = [np.append(end, SIDE * count) for end, count in zip(ends, cells)]
        self.places = np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1).reshape(-1, 3) - (0.5, 0.0, 0.5)
        speed = np.sqrt(
            YOUNGS_MODULUS * (1 - POISSONS_RATIO) / (1 + POISSONS_RATIO) / (1 - 2 * POISSONS_RATIO) / DENSITY
        )
        self.step = 0.3 * SIDE * (nodes[1] - nodes[0]) / 2 / speed

    def gathered(self, values: np.ndarray) -> np.ndarray:
        """Sums at nodes of what elements have there."""
        return np.bincount(self.of_element.ravel(), np.ascontiguousarray(values).ravel(), self.total)

    def forces(self, u: np.ndarray) -> tuple[np.ndarray, float]:
        """Elastic forces (nodes, 3) [N] of displacements, and the energy [J]."""
        shear = YOUNGS_MODULUS / 2 / (1 + POISSONS_RATIO)
        lame = 2 * shear * POISSONS_RATIO / (1 - 2 * POISSONS_RATIO)
        local, D = u[self.of_element], self.slope
        G = np.stack(
            [np.einsum(f"{a}m,{b}c->eijkc", D, local) for a, b in (("i", "emjk"), ("j", "eimk"), ("k", "eijm"))],
            axis=-1,
        )
        strain = 0.5 * (G + G.swapaxes(-1, -2))
        stress = 2 * shear * strain + lame * np.trace(G, axis1=-2, axis2=-1)[..., None, None] * np.eye(3)
        energy = 0.5 * np.einsum("eijkcd,eijkcd,ijk->", stress, strain, self.weight)
        stress = stress * self.weight[..., None, None]
        force = sum(
            np.einsum(f"m{b},{a}c->eijkc", D, stress[..., axis])
            for axis, (a, b) in enumerate((("emjk", "i"), ("eimk", "j"), ("eijm", "k")))
        )
        return -np.stack([self.gathered(force[..., c]) for c in range(3)], axis=-1), float(energy)


def series(case: str, order: int, samples: int = 200) -> dict:
    """Energies and the corner's motion at equal times."""
    length, end, start = CASES[case]
    block = Block(length, order)
    free = (block.places[:, 1] > 1e-9)[:, None]
    v = np.stack(start(*block.places.T), axis=-1) * free
    corner = np.argmin(np.abs(block.places - (0.5, length, 0.5)).sum(axis=1))
    u, between = np.zeros_like(v), int(np.ceil(end / samples / block.step))
    dt, mass = end / samples / between, block.mass[:, None]
    rows, (force, energy) = [], block.forces(u)
    for step in range(samples * between + 1):
        if step % between == 0:
            twist = 0.5 * (u[corner, 0] - u[corner, 2]) / 0.5
            rows.append((step * dt, 0.5 * float(np.sum(mass * v * v)), energy, twist, u[corner, 0]))
        v += 0.5 * dt * free * force / mass
        u += dt * v
        force, energy = block.forces(u)
        v += 0.5 * dt * free * force / mass
    t, *columns = (list(column) for column in zip(*rows))
    names = ("K", "W", "twist", "ux")
    said = f"small {case} of a clamped 1 x {length:g} x 1 block, spectral elements of order {order}"
    return {"case": case, "description": said, "t": t, "E0": rows[0][1], "series": dict(zip(names, columns))}


if __name__ == "__main__":
    print(json.dumps(series(sys.argv[1], int(sys.argv[2]))))
