"""Hyperelastic laws with Maxwell branches: stress, waves and dissipation against derivatives of the energy."""

from typing import NamedTuple

import numpy as np
import pytest

from parsolid.elementary import log
from parsolid.materials.hyperelastic import acoustics, evaluation
from parsolid.materials.hyperelastic import functions as of
from parsolid.materials.hyperelastic.mooney_rivlin import NeoHookean
from parsolid.materials.law_functions import law_function
from parsolid.materials.viscoelastic import maxwell
from parsolid.materials.viscoelastic.relaxation import branch_states
from parsolid.tensors import contract


def branch_sum(law, A):
    """sum mu_alpha A_alpha (n, 3, 3) of A (n, m, 3, 3)."""
    return np.einsum("a,naij->nij", np.array(law.branch_moduli), A)


def branches_of(law, F, A):
    """Stored energies and rates of dissipation (n, m)."""
    stored = np.zeros((len(F), len(law.branch_moduli)))
    rates, C = np.zeros_like(stored), evaluation.symmetric_rows(np.swapaxes(F, 1, 2) @ F)
    rows = evaluation.symmetric_rows(A).reshape(len(F), -1, 6)
    branch_states(np.array(law.branch_moduli), np.array(law.relaxation_times), C, rows, stored, rates)
    return stored, rates


def derivative(function, step):
    """d/de function(e) at 0, sixth order."""
    weights = (3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0)
    return sum(w * (function((k + 1) * step) - function(-(k + 1) * step)) for k, w in enumerate(weights)) / step


def test_relaxed_branches_carry_neither_energy_nor_stress(viscous, random_deformation):
    F = random_deformation(10)
    relaxed = np.repeat(np.linalg.inv(np.swapaxes(F, 1, 2) @ F)[:, None], 2, axis=1)
    expected = evaluation.stresses(viscous, F)
    assert evaluation.stresses(viscous, F, branch_sum(viscous, relaxed)) == pytest.approx(
        expected, rel=1e-12, abs=1e-12
    )
    stored, rates = branches_of(viscous, F, relaxed)
    assert stored == pytest.approx(0.0, abs=1e-12) and rates == pytest.approx(0.0, abs=1e-24)


def test_the_stress_turns_and_its_tangent_is_symmetric(viscous, random, random_deformation, random_branches):
    F, law, viscous_sum = random_deformation(10), viscous, branch_sum(viscous, random_branches(10, 2))
    turn = np.linalg.qr(random.standard_normal((3, 3)))[0]
    turn *= np.sign(np.linalg.det(turn))
    P = evaluation.stresses(law, F, viscous_sum)
    turned = evaluation.stresses(law, turn @ F, viscous_sum)
    assert turned == pytest.approx(turn @ P, rel=1e-11, abs=1e-11 * np.abs(P).max())
    tangent = np.empty((10, 9, 9))
    for c in range(9):
        change = np.eye(9)[c].reshape(3, 3)
        slope = derivative(lambda e, change=change: evaluation.stresses(law, F + e * change, viscous_sum), 3e-4)
        tangent[:, :, c] = slope.reshape(10, 9)
    assert tangent == pytest.approx(np.swapaxes(tangent, 1, 2), abs=1e-8 * np.abs(tangent).max())


def test_dissipation_is_what_the_energy_loses_and_never_negative(viscous, random_deformation, random_branches):
    F, A = random_deformation(200), random_branches(200, 2)
    inverse, times = np.linalg.inv(np.swapaxes(F, 1, 2) @ F)[:, None], np.array(viscous.relaxation_times)
    rate = (inverse - A) / times[:, None, None]
    # a time in which A changes by no more than its smallest eigenvalue
    time = np.linalg.eigvalsh(A)[..., 0].min(axis=1) / np.abs(rate).max(axis=(1, 2, 3))
    change = rate * time[:, None, None, None]
    loss = -derivative(lambda e: branches_of(viscous, F, A + e * change)[0].sum(axis=1), 1e-2)
    rates = branches_of(viscous, F, A)[1]
    assert rates.sum(axis=1) * time == pytest.approx(loss, rel=1e-7)
    # and as in the paper (28)
    C = np.swapaxes(F, 1, 2) @ F
    trace = np.trace(C[:, None] @ A + inverse @ np.linalg.inv(A) - 2.0 * np.eye(3), axis1=-2, axis2=-1)
    assert rates == pytest.approx(0.5 * np.array(viscous.branch_moduli) / times * trace, rel=1e-9)
    for spread in (1e-7, 1e-2, 0.3):
        assert branches_of(viscous, random_deformation(5000, spread), random_branches(5000, 2, spread))[1].min() >= 0.0


