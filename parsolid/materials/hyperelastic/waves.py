"""Acoustic tensor and wave speeds of the Mooney-Rivlin solid with Maxwell branches, for any direction.

Equation numbers are those of Lee et al.; states and shapes as in `materials.hyperelastic.conjugates`; N (..., 3) is a
material direction, normalised here. With B = sum mu_alpha A_alpha, C = F^T F, kappa = f'' + sum mu_alpha / J^2 and n
the spatial normal H N / |H N|,

    Q(N) = (2 xi + N . B N) I + 2 zeta [(tr C - N . C N) I - F (I - N (x) N) F^T] + kappa H N (x) H N.

n is an eigenvector for every N, so (56) and (59), derived for principal directions, hold for any N. The pressure wave
is the fastest: rho (c_p^2 - c_s^2) = 2 zeta lambda^2 + kappa |H N|^2 > 0, lambda a principal stretch of the surface
normal to N. rho c_p(N)^2 is a quadratic form in N, so the greatest speed over all N is that of its greatest eigenvalue,
whatever zeta.
"""

import math

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.hyperelastic.conjugates import PolyconvexState, branch_sum, right_cauchy_green
from parsolid.materials.hyperelastic.hessians import branch_hessian, equilibrium_hessian

# turns of a frame at the most
_ROUNDS = 1000


def acoustic_tensor(law, state: PolyconvexState, N) -> np.ndarray:
    """Q(N) [Pa] (..., 3, 3) of (54), with eigenvalues rho c^2."""
    N = _unit(N)
    stretched, normal = _apply(state.F, N), _apply(state.H, N)
    C, identity = right_cauchy_green(state.F), np.eye(3)
    surface = state.F @ np.swapaxes(state.F, -1, -2) - _dyad(stretched, stretched)
    area = np.trace(C, axis1=-2, axis2=-1) - _form(C, N)
    isotropic = 2.0 * law.xi + _branch_form(law, state, N)
    kappa = equilibrium_hessian(law, state).JJ + branch_hessian(law, state).JJ.sum(axis=-1)
    twice_zeta = 2.0 * (law.zeta or 0.0)
    return (
        (isotropic + twice_zeta * area)[..., None, None] * identity
        - twice_zeta * surface
        + kappa[..., None, None] * _dyad(normal, normal)
    )


def pressure_wave_speed(law, state: PolyconvexState, N) -> np.ndarray:
    """c_p [m/s] (...) along N, eq (56)."""
    return np.sqrt(_form(_pressure_tensor(law, state), _unit(N)) / law.density)


def shear_wave_speeds(law, state: PolyconvexState, N) -> np.ndarray:
    """c_s [m/s] (..., 2) along N, eq (59), the slower first; equal where zeta = 0."""
    N = _unit(N)
    isotropic = 2.0 * law.xi + _branch_form(law, state, N)
    squares = isotropic[..., None] + 2.0 * (law.zeta or 0.0) * surface_stretches(state.F, N) ** 2
    return np.sqrt(squares / law.density)


def surface_stretches(F, N) -> np.ndarray:
    """Principal stretches (..., 2), the smaller first, of the material surface normal to N: Lambda_T of (60)."""
    C, (first, second) = right_cauchy_green(F), _tangents(_unit(N))
    a, b, c = _form(C, first), _form(C, second), np.einsum("...i,...ij,...j->...", first, C, second)
    mean, radius = 0.5 * (a + b), np.hypot(0.5 * (a - b), c)
    return np.sqrt(np.stack([mean - radius, mean + radius], axis=-1))


def largest_wave_speed(law, state: PolyconvexState) -> np.ndarray:
    """The greatest speed over all directions [m/s] (...), exact for any zeta: sharper than (79).

    rho c_max^2 is the greatest eigenvalue of the pressure wave tensor; with zeta = 0 it is mu + lambda_max(M),
    M = sum mu_alpha A_alpha + [lambda_hat + (mu + sum mu_alpha)/J^2] H^T H.
    """
    return np.sqrt(np.linalg.eigvalsh(_pressure_tensor(law, state))[..., -1] / law.density)


def largest_shear_wave_speed(law, state: PolyconvexState) -> np.ndarray:
    """The greatest shear wave speed over all directions [m/s] (...).

    In closed form with zeta = 0 or without branches, else found by a search over directions (see `_extreme`).
    """
    return np.sqrt(-_extreme(law, state, -1.0) / law.density)


def smallest_acoustic_eigenvalue(law, state: PolyconvexState) -> np.ndarray:
    """The smallest eigenvalue of Q(N) over all N [Pa] (...), that of the slowest shear wave: positive where hyperbolic.

    In closed form with zeta = 0 or without branches, else found by a search over directions. Never less than
    2 xi + 2 zeta lambda_min(C) + lambda_min(sum mu_alpha A_alpha).
    """
    return _extreme(law, state, 1.0)


