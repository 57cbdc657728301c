"""A Prony law's numba functions over batches of numpy tensors in space; rows (n, 6) hold 11, 22, 33, 12, 13, 23."""

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic.evaluation import six
from parsolid.materials.viscoelastic import prony


def strains(law, gradients: np.ndarray) -> np.ndarray:
    """The law's strain, rows (n, 6), of displacement gradients (n, 3, 3)."""
    rows = np.ascontiguousarray(gradients, dtype=np.float64).reshape(-1, 9)
    result = np.empty((len(rows), 6))
    _strains(law, rows, result)
    return result


def stresses(law, strain: np.ndarray, relaxing: np.ndarray) -> np.ndarray:
    """Stress, rows (n, 6) [Pa], of the strain and the relaxing strain, rows (n, 6)."""
    result = np.empty_like(strain)
    _stresses(law, strain, relaxing, result)
    return result


def equilibrium_forms(law, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """`prony.equilibrium_form` (n,) [J/m^3] of rows (n, 6)."""
    result = np.empty(len(a))
    _equilibrium_forms(law, a, b, result)
    return result


def branch_forms(law, a: np.ndarray, b: np.ndarray) -> np.ndarray:
    """`prony.branch_form` (n,) [J/m^3] of rows (n, 6)."""
    result = np.empty(len(a))
    _branch_forms(law, a, b, result)
    return result


@compiled
def _strains(law, gradients, result):
    for i in range(len(gradients)):
        g = gradients[i]
        strain = prony.strain_measure(law, (g[0], g[1], g[2], g[3], g[4], g[5], g[6], g[7], g[8]))
        for c in range(6):
            result[i, c] = strain[c]


@compiled
def _stresses(law, strain, relaxing, result):
    for i in range(len(strain)):
        values = prony.stress(law, six(strain, i), six(relaxing, i))
        for c in range(6):
            result[i, c] = values[c]


@compiled
def _equilibrium_forms(law, a, b, result):
    for i in range(len(a)):
        result[i] = prony.equilibrium_form(law, six(a, i), six(b, i))


@compiled
def _branch_forms(law, a, b, result):
    for i in range(len(a)):
        result[i] = prony.branch_form(law, six(a, i), six(b, i))
