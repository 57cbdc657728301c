"""Polyconvex energy, conjugate stresses, relaxation and entropy of the Mooney-Rivlin solid with Maxwell branches.

Equation numbers are those of Lee et al. A state is a `PolyconvexState`; its arrays have any common leading shape,
written `...` below (empty for a single state), and m is the number of branches, 0 for an elastic solid. The arguments
F, H, J, Y, y are independent of each other, as in W(X, Y) of (11); `polyconvex_state` makes the consistent state of a
deformation.
"""

from typing import NamedTuple

import numpy as np

from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.hyperelastic.evaluation import cofactor, tensor_cross


class PolyconvexState(NamedTuple):
    """The arguments of W, eqs (11), (12), or quantities conjugate to them, component by component.

    F (..., 3, 3) deformation gradient, H (..., 3, 3) its cofactor, J (...) its Jacobian, Y (..., m, 3, 3) viscous
    deformation C_v,alpha, y (..., m) det C_v,alpha^{-1}. All dimensionless; the conjugates are in Pa.
    """

    F: np.ndarray
    H: np.ndarray
    J: np.ndarray
    Y: np.ndarray
    y: np.ndarray


class EntropyVariables(NamedTuple):
    """V = dS/dU of (36): velocity (..., 3) [m/s] and the conjugate stresses [Pa]."""

    velocity: np.ndarray
    stresses: PolyconvexState


def branch_moduli(law) -> np.ndarray:
    """mu_alpha [Pa], shape (m,)."""
    return np.array(law.branch_moduli or (), dtype=np.float64)


def relaxation_times(law) -> np.ndarray:
    """tau_alpha [s], shape (m,)."""
    return np.array(law.relaxation_times or (), dtype=np.float64)


def polyconvex_state(law, F, A=None) -> PolyconvexState:
    """The state with H = cof F, J = det F, Y = A^{-1}, y = det A.

    F (..., 3, 3); A (..., m, 3, 3) is the solver's internal variable C_v,alpha^{-1}, the identity (virgin) unless
    given. Raises ValueError when the shapes do not fit the law.
    """
    F, count = np.asarray(F, dtype=np.float64), len(branch_moduli(law))
    shape = (*F.shape[:-2], count, 3, 3)
    if F.shape[-2:] != (3, 3):
        raise ValueError(f"F: expected a shape (..., 3, 3), found {F.shape}")
    A = np.eye(3) if A is None else np.asarray(A, dtype=np.float64)
    if A.ndim > 2 and A.shape[-3] != count:
        raise ValueError(f"A: expected a shape (..., {count}, 3, 3) for {count} branches, found {A.shape}")
    A = np.broadcast_to(A, shape)
    return PolyconvexState(F, cofactor(F), np.linalg.det(F), np.linalg.inv(A), np.linalg.det(A))


def right_cauchy_green(F: np.ndarray) -> np.ndarray:
    """C = F^T F, shape (..., 3, 3)."""
    return np.swapaxes(F, -1, -2) @ F


def branch_sum(law, state: PolyconvexState) -> np.ndarray | None:
    """sum_alpha mu_alpha Y_alpha^{-1} [Pa] (..., 3, 3); None for a law without branches."""
    if law.branch_moduli is None:
        return None
    return np.einsum("a,...aij->...ij", branch_moduli(law), np.linalg.inv(state.Y))


def energies(law, state: PolyconvexState) -> tuple[np.ndarray, np.ndarray]:
    """W_infinity (...) of (19) and W_alpha (..., m) of (20) [J/m^3]."""
    J, C = np.asarray(state.J, dtype=np.float64)[..., None], right_cauchy_green(state.F)[..., None, :, :]
    invariant = np.einsum("...ij,...ij->...", C, np.linalg.inv(state.Y))
    viscous = 0.5 * branch_moduli(law) * (invariant - 3.0 - np.log(J * J * state.y))
    return evaluation.equilibrium_energy(law, state.F, state.H, state.J), viscous


def energy(law, state: PolyconvexState) -> np.ndarray:
    """W (...) of (11) [J/m^3]."""
    equilibrium, viscous = energies(law, state)
    return equilibrium + viscous.sum(axis=-1)


