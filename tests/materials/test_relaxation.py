"""ViscoelasticHistory of the internal variables over a step, and the energy that it dissipates."""

import itertools

import numpy as np
import pytest

from parsolid.materials.hyperelastic.evaluation import symmetric_rows, symmetric_tensors
from parsolid.materials.viscoelastic.maxwell import loss_weights, relaxation_loss, relaxation_weights
from parsolid.materials.viscoelastic.relaxation import branch_states, dissipated_energy, relaxed_branches

TIMES = np.array([0.5])


def loss_of(start, old, new, step, tau):
    """What a branch of modulus 2 loses by the rates of both ends."""
    end = relaxed_branches(start[None], old, new, step, np.array([tau]))
    rows = []
    for inverse, A in ((old, start), (new, end[0])):
        C = symmetric_rows(np.linalg.inv(symmetric_tensors(inverse[None])[0]))[0]
        rows += [tuple(C), tuple(inverse), tuple(A)]
    return relaxation_loss(2.0, tau, tuple(tau * weight for weight in loss_weights(step, tau)), *rows)


def inverse_at(t):
    """C^{-1} of a motion with shear and stretch, as a row of 6."""
    F = np.array([[1.0 + 0.4 * np.sin(t), 0.7 * t, 0.0], [0.0, 1.0 + 0.1 * t, 0.2 * t * t], [0.0, 0.0, 1.0]])
    return symmetric_rows(np.linalg.inv(F.T @ F))[0]


def relaxed(steps, end=2.0, times=TIMES):
    A = symmetric_rows(np.eye(3)).repeat(len(times), axis=0)
    step = end / steps
    for k in range(steps):
        A = relaxed_branches(A, inverse_at(k * step), inverse_at((k + 1) * step), step, times)
    return A


@pytest.mark.parametrize("x", [0.0, 1e-300, 1e-12, 1e-6, 9.99e-6, 1.001e-5, 1e-3, 1.0, 30.0, 1e3, 1e12])
def test_weights_sum_to_one_and_are_exact(x):
    weights = relaxation_weights(x, 1.0)
    assert sum(weights) == pytest.approx(1.0, abs=1e-15)
    assert min(weights) >= 0.0
    # exp(-x), x/2 - x^2/3..., x/2 - x^2/6...: the series where they cancel
    if x < 0.1:
        series = [
            sum((-x) ** k * (k / factorial(k + 1)) for k in range(1, 30)),
            sum((-x) ** k / factorial(k + 1) for k in range(1, 30)),
        ]
        assert weights[1] == pytest.approx(-series[0], rel=1e-9, abs=1e-300)
        assert weights[2] == pytest.approx(-series[1], rel=1e-9, abs=1e-300)
    else:
        phi = (1.0 - np.exp(-x)) / x
        assert weights == pytest.approx((np.exp(-x), phi - np.exp(-x), 1.0 - phi), rel=1e-13)


def factorial(n):
    return float(np.prod(np.arange(1.0, n + 1.0)))


def test_relaxation_is_of_second_order():
    exact = relaxed(20000)
    errors = [np.abs(relaxed(steps) - exact).max() for steps in (25, 50, 100)]
    orders = np.log2(np.array(errors[:-1]) / errors[1:])
    assert orders == pytest.approx([2.0, 2.0], abs=0.05)


def test_relaxation_at_fixed_deformation_is_exact_whatever_the_step():
    inverse = inverse_at(1.3)
    times = np.array([1e-6, 1e-2, 1.0, 1e4])
    start = symmetric_rows(np.eye(3)).repeat(4, axis=0)
    for step in (1e-9, 1e-3, 2.0, 1e5):
        A = relaxed_branches(start, inverse, inverse, step, times)
        expected = inverse + (start - inverse) * np.exp(-step / times)[:, None]
        assert A == pytest.approx(expected, abs=1e-15)


def test_a_jump_leaves_the_internal_variables_as_they_are():
    start = symmetric_rows(np.diag([1.0, 2.0, 3.0]))
    A = relaxed_branches(start, inverse_at(0.0), inverse_at(1.0), 0.0, TIMES)
    assert np.array_equal(A, start)
    assert dissipated_energy(start, inverse_at(0.0)[None], inverse_at(1.0)[None], 0.0, np.array([2.0]), TIMES) == 0.0


def closed_form(C, decay):
    """Energy that a branch of modulus 2, virgin before a jump to C, has lost when its excess has decayed to a part of
    it.
    """
    excess = np.linalg.eigvalsh(C) - 1.0
    return (excess * (1.0 - decay) - np.log((1.0 + excess) / (1.0 + excess * decay))).sum()


