"""Tensor algebra on tuples of floats and of Lanes, against numpy."""

import numpy as np
import pytest
from numba.extending import register_jitable

from decomposition.compiled import compiled
from parsolid.numerics import tensors as tensor
from parsolid.numerics.lanes import load
from parsolid.numerics.layout import Space, load_branch, load_nine

LEVI_CIVITA = np.zeros((3, 3, 3))
for _even in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
    LEVI_CIVITA[_even] = 1.0
    LEVI_CIVITA[_even[::-1]] = -1.0


@register_jitable
def general_operations(a, b, s):
    return (
        tensor.cross(a, b),
        tensor.cofactor(a),
        tensor.matmul(a, b),
        tensor.matmul_transposed(a, b),
        tensor.expand(s),
        tensor.add(a, b),
        tensor.scale(0.3, a),
    )


@register_jitable
def symmetric_operations(a, s, r):
    return (
        tensor.gram(a),
        tensor.inverse_symmetric(s),
        tensor.add(s, r),
        tensor.scale(0.3, s),
        tensor.plus_identity(s, 0.7),
        tensor.add(s, tensor.zero_like_gram(a)),
    )


@register_jitable
def scalar_operations(a, b, s, r):
    return (
        tensor.contract(a, b),
        tensor.contract_symmetric(s, r),
        tensor.determinant_symmetric(s),
        tensor.trace_symmetric(s),
    )


@compiled
def on_floats(a, b, s, r):
    return general_operations(a, b, s), symmetric_operations(a, s, r), scalar_operations(a, b, s, r)


@register_jitable
def _lane_of_each(generals, symmetrics, scalars, k):
    one, two, three, four, five, six, seven = generals
    general = (
        tensor.lane_of_general(one, k),
        tensor.lane_of_general(two, k),
        tensor.lane_of_general(three, k),
        tensor.lane_of_general(four, k),
        tensor.lane_of_general(five, k),
        tensor.lane_of_general(six, k),
        tensor.lane_of_general(seven, k),
    )
    g, i, t, c, p, z = symmetrics
    symmetric = (
        tensor.lane_of_stored_symmetric(g, k),
        tensor.lane_of_stored_symmetric(i, k),
        tensor.lane_of_stored_symmetric(t, k),
        tensor.lane_of_stored_symmetric(c, k),
        tensor.lane_of_stored_symmetric(p, k),
        tensor.lane_of_stored_symmetric(z, k),
    )
    scalar = (
        tensor.lane(scalars[0], k),
        tensor.lane(scalars[1], k),
        tensor.lane(scalars[2], k),
        tensor.lane(scalars[3], k),
    )
    return general, symmetric, scalar


@compiled
def on_lanes_in_space(rows, k):
    """rows (30, 4): a, b (9 each), s, r (6 each) of four particles."""
    a, b = load_nine(rows, 0, 0), load_nine(rows, 9, 0)
    s, r = load_branch(Space(), rows, 3, 0), load_branch(Space(), rows, 4, 0)
    return _lane_of_each(general_operations(a, b, s), symmetric_operations(a, s, r), scalar_operations(a, b, s, r), k)


@register_jitable
def _five(rows, first):
    return (
        load(rows, first, 0),
        load(rows, first + 1, 0),
        load(rows, first + 2, 0),
        load(rows, first + 3, 0),
        load(rows, first + 4, 0),
    )


@register_jitable
def _four(rows, first):
    return load(rows, first, 0), load(rows, first + 1, 0), load(rows, first + 2, 0), load(rows, first + 3, 0)


@compiled
def on_lanes_in_plane(rows, k):
    """rows (18, 4): a, b (5 each), s, r (4 each) of four particles."""
    a, b, s, r = _five(rows, 0), _five(rows, 5), _four(rows, 10), _four(rows, 14)
    return _lane_of_each(general_operations(a, b, s), symmetric_operations(a, s, r), scalar_operations(a, b, s, r), k)


def general_matrix(values) -> np.ndarray:
    """(3, 3) from 5 or 9 components."""
    if len(values) == 9:
        return np.reshape(values, (3, 3))
    result = np.zeros((3, 3))
    result[:2, :2], result[2, 2] = np.reshape(values[:4], (2, 2)), values[4]
    return result


def symmetric_matrix(values) -> np.ndarray:
    """(3, 3) from 4 or 6 components."""
    result = np.diag(np.array(values[:3], float))
    pairs = ((0, 1), (0, 2), (1, 2))
    for (i, j), value in zip(pairs, values[3:]):
        result[i, j] = result[j, i] = value
    return result


def expected(a, b, s, r):
    """What numpy makes of the same matrices."""
    cross = np.einsum("ijk,IJK,jJ,kK->iI", LEVI_CIVITA, LEVI_CIVITA, a, b)
    cofactor = np.linalg.det(a) * np.linalg.inv(a).T
    general = (cross, cofactor, a @ b, a @ b.T, s, a + b, 0.3 * a)
    symmetric = (a.T @ a, np.linalg.inv(s), s + r, 0.3 * s, s + 0.7 * np.eye(3), s)
    scalar = (np.sum(a * b), np.sum(s * r), np.linalg.det(s), np.trace(s))
    return general, symmetric, scalar