def conjugate_stresses(law, state: PolyconvexState) -> PolyconvexState:
    """Sigma_F, Sigma_H, Sigma_J of (15), (A.1), equilibrium and branches together, Sigma_Y and Sigma_y of (A.2) [Pa].

    Sigma_Y is the derivative with respect to a symmetric Y: dW = Sigma_Y : dY.
    """
    F, H, J, Y, y = state
    moduli, inverse = branch_moduli(law), np.linalg.inv(Y)
    zeta = law.zeta or 0.0
    sigma_F = 2.0 * law.xi * F + F @ np.einsum("a,...aij->...ij", moduli, inverse)
    sigma_J = law.lambda_hat * (J - 1.0) - (2.0 * (law.xi + 2.0 * zeta) + moduli.sum()) / J
    sigma_Y = -0.5 * moduli[:, None, None] * (inverse @ right_cauchy_green(F)[..., None, :, :] @ inverse)
    return PolyconvexState(sigma_F, 2.0 * zeta * H, sigma_J, sigma_Y, -0.5 * moduli / y)


def first_piola_kirchhoff(law, state: PolyconvexState) -> np.ndarray:
    """P = Sigma_F + Sigma_H x F + Sigma_J H [Pa] (..., 3, 3) of (14)."""
    return evaluation.first_piola_kirchhoff_stress(law, state.F, state.H, state.J, branch_sum(law, state))


def cauchy_stress(law, state: PolyconvexState) -> np.ndarray:
    """sigma = P F^T / J [Pa] (..., 3, 3)."""
    stress = first_piola_kirchhoff(law, state) @ np.swapaxes(state.F, -1, -2) / np.asarray(state.J)[..., None, None]
    # symmetric but for rounding, because W depends on F through C
    return 0.5 * (stress + np.swapaxes(stress, -1, -2))


def relaxation_rates(law, state: PolyconvexState) -> tuple[np.ndarray, np.ndarray]:
    """dY/dt (..., m, 3, 3) and dy/dt (..., m) at fixed F, H, J [1/s], eqs (25)."""
    times, inverse = relaxation_times(law), np.linalg.inv(right_cauchy_green(state.F))[..., None, :, :]
    Y, y = state.Y, state.y
    rate_Y = (Y - Y @ inverse @ Y) / times[:, None, None]
    return rate_Y, y * (np.einsum("...ij,...ij->...", inverse, Y) - 3.0) / times


def dissipation_rates(law, state: PolyconvexState) -> np.ndarray:
    """Internal dissipation of every branch [W/m^3], shape (..., m), eqs (27), (28).

    With D = A - C^{-1}, tr[C A + C^{-1} A^{-1} - 2 I] = C : D A^{-1} D: not negative, and without cancellation near D =
    0.
    """
    C = right_cauchy_green(state.F)[..., None, :, :]
    excess = np.linalg.inv(state.Y) - np.linalg.inv(C)
    trace = np.einsum("...ij,...ij->...", np.broadcast_to(C, excess.shape), excess @ state.Y @ excess)
    return 0.5 * branch_moduli(law) / relaxation_times(law) * trace


def entropy(law, momentum, state: PolyconvexState) -> np.ndarray:
    """Generalised entropy S = p.p/(2 rho) + W [J/m^3] (...) of (35); momentum p (..., 3) [kg/(m^2 s)]."""
    momentum = np.asarray(momentum, dtype=np.float64)
    return 0.5 / law.density * np.einsum("...i,...i->...", momentum, momentum) + energy(law, state)


def entropy_variables(law, momentum, state: PolyconvexState) -> EntropyVariables:
    """Conjugate variables V = dS/dU of (36); momentum p (..., 3) [kg/(m^2 s)]. -V . R is the dissipation (condition
    iv).
    """
    return EntropyVariables(np.asarray(momentum, dtype=np.float64) / law.density, conjugate_stresses(law, state))


def assembled_stress(stresses: PolyconvexState, state: PolyconvexState) -> np.ndarray:
    """P of (14) [Pa] (..., 3, 3) from given conjugate stresses, whatever the law."""
    volumetric = np.asarray(stresses.J)[..., None, None] * state.H
    return stresses.F + tensor_cross(stresses.H, state.F) + volumetric