@pytest.mark.parametrize("stretch", [0.1, 0.5, 1.5, 8.0])
@pytest.mark.parametrize("step", [1e-2, 0.3, 5.0, 1e4, 1e9])
def test_dissipated_energy_of_a_hold_is_that_of_the_closed_form(stretch, step):
    F = np.diag([stretch, 1.1, 0.7]) @ np.array([[1.0, 0.4, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    C = F.T @ F
    inverse = symmetric_rows(np.linalg.inv(C))[0]
    found = dissipated_energy(symmetric_rows(np.eye(3)), inverse[None], inverse[None], step, np.array([2.0]), TIMES)
    assert found == pytest.approx(closed_form(C, np.exp(-step / TIMES[0])), rel=1e-12)


@pytest.mark.parametrize("tau", [1e-7, 1e-2, 1.0, 1e3])
def test_dissipated_energy_is_the_integral_of_the_rate(tau):
    # C^{-1} linear in time, as the step takes it
    old, new, step = inverse_at(0.5), inverse_at(0.9), 0.4
    start = 0.9 * old + 0.1 * symmetric_rows(np.eye(3))[0]
    found = dissipated_energy(start[None], old[None], new[None], step, np.array([2.0]), np.array([tau]))
    # the layer at the start is resolved by times in geometric progression
    edges = np.concatenate([[0.0], step * np.geomspace(1e-12, 1.0, 400)])
    nodes, weights = np.polynomial.legendre.leggauss(6)
    total = 0.0
    for lower, upper in itertools.pairwise(edges):
        s = lower + 0.5 * (upper - lower) * (1.0 + nodes)
        C_inverse = symmetric_tensors(old + (s / step)[:, None] * (new - old))
        change = np.exp(-s / tau)[:, None] * (start - old) + tau * np.expm1(-s / tau)[:, None] * (new - old) / step
        A = C_inverse + symmetric_tensors(change)
        rates, C = np.empty((6, 1)), symmetric_rows(np.linalg.inv(C_inverse))
        branch_states(np.array([2.0]), np.array([tau]), C, symmetric_rows(A)[:, None], np.empty((6, 1)), rates)
        total += 0.5 * (upper - lower) * weights @ rates[:, 0]
    # the check itself subtracts C^{-1} from A where they are equal but for the lag, tau times the rate
    assert found == pytest.approx(total, rel=1e-10 if tau > 1e-5 else 1e-6)


@pytest.mark.parametrize("x", [1e-6, 1e-3, 0.0999, 0.1001, 0.7, 3.0, 40.0])
def test_weights_of_the_loss_are_integrals_over_the_step(x):
    nodes, weights = np.polynomial.legendre.leggauss(40)
    s, weights = 0.5 * x * (1.0 + nodes), 0.5 * x * weights
    part = np.expm1(-s) / np.expm1(-x)
    expected = [weights @ f for f in ((1.0 - part) ** 2, 2.0 * part * (1.0 - part), part**2)]
    assert loss_weights(x, 1.0) == pytest.approx(expected, rel=1e-11)


@pytest.mark.parametrize("tau", [1e-7, 1e-2, 0.05, 1.0, 1e3])
def test_what_a_step_loses_is_exact_to_the_change_of_strain(tau):
    # started as this motion leaves it, beside the exact energy of C^{-1} linear in time
    errors, whole = [], []
    for step in (0.04, 0.02, 0.01):
        old, new = inverse_at(0.8), inverse_at(0.8 + step)
        start = old - 0.3 * (-np.expm1(-0.8 / tau)) * min(tau, 0.5) * (new - old) / step
        found = loss_of(start, old, new, step, tau)
        exact = dissipated_energy(start[None], old[None], new[None], step, np.array([2.0]), np.array([tau]))
        errors.append(abs(found - exact))
        whole.append(exact)
    assert errors[0] < 0.03 * whole[0], (errors, whole)
    assert errors[-1] < 0.55 * errors[0] * whole[-1] / whole[0], (errors, whole)


def test_a_step_never_gains_whatever_the_strain_does(random_deformation, random_branches):
    F, A = random_deformation(400), random_branches(200, 1)
    inverses = symmetric_rows(np.linalg.inv(np.swapaxes(F, 1, 2) @ F))
    least = np.inf
    for n in range(200):
        start = symmetric_rows(A[n])[0]
        for x in (1e-4, 0.3, 2.0, 1e3):
            least = min(least, loss_of(start, inverses[2 * n], inverses[2 * n + 1], x, 1.0) / x)
    assert least >= 0.0
