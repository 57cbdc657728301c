"""Between reference and current place, and mean dilatations whose power is that of the mean pressures."""

import numpy as np
import pytest

from parsolid.methods.mpm import grid
from parsolid.methods.mpm import lagrangian as grid_lagrangian
from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.layout import Axisymmetric, Plane, Space

COUNT = 10
SPACES = (Plane(), Axisymmetric(), Space())


def random_particles(space):
    """deformation, rate, stress and their tensors (n, 3, 3)."""
    random = np.random.default_rng(2)
    F = np.eye(3) + 0.2 * random.normal(size=(COUNT, 3, 3))
    G, sigma = random.normal(size=(2, COUNT, 3, 3))
    sigma = sigma + sigma.transpose(0, 2, 1)
    if space.dimension == 2:
        for tensor in (F, G, sigma):
            tensor[:, :2, 2] = tensor[:, 2, :2] = 0.0
    if isinstance(space, Plane):
        F[:, 2, 2], G[:, 2, 2] = 1.0, 0.0
    rows = {2: [(0, 0), (0, 1), (1, 0), (1, 1), (2, 2)], 3: [(i, j) for i in range(3) for j in range(3)]}[
        space.dimension
    ]
    deformation = aligned_zeros((len(rows), COUNT + 4))
    for row, (i, j) in enumerate(rows):
        deformation[row, :COUNT] = F[:, i, j]
    rate, stress = aligned_zeros((COUNT + 4, 12)), aligned_zeros((COUNT + 4, 8))
    rate[:COUNT].reshape(-1, 3, 4)[:, :, :3] = G
    for column, (i, j) in {0: (0, 0), 1: (1, 1), 2: (2, 2), 4: (1, 2), 5: (0, 2), 6: (0, 1)}.items():
        stress[:COUNT, column] = sigma[:, i, j]
    return deformation, rate, stress, F, G, sigma


def tensors(rows):
    return rows[:COUNT].reshape(-1, 3, 4)[:, :, :3]


@pytest.mark.parametrize("space", SPACES)
def test_gradients_and_stresses_change_place(space):
    deformation, rate, stress, F, G, sigma = random_particles(space)
    nominal = aligned_zeros((COUNT + 4, 12))
    grid_lagrangian.to_spatial_gradient(0, COUNT, space, deformation, rate)
    grid_lagrangian.to_first_piola_kirchhoff(0, COUNT, space, deformation, stress, nominal)
    inverse = np.linalg.inv(F)
    np.testing.assert_allclose(tensors(rate), G @ inverse, atol=1e-12)
    np.testing.assert_allclose(tensors(nominal), sigma @ inverse.transpose(0, 2, 1), atol=1e-12)


@pytest.mark.parametrize("space", SPACES)
def test_smallest_stretches(space):
    deformation, _, stress, F, _, _ = random_particles(space)
    stress[:, 7] = np.random.default_rng(3).uniform(1.0, 5.0, len(stress))
    singular = np.linalg.svd(F, compute_uv=False).min(axis=1)
    found = grid_lagrangian.smallest_stretches(0, COUNT, space, deformation, stress)
    assert found == pytest.approx((singular.min(), (singular / stress[:COUNT, 7]).min()), rel=1e-7)


@pytest.mark.parametrize("space", SPACES)
def test_mean_dilatation_and_mean_pressure_are_adjoint(space):
    _, rate, stress, _, G, sigma = random_particles(space)
    order = np.array([4, 0, 7, 1, 2, 3, 9, 8, 5, 6])
    none = np.zeros((3, 4))
    cells = grid.Grid(np.zeros(4), 1.0, 1.0, none, np.array([0, 3, 3, 10]), order, np.zeros((3, 1), np.int32))
    motion = aligned_zeros((COUNT + 4, 8))
    motion[:COUNT, 7] = np.random.default_rng(4).uniform(0.5, 2.0, COUNT)
    grid_lagrangian.average_dilatation(0, 3, space, cells, motion, rate)
    grid_lagrangian.average_pressure(0, 3, space, cells, motion, stress)
    averaged, volume = tensors(rate), motion[:COUNT, 7]
    theta = np.trace(averaged, axis1=1, axis2=2)
    for members in (order[:3], order[3:]):
        mean = np.average(np.trace(G[members], axis1=1, axis2=2), weights=volume[members])
        np.testing.assert_allclose(theta[members], mean, atol=1e-13)
    deviator = G - np.trace(G, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3)
    if isinstance(space, Plane):
        assert not averaged[:, 2, 2].any()
    else:
        np.testing.assert_allclose(averaged - theta[:, None, None] / 3.0 * np.eye(3), deviator, atol=1e-12)
    mended = sigma.copy()
    for d in range(3):
        mended[:, d, d] = stress[:COUNT, d]
    np.testing.assert_allclose((sigma * averaged).sum(), (mended * G).sum(), rtol=1e-12)
    np.testing.assert_allclose(mended[:, 0, 0] - mended[:, 1, 1], sigma[:, 0, 0] - sigma[:, 1, 1], atol=1e-12)
