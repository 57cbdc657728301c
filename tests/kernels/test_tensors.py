"""Small tensors as tuples against numpy and scipy; kernels give what plain Python gives."""

import numpy as np
import pytest
from scipy.linalg import expm, polar

from parsolid import tensors as t
from parsolid.kernels import kernel
from parsolid.principal import exp_of_small, log_of_small

SIX = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))


def nine(matrix):
    return tuple(np.ravel(matrix).tolist())


def six(matrix):
    return tuple(matrix[SIX].tolist())


def general_and_symmetric(seed):
    random = np.random.default_rng(seed)
    a, b, s, u = random.standard_normal((4, 3, 3))
    return a, b, s + s.T, u + u.T


@pytest.mark.parametrize("seed", range(5))
def test_operations_are_those_of_matrices(seed):
    a, b, s, u = general_and_symmetric(seed)
    A, B, S, U = nine(a), nine(b), six(s), six(u)
    cofactor = np.linalg.det(a) * np.linalg.inv(a).T
    expected = [
        (t.plus(A, B), a + b),
        (t.times(2.5, A), 2.5 * a),
        (t.combine(2.0, A, -0.5, B), 2.0 * a - 0.5 * b),
        (t.transpose(A), a.T),
        (t.matmul(A, B), a @ b),
        (t.matmul_transposed(A, B), a @ b.T),
        (t.cofactor(A), cofactor),
        (t.inverse(A), np.linalg.inv(a)),
        (t.general(S), s),
        (t.cross(A, A), 2.0 * cofactor),
    ]
    for found, matrix in expected:
        np.testing.assert_allclose(found, nine(matrix), rtol=1e-11, atol=1e-12)
    symmetric = [
        (t.gram(A), a.T @ a),
        (t.symmetric_part(A), 0.5 * (a + a.T)),
        (t.plus_symmetric(S, U), s + u),
        (t.times_symmetric(3.0, S), 3.0 * s),
        (t.combine_symmetric(2.0, S, -1.0, U), 2.0 * s - u),
        (t.add_spherical(S, 0.7), s + 0.7 * np.eye(3)),
        (t.inverse_symmetric(S), np.linalg.inv(s)),
        (t.congruence(A, S), a @ s @ a.T),
    ]
    for found, matrix in symmetric:
        np.testing.assert_allclose(found, six(matrix), rtol=1e-10, atol=1e-11)
    numbers = [
        (t.determinant(A), np.linalg.det(a)),
        (t.determinant_symmetric(S), np.linalg.det(s)),
        (t.trace(A), np.trace(a)),
        (t.trace_symmetric(S), np.trace(s)),
        (t.contract(A, B), np.sum(a * b)),
        (t.contract_symmetric(S, U), np.sum(s * u)),
    ]
    for found, number in numbers:
        assert found == pytest.approx(number, rel=1e-11, abs=1e-12)


def test_the_cross_product_is_the_derivative_of_the_cofactor():
    a, b, _, _ = general_and_symmetric(9)
    h = 1e-6
    slope = (np.array(t.cofactor(nine(a + h * b))) - np.array(t.cofactor(nine(a - h * b)))) / (2.0 * h)
    np.testing.assert_allclose(t.cross(nine(a), nine(b)), slope, atol=1e-8)


@pytest.mark.parametrize("scale", [1e-60, 1.0, 1e60])
def test_the_largest_eigenvalue_and_its_bound(scale):
    for seed in range(20):
        s = scale * general_and_symmetric(seed)[2]
        exact = np.linalg.eigvalsh(s)[-1]
        assert t.largest_eigenvalue(six(s)) == pytest.approx(exact, rel=1e-12, abs=1e-12 * scale)
        if scale == 1.0:
            assert t.largest_eigenvalue_bound(six(s)) >= exact - 1e-12


@pytest.mark.parametrize("eigenvalues", [(2.0, 2.0, 2.0), (3.0, 3.0, 1.0), (3.0, 1.0, 1.0), (0.0, 0.0, 0.0)])
def test_the_largest_eigenvalue_of_equal_ones(eigenvalues):
    Q = expm(np.array([[0.0, 0.3, -0.7], [-0.3, 0.0, 0.2], [0.7, -0.2, 0.0]]))
    s = Q @ np.diag(eigenvalues) @ Q.T
    # the closed form loses half the digits where two eigenvalues are equal
    assert t.largest_eigenvalue(six(s)) == pytest.approx(max(eigenvalues), abs=1e-7)
    assert t.largest_eigenvalue_bound(six(s)) >= max(eigenvalues) - 1e-12


