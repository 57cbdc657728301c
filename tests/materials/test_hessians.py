"""Second derivatives of the polyconvex energy against numerical ones of the stresses, and its convexity."""

import numpy as np
import pytest

from parsolid.materials.hyperelastic.hyperbolicity import (
    SYMMETRIC_BASIS,
    branch_hessian,
    conjugate_stresses,
    equilibrium_hessian,
    hessian_matrix,
    polyconvex_state,
)


def vector(quantities, index):
    """A state or its conjugates as a vector in the order of `hessian_matrix`."""
    F, H, J, Y, y = (value[index] for value in quantities)
    branches = [np.append(np.einsum("pij,ij->p", SYMMETRIC_BASIS, Y[a]), y[a]) for a in range(len(y))]
    return np.concatenate([F.ravel(), H.ravel(), [J], *branches])


def moved(state, direction, step):
    """A single state moved along a direction in the order of `hessian_matrix`."""
    F, H, J, Y, y = (np.array(value) for value in state)
    F += step * direction[:9].reshape(3, 3)
    H += step * direction[9:18].reshape(3, 3)
    J += step * direction[18]
    for a in range(len(y)):
        part = direction[19 + 7 * a : 26 + 7 * a]
        Y[a] += step * np.einsum("p,pij->ij", part[:6], SYMMETRIC_BASIS)
        y[a] += step * part[6]
    return type(state)(F, H, J, Y, y)


def test_hessian_is_the_derivative_of_the_conjugate_stresses(law, random_state):
    state = random_state(law, 4, independent=True)
    matrices = hessian_matrix(law, state)
    weights, step = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0), 2e-4
    for n in range(4):
        single = type(state)(*(value[n] for value in state))
        numerical = np.zeros_like(matrices[n])
        for column, direction in enumerate(np.eye(len(numerical))):
            for k, weight in enumerate(weights, 1):
                ahead = vector(conjugate_stresses(law, moved(single, direction, k * step)), ...)
                behind = vector(conjugate_stresses(law, moved(single, direction, -k * step)), ...)
                numerical[:, column] += weight * (ahead - behind) / step
        assert np.abs(numerical - matrices[n]).max() <= 1e-7 * np.abs(matrices[n]).max()
        assert matrices[n] == pytest.approx(matrices[n].T, rel=1e-13, abs=1e-13)


def test_energy_is_convex_in_all_its_arguments(law, random_state):
    eigenvalues = np.linalg.eigvalsh(hessian_matrix(law, random_state(law, 500, independent=True)))
    assert (eigenvalues[:, 0] >= -1e-13 * eigenvalues[:, -1]).all()


def test_each_branch_has_six_zero_modes(viscous, random_state):
    state = random_state(viscous, 200)
    hessian = branch_hessian(viscous, state)
    for alpha in range(2):
        FF = hessian.FF[:, alpha].reshape(-1, 9, 9)
        FY = np.einsum("nmil,pil->nmp", hessian.FY[:, alpha].reshape(-1, 9, 3, 3), SYMMETRIC_BASIS)
        YY = np.einsum("pim,nimkl,qkl->npq", SYMMETRIC_BASIS, hessian.YY[:, alpha], SYMMETRIC_BASIS)
        block = np.block([[FF, FY], [np.swapaxes(FY, 1, 2), YY]])
        # measured against each variable's own stiffness: C_v may be very soft or very stiff
        scale = 1.0 / np.sqrt(np.einsum("nii->ni", block))
        eigenvalues = np.linalg.eigvalsh(block * scale[:, :, None] * scale[:, None, :])
        assert np.abs(eigenvalues[:, :6]).max() <= 1e-12
        assert eigenvalues[:, 6].min() >= 1e-6
        # the modes are dF = F Y^{-1} dY
        modes = np.einsum("nij,pjk->npik", state.F @ np.linalg.inv(state.Y[:, alpha]), SYMMETRIC_BASIS)
        forces = np.einsum("nmk,npk->npm", FF, modes.reshape(-1, 6, 9)) + np.einsum("nmp->npm", FY)
        assert np.abs(forces).max() <= 1e-12 * np.abs(FY).max()


def test_only_the_area_term_gives_stiffness_to_the_cofactor(law):
    matrix = hessian_matrix(law, polyconvex_state(law, np.eye(3)))
    expected = 2.0 * (law.zeta or 0.0) * np.eye(9)
    assert np.array_equal(matrix[9:18, 9:18], expected)


def test_blocks_carry_the_symmetries_that_second_derivatives_have(viscous, random_state):
    hessian = branch_hessian(viscous, random_state(viscous, 5))
    assert hessian.YY == pytest.approx(np.moveaxis(hessian.YY, (-4, -3), (-2, -1)), rel=1e-12, abs=1e-9)
    assert np.array_equal(hessian.FY, np.swapaxes(hessian.FY, -1, -2))
    assert np.array_equal(hessian.FY, np.moveaxis(hessian.YF, (-4, -3), (-2, -1)))


def test_equilibrium_blocks(law, random_state):
    state = random_state(law, 5)
    blocks = equilibrium_hessian(law, state)
    direction = np.arange(9.0).reshape(3, 3)
    assert np.einsum("nijkl,kl->nij", blocks.FF, direction) == pytest.approx(
        np.broadcast_to(2.0 * law.xi * direction, (5, 3, 3))
    )
    assert (blocks.JJ > law.lambda_hat).all()
