"""What the edges of a clamp cost lattices of fourth order, and which part of their nodes' volume takes it away.

    python docs/clamp_edges.py parts            # the part at which two lattices have one frequency
    python docs/clamp_edges.py orders           # errors of frequencies with the clamp, without one, and with that part

A block 1 wide and 2 long in plane strain with the operators of `parsolid/pairs/box_weights.py`, linear, so that
errors are those in space alone: lowest frequency of bending of K = sum of D^T V C D with the lumped mass. It is held at
Y = 0; without a clamp Y = 0 is a plane of symmetry there, with the same end of the operator and smooth stress.
"""

import sys
from typing import NamedTuple

import numpy as np
from scipy.optimize import brentq
from scipy.sparse import bmat, csr_matrix, diags, identity, kron
from scipy.sparse.linalg import eigsh

from parsolid.pairs.box_weights import REACH, Axis, norms_of, operator_of

LENGTH = 2.0
POISSONS_RATIOS = (0.0, 0.2, 0.3, 0.4, 0.45, 0.47, 0.49)
# spacing across the clamp over that along it
RATIOS = (0.5, 0.75, 1.0, 1.5)
# cells across of the errors that are shown, and of what is taken as true; the greatest part that is looked for
CELLS, FINEST, MOST = (8, 12, 16, 24, 32), (40, 64), 0.95


class Block(NamedTuple):
    """Cells across; spacing along Y over that along X; operators of fourth order, or those of cells; with a clamp."""

    cells: int
    ratio: float = 1.0
    wide: bool = True
    clamped: bool = True


def slopes(nodes: int, length: float, wide: bool) -> tuple[csr_matrix, np.ndarray]:
    """Derivative (nodes, nodes) [1/m] and lengths (nodes,) [m] of an axis of even steps."""
    axis = Axis(nodes, length / (nodes - 1))
    operator, own = operator_of(axis, wide), norms_of(axis, wide) * axis.step
    result = np.zeros((nodes, nodes + 2 * REACH))
    for i in range(nodes):
        result[i, i : i + 2 * REACH + 1] = operator[i]
        result[i, i + REACH] = -operator[i].sum()
    return csr_matrix(result[:, REACH:-REACH] / own[:, None]), own


def frequency(block: Block, poissons_ratio: float, part: float) -> float:
    """Times sqrt(density / shear modulus) [1/m]; part: of their volume that the clamp's edge nodes do without."""
    Dx, Hx = slopes(block.cells + 1, 1.0, block.wide)
    Dy, Hy = slopes(round(LENGTH * block.cells / block.ratio) + 1, LENGTH, block.wide)
    i, j = (one.ravel() for one in np.indices((len(Hx), len(Hy))))
    volume, edge = np.kron(Hx, Hy), (j == 0) & ((i == 0) | (i == len(Hx) - 1)) & block.clamped
    V = diags(volume * (1.0 - part * edge))
    x, y = kron(Dx, identity(len(Hy)), format="csr"), kron(identity(len(Hx)), Dy, format="csr")
    lame = 2.0 * poissons_ratio / (1.0 - 2.0 * poissons_ratio)
    xx, yy, xy = x.T @ V @ x, y.T @ V @ y, x.T @ V @ y
    K = bmat([[(lame + 2.0) * xx + yy, lame * xy + xy.T], [lame * xy.T + xy, (lame + 2.0) * yy + xx]], format="csr")
    free = np.concatenate((j > 0, j > 0) if block.clamped else (j >= 0, j > 0))
    root = diags(1.0 / np.sqrt(np.tile(volume, 2)[free]))
    squares = eigsh(root @ K[free][:, free] @ root, 3, sigma=-0.1, return_eigenvectors=False)
    # the plane of symmetry leaves one motion of the whole free
    return float(np.sqrt(np.sort(squares)[0 if block.clamped else 1]))


def exponent(poissons_ratio: float) -> float:
    """Of the distance in the displacement at a right angle of a clamped and a free side, plane strain (Williams, J.
    Appl. Mech. 19 (1952)): the root below 1, or 1 where none is."""

    def excess(power: float) -> float:
        factor = 3.0 - 4.0 * poissons_ratio
        return factor * np.sin(0.5 * np.pi * power) ** 2 - 4.0 * (1.0 - poissons_ratio) ** 2 + power**2

    return float(brentq(excess, 0.1, 1.0)) if excess(1.0) > 0.0 else 1.0


def part_of(block: Block, poissons_ratio: float) -> float:
    """The part at which the block has the frequency of one with twice as many cells, nan where there is none."""
    finer = block._replace(cells=2 * block.cells)

    def difference(part: float) -> float:
        return frequency(block, poissons_ratio, part) - frequency(finer, poissons_ratio, part)

    return float(brentq(difference, 0.0, MOST, xtol=1e-3)) if difference(0.0) * difference(MOST) < 0.0 else np.nan


def parts() -> None:
    print("| Poisson's ratio | power |", " | ".join(f"h_Y/h_X = {ratio}" for ratio in RATIOS), "| cells |")
    for nu in POISSONS_RATIOS:
        found = [part_of(Block(12, ratio), nu) for ratio in RATIOS] + [part_of(Block(12, 1.0, False), nu)]
        print(f"| {nu} | {exponent(nu):.2f} |", " | ".join(f"{one:.2f}" for one in found), "|", flush=True)


def true_of(clamped: bool, poissons_ratio: float) -> float:
    """Of lattices whose nodes lack nothing, extrapolated with the power of the singular stress, or the finest."""
    coarse, fine = (frequency(Block(n, clamped=clamped), poissons_ratio, 0.0) for n in FINEST)
    ratio = (FINEST[1] / FINEST[0]) ** (2.0 * exponent(poissons_ratio))
    return fine + (fine - coarse) / (ratio - 1.0) if clamped else fine


def orders(poissons_ratio: float = 0.45, part: float = 0.6) -> None:
    cases = {"clamp": (True, 0.0), f"clamp, {part}": (True, part), "no clamp": (False, 0.0)}
    for name, (clamped, lacking) in cases.items():
        found = np.array([frequency(Block(n, clamped=clamped), poissons_ratio, lacking) for n in CELLS])
        errors = np.abs(found / true_of(clamped, poissons_ratio) - 1.0)
        rates = np.log(errors[:-1] / errors[1:]) / np.log(np.divide(CELLS[1:], CELLS[:-1]))
        print(
            f"| {name} |", " | ".join(f"{100 * e:.4f}" for e in errors), "|", ", ".join(f"{r:.1f}" for r in rates), "|"
        )


if __name__ == "__main__":
    {"parts": parts, "orders": orders}[sys.argv[1]]()
