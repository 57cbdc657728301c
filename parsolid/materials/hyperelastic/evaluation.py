"""A law's numba functions over batches of numpy tensors, so that a formula is written once.

Tensors are arrays (..., 3, 3) of float64; the leading shape is any, and empty for a single state.
"""

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic import law as laws
from parsolid.numerics import tensors as tensor
from parsolid.numerics.dispatch import none_without

_ROW, _COLUMN = (0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2)


def general_rows(tensors: np.ndarray) -> np.ndarray:
    """Rows (n, 9) in `numerics.tensors` order of tensors (..., 3, 3)."""
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


def cofactor(F: np.ndarray) -> np.ndarray:
    """Cofactor H = 1/2 F x F = det(F) F^{-T} of tensors (..., 3, 3)."""
    F = np.asarray(F, dtype=np.float64)
    rows = general_rows(F)
    result = np.empty_like(rows)
    _cofactors(rows, result)
    return result.reshape(F.shape)


def tensor_cross(A: np.ndarray, B: np.ndarray) -> np.ndarray:
    """Tensor cross product (A x B)_iI = eps_ijk eps_IJK A_jJ B_kK of tensors (..., 3, 3)."""
    A, B = np.broadcast_arrays(np.asarray(A, dtype=np.float64), np.asarray(B, dtype=np.float64))
    first, second = general_rows(A), general_rows(B)
    result = np.empty_like(first)
    _crosses(first, second, result)
    return result.reshape(A.shape)


def equilibrium_energy(law, F, H, J) -> np.ndarray:
    """`law.equilibrium_energy`, W_infinity [J/m^3] with the leading shape of the tensors."""
    result = np.empty(np.size(J))
    _energies(law, general_rows(F), general_rows(H), np.ravel(J), result)
    return result.reshape(np.shape(J))


def first_piola_kirchhoff_stress(law, F, H, J, branch_sum=None) -> np.ndarray:
    """`law.first_piola_kirchhoff_stress`, P [Pa] (..., 3, 3); branch_sum is sum_alpha mu_alpha A_alpha [Pa] or None."""
    rows = general_rows(F)
    result = np.empty_like(rows)
    _stresses(law, rows, general_rows(H), np.ravel(J), _optional(branch_sum), result)
    return result.reshape(np.shape(F))


def pressure_wave_tensor(law, F, H, J, branch_sum=None) -> np.ndarray:
    """`law.pressure_wave_tensor`, Q [Pa] (..., 3, 3) with rho c_p(N)^2 = N . Q N."""
    result = np.empty((np.size(J), 6))
    _pressure_waves(law, general_rows(F), general_rows(H), np.ravel(J), _optional(branch_sum), result)
    return symmetric_tensors(result).reshape(np.shape(F))


def shear_wave_tensor(law, F, branch_sum=None) -> np.ndarray:
    """`law.shear_wave_tensor`, Q [Pa] (..., 3, 3) with N . Q N the mean rho c_s(N)^2 of both shear waves."""
    rows = general_rows(F)
    result = np.empty((len(rows), 6))
    _shear_waves(law, rows, _optional(branch_sum), result)
    return symmetric_tensors(result).reshape(np.shape(F))


def _optional(branch_sum):
    return None if branch_sum is None else symmetric_rows(branch_sum)


@register_jitable
def _nine(a, i):
    return tensor.GeneralSpace(a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5], a[i, 6], a[i, 7], a[i, 8])


@register_jitable
def six(a, i):
    """Row i of an (n, 6) array as a symmetric tensor of `numerics.tensors`."""
    return tensor.SymmetricSpace(a[i, 0], a[i, 1], a[i, 2], a[i, 3], a[i, 4], a[i, 5])


@none_without("rows")
def _branch_row(rows, i):
    return six(rows, i)


@compiled
def _put(result, i, values):
    for c in range(len(values)):
        result[i, c] = values[c]


@compiled
def _cofactors(F, result):
    for i in range(len(F)):
        _put(result, i, tensor.cofactor(_nine(F, i)))


@compiled
def _crosses(A, B, result):
    for i in range(len(A)):
        _put(result, i, tensor.cross(_nine(A, i), _nine(B, i)))


@compiled
def _energies(law, F, H, J, result):
    for i in range(len(F)):
        result[i] = laws.equilibrium_energy(law, _nine(F, i), _nine(H, i), J[i])


@compiled(error_model="numpy")
def _stresses(law, F, H, J, branch_sum, result):
    for i in range(len(F)):
        P = laws.first_piola_kirchhoff_stress(law, _nine(F, i), _nine(H, i), J[i], _branch_row(branch_sum, i))
        _put(result, i, P)


@compiled(error_model="numpy")
def _pressure_waves(law, F, H, J, branch_sum, result):
    for i in range(len(F)):
        Q = laws.pressure_wave_tensor(law, _nine(F, i), _nine(H, i), J[i], _branch_row(branch_sum, i))
        _put(result, i, Q)


@compiled
def _shear_waves(law, F, branch_sum, result):
    for i in range(len(F)):
        _put(result, i, laws.shear_wave_tensor(law, _nine(F, i), _branch_row(branch_sum, i)))
