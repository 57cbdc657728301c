"""Acoustic tensor and wave speeds of any hyperelastic law with Maxwell branches, from its stress.

Arrays have a common leading shape `...`; F (..., 3, 3), branch_sum [Pa] (..., 3, 3) or None as in `evaluation`.
Derivatives are five-point differences, exact to about 1e-10; extremes over directions are searched for, to about 1e-9.
"""

import numpy as np

from parsolid.materials.hyperelastic.evaluation import stresses

_STEP = 1e-3
_DIRECTIONS, _ROUNDS, _SHRINK = 64, 24, 0.6


def tangents(law, F, branch_sum=None) -> np.ndarray:
    """dP_iJ/dF_kL [Pa] (..., 3, 3, 3, 3) at fixed A."""
    F = np.asarray(F, float)
    result = np.empty((*F.shape, 3, 3))
    for k, L in np.ndindex(3, 3):
        change = np.zeros((3, 3))
        change[k, L] = _STEP
        ahead, behind, far_ahead, far_behind = (stresses(law, F + a * change, branch_sum) for a in (1, -1, 2, -2))
        result[..., k, L] = (8.0 * (ahead - behind) - (far_ahead - far_behind)) / (12.0 * _STEP)
    return result


def acoustic_tensors(tangent: np.ndarray, N) -> np.ndarray:
    """Q(N) [Pa] (..., 3, 3), Q_ik = dP_iJ/dF_kL N_J N_L, with eigenvalues rho0 c^2; N (..., 3) of unit length."""
    result = np.einsum("...iJkL,...J,...L->...ik", tangent, N, N, optimize=True)
    return 0.5 * (result + np.swapaxes(result, -1, -2))


def wave_moduli(law, F, N, branch_sum=None) -> np.ndarray:
    """rho0 c^2 [Pa] (..., 3) of the three waves along N (3,) of unit length, the slowest first."""
    return np.linalg.eigvalsh(acoustic_tensors(tangents(law, F, branch_sum), np.asarray(N, float)))


def extreme_moduli(law, F, branch_sum=None) -> np.ndarray:
    """Over all directions the least rho0 c^2, the greatest of shear waves and the greatest of all [Pa] (..., 3)."""
    tangent = tangents(law, F, branch_sum)
    values = [_greatest(tangent, wave, sign) for wave, sign in ((0, -1.0), (1, 1.0), (2, 1.0))]
    return np.stack([-values[0], values[1], values[2]], axis=-1)


def _greatest(tangent: np.ndarray, wave: int, sign: float) -> np.ndarray:
    """The greatest of sign times rho0 c^2 of a wave over directions: the best of many, moved while that gains."""

    def value(N):
        return sign * np.linalg.eigvalsh(acoustic_tensors(tangent, N))[..., wave]

    tried = [np.broadcast_to(N, tangent.shape[:-3]) for N in _hemisphere()]
    values = np.stack([value(N) for N in tried])
    best = values.argmax(axis=0)
    N, found = np.take_along_axis(np.stack(tried), best[None, ..., None], axis=0)[0], values.max(axis=0)
    reach = 2.0 / np.sqrt(_DIRECTIONS)
    for _ in range(_ROUNDS):
        for axis in np.eye(3):
            for way in (reach, -reach):
                moved = N + way * axis
                moved /= np.linalg.norm(moved, axis=-1, keepdims=True)
                new = value(moved)
                N, found = np.where((new > found)[..., None], moved, N), np.maximum(new, found)
        reach *= _SHRINK
    return found


def _hemisphere() -> np.ndarray:
    """Directions (n, 3) spread evenly over half of the sphere, on a spiral."""
    z = (np.arange(_DIRECTIONS) + 0.5) / _DIRECTIONS
    angle = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(_DIRECTIONS)
    radius = np.sqrt(1.0 - z * z)
    return np.stack([radius * np.cos(angle), radius * np.sin(angle), z], axis=-1)