@pytest.mark.parametrize("spread", [1e-9, 1e-3, 0.1, 0.6])
def test_rotations_of_random_gradients(spread):
    random = np.random.default_rng(3)
    for _ in range(100):
        F = np.eye(3) + spread * random.standard_normal((3, 3))
        if np.linalg.det(F) > 0.05:
            np.testing.assert_allclose(t.rotation(nine(F)), nine(polar(F)[0]), atol=3e-14)


def test_rotation_of_extreme_stretches():
    """Plastic strains of 3 and more."""
    random = np.random.default_rng(4)
    for _ in range(40):
        Q, S = (expm(w - w.T) for w in random.standard_normal((2, 3, 3)))
        F = Q @ S @ np.diag(np.exp(random.uniform(-4.0, 4.0, 3))) @ S.T
        np.testing.assert_allclose(t.rotation(nine(F)), nine(Q), atol=1e-10)


def test_the_rotation_near_another_is_of_second_order():
    random = np.random.default_rng(7)
    F, spin = np.eye(3) + 0.2 * random.standard_normal((3, 3)), random.standard_normal((3, 3))
    exact, errors = polar(F)[0], []
    for size in (0.02, 0.01):
        R = np.reshape(t.rotation_near(nine(exact @ expm(size * (spin - spin.T))), nine(F)), (3, 3))
        np.testing.assert_allclose(R @ R.T, np.eye(3), atol=1e-13)
        errors.append(np.abs(R - exact).max())
    assert np.log2(errors[0] / errors[1]) > 1.8


def test_the_rotation_in_the_plane():
    F = np.array([[1.2, 0.5, 0.0], [-0.3, 0.8, 0.0], [0.0, 0.0, 1.4]])
    np.testing.assert_allclose(t.plane_rotation(nine(F)), nine(polar(F)[0]), atol=1e-15)


@kernel
def many(A, S, result):
    for i in range(A.shape[1]):
        a = (A[0, i], A[1, i], A[2, i], A[3, i], A[4, i], A[5, i], A[6, i], A[7, i], A[8, i])
        s = (S[0, i], S[1, i], S[2, i], S[3, i], S[4, i], S[5, i])
        R = t.rotation(a)
        result[0, i] = t.contract(t.matmul(t.inverse(a), R), t.general(t.congruence(R, s)))
        result[1, i] = t.largest_eigenvalue(t.gram(a))


def test_kernels_give_what_python_gives():
    random = np.random.default_rng(2)
    A, S, found = (
        np.eye(3).reshape(9, 1) + 0.3 * random.standard_normal((9, 30)),
        random.standard_normal((6, 30)),
        np.empty((2, 30)),
    )
    A = np.ascontiguousarray(A[:, np.linalg.det(A.T.reshape(-1, 3, 3)) > 0.1])
    many(A, S, found)
    for i in range(A.shape[1]):
        a, s = nine(A[:, i]), tuple(S[:, i].tolist())
        R = t.rotation(a)
        assert found[0, i] == pytest.approx(
            t.contract(t.matmul(t.inverse(a), R), t.general(t.congruence(R, s))), rel=1e-11
        )
        assert found[1, i] == pytest.approx(t.largest_eigenvalue(t.gram(a)), rel=1e-13)


@pytest.mark.parametrize("step", [0.0, 0.3, 2.0])
def test_a_spin_turns_by_cayleys_formula(step):
    L, one = general_and_symmetric(4)[0], np.eye(3)
    W = 0.25 * step * (L - L.T)
    wanted = np.linalg.solve(one - W, one + W)
    np.testing.assert_allclose(t.spin_rotation(nine(L), step), nine(wanted), atol=1e-14)
    np.testing.assert_allclose(wanted @ wanted.T, one, atol=1e-14)


@pytest.mark.parametrize("size", [1e-6, 0.1])
def test_logarithm_and_exponential_of_small_tensors(size):
    S = general_and_symmetric(7)[2]
    S = S - np.trace(S) / 3.0 * np.eye(3)
    S *= size / np.linalg.norm(S)
    values, axes = np.linalg.eigh(S)
    for function, exact, least in ((log_of_small, np.log1p, size), (exp_of_small, np.exp, 1.0)):
        assert function(six(S)) == pytest.approx(six((axes * exact(values)) @ axes.T), rel=1e-13, abs=1e-15 * least)
