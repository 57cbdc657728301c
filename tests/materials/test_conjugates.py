"""Stresses, relaxation, dissipation and entropy against numerical derivatives of the energy."""

import numpy as np
import pytest

from parsolid.materials.hyperelastic import evaluation
from parsolid.materials.hyperelastic.hyperbolicity import (
    SYMMETRIC_BASIS,
    assembled_stress,
    cauchy_stress,
    conjugate_stresses,
    dissipation_rates,
    energies,
    energy,
    entropy,
    entropy_variables,
    first_piola_kirchhoff,
    polyconvex_state,
    relaxation_rates,
    right_cauchy_green,
)

CLOSE = 1e-7


def derivative(function, step=1e-3):
    """d/de function(e) at 0, sixth order."""
    weights = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
    return sum(w * (function((k + 1) * step) - function(-(k + 1) * step)) for k, w in enumerate(weights)) / step


def directional(law, state, name, direction):
    """Derivative of W along a direction of one of the independent variables."""
    return derivative(lambda e: energy(law, state._replace(**{name: getattr(state, name) + e * direction})))


def test_every_conjugate_stress_is_the_derivative_of_the_energy(law, random_state, random):
    state = random_state(law, 20, independent=True)
    stresses = conjugate_stresses(law, state)
    scale = max(np.abs(stress).max() for stress in stresses if stress.size)
    for name in ("F", "H", "J"):
        value = getattr(state, name)
        direction = random.standard_normal(value.shape)
        product = (getattr(stresses, name) * direction).reshape(20, -1).sum(axis=1)
        assert directional(law, state, name, direction) == pytest.approx(product, rel=CLOSE, abs=CLOSE * scale)


def test_stresses_conjugate_to_internal_variables(viscous, random_state):
    state = random_state(viscous, 20, independent=True)
    stresses = conjugate_stresses(viscous, state)
    # C_v with a smallest eigenvalue of 0.01 allows no large step
    for alpha in range(2):
        for basis in SYMMETRIC_BASIS:
            direction = np.zeros_like(state.Y)
            direction[:, alpha] = basis
            smallest = np.linalg.eigvalsh(state.Y[:, alpha])[:, 0]
            direction *= smallest[:, None, None, None]
            expected = smallest * np.einsum("nij,ij->n", stresses.Y[:, alpha], basis)
            scale = np.abs(stresses.Y[:, alpha]).max(axis=(1, 2)) * smallest
            assert np.abs(directional(viscous, state, "Y", direction) - expected).max() <= CLOSE * scale.max()
        direction = np.zeros_like(state.y)
        direction[:, alpha] = 1.0
        assert directional(viscous, state, "y", direction) == pytest.approx(stresses.y[:, alpha], rel=CLOSE)


def test_first_piola_kirchhoff_stress_is_the_derivative_along_the_deformation(law, random_state, random):
    state = random_state(law, 50)
    A, direction = np.linalg.inv(state.Y), random.standard_normal((50, 3, 3))
    P = first_piola_kirchhoff(law, state)
    numerical = derivative(lambda e: energy(law, polyconvex_state(law, state.F + e * direction, A)), 3e-4)
    product = np.einsum("nij,nij->n", P, direction)
    assert numerical == pytest.approx(product, rel=CLOSE, abs=CLOSE * np.abs(P).max())
    assert P == pytest.approx(
        assembled_stress(conjugate_stresses(law, state), state), rel=1e-13, abs=1e-13 * np.abs(P).max()
    )


def test_tensor_cross_product_and_cofactor(random):
    epsilon = np.zeros((3, 3, 3))
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        epsilon[i, j, k], epsilon[i, k, j] = 1.0, -1.0
    A, B = random.standard_normal((2, 10, 3, 3))
    expected = np.einsum("ijk,IJK,njJ,nkK->niI", epsilon, epsilon, A, B)
    assert evaluation.tensor_cross(A, B) == pytest.approx(expected, abs=1e-14)
    assert evaluation.cofactor(A) == pytest.approx(
        np.einsum("n,nji->nij", np.linalg.det(A), np.linalg.inv(A)), abs=1e-12
    )
    assert evaluation.cofactor(A) == pytest.approx(0.5 * evaluation.tensor_cross(A, A), abs=1e-13)


def test_virgin_state_is_free_of_stress_and_energy(law):
    state = polyconvex_state(law, np.eye(3))
    assert first_piola_kirchhoff(law, state) == pytest.approx(np.zeros((3, 3)), abs=1e-14)
    assert energy(law, state) == pytest.approx(0.0, abs=1e-14)
    assert np.all(dissipation_rates(law, state) == 0.0)


def test_relaxed_branches_carry_neither_energy_nor_stress(viscous, random_deformation):
    F = random_deformation(10)
    relaxed = np.repeat(np.linalg.inv(right_cauchy_green(F))[:, None], 2, axis=1)
    state = polyconvex_state(viscous, F, relaxed)
    elastic = viscous._replace(branch_moduli=None, relaxation_times=None)
    expected = first_piola_kirchhoff(elastic, polyconvex_state(elastic, F))
    assert first_piola_kirchhoff(viscous, state) == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert energies(viscous, state)[1] == pytest.approx(0.0, abs=1e-12)
    # (27) is the integrand of a second-order minimum
    assert dissipation_rates(viscous, state) == pytest.approx(0.0, abs=1e-24)


