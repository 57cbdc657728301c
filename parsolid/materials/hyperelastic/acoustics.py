"""Acoustic tensor and wave speeds of any hyperelastic law with Maxwell branches, from its stress; `waves` has closed
forms of one.

States and shapes as in `materials.hyperelastic.conjugates`: arrays have a common leading shape `...`. Derivatives are
central differences, exact to about 1e-9; extremes over directions are searched for, to about 1e-6.
"""

import numpy as np

from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.hyperelastic.conjugates import PolyconvexState, branch_sum

_STEP = 1e-5
_DIRECTIONS, _ROUNDS, _SHRINK = 64, 24, 0.6


def acoustic_tensor(law, state: PolyconvexState, N) -> np.ndarray:
    """Q(N) [Pa] (..., 3, 3), Q_ik = dP_iJ/dF_kL N_J N_L at fixed A, with eigenvalues rho c^2; N (..., 3) of unit
    length.
    """
    N, viscous = np.asarray(N, dtype=np.float64), branch_sum(law, state)
    result = np.empty(np.shape(state.F))
    for k in range(3):
        change = _STEP * np.eye(3)[k][:, None] * N[..., None, :]
        ahead, behind = (_stress(law, state.F + sign * change, viscous) for sign in (1.0, -1.0))
        result[..., :, k] = np.einsum("...ij,...j->...i", ahead - behind, N) / (2.0 * _STEP)
    return 0.5 * (result + np.swapaxes(result, -1, -2))


def wave_moduli(law, state: PolyconvexState, N) -> np.ndarray:
    """rho c^2 [Pa] (..., 3) of the three waves along N, the slowest first."""
    return np.linalg.eigvalsh(acoustic_tensor(law, state, N))


def extreme_moduli(law, state: PolyconvexState) -> np.ndarray:
    """Over all directions the least rho c^2, the greatest of shear waves and the greatest of all [Pa] (..., 3)."""
    values = [_greatest(law, state, wave, sign) for wave, sign in ((0, -1.0), (1, 1.0), (2, 1.0))]
    return np.stack([-values[0], values[1], values[2]], axis=-1)


def _stress(law, F, viscous):
    return evaluation.first_piola_kirchhoff_stress(law, F, evaluation.cofactor(F), np.linalg.det(F), viscous)


def _greatest(law, state: PolyconvexState, wave: int, sign: float) -> np.ndarray:
    """The greatest of sign times rho c^2 of a wave over directions: the best of many, moved while that gains."""
    shape = np.shape(state.J)

    def value(N):
        return sign * wave_moduli(law, state, N)[..., wave]

    tried = [np.broadcast_to(N, (*shape, 3)) for N in _hemisphere()]
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
