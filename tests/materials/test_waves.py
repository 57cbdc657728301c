"""Wave speeds against the eigenvalues of the acoustic tensor, for random states and any direction."""

import numpy as np
import pytest

from parsolid.materials.hyperelastic import evaluation, waves
from parsolid.materials.hyperelastic.hyperbolicity import (
    acoustic_tensor,
    branch_hessian,
    branch_sum,
    equilibrium_hessian,
    first_piola_kirchhoff,
    largest_shear_wave_speed,
    largest_wave_speed,
    polyconvex_state,
    pressure_wave_speed,
    right_cauchy_green,
    shear_wave_speeds,
    smallest_acoustic_eigenvalue,
    surface_stretches,
)
from parsolid.numerics.tensors import largest_eigenvalue

COUNT = 300


@pytest.fixture
def directions(random):
    """Directions of any length."""
    return random.standard_normal((COUNT, 3))


def squares(law, state, N):
    """Eigenvalues of the acoustic tensor [Pa], ascending."""
    return np.linalg.eigvalsh(acoustic_tensor(law, state, N))


def test_acoustic_tensor_is_the_hessian_along_the_direction(law, random_state, directions):
    state = random_state(law, COUNT)
    N = directions / np.linalg.norm(directions, axis=1)[:, None]
    equilibrium, branches = equilibrium_hessian(law, state), branch_hessian(law, state)
    FF = equilibrium.FF + branches.FF.sum(axis=1)
    # (54): v (x) N, F x (v (x) N) and H : (v (x) N) for the unit vectors v
    fibres = np.einsum("vi,nI->nviI", np.eye(3), N)
    areas = evaluation.tensor_cross(state.F[:, None], fibres)
    volumes = np.einsum("niI,nviI->nv", state.H, fibres)
    expected = np.einsum("nviI,niIkK,nwkK->nvw", fibres, FF, fibres) + np.einsum(
        "nviI,niIkK,nwkK->nvw", areas, equilibrium.HH, areas
    )
    expected += np.einsum("nv,n,nw->nvw", volumes, equilibrium.JJ + branches.JJ.sum(axis=1), volumes)
    assert acoustic_tensor(law, state, directions) == pytest.approx(
        expected, rel=1e-12, abs=1e-12 * np.abs(expected).max()
    )


def test_acoustic_tensor_is_the_derivative_of_the_stress(law, random_state, random):
    state = random_state(law, 20)
    N, v = np.array([0.6, 0.0, 0.8]), random.standard_normal((20, 3))
    A, direction = np.linalg.inv(state.Y), v[:, :, None] * N
    step, weights = 3e-4, (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)

    def traction(e):
        return first_piola_kirchhoff(law, polyconvex_state(law, state.F + e * direction, A)) @ N

    numerical = sum(w * (traction(k * step) - traction(-k * step)) for k, w in enumerate(weights, 1)) / step
    expected = np.einsum("nij,nj->ni", acoustic_tensor(law, state, N), v)
    assert numerical == pytest.approx(expected, rel=1e-7, abs=1e-7 * np.abs(expected).max())


def test_wave_speeds_are_exact_for_any_direction(law, random_state, directions):
    state = random_state(law, COUNT)
    eigenvalues = squares(law, state, directions) / law.density
    assert pressure_wave_speed(law, state, directions) ** 2 == pytest.approx(eigenvalues[:, 2], rel=1e-11)
    assert shear_wave_speeds(law, state, directions) ** 2 == pytest.approx(eigenvalues[:, :2], rel=1e-10)


def test_wave_tensors_of_the_solver_say_the_same(law, random_state, directions):
    state = random_state(law, COUNT)
    N = directions / np.linalg.norm(directions, axis=1)[:, None]
    eigenvalues, viscous = squares(law, state, directions), branch_sum(law, state)
    pressure = evaluation.pressure_wave_tensor(law, state.F, state.H, state.J, viscous)
    shear = evaluation.shear_wave_tensor(law, state.F, viscous)
    assert np.einsum("ni,nij,nj->n", N, pressure, N) == pytest.approx(eigenvalues[:, 2], rel=1e-11)
    assert np.einsum("ni,nij,nj->n", N, shear, N) == pytest.approx(eigenvalues[:, :2].mean(axis=1), rel=1e-11)


def test_the_pressure_wave_is_the_fastest(law, random_state, directions):
    state = random_state(law, COUNT)
    assert (pressure_wave_speed(law, state, directions) > shear_wave_speeds(law, state, directions)[:, 1]).all()


