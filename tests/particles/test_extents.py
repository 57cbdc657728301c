"""Bounds of deformed bodies from the domains of their particles."""

import numpy as np

from parsolid.particles.extents import domain_bounds


def test_a_sheared_and_stretched_box():
    """The bounds of a homogeneously deformed box are those of its corners, whatever the lattice."""
    spacing = np.array([0.25, 0.5])
    X = np.stack(np.meshgrid([0.125, 0.375, 0.625, 0.875], [0.25, 0.75], indexing="ij"), axis=-1).reshape(-1, 2)
    F = np.eye(3)
    F[:2, :2] = [[1.2, 0.3], [-0.1, 0.7]]
    position = X @ F[:2, :2].T
    corners = np.array([[0, 0], [1, 0], [0, 1], [1, 1]]) @ F[:2, :2].T
    lower, upper = domain_bounds(position, np.tile(F, (8, 1, 1)), np.tile(spacing, (8, 1)), None)
    np.testing.assert_allclose(lower, corners.min(axis=0), atol=1e-14)
    np.testing.assert_allclose(upper, corners.max(axis=0), atol=1e-14)


def test_own_axes_and_no_particles():
    turned = np.array([[[0.0, 1.0], [-1.0, 0.0]]])
    lower, upper = domain_bounds(np.zeros((1, 2)), np.eye(3)[None], np.array([[4.0, 2.0]]), turned)
    np.testing.assert_allclose(np.stack((lower, upper)), [[-1.0, -2.0], [1.0, 2.0]], atol=1e-15)
    lower, upper = domain_bounds(np.zeros((0, 3)), np.zeros((0, 3, 3)), np.zeros((0, 3)), None)
    assert np.all(lower == np.inf) and np.all(upper == -np.inf)
