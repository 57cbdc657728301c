"""Weights along the axes of a box against the published operators, polynomials and explicit images."""

import numpy as np
import pytest

from parsolid.pairs.box_weights import REACH, Axis, axis_tables, lengths_of, operator_of, shares_of
from tests.pairs.boxes import dense_operator, places_of

GRADED = tuple((np.linspace(0.0, 1.0, 12) ** 1.15 * 11.0).tolist())


def dense(table: np.ndarray) -> np.ndarray:
    """A table (7, n) as a matrix (n, n)."""
    n = table.shape[1]
    result = np.zeros((n, n))
    for k in range(2 * REACH + 1):
        for i in range(n):
            if 0 <= i + k - REACH < n:
                result[i, i + k - REACH] += table[k, i]
            else:
                assert table[k, i] == 0.0
    return result


@pytest.mark.parametrize(("nodes", "fourth"), [(2, False), (3, False), (7, False), (8, True), (9, True), (20, True)])
def test_free_axes_have_the_published_operator(nodes, fourth):
    axis = Axis(nodes, 0.3)
    Q, H = dense_operator(axis, fourth)
    tables = axis_tables(axis, fourth, 1.0, True)
    np.testing.assert_allclose(tables.length, H, rtol=1e-15)
    for along in (0, 1):
        np.testing.assert_allclose(dense(tables.gradient[along]), Q / H[:, None], atol=1e-14)
        # the adjoint: H Div = -(H Grad)^T
        np.testing.assert_allclose(dense(tables.divergence[along]), -Q.T / H[:, None], atol=1e-14)


@pytest.mark.parametrize("places", [(), GRADED])
@pytest.mark.parametrize("fourth", [False, True])
def test_gradients_of_linear_fields_are_exact_and_sums_are_by_parts(places, fourth):
    axis = Axis(12, 0.1, ("", ""), places)
    tables, X = axis_tables(axis, fourth, 1.0, True), places_of(axis)
    D = dense(tables.gradient[1])
    np.testing.assert_allclose(D @ (2.0 * X + 3.0), 2.0, rtol=1e-12)
    ends = np.zeros((12, 12))
    ends[0, 0], ends[-1, -1] = -1.0, 1.0
    HD = tables.length[:, None] * D
    np.testing.assert_allclose(HD + HD.T, ends, atol=1e-14)
    assert tables.length.sum() == pytest.approx(X[-1] - X[0], rel=1e-13)


@pytest.mark.parametrize("nodes", [4, 5, 6, 7])
def test_short_axes_have_both_ends_of_the_operator(nodes):
    tables, X = axis_tables(Axis(nodes, 0.5), True, 1.0, True), 0.5 * np.arange(nodes)
    D, ends = dense(tables.gradient[1]), np.zeros((nodes, nodes))
    np.testing.assert_allclose(D @ (3.0 * X * X - X + 2.0), 6.0 * X - 1.0, atol=1e-13)
    ends[0, 0], ends[-1, -1] = -1.0, 1.0
    HD = tables.length[:, None] * D
    np.testing.assert_allclose(HD + HD.T, ends, atol=1e-14)
    # of cubics; trapezia give a whole cell's part too much of squares
    assert tables.length @ X**3 == pytest.approx(X[-1] ** 4 / 4.0, rel=1e-13)


def test_the_order_is_four_inside_and_two_at_the_ends():
    errors = []
    for nodes in (41, 81):
        axis = Axis(nodes, 1.0 / (nodes - 1))
        X = places_of(axis)
        error = np.abs(dense(axis_tables(axis, True, 1.0, True).gradient[1]) @ np.sin(3.0 * X) - 3.0 * np.cos(3.0 * X))
        errors.append((error[6:-6].max(), error[0]))
    inside, end = (np.log2(coarse / fine) for coarse, fine in zip(*errors))
    assert inside > 3.8
    assert 1.8 < end < 2.3


