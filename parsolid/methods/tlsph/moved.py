"""What the kernels know of a reference configuration that has been moved: its deformation F_r from the original one.

The passes stand in the moved configuration, the state and the law in the original one. With J_r = det F_r and the
correction L of the moved configuration, the arrays `correction` and `pair_volume` hold F_r^T L / J_r and the original
volume V, by which the gradient and the stress are those of the original configuration without a further product:

    G = [ sum_b (v_b - v_a) (x) g_ab ] (F_r^T L / J_r)^T / V = G_r F_r,      P_r L = P (F_r^T L / J_r).

What is left to be moved is the record of the dissipation: G_r = G F_r^{-1} and rho^2 Q / J_r^2 between F_r and F_r^T.
"""

import math
from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from parsolid.numerics.dispatch import none_without
from parsolid.numerics.lanes import WIDTH, lane
from parsolid.numerics.layout import load_deformation_gradient
from parsolid.numerics.polar import congruence
from parsolid.numerics.tensors import contract, gram, matmul, plus_identity


class Moved(NamedTuple):
    """Rows (4 or 9, capacity) of F_r / J_r, which carries areas' waves along, and of F_r^{-1}."""

    push: np.ndarray
    inverse: np.ndarray


@none_without("moved", returns="G")
def gradient_in_reference(moved, space, i, G):
    """G_r = G F_r^{-1}; G itself where the reference is fixed."""
    return matmul(G, load_deformation_gradient(space, moved.inverse, i))


@none_without("moved", returns="waves")
def waves_in_reference(moved, space, i, waves):
    """rho_r^2 c_r^2 as a tensor of the moved normal, F_r waves F_r^T / J_r^2; itself where the reference is fixed."""
    return congruence(load_deformation_gradient(space, moved.push, i), waves)


@compiled(error_model="numpy")
def largest_distortion(space, owned, deformation, inverse):
    """Greatest |f^T f - 1|/2 of f = F F_r^{-1}, the Green strain since the reference was moved; 0 for rotations."""
    largest = 0.0
    for i in range(0, owned, WIDTH):
        F = load_deformation_gradient(space, deformation, i)
        strain = plus_identity(gram(matmul(F, load_deformation_gradient(space, inverse, i))), -1.0)
        square = contract(strain, strain)
        for k in range(min(WIDTH, owned - i)):
            largest = max(largest, lane(square, k))
    return 0.5 * math.sqrt(largest)