def random_components(dimension: int):
    """Components (4 particles, ...) of two general and two positive symmetric tensors."""
    random = np.random.default_rng(dimension)
    general, symmetric = (9, 6) if dimension == 3 else (5, 4)
    a, b = random.normal(size=(2, 4, general))
    s, r = 0.3 * random.normal(size=(2, 4, symmetric))
    s[:, :3] += 2.0
    return a, b, s, r


def check(result, a, b, s, r):
    wanted = expected(general_matrix(a), general_matrix(b), symmetric_matrix(s), symmetric_matrix(r))
    for values, matrix in zip(result[0], wanted[0]):
        np.testing.assert_allclose(general_matrix(values), matrix, atol=1e-13)
    for values, matrix in zip(result[1], wanted[1]):
        np.testing.assert_allclose(symmetric_matrix(values), matrix, atol=1e-13)
    np.testing.assert_allclose(result[2], wanted[2], atol=1e-13)


@pytest.mark.parametrize("dimension", [2, 3])
def test_floats_agree_with_numpy(dimension):
    for a, b, s, r in zip(*random_components(dimension)):
        check(on_floats(*(tuple(map(float, values)) for values in (a, b, s, r))), a, b, s, r)


@pytest.mark.parametrize("dimension", [2, 3])
def test_lanes_agree_with_numpy(dimension):
    components = random_components(dimension)
    rows = np.ascontiguousarray(np.concatenate(components, axis=1).T)
    run = on_lanes_in_space if dimension == 3 else on_lanes_in_plane
    for k in range(4):
        check(run(rows, k), *(values[k] for values in components))


def test_the_cross_product_with_itself_is_twice_the_cofactor():
    a, b, s, r = (tuple(map(float, values[0])) for values in random_components(3))
    cross = on_floats(a, a, s, r)[0][0]
    cofactor = on_floats(a, b, s, r)[0][1]
    np.testing.assert_allclose(cross, 2.0 * np.array(cofactor), atol=1e-14)


@pytest.mark.parametrize("scale", [1e-6, 1.0, 1e9])
def test_the_largest_eigenvalue_is_that_of_numpy(scale):
    random = np.random.default_rng(5)
    for _ in range(200):
        values = tuple(scale * random.normal(size=6))
        wanted = np.linalg.eigvalsh(symmetric_matrix(values))[-1]
        assert tensor.largest_eigenvalue(values) == pytest.approx(wanted, abs=1e-14 * scale * 10)


@pytest.mark.parametrize(
    "eigenvalues", [(2, 2, 2), (2, 2, 1), (3, 1, 1), (0, 0, 0), (5, 0, 0), (1, 1 + 1e-9, 1 - 1e-9), (-1, -1, -3)]
)
def test_the_largest_eigenvalue_of_degenerate_tensors(eigenvalues):
    random = np.random.default_rng(6)
    for turned in (False, True):
        rotation = np.linalg.qr(random.normal(size=(3, 3)))[0] if turned else np.eye(3)
        m = rotation @ np.diag(np.array(eigenvalues, float)) @ rotation.T
        values = (m[0, 0], m[1, 1], m[2, 2], m[0, 1], m[0, 2], m[1, 2])
        error = tensor.largest_eigenvalue(values) - max(eigenvalues)
        # where the larger two meet, the closed form loses half the digits, on the side that shortens the time step
        assert -1e-14 < error < 1e-8


def _written(F, S, s):
    """Formulas as papers have them, of a general and a symmetric tensor."""
    C = tensor.gram(F)
    first = 2.0 * s * F + tensor.cofactor(F) * s - F / 3.0
    second = F @ S - -F + S + s * tensor.I
    third = s * tensor.I - C + S + None
    return first, second, third, (F @ S).T @ (s * tensor.I), tensor.trace(F), F[0]


@compiled
def _compiled_formulas(F, S, s):
    return _jitted(F, S, s)


_jitted = register_jitable(_written)


@pytest.mark.parametrize("general, symmetric", [(5, 4), (9, 6)])
def test_operators_mean_the_same_in_plain_python_and_compiled(general, symmetric):
    random = np.random.default_rng(3)
    F = tensor.as_tensor(tuple(map(float, random.standard_normal(general))))
    S = tensor.as_tensor(tuple(map(float, random.standard_normal(symmetric))))
    plain, machine = _written(F, S, 0.7), _compiled_formulas(F, S, 0.7)
    assert plain == machine
    assert [type(result) for result in plain] == [type(result) for result in machine]


def test_operators_are_those_of_matrices():
    random = np.random.default_rng(4)
    A, B = random.standard_normal((2, 3, 3))
    B += B.T
    F = tensor.as_tensor(tuple(A.ravel()))
    S = tensor.as_tensor((B[0, 0], B[1, 1], B[2, 2], B[0, 1], B[0, 2], B[1, 2]))
    first, second, third, fourth, trace, corner = _written(F, S, 0.7)
    one = np.eye(3)
    cofactor = np.linalg.det(A) * np.linalg.inv(A).T
    for found, expected in (
        (first, 1.4 * A + 0.7 * cofactor - A / 3.0),
        (second, A @ B + A + B + 0.7 * one),
        (tensor.expand(third), 0.7 * one - A.T @ A + B),
        (fourth, 0.7 * (A @ B).T),
    ):
        assert np.reshape(found, (3, 3)) == pytest.approx(expected, rel=1e-13, abs=1e-13)
    assert (trace, corner) == (pytest.approx(np.trace(A)), A[0, 0])
    with pytest.raises(TypeError):
        F + 1.0
    with pytest.raises(TypeError):
        F * F
