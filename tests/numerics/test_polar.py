"""Rotations of deformation gradients against scipy's polar decomposition."""

import numpy as np
import pytest
from scipy.linalg import expm, polar

from decomposition.compiled import compiled
from parsolid.numerics.layout import load_nine, store_nine
from parsolid.numerics.polar import congruence, rotation, rotation_near, symmetric_part


@compiled
def rotations(F, R):
    for i in range(0, F.shape[1], 4):
        store_nine(R, 0, i, rotation(load_nine(F, 0, i)), 4)


@compiled
def rotations_near(near, F, R):
    for i in range(0, F.shape[1], 4):
        store_nine(R, 0, i, rotation_near(load_nine(near, 0, i), load_nine(F, 0, i)), 4)


@compiled
def plane_rotation(F):
    return rotation(F)


@compiled
def rotated(a, s):
    return congruence(a, s), symmetric_part(a)


def rows(tensors):
    return np.ascontiguousarray(np.reshape(tensors, (-1, 9)).T)


def random_gradients(count, spread, random):
    F = np.eye(3) + spread * random.standard_normal((4 * count, 3, 3))
    return F[np.linalg.det(F) > 0.05][:count]


@pytest.mark.parametrize("spread", [1e-9, 1e-3, 0.1, 0.6])
def test_rotations_of_random_gradients(spread):
    F = random_gradients(400, spread, np.random.default_rng(3))
    R = np.empty((9, 400))
    rotations(rows(F), R)
    exact = np.array([polar(f)[0] for f in F])
    # the rotation is as sharp as the smallest sum of two stretches
    assert R.T.reshape(-1, 3, 3) == pytest.approx(exact, abs=3e-14)


def test_rotation_of_extreme_stretches():
    """Plastic strains of 3 and more."""
    random = np.random.default_rng(4)
    stretches = np.exp(random.uniform(-4.0, 4.0, (40, 3)))
    Q, S = (np.array([expm(w - w.T) for w in random.standard_normal((40, 3, 3))]) for _ in range(2))
    F = Q @ S @ (stretches[:, :, None] * np.swapaxes(S, 1, 2))
    R = np.empty((9, 40))
    rotations(rows(F), R)
    assert R.T.reshape(-1, 3, 3) == pytest.approx(Q, abs=1e-10)


def test_a_lane_does_not_feel_its_neighbours():
    random = np.random.default_rng(6)
    F = rows(random_gradients(16, 0.4, random))
    R, turned = np.empty((9, 16)), np.empty((9, 16))
    rotations(F, R)
    order = random.permutation(16)
    rotations(np.ascontiguousarray(F[:, order]), turned)
    np.testing.assert_array_equal(turned, R[:, order])


def test_rotation_near_is_of_second_order():
    random = np.random.default_rng(7)
    F, spin = random_gradients(40, 0.2, random), random.standard_normal((3, 3))
    exact = np.array([polar(f)[0] for f in F])
    errors = []
    for size in (0.02, 0.01):
        near, R = exact @ expm(size * (spin - spin.T)), np.empty((9, 40))
        rotations_near(rows(near), rows(F), R)
        found = R.T.reshape(-1, 3, 3)
        assert found @ np.swapaxes(found, 1, 2) == pytest.approx(np.tile(np.eye(3), (40, 1, 1)), abs=1e-13)
        errors.append(np.abs(found - exact).max())
    assert np.log2(errors[0] / errors[1]) > 1.8


def test_plane_and_congruence():
    F = np.array([[1.2, 0.5, 0.0], [-0.3, 0.8, 0.0], [0.0, 0.0, 1.4]])
    R = np.array(plane_rotation((1.2, 0.5, -0.3, 0.8, 1.4)))
    assert R == pytest.approx(polar(F)[0][[0, 0, 1, 1, 2], [0, 1, 0, 1, 2]], abs=1e-15)
    random = np.random.default_rng(8)
    a, s = random.standard_normal((3, 3)), random.standard_normal((3, 3))
    s = s + s.T
    six = ((0, 1, 2, 0, 0, 1), (0, 1, 2, 1, 2, 2))
    found, half = rotated(tuple(a.ravel()), tuple(s[six]))
    assert found == pytest.approx((a @ s @ a.T)[six], abs=1e-14)
    assert half == pytest.approx((0.5 * (a + a.T))[six], abs=1e-15)
