"""Blocks on an incline: where their weight acts at once they bounce, and slide while little presses."""

import numpy as np
import pytest
import scipy.sparse
from solids import run_to_end, supports

SOFT = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 4e6, "poissons_ratio": 0.3}
GRAVITY, SPACING, BASE, BLOCK, SHIFT = 10.0, 0.1, (24, 4), (10, 5), 3


def incline(friction: float, slope: float, grows: float, end: float) -> dict:
    """A block on a base of its material, in the axes of the base; the weight grows over a time [s]."""
    along, across = (f"{GRAVITY * one(np.arctan(slope))}" for one in (np.sin, np.cos))
    grown = f"where(t < {grows}, 0.5 - 0.5*cos(pi*t/{max(grows, 1e-9)}), 1)"
    bodies = []
    for name, cells, corner in (("base", BASE, (0, 0)), ("block", BLOCK, (SHIFT, BASE[1]))):
        box = {"lower": [SPACING * one for one in corner], "upper": [SPACING * (a + b) for a, b in zip(corner, cells)]}
        bodies.append(
            {"name": name, "shape": {"box": box}, "particles": [one + 1 for one in cells], "material": dict(SOFT)}
        )
    return {
        "dimension": 2,
        "end_time": end,
        "method": {"kind": "tlsph", "balance_limit": 1, "weights": "kernel"},
        "bodies": bodies,
        "contact": [{"bodies": ["base", "block"], "friction": friction}],
        "boundaries": supports(Y=(0.0, "fixed")),
        "loads": {"acceleration": [f"{along}*{grown}", f"-{across}*{grown}"]},
    }


def stiffness(cells: tuple[int, int], C: np.ndarray) -> tuple[scipy.sparse.csr_matrix, np.ndarray]:
    """Of square bilinear elements in plane strain, and lumped masses [kg/m]."""
    s, t = np.array([-1, 1, 1, -1]), np.array([-1, -1, 1, 1])
    K = np.zeros((8, 8))
    for a, b in np.array([(-1, -1), (-1, 1), (1, -1), (1, 1)]) / np.sqrt(3):
        B = np.zeros((3, 8))
        B[0, ::2] = B[2, 1::2] = s * (1 + t * b) / (2 * SPACING)
        B[1, 1::2] = B[2, ::2] = t * (1 + s * a) / (2 * SPACING)
        K += B.T @ C @ B * SPACING**2 / 4
    i, j = (one.ravel() for one in np.meshgrid(*(np.arange(n) for n in cells)))
    row = cells[0] + 1
    elements = (j * row + i)[:, None] + np.array([0, 1, row + 1, row])
    unknowns = (2 * elements[:, :, None] + np.arange(2)).reshape(-1, 8)
    nodes = row * (cells[1] + 1)
    mass = np.bincount(elements.ravel(), minlength=nodes) * SOFT["density"] * SPACING**2 / 4
    places = np.repeat(unknowns, 8, axis=1).ravel(), np.tile(unknowns, (1, 8)).ravel()
    return scipy.sparse.csr_matrix((np.tile(K.ravel(), len(elements)), places), (2 * nodes, 2 * nodes)), mass


def by_finite_elements(friction: float, slope: float, grows: float, end: float) -> float:
    """How far [m] the block has moved along the base: linear elasticity without damping, nodes that meet nodes, and
    impulses that allow no penetration and obey Coulomb's law without a spring (Moreau's time stepping)."""
    lame, shear = SOFT["youngs_modulus"] * 0.3 / (1.3 * 0.4), SOFT["youngs_modulus"] / 2.6
    C = np.diag([lame + 2 * shear, lame + 2 * shear, shear])
    C[0, 1] = C[1, 0] = lame
    (below, base), (above, block) = stiffness(BASE, C), stiffness(BLOCK, C)
    K, m = scipy.sparse.block_diag((below, above), "csr"), np.concatenate((base, block))
    met = np.arange(BLOCK[0] + 1)
    own, other, first = len(base) + met, BASE[1] * (BASE[0] + 1) + SHIFT + met, BASE[0] + 1
    steps = int(end / (0.35 * SPACING / np.sqrt(C[0, 0] / SOFT["density"]))) + 1
    step, angle, reduced = end / steps, np.arctan(slope), 1 / (1 / m[own] + 1 / m[other])
    weight = GRAVITY * np.array([np.sin(angle), -np.cos(angle)])
    u, v = np.zeros((2, len(m), 2))
    for n in range(steps):
        t = (n + 0.5) * step
        grown = 0.5 - 0.5 * np.cos(np.pi * t / grows) if t < grows else 1.0
        v += step * (grown * weight - (K @ u.ravel()).reshape(-1, 2) / m[:, None])
        v[:first] = 0.0
        slip, approach = (v[own] - v[other]).T
        normal = np.maximum(0.0, -reduced * (approach + (u[own, 1] - u[other, 1]) / step))
        impulse = np.stack((np.clip(-reduced * slip, -friction * normal, friction * normal), normal), axis=1)
        v[own] += impulse / m[own, None]
        v[other] -= impulse / m[other, None]
        u += step * v
    return float(block @ u[len(base) :, 0] / block.sum())


@pytest.mark.parametrize(
    ("case", "error"), [((0.2, 0.25, 0.1, 0.25), 0.005), ((0.2, 0.25, 0.0, 0.1), 0.05), ((0.4, 0.2, 0.0, 0.05), 0.05)]
)
def test_a_block_moves_as_coulombs_law_without_a_spring_says(case, error):
    """Also where it bounces: with friction .4 it holds on a slope of .2 but slides while little presses."""

    def place(sim):
        rows = sim.systems[0].particles.owned_rows
        shares = (rows("body") == 1) * rows("volume")
        return {"place": shares @ rows("position")[:, 0] / shares.sum()}

    _, columns = run_to_end(incline(*case), more=place)
    assert abs((columns["place"][-1] - columns["place"][0]) / by_finite_elements(*case) - 1.0) < error