def test_a_branch_by_itself_says_the_same(viscous, random_deformation, random_branches):
    F, A = random_deformation(20), random_branches(20, 2)
    stored, rates = branches_of(viscous, F, A)
    C = np.swapaxes(F, 1, 2) @ F
    for n in range(20):
        c, inverse, a = (tuple(evaluation.symmetric_rows(x)[0]) for x in (C[n], np.linalg.inv(C[n]), A[n, 0]))
        mu, tau = viscous.branch_moduli[0], viscous.relaxation_times[0]
        assert maxwell.branch_energy(mu, c, np.linalg.det(F[n]), a) == pytest.approx(stored[n, 0], rel=1e-11)
        assert maxwell.branch_dissipation(mu, tau, c, inverse, a) == pytest.approx(rates[n, 0], rel=1e-10)


def test_wave_tensors_are_those_of_the_acoustic_tensor(viscous, random, random_deformation, random_branches):
    """The pressure wave's is exact for any direction, the shear waves' the mean of both."""
    F, law, viscous_sum = random_deformation(50), viscous, branch_sum(viscous, random_branches(50, 2))
    _, Q, S = evaluation.states(law, F, viscous_sum)
    for N in np.linalg.qr(random.standard_normal((3, 3)))[0]:
        moduli = acoustics.wave_moduli(law, F, N, viscous_sum)
        assert np.einsum("i,nij,j->n", N, Q, N) == pytest.approx(moduli[:, 2], rel=1e-8)
        assert np.einsum("i,nij,j->n", N, S, N) == pytest.approx(moduli[:, :2].mean(axis=1), rel=1e-8)
    extreme = acoustics.extreme_moduli(law, F[:10], viscous_sum[:10])
    assert extreme[:, 2] == pytest.approx(np.linalg.eigvalsh(Q[:10])[:, -1], rel=1e-8)
    assert (extreme[:, 0] > 0.0).all() and (extreme[:, 0] <= extreme[:, 1]).all()
    # there is no modulus that would hold in every direction
    assert of.isotropic_shear_modulus(law) is None


def test_an_energy_is_enough(random_deformation, plain_python):
    """Stress and moduli follow within 1e-9, and the waves are no slower than they are."""

    class EnergyAlone(NamedTuple):
        density: float
        xi: float
        lambda_hat: float
        branch_moduli: tuple | None
        relaxation_times: tuple | None

    @of.energy.of(EnergyAlone)
    def _energy(law, F, H, J):
        return law.xi * (contract(F, F) - 3.0) - 2.0 * law.xi * log(J) + 0.5 * law.lambda_hat * (J - 1.0) * (J - 1.0)

    known, alone = NeoHookean(1100.0, 3.0, 7.0, None, None), EnergyAlone(1100.0, 3.0, 7.0, None, None)
    F = random_deformation(100)
    P = evaluation.stresses(known, F)
    assert evaluation.stresses(alone, F) == pytest.approx(P, abs=1e-9 * np.abs(P).max())
    assert of.elastic_moduli(alone) == pytest.approx(of.elastic_moduli(known), rel=1e-8)
    assert of.isotropic_shear_modulus(known) == 6.0
    assert of.isotropic_shear_modulus(alone) == pytest.approx(6.0, rel=1e-8)
    excess = evaluation.states(alone, F)[1] - evaluation.states(known, F)[1]
    assert np.linalg.eigvalsh(excess).min() > 0.0


def test_implementations_are_chosen_by_the_type_of_a_law():
    class Part(NamedTuple):
        a: float

    @law_function
    def value(law):
        """A number."""

    value.of(Part)(lambda law: "part")
    assert value(Part(1.0)) == "part"
    with pytest.raises(TypeError, match="value"):
        value(None)
    value.of(None)(lambda law: "nothing")
    value.otherwise(lambda law: "any")
    assert (value(None), value(3.0)) == ("nothing", "any") and value.has(Part) and not value.has(float)
