"""Second derivatives of the polyconvex energy, Lee et al., eqs (17), (18), (A.3)-(A.6), with (A.6) corrected.

As printed, (A.6) has the indices of W_YF in the wrong place and W_YY without its symmetry in Y; here
    W_FY [kM, IL] = -mu_alpha sym_IL [(F Y^{-1})_kI Y^{-1}_LM],   W_YF its transpose,
    W_YY [IM, KL] = mu_alpha sym_KL sym_IM [(Y^{-1} C Y^{-1})_IK Y^{-1}_ML].
States and shapes as in `materials.hyperelastic.conjugates`.
"""

from typing import NamedTuple

import numpy as np

from parsolid.materials.hyperelastic.conjugates import PolyconvexState, branch_moduli, right_cauchy_green

_IDENTITY = np.eye(3)
_FOURTH_ORDER = np.einsum("ik,jl->ijkl", _IDENTITY, _IDENTITY)


class EquilibriumHessian(NamedTuple):
    """The blocks of [H_W^infinity] that do not vanish: FF, HH (..., 3, 3, 3, 3), JJ (...) [Pa], eq (A.3)."""

    FF: np.ndarray
    HH: np.ndarray
    JJ: np.ndarray


class BranchHessian(NamedTuple):
    """The blocks of [H_W^alpha] that do not vanish [Pa], eqs (A.4)-(A.6).

    FF, FY, YF, YY (..., m, 3, 3, 3, 3), JJ, yy (..., m). FY [k, M, I, L] = d^2 W / dF_kM dY_IL.
    """

    FF: np.ndarray
    FY: np.ndarray
    YF: np.ndarray
    YY: np.ndarray
    JJ: np.ndarray
    yy: np.ndarray


def equilibrium_hessian(law, state: PolyconvexState) -> EquilibriumHessian:
    """Second derivatives of W_infinity(F, H, J) (A.3)."""
    shape, zeta = np.shape(state.J), law.zeta or 0.0
    tensors = np.broadcast_to(_FOURTH_ORDER, (*shape, 3, 3, 3, 3))
    curvature = law.lambda_hat + 2.0 * (law.xi + 2.0 * zeta) / np.square(state.J)
    return EquilibriumHessian(2.0 * law.xi * tensors, 2.0 * zeta * tensors, curvature)


def branch_hessian(law, state: PolyconvexState) -> BranchHessian:
    """Second derivatives of every W_alpha(F, J, Y, y), with the corrected (A.6)."""
    F, C = state.F[..., None, :, :], right_cauchy_green(state.F)[..., None, :, :]
    moduli, inverse = branch_moduli(law), np.linalg.inv(state.Y)
    fourth = moduli[:, None, None, None, None]
    K = F @ inverse
    FF = fourth * np.einsum("ik,...ajl->...aijkl", _IDENTITY, inverse)
    FY = -fourth * _symmetric_in_last(np.einsum("...aki,...alm->...akmil", K, inverse))
    YF = np.moveaxis(FY, (-4, -3), (-2, -1))
    YY = fourth * _symmetric_in_last(np.einsum("...aik,...aml->...aimkl", inverse @ C @ inverse, inverse))
    YY = 0.5 * (YY + np.swapaxes(YY, -4, -3))
    J = np.asarray(state.J, dtype=np.float64)[..., None]
    return BranchHessian(FF, FY, YF, YY, moduli / np.square(J), 0.5 * moduli / np.square(state.y))


def hessian_matrix(law, state: PolyconvexState) -> np.ndarray:
    """[H_W] of (17), (18) [Pa] as a symmetric matrix (..., 19 + 7 m, 19 + 7 m), positive semi-definite.

    Order: F (9, row by row), H (9), J, then for each branch Y (6: 11, 22, 33, and sqrt(2) times 12, 13, 23, so that the
    products of vectors are those of tensors) and y. Every branch has six zero modes dF = F Y^{-1} dY in (F, Y); with
    zeta = 0 there are nine more, dH.
    """
    equilibrium, branches = equilibrium_hessian(law, state), branch_hessian(law, state)
    shape, count = np.shape(state.J), len(branch_moduli(law))
    result = np.zeros((*shape, 19 + 7 * count, 19 + 7 * count))
    result[..., :9, :9] = (equilibrium.FF + branches.FF.sum(axis=-5)).reshape(*shape, 9, 9)
    result[..., 9:18, 9:18] = equilibrium.HH.reshape(*shape, 9, 9)
    result[..., 18, 18] = equilibrium.JJ + branches.JJ.sum(axis=-1)
    for alpha in range(count):
        Y, y = slice(19 + 7 * alpha, 25 + 7 * alpha), 25 + 7 * alpha
        FY = np.einsum(
            "...mil,pil->...mp", branches.FY[..., alpha, :, :, :, :].reshape(*shape, 9, 3, 3), SYMMETRIC_BASIS
        )
        result[..., :9, Y] = FY
        result[..., Y, :9] = np.swapaxes(FY, -1, -2)
        YY = branches.YY[..., alpha, :, :, :, :]
        result[..., Y, Y] = np.einsum("pim,...imkl,qkl->...pq", SYMMETRIC_BASIS, YY, SYMMETRIC_BASIS)
        result[..., y, y] = branches.yy[..., alpha]
    return result


def _symmetric_in_last(tensors: np.ndarray) -> np.ndarray:
    return 0.5 * (tensors + np.swapaxes(tensors, -1, -2))


def _symmetric_basis() -> np.ndarray:
    basis = np.zeros((6, 3, 3))
    for p, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        basis[p, i, j] = basis[p, j, i] = 1.0 if i == j else np.sqrt(0.5)
    return basis


# orthonormal basis (6, 3, 3) of the symmetric tensors
SYMMETRIC_BASIS = _symmetric_basis()
