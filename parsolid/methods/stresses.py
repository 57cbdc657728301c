"""Stresses of the stored state, for output and probes."""

import numpy as np
from numba import njit

from parsolid.kernels.layout import load_deformation
from parsolid.kernels.simd import WIDTH, lane
from parsolid.kernels.tensor import lane_of_general
from parsolid.materials.law import first_piola_kirchhoff_stress
from parsolid.methods.deformation import current_branches


@njit(cache=True, error_model="numpy")
def stress_components(space, first, last, law, body, result):
    """First Piola-Kirchhoff stress [Pa] of particles first..last-1 into result (last - first, 9 or 5), `kernels.tensor` order."""
    for i in range(first, last, WIDTH):
        F, H, J = load_deformation(space, body.deformation, i)
        P = first_piola_kirchhoff_stress(law, F, H, J, current_branches(space, law, body.branches, i, F))
        for k in range(min(WIDTH, last - i)):
            values = lane_of_general(P, k)
            for c in range(len(values)):
                result[i + k - first, c] = values[c]


def as_matrices(components: np.ndarray) -> np.ndarray:
    """Tensors (n, 3, 3) from rows in `kernels.tensor` order, (n, 9) or plane strain (n, 5)."""
    n = len(components)
    if components.shape[1] == 9:
        return components.reshape(n, 3, 3)
    result = np.zeros((n, 3, 3))
    result[:, :2, :2] = components[:, :4].reshape(n, 2, 2)
    result[:, 2, 2] = components[:, 4]
    return result
