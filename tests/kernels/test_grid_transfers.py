"""Scatter and gather for every basis against plain sums over all particles and nodes, and the identities they must obey."""

import numpy as np
import pytest
from grid_reference import BASES, make_cloud, space_of, weights_of

from parsolid.kernels import grid
from parsolid.kernels.grid_gather import gather
from parsolid.kernels.grid_scatter import scatter
from parsolid.kernels.simd import aligned_zeros

CASES = [(name, dimension) for name in BASES for dimension in (2, 3)]


def particles(cloud):
    return int(cloud.grid.start[-1])


def symmetric(rows):
    """(n, 3, 3) from rows xx yy zz 0 | yz xz xy 0."""
    xx, yy, zz, _, yz, xz, xy, _ = rows.T
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


def random_stress(cloud, seed=5):
    random = np.random.default_rng(seed)
    rows = aligned_zeros((len(cloud.motion), 8))
    rows[:] = random.normal(size=rows.shape)
    rows[:, 3] = 0.0
    if cloud.dimension == 2:
        rows[:, 4:6] = 0.0
    return rows


def random_affine(cloud):
    affine = aligned_zeros((len(cloud.motion), 12))
    shown = affine.reshape(-1, 3, 4)[:, : cloud.dimension, : cloud.dimension]
    shown[:] = np.random.default_rng(7).normal(size=shown.shape)
    return affine


def run_scatter(cloud, transfer, stress, external=None, space=None, motion=True, partials=None):
    cells, where = len(cloud.grid.base), cloud.motion
    cloud.nodes[:] = 0.0
    if external is None:
        # not None: one kernel less to compile
        external = aligned_zeros((len(where), 4))
    scatter(
        0, cells, space or space_of(cloud.dimension), cloud.basis, cloud.grid, cloud.scratch, where,
        where if motion else None, transfer, stress, external, cloud.nodes, partials,
    )  # fmt: skip
    return cloud.nodes


@pytest.mark.parametrize("name, dimension", CASES)
def test_scatter_is_the_plain_sum(name, dimension):
    cloud = make_cloud(name, dimension)
    n, rows = particles(cloud), random_stress(cloud)
    external = aligned_zeros((len(cloud.motion), 4))
    external[:, :dimension] = np.random.default_rng(6).normal(size=(len(cloud.motion), dimension))
    affine = random_affine(cloud)
    w, gradient, apart = weights_of(cloud, name)
    m, v = cloud.motion[:n, 3], cloud.motion[:n, 4:7]
    slopes = affine.reshape(-1, 3, 4)[:n, :, :3]
    force = np.einsum("pi,pa->ia", w, external[:n, :3]) - np.einsum("pab,pib->ia", symmetric(rows[:n]), gradient)
    for transfer, velocity in (
        (grid.Flip(1.0), v[:, None]),
        (grid.Apic(affine), v[:, None] + np.einsum("pab,pib->pia", slopes, apart)),
    ):
        nodes = run_scatter(cloud, transfer, grid.CauchyStress(rows), external)
        np.testing.assert_allclose(nodes[:, 3], w.T @ m, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(nodes[:, :3], np.einsum("pi,p,pia->ia", w, m, velocity + 0 * apart), atol=1e-12)
        np.testing.assert_allclose(nodes[:, 4:7], force, atol=2e-12)
        assert not nodes[:, 7].any()


@pytest.mark.parametrize("name, dimension", CASES)
def test_gather_is_the_plain_sum(name, dimension):
    cloud = make_cloud(name, dimension)
    n, step, fraction = particles(cloud), 0.01, 0.95
    random = np.random.default_rng(8)
    cloud.nodes[:, :dimension] = random.normal(size=(len(cloud.nodes), dimension))
    cloud.nodes[:, 3] = random.uniform(1.0, 2.0, len(cloud.nodes))
    cloud.nodes[:, 4 : 4 + dimension] = random.normal(size=(len(cloud.nodes), dimension))
    w, gradient, apart = weights_of(cloud, name)
    before = cloud.motion[:n].copy()
    nodal = w @ cloud.nodes[:, :3]
    rate = aligned_zeros((len(cloud.motion), 12))
    affine = aligned_zeros((len(cloud.motion), 12))
    flip = fraction * (before[:, 4:7] + w @ cloud.nodes[:, 4:7]) + (1 - fraction) * nodal
    spread = np.einsum("pi,pia->pa", w, apart**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        moments = np.einsum("ia,pi,pib->pab", cloud.nodes[:, :3], w, apart) / spread[:, None]
    gradients = np.einsum("ia,pib->pab", cloud.nodes[:, :3], gradient)
    if name == "linear":
        moments = gradients
    for transfer, velocity in ((grid.Flip(fraction), flip), (grid.Apic(affine), nodal)):
        cloud.motion[:n] = before
        gather(
            0, len(cloud.grid.base), space_of(dimension), cloud.basis, cloud.grid, cloud.scratch, cloud.motion, cloud.nodes,
            cloud.motion, step, transfer, rate, None,
        )  # fmt: skip
        np.testing.assert_allclose(cloud.motion[:n, 4:7], velocity, atol=1e-12)
        np.testing.assert_allclose(cloud.motion[:n, :3], before[:, :3] + step * nodal, atol=1e-13)
        np.testing.assert_array_equal(cloud.motion[:n, [3, 7]], before[:, [3, 7]])
        np.testing.assert_allclose(rate.reshape(-1, 3, 4)[:n, :, :3], gradients, atol=1e-11)
    shown = affine.reshape(-1, 3, 4)[:n, :dimension, :dimension]
    np.testing.assert_allclose(shown, moments[:, :dimension, :dimension], atol=2e-11)