def _extreme(law, state: PolyconvexState, sign: float) -> np.ndarray:
    """Least value over all N of sign times rho c_s^2 (the slow one for +1, the fast one for -1).

    rho c_s^2 = 2 xi + 2 zeta T . C T + N . B N, minimised over orthonormal pairs T, N.
    """
    stretch = sign * 2.0 * (law.zeta or 0.0) * right_cauchy_green(state.F)
    viscous = branch_sum(law, state)
    constant = sign * 2.0 * law.xi
    if viscous is None:
        return constant + np.linalg.eigvalsh(stretch)[..., 0]
    if law.zeta is None:
        return constant + np.linalg.eigvalsh(sign * viscous)[..., 0]
    return constant + _least_pair(stretch, sign * viscous)


def _least_pair(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Least T . first T + N . second N over orthonormal T, N; forms (..., 3, 3).

    From many frames, the frame is turned in each of its three planes by the best angle, until no turn gains.
    """
    N = _starts()
    fixed = np.stack([*_tangents(N), N], axis=-1)
    frames = np.empty((*first.shape[:-2], len(N) + 2, 3, 3))
    frames[..., :-2, :, :] = fixed
    frames[..., -2, :, :] = np.linalg.eigh(first)[1][..., (0, 2, 1)]
    frames[..., -1, :, :] = np.linalg.eigh(second)[1][..., (1, 2, 0)]
    first, second = (
        np.einsum("...kim,...ij,...kjn->...kmn", frames, form, frames, optimize=True) for form in (first, second)
    )
    result = np.empty(first.shape[:-2])
    _turn_to_least(first.reshape(-1, 3, 3), second.reshape(-1, 3, 3), result.reshape(-1))
    return result.min(axis=-1)


@compiled
def _turn_to_least(first, second, result):
    """Turn each frame, in which the forms are given, until first_11 + second_33 is least; forms are overwritten."""
    for k in range(len(first)):
        a, b = first[k], second[k]
        value = np.inf
        for _ in range(_ROUNDS):
            _turn(a, b, 0, 1, a[0, 0], a[1, 1], a[0, 1])
            _turn(a, b, 2, 1, b[2, 2], b[1, 1], b[2, 1])
            _turn(a, b, 0, 2, a[0, 0] + b[2, 2], a[2, 2] + b[0, 0], a[0, 2] - b[0, 2])
            before, value = value, a[0, 0] + b[2, 2]
            if before - value <= 1e-15 * abs(value):
                break
        result[k] = value


@compiled
def _turn(a, b, i, j, ii, jj, ij):
    """Turn both forms in the plane of axes i, j by the angle that makes c^2 ii + s^2 jj + 2 c s ij least."""
    angle = 0.5 * math.atan2(-2.0 * ij, jj - ii)
    c, s = math.cos(angle), math.sin(angle)
    for form in (a, b):
        for k in range(3):
            form[k, i], form[k, j] = c * form[k, i] + s * form[k, j], c * form[k, j] - s * form[k, i]
        for k in range(3):
            form[i, k], form[j, k] = c * form[i, k] + s * form[j, k], c * form[j, k] - s * form[i, k]


def _starts() -> np.ndarray:
    """Directions (13, 3) to the corners, edges and faces of a cube, one of each opposite pair."""
    grid = np.stack(np.meshgrid(*3 * ([-1.0, 0.0, 1.0],), indexing="ij"), axis=-1).reshape(-1, 3)[14:]
    return grid / np.linalg.norm(grid, axis=-1, keepdims=True)


def _pressure_tensor(law, state: PolyconvexState) -> np.ndarray:
    return evaluation.pressure_wave_tensor(law, state.F, state.H, state.J, branch_sum(law, state))


def _branch_form(law, state: PolyconvexState, N: np.ndarray) -> np.ndarray:
    """N . sum mu_alpha A_alpha N [Pa]."""
    viscous = branch_sum(law, state)
    return np.zeros(np.broadcast_shapes(np.shape(state.J), N.shape[:-1])) if viscous is None else _form(viscous, N)


def _unit(N) -> np.ndarray:
    N = np.asarray(N, dtype=np.float64)
    return N / np.linalg.norm(N, axis=-1, keepdims=True)


def _tangents(N: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Two unit vectors (..., 3) that are orthogonal to the unit vectors N and to each other."""
    axis = np.eye(3)[np.abs(N).argmin(axis=-1)]
    first = np.cross(N, axis)
    first /= np.linalg.norm(first, axis=-1, keepdims=True)
    return first, np.cross(N, first)


def _apply(tensor: np.ndarray, vector: np.ndarray) -> np.ndarray:
    return np.einsum("...ij,...j->...i", tensor, vector)


def _form(tensor: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """N . tensor N."""
    return np.einsum("...i,...ij,...j->...", vector, tensor, vector)


def _dyad(a: np.ndarray, b: np.ndarray) -> np.ndarray:
    return a[..., :, None] * b[..., None, :]