@pytest.mark.parametrize("kinds", [("roller", ""), ("", "roller"), ("antisymmetric", ""), ("roller", "antisymmetric")])
@pytest.mark.parametrize("fourth", [False, True])
@pytest.mark.parametrize("graded", [False, True])
def test_folded_images_are_explicit_images(kinds, fourth, graded):
    """A field on the half is continued by its parity; the operators of the whole give the same on the half."""
    n = 12
    half = Axis(n, 0.2, kinds, GRADED if graded else ())
    whole, tables = half.whole, axis_tables(half, fourth, 1.0, True)
    big = axis_tables(whole, fourth, 1.0, True)
    start = n - 1 if kinds[0] else 0
    here = slice(start, start + n)
    np.testing.assert_allclose(tables.length / half.step, big.length[here], rtol=1e-12)
    rng = np.random.default_rng(1)
    for along in (0, 1):
        # parity of a velocity component and of the column of its stress at each end
        v, P = rng.standard_normal((2, n))
        parity = [{"": 0.0, "roller": 1.0 - 2.0 * along, "antisymmetric": 2.0 * along - 1.0}[kind] for kind in kinds]
        for f, sign in ((v, 1.0), (P, -1.0)):
            for end, s in zip((0, -1), parity):
                f[end] = 0.0 if s * sign < 0.0 else f[end]

        def continued(f, sign):
            below = sign * parity[0] * f[:0:-1] if kinds[0] else f[:0]
            above = sign * parity[1] * f[-2::-1] if kinds[1] else f[:0]
            return np.concatenate((below, f, above))

        grad = dense(big.gradient[along]) @ continued(v, 1.0) / half.step
        np.testing.assert_allclose(dense(tables.gradient[along]) @ v, grad[here], atol=1e-11)
        div = dense(big.divergence[along]) @ continued(P, -1.0) / half.step
        np.testing.assert_allclose(dense(tables.divergence[along]) @ P, div[here], atol=1e-11)
        # fluxes, one less than nodes, turn their direction at an image
        flux = rng.standard_normal(n - 1)
        below = -parity[0] * flux[::-1] if kinds[0] else flux[:0]
        above = -parity[1] * flux[::-1] if kinds[1] else flux[:0]
        every = np.concatenate((below, flux, above))
        D = np.zeros(whole.nodes)
        D[:-1] += big.jump[along, 0, :-1] * every / half.step
        D[1:] += big.jump[along, 1, 1:] * every / half.step
        mine = np.zeros(n)
        mine[:-1] += tables.jump[along, 0, :-1] * flux
        mine[1:] += tables.jump[along, 1, 1:] * flux
        np.testing.assert_allclose(mine, D[here], atol=1e-11)


def test_dissipation_acts_between_neighbours_with_the_weights_of_the_gradient():
    axis = Axis(9, 0.5)
    tables, q, H = axis_tables(axis, True, 2.5, True), operator_of(axis, True), lengths_of(axis, True)
    np.testing.assert_allclose(tables.jump[0, 0, :-1], 2.5 * q[:-1, REACH + 1] / H[:-1], rtol=1e-14)
    np.testing.assert_allclose(tables.jump[0, 1, 1:], -2.5 * q[:-1, REACH + 1] / H[1:], rtol=1e-14)


def test_outermost_pairs_of_graded_axes_do_not_dissipate_by_reconstructed_jumps():
    graded = axis_tables(Axis(12, 0.1, ("", "roller"), GRADED), True, 1.0, True)
    assert not graded.jump[:, 0, 0].any() and not graded.jump[:, 1, 1].any()
    assert graded.jump[0, 0, 1:-1].all() and graded.jump[0, 1, 2:].all()
    plain = axis_tables(Axis(12, 0.1, ("", "roller"), GRADED), True, 1.0, False)
    assert plain.jump[:, 0, :-1].all() and not plain.half_step.any()


def test_half_of_a_node_on_a_mirror_plane_is_on_this_side():
    assert shares_of(Axis(8, 1.0, ("roller", ""))).tolist() == [0.5] + 7 * [1.0]
