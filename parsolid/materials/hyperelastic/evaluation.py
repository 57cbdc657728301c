"""The functions of a hyperelastic law over batches of numpy tensors.

Tensors are arrays (..., 3, 3) of float64; the leading shape is any, and empty for a single state. branch_sum is
sum mu_alpha A_alpha [Pa] of Maxwell branches (`materials.viscoelastic.maxwell`), None without.
"""

from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.hyperelastic.at_particles import after_step
from parsolid.materials.hyperelastic.functions import energy, pressure_waves, shear_waves, stress
from parsolid.materials.viscoelastic.maxwell import branch_stress, branch_waves, total_modulus
from parsolid.tensors import cofactor, determinant, plus, plus_symmetric

_ROW, _COLUMN = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def general_rows(tensors: np.ndarray) -> np.ndarray:
    """Rows (n, 9) of tensors (..., 3, 3)."""
    return np.ascontiguousarray(tensors, dtype=np.float64).reshape(-1, 9)


def symmetric_rows(tensors: np.ndarray) -> np.ndarray:
    """Rows (n, 6): 11, 22, 33, 12, 13, 23 of symmetric tensors (..., 3, 3)."""
    return np.ascontiguousarray(np.asarray(tensors, dtype=np.float64)[..., _ROW, _COLUMN]).reshape(-1, 6)


def symmetric_tensors(rows: np.ndarray) -> np.ndarray:
    """Symmetric tensors (..., 3, 3) of rows (..., 6)."""
    result = np.empty((*rows.shape[:-1], 3, 3))
    result[..., _ROW, _COLUMN] = rows
    result[..., _COLUMN, _ROW] = rows
    return result


def energies(law, F) -> np.ndarray:
    """Stored energy without branches [J/m^3] (...)."""
    result = np.empty(np.shape(F)[:-2])
    _energies(law, general_rows(F), result.reshape(-1))
    return result


def stresses(law, F, branch_sum=None) -> np.ndarray:
    """First Piola-Kirchhoff stress [Pa] (..., 3, 3)."""
    return states(law, F, branch_sum)[0]


def states(law, F, branch_sum=None) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """First Piola-Kirchhoff stress, `functions.pressure_waves` and `functions.shear_waves` [Pa] (..., 3, 3), with the
    branches."""
    rows, shape = general_rows(F), np.shape(F)
    P, pressure, shear = np.empty_like(rows), np.empty((len(rows), 6)), np.empty((len(rows), 6))
    viscous = None if branch_sum is None else symmetric_rows(np.broadcast_to(branch_sum, shape))
    _evaluate(law, total_modulus(law.branch_moduli), rows, viscous, P, pressure, shear)
    return P.reshape(shape), symmetric_tensors(pressure).reshape(shape), symmetric_tensors(shear).reshape(shape)


def after_step_to(law: Any, F: np.ndarray) -> Any:
    """The law at a point with its state variables after a step that ends at F (3, 3)."""
    rows = tuple(np.asarray(F, float).ravel().tolist())
    return after_step(law, rows, cofactor(rows), determinant(rows))


@kernel
def _energies(law, rows, result):
    for i in range(len(rows)):
        r = rows[i]
        F = (r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8])
        result[i] = energy(law, F, cofactor(F), determinant(F))


@kernel
def _evaluate(law, moduli, rows, branch_sums, P, pressure, shear):
    for i in range(len(rows)):
        r = rows[i]
        F = (r[0], r[1], r[2], r[3], r[4], r[5], r[6], r[7], r[8])
        H, J = cofactor(F), determinant(F)
        p, q, s = stress(law, F, H, J), pressure_waves(law, F, H, J), shear_waves(law, F)
        if branch_sums is not None:
            b = branch_sums[i]
            branches = (b[0], b[1], b[2], b[3], b[4], b[5])
            p, s = plus(p, branch_stress(moduli, branches, F, H, J)), plus_symmetric(s, branches)
            q = plus_symmetric(q, branch_waves(moduli, branches, H, J))
        for c in range(9):
            P[i, c] = p[c]
        for c in range(6):
            pressure[i, c], shear[i, c] = q[c], s[c]
