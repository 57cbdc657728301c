"""Stresses of the stored state, for output and probes."""

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic.law import first_piola_kirchhoff_stress
from parsolid.methods.tlsph.deformation import current_branches
from parsolid.methods.tlsph.strain import load_strain
from parsolid.numerics.lanes import WIDTH
from parsolid.numerics.tensors import lane_of_general


@compiled(error_model="numpy")
def stress_components(space, first, last, law, body, result):
    """First Piola-Kirchhoff stress [Pa] of particles first..last-1 into result (last - first, 9 or 5),
    `numerics.tensors` order."""
    for i in range(first, last, WIDTH):
        F, H, J = load_strain(space, body, i)
        P = first_piola_kirchhoff_stress(law, F, H, J, current_branches(space, law, body.branches, i, F))
        for k in range(min(WIDTH, last - i)):
            values = lane_of_general(P, k)
            for c in range(len(values)):
                result[i + k - first, c] = values[c]


def deformation_gradients(table, dimension: int, first: int, last: int) -> np.ndarray:
    """F (n, 3, 3) of particles first..last-1 from the table's field, with F33 = 1 in the plane."""
    result = np.zeros((last - first, 3, 3))
    result[:, range(3), range(3)] = 1.0
    F = table.owned_rows("deformation_gradient")[first:last]
    result[:, :dimension, :dimension] = F.reshape(-1, dimension, dimension)
    return result


def first_piola_kirchhoff_stresses(space, blocks: list, body_of, first: int, last: int) -> np.ndarray:
    """P (n, 3, 3) [Pa] of particles first..last-1; body_of(block) gives the arrays as the block's law sees them."""
    rows = np.zeros((last - first, 9 if space.dimension == 3 else 5))
    for block in blocks:
        low, high = max(first, block.first), min(last, block.last)
        if low < high:
            stress_components(space, low, high, block.law, body_of(block), rows[low - first : high - first])
    return as_matrices(rows)


def as_matrices(components: np.ndarray) -> np.ndarray:
    """Tensors (n, 3, 3) from rows in `numerics.tensors` order, (n, 9) or plane strain (n, 5)."""
    n = len(components)
    if components.shape[1] == 9:
        return components.reshape(n, 3, 3)
    result = np.zeros((n, 3, 3))
    result[:, :2, :2] = components[:, :4].reshape(n, 2, 2)
    result[:, 2, 2] = components[:, 4]
    return result