def test_small_strain_moduli(law):
    mu, lame = 2.0 * (law.xi + (law.zeta or 0.0)), law.lambda_hat + 4.0 * (law.zeta or 0.0)
    added = sum(law.branch_moduli or ())
    strain = 1e-6 * np.array([[1.0, 0.5, -0.3], [0.5, -2.0, 0.7], [-0.3, 0.7, 0.4]])
    stress = cauchy_stress(law, polyconvex_state(law, np.eye(3) + strain))
    expected = 2.0 * (mu + added) * strain + lame * np.trace(strain) * np.eye(3)
    assert stress == pytest.approx(expected, abs=2e-4 * np.abs(expected).max())


def test_cauchy_stress_rotates_with_the_body(law, random_state, random):
    state = random_state(law, 5)
    rotation = np.linalg.qr(random.standard_normal((3, 3)))[0]
    rotation *= np.sign(np.linalg.det(rotation))
    turned = polyconvex_state(law, rotation @ state.F, np.linalg.inv(state.Y))
    expected = rotation @ cauchy_stress(law, state) @ rotation.T
    assert cauchy_stress(law, turned) == pytest.approx(expected, rel=1e-11, abs=1e-11 * np.abs(expected).max())


def test_dissipation_is_what_the_energy_loses_at_fixed_deformation(viscous, random_state):
    state = random_state(viscous, 200)
    rate_Y, _ = relaxation_rates(viscous, state)
    A = np.linalg.inv(state.Y)
    rate = -A @ rate_Y @ A
    # (26) is (25) in terms of A
    inverse = np.linalg.inv(right_cauchy_green(state.F))[:, None]
    times = np.array(viscous.relaxation_times)[:, None, None]
    assert rate == pytest.approx((inverse - A) / times, rel=1e-9, abs=1e-9 * np.abs(rate).max())
    # a time in which A changes by no more than its smallest eigenvalue
    time = np.linalg.eigvalsh(A)[..., 0].min(axis=1) / np.abs(rate).max(axis=(1, 2, 3))
    change = rate * time[:, None, None, None]
    loss = -derivative(lambda e: energy(viscous, polyconvex_state(viscous, state.F, A + e * change)), 1e-2)
    assert dissipation_rates(viscous, state).sum(axis=1) * time == pytest.approx(loss, rel=CLOSE)


def test_dissipation_from_conjugate_stresses_and_as_in_the_paper(viscous, random_state):
    state = random_state(viscous, 200, independent=True)
    stresses, (rate_Y, rate_y) = conjugate_stresses(viscous, state), relaxation_rates(viscous, state)
    conjugate = -np.einsum("naij,naij->na", stresses.Y, rate_Y) - stresses.y * rate_y
    assert dissipation_rates(viscous, state) == pytest.approx(conjugate, rel=1e-9)
    C = right_cauchy_green(state.F)[:, None]
    trace = np.trace(C @ np.linalg.inv(state.Y) + np.linalg.inv(C) @ state.Y - 2.0 * np.eye(3), axis1=-2, axis2=-1)
    paper = 0.5 * np.array(viscous.branch_moduli) / np.array(viscous.relaxation_times) * trace
    assert dissipation_rates(viscous, state) == pytest.approx(paper, rel=1e-9)


def test_dissipation_is_never_negative(viscous, random_deformation, random_branches):
    for spread in (1e-7, 1e-2, 0.3):
        A = random_branches(5000, 2, spread)
        rates = dissipation_rates(viscous, polyconvex_state(viscous, random_deformation(5000, spread), A))
        assert rates.min() >= 0.0


def test_entropy_variables_are_the_derivatives_of_the_entropy(viscous, random_state, random):
    state, momentum = random_state(viscous, 10, independent=True), random.standard_normal((10, 3))
    variables = entropy_variables(viscous, momentum, state)
    direction = random.standard_normal((10, 3))
    numerical = derivative(lambda e: entropy(viscous, momentum + e * direction, state))
    assert numerical == pytest.approx(np.einsum("ni,ni->n", variables.velocity, direction), rel=CLOSE, abs=1e-9)
    direction = random.standard_normal((10, 3, 3))
    numerical = derivative(lambda e: entropy(viscous, momentum, state._replace(F=state.F + e * direction)))
    assert numerical == pytest.approx(np.einsum("nij,nij->n", variables.stresses.F, direction), rel=CLOSE, abs=1e-6)


def test_single_states_and_batches_agree(law, random_state):
    batch = random_state(law, 3)
    for i in range(3):
        single = type(batch)(*(value[i] for value in batch))
        assert first_piola_kirchhoff(law, single) == pytest.approx(first_piola_kirchhoff(law, batch)[i], rel=1e-14)
        assert energy(law, single) == pytest.approx(energy(law, batch)[i], rel=1e-14)


def test_shapes_that_do_not_fit_are_refused(viscous):
    with pytest.raises(ValueError, match=r"A: expected a shape \(\.\.\., 2, 3, 3\)"):
        polyconvex_state(viscous, np.eye(3), np.ones((3, 3, 3)))
    with pytest.raises(ValueError, match=r"F: expected a shape"):
        polyconvex_state(viscous, np.eye(2))
