"""Whether a hyperelastic law keeps its waves: of a positive acoustic tensor, on a few strains."""

from typing import Any

import numpy as np

from parsolid.materials.hyperelastic.functions import elastic_moduli, stress

# logarithmic principal strains: along one axis, at constant volume, and in all
_MOST = 0.3
_STRAINS = _MOST * np.array(
    [
        [1, 0, 0],
        [-1, 0, 0],
        [1, -0.5, -0.5],
        [-1, 0.5, 0.5],
        [1, -1, 0],
        [1, 1, -1],
        [-1, -1, 1],
        [0.33] * 3,
        [-0.33] * 3,
    ]
)
_DIRECTIONS = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 0], [1, 0, 1], [0, 1, 1], [1, 1, 1]], float)
_STEP = 1e-5


def _stress(law: Any, F: np.ndarray) -> np.ndarray:
    J = float(np.linalg.det(F))
    H = J * np.linalg.inv(F).T
    return np.reshape(stress(law, tuple(F.ravel().tolist()), tuple(H.ravel().tolist()), J), (3, 3))


def least_wave(law: Any) -> float:
    """The least rho c^2 over the shear modulus, over waves of some directions in states of logarithmic strains up to
    0.3; below 0 waves grow in place of running. Of a law without branches; not a number where it has no stress there.
    """
    least = np.inf
    for strain in _STRAINS:
        F = np.diag(np.exp(strain))
        for N in _DIRECTIONS / np.linalg.norm(_DIRECTIONS, axis=1)[:, None]:
            acoustic = np.empty((3, 3))
            for k in range(3):
                change = _STEP * np.outer(np.eye(3)[k], N)
                acoustic[:, k] = (_stress(law, F + change) - _stress(law, F - change)) @ N / (2.0 * _STEP)
            least = min(least, float(np.linalg.eigvalsh(0.5 * (acoustic + acoustic.T))[0]))
    return least / float(elastic_moduli(law)[0])