def test_greatest_speed_is_reached_and_never_exceeded(law, random_state, random):
    state = random_state(law, 50)
    greatest = largest_wave_speed(law, state)
    sampled = pressure_wave_speed(law, state, random.standard_normal((3000, 1, 3))).max(axis=0)
    assert (sampled <= greatest * (1.0 + 1e-13)).all()
    assert sampled == pytest.approx(greatest, rel=5e-3)
    tensor = evaluation.pressure_wave_tensor(law, state.F, state.H, state.J, branch_sum(law, state))
    N = np.linalg.eigh(tensor)[1][..., -1]
    assert np.sqrt(squares(law, state, N)[:, 2] / law.density) == pytest.approx(greatest, rel=1e-12)


def test_greatest_speed_in_closed_form_without_area_term(random_state):
    from parsolid.materials.hyperelastic.mooney_rivlin import MooneyRivlin

    law = MooneyRivlin(1100.0, 3.0, None, 7.0, (2.0, 5.0), (0.1, 3.0))
    state = random_state(law, 50)
    mu, added = 2.0 * law.xi, sum(law.branch_moduli)
    M = branch_sum(law, state) + ((law.lambda_hat + (mu + added) / state.J**2)[:, None, None]) * right_cauchy_green(
        state.H
    )
    assert law.density * largest_wave_speed(law, state) ** 2 == pytest.approx(
        mu + np.linalg.eigvalsh(M)[:, -1], rel=1e-12
    )


def test_speeds_at_rest(law):
    state = polyconvex_state(law, np.eye(3))
    mu, lame = 2.0 * (law.xi + (law.zeta or 0.0)), law.lambda_hat + 4.0 * (law.zeta or 0.0)
    added = sum(law.branch_moduli or ())
    assert largest_wave_speed(law, state) == pytest.approx(
        np.sqrt((lame + 2.0 * mu + 2.0 * added) / law.density), rel=1e-13
    )
    assert shear_wave_speeds(law, state, [1.0, 1.0, 0.0]) == pytest.approx(
        np.sqrt((mu + added) / law.density), rel=1e-13
    )
    assert smallest_acoustic_eigenvalue(law, state) == pytest.approx(mu + added, rel=1e-13)
    assert largest_shear_wave_speed(law, state) == pytest.approx(np.sqrt((mu + added) / law.density), rel=1e-13)


def test_extreme_shear_waves_over_all_directions(law, random_state, random):
    state = random_state(law, 50)
    speeds = shear_wave_speeds(law, state, random.standard_normal((5000, 1, 3)))
    smallest, largest = smallest_acoustic_eigenvalue(law, state), largest_shear_wave_speed(law, state)
    assert (law.density * speeds[..., 0].min(axis=0) ** 2 >= smallest * (1.0 - 1e-12)).all()
    assert (speeds[..., 1].max(axis=0) <= largest * (1.0 + 1e-12)).all()
    assert law.density * speeds[..., 0].min(axis=0) ** 2 == pytest.approx(smallest, rel=0.02)
    assert speeds[..., 1].max(axis=0) == pytest.approx(largest, rel=0.01)
    assert (smallest >= 2.0 * law.xi * (1.0 - 1e-13)).all()


def test_surface_stretches_are_those_of_the_strained_plane(random_deformation):
    F = random_deformation(20)
    plane = F[:, :, :2]
    expected = np.linalg.svd(plane, compute_uv=False)[:, ::-1]
    assert surface_stretches(F, [0.0, 0.0, 2.0]) == pytest.approx(expected, rel=1e-12)


def test_closed_form_eigenvalue_of_the_solver(random):
    for eigenvalues in ((1.0, 2.0, 3.0), (1.0, 3.0, 3.0), (1.0, 1.0, 3.0), (2.0, 2.0, 2.0), (1e-6, 1.0, 1e6)):
        basis = np.linalg.qr(random.standard_normal((3, 3)))[0]
        tensor = basis @ np.diag(eigenvalues) @ basis.T
        found = largest_eigenvalue(tuple(evaluation.symmetric_rows(tensor)[0]))
        # two equal greatest eigenvalues cost half the digits: the angle of the closed form is then badly conditioned
        assert found == pytest.approx(max(eigenvalues), rel=3e-8)


def test_directions_to_begin_with_are_in_space_and_no_two_opposite():
    starts = waves._starts()
    assert starts.shape == (13, 3) and np.allclose(np.linalg.norm(starts, axis=1), 1.0)
    assert np.abs(starts @ starts.T - np.eye(13)).max() < 0.99
