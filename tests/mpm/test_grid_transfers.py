"""Both transfers for every basis against plain sums over all particles and nodes, and the identities they must
obey.
"""

import numpy as np
import pytest
from grid_reference import BASES, make_cloud, weights_of

from parsolid.methods.mpm.transfer import grid_to_particles, particles_to_grid

# forces of zero: the kernels of the test with forces; None where those of runs without are wanted
NOTHING = "nothing"


def particles(particle_set):
    return int(particle_set.cells.start[-1])


def symmetric(rows):
    """(n, 3, 3) from rows xx yy zz 0 | yz xz xy 0."""
    xx, yy, zz, _, yz, xz, xy, _ = rows.T
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]]).transpose(2, 0, 1)


def random_stress(particle_set, seed=5):
    random = np.random.default_rng(seed)
    rows = np.zeros((len(particle_set.motion), 8))
    rows[:] = random.normal(size=rows.shape)
    rows[:, 3] = 0.0
    if particle_set.dimension == 2:
        rows[:, 4:6] = 0.0
    return rows


def random_affine(particle_set):
    affine = np.zeros((len(particle_set.motion), 12))
    shown = affine.reshape(-1, 3, 4)[:, : particle_set.dimension, : particle_set.dimension]
    shown[:] = np.random.default_rng(7).normal(size=shown.shape)
    return affine


def give(particle_set, slope, stress, external=NOTHING, axisymmetric=False):
    """What the particles give to the nodes."""
    particle_set.nodes[:] = 0.0
    if external is NOTHING:
        external = np.zeros((len(particle_set.motion), 4))
    cells = particle_set.cells._replace(axisymmetric=axisymmetric)
    particles_to_grid(particle_set.basis, cells, particle_set.motion, slope, stress, external, particle_set.nodes)
    return particle_set.nodes


@pytest.mark.parametrize("name, dimension", list(zip(BASES, (2, 2, 3, 2))))
def test_scatter_is_the_plain_sum(name, dimension):
    particle_set = make_cloud(name, dimension)
    n, rows = particles(particle_set), random_stress(particle_set)
    external = np.zeros((len(particle_set.motion), 4))
    external[:, :dimension] = np.random.default_rng(6).normal(size=(len(particle_set.motion), dimension))
    affine = random_affine(particle_set)
    w, gradient, apart = weights_of(particle_set, name)
    m, v = particle_set.motion[:n, 3], particle_set.motion[:n, 4:7]
    slopes = affine.reshape(-1, 3, 4)[:n, :, :3]
    force = np.einsum("pi,pa->ia", w, external[:n, :3]) - np.einsum("pab,pib->ia", symmetric(rows[:n]), gradient)
    for slope, velocity in (
        (None, v[:, None]),
        (affine, v[:, None] + np.einsum("pab,pib->pia", slopes, apart)),
    ):
        nodes = give(particle_set, slope, rows, external)
        np.testing.assert_allclose(nodes[:, 3], w.T @ m, rtol=1e-12, atol=1e-14)
        np.testing.assert_allclose(nodes[:, :3], np.einsum("pi,p,pia->ia", w, m, velocity + 0 * apart), atol=1e-12)
        np.testing.assert_allclose(nodes[:, 4:7], force, atol=2e-12)
        assert not nodes[:, 7].any()


@pytest.mark.parametrize("name, dimension", list(zip(BASES, (2, 2, 3, 2))))
def test_gather_is_the_plain_sum(name, dimension):
    particle_set = make_cloud(name, dimension)
    n, step, fraction = particles(particle_set), 0.01, 0.95
    random = np.random.default_rng(8)
    particle_set.nodes[:, :dimension] = random.normal(size=(len(particle_set.nodes), dimension))
    particle_set.nodes[:, 3] = random.uniform(1.0, 2.0, len(particle_set.nodes))
    particle_set.nodes[:, 4 : 4 + dimension] = random.normal(size=(len(particle_set.nodes), dimension))
    w, gradient, apart = weights_of(particle_set, name)
    before = particle_set.motion[:n].copy()
    nodal = w @ particle_set.nodes[:, :3]
    rate = np.zeros((len(particle_set.motion), 12))
    affine = np.zeros((len(particle_set.motion), 12))
    flip = fraction * (before[:, 4:7] + w @ particle_set.nodes[:, 4:7]) + (1 - fraction) * nodal
    spread = np.einsum("pi,pia->pa", w, apart**2)
    with np.errstate(divide="ignore", invalid="ignore"):
        moments = np.einsum("ia,pi,pib->pab", particle_set.nodes[:, :3], w, apart) / spread[:, None]
    gradients = np.einsum("ia,pib->pab", particle_set.nodes[:, :3], gradient)
    if name == "linear":
        moments = gradients
    aflip = np.zeros(affine.shape)
    for part, slope, velocity in ((fraction, None, flip), (0.0, affine, nodal), (fraction, aflip, flip)):
        particle_set.motion[:n] = before
        moved = (particle_set.nodes, None, step, particle_set.motion)
        grid_to_particles(particle_set.basis, particle_set.cells, *moved, part, slope, rate, None)
        np.testing.assert_allclose(particle_set.motion[:n, 4:7], velocity, atol=1e-12)
        np.testing.assert_allclose(particle_set.motion[:n, :3], before[:, :3] + step * nodal, atol=1e-13)
        np.testing.assert_array_equal(particle_set.motion[:n, [3, 7]], before[:, [3, 7]])
        np.testing.assert_allclose(rate.reshape(-1, 3, 4)[:n, :, :3], gradients, atol=1e-11)
    shown = affine.reshape(-1, 3, 4)[:n, :dimension, :dimension]
    np.testing.assert_allclose(shown, moments[:, :dimension, :dimension], atol=2e-11)
    np.testing.assert_array_equal(aflip, affine)
