"""Both transfers for every basis, the passes of MUSL and rigid walls against plain sums over all particles and nodes.
Momentum, spin and power follow from the sums; `contracts` and `test_transfers` look at them in runs.
"""

import numpy as np
import pytest
from grid_reference import BASES, make_cloud, weights_of

from parsolid.methods.mpm.conditions import stop_at_wall
from parsolid.methods.mpm.grid import accelerate, velocities_of_momentum
from parsolid.methods.mpm.transfer import grid_to_particles, particles_to_grid

LEAST = 1e-12

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


def take(particle_set, fraction, slope, step, rate, remapped=None, axisymmetric=False):
    """What the particles take from the nodes."""
    cells = particle_set.cells._replace(axisymmetric=axisymmetric)
    moved = (particle_set.nodes, remapped, step, particle_set.motion)
    grid_to_particles(particle_set.basis, cells, *moved, fraction, slope, rate, None)


def new_rate(particle_set):
    return np.zeros((len(particle_set.motion), 12))


def tensors(rows, count):
    return rows.reshape(-1, 3, 4)[:count, :, :3]


@pytest.mark.parametrize("name", ["linear", "quadratic-spline"])
def test_hoop_stress_and_hoop_rate(name):
    particle_set = make_cloud(name, 2)
    n, stress = particles(particle_set), random_stress(particle_set)
    stress[:, [0, 1, 6]] = 0.0
    w, _, _ = weights_of(particle_set, name)
    radius = particle_set.motion[:n, 0].copy()
    nodes = give(particle_set, None, stress, axisymmetric=True)
    np.testing.assert_allclose(nodes[:, 4], -w.T @ (stress[:n, 2] / radius), atol=1e-12)
    assert not nodes[:, 5:7].any()
    accelerate(len(nodes), nodes, 0.01, 0.0)
    rate = new_rate(particle_set)
    take(particle_set, 0.0, None, 0.0, rate, axisymmetric=True)
    np.testing.assert_allclose(tensors(rate, n)[:, 2, 2], (w @ nodes[:, 0]) / radius, atol=1e-12)


def test_velocities_mapped_back_move_nothing_else():
    """MUSL: positions go with the new nodal velocities, gradients are those of the particles' velocities on
    the grid.
    """
    name = "quadratic-spline"
    particle_set = make_cloud(name, 2)
    n, step = particles(particle_set), 0.01
    w, gradient, _ = weights_of(particle_set, name)
    before = particle_set.motion[:n].copy()
    nodes = give(particle_set, None, random_stress(particle_set), None).copy()
    particle_set.nodes[:] = nodes
    accelerate(len(nodes), particle_set.nodes, step, 0.0)
    moved = particle_set.nodes.copy()
    take(particle_set, 1.0, None, step, None)
    np.testing.assert_array_equal(particle_set.motion[:n, :4], before[:, :4])
    remapped = give(particle_set, None, None, None).copy()
    velocities_of_momentum(len(nodes), remapped, LEAST)
    momentum, mass = w.T @ (before[:, 3:4] * particle_set.motion[:n, 4:7]), (w.T @ before[:, 3])[:, None]
    wanted = np.divide(momentum, mass, where=mass > LEAST, out=np.zeros_like(momentum))
    np.testing.assert_allclose(remapped[:, :3], wanted, atol=1e-11)
    particle_set.nodes[:] = moved
    rate, velocity = new_rate(particle_set), particle_set.motion[:n, 4:].copy()
    take(particle_set, None, None, step, rate, remapped)
    np.testing.assert_array_equal(particle_set.motion[:n, 4:], velocity)
    np.testing.assert_allclose(particle_set.motion[:n, :3], before[:, :3] + step * (w @ moved[:, :3]), atol=1e-13)
    np.testing.assert_allclose(tensors(rate, n), np.einsum("ia,pib->pab", wanted, gradient), atol=1e-10)


@pytest.mark.parametrize("dimension", [2, 3])
def test_light_nodes_stand_still(dimension):
    particle_set = make_cloud("quadratic-spline", dimension)
    nodes = give(particle_set, None, random_stress(particle_set))
    least = float(np.median(nodes[:, 3]))
    mass, force = nodes[:, 3].copy(), nodes[:, 4:7].copy()
    velocity = nodes[:, :3] / np.maximum(mass[:, None], 1e-300)
    accelerate(len(nodes), nodes, 0.1, least)
    light, change = mass <= least, 0.1 * force / np.maximum(mass[:, None], 1e-300)
    assert light.any() and not nodes[light].any()
    np.testing.assert_allclose(nodes[~light, :3], (velocity + change)[~light], atol=1e-13)
    np.testing.assert_allclose(nodes[~light, 4:7], change[~light], atol=1e-13)
    np.testing.assert_array_equal(nodes[~light, 3], mass[~light])


@pytest.mark.parametrize("sticking", [False, True])
def test_a_rigid_wall(sticking):
    """Nodes behind the wall take its normal velocity if they approach it, all of it if they stick; the impulse is what
    they got.
    """
    random = np.random.default_rng(1)
    places, nodes = random.uniform(-1.0, 1.0, (200, 4)), random.normal(size=(200, 8))
    nodes[:, 3] = random.uniform(0.0, 1.0, 200)
    nodes[:20, 3] = 0.0
    share = random.uniform(0.0, 1.0, 200)
    point, normal, moving = np.array([0.1, 0.2, 0.3]), np.array([0.6, 0.8, 0.0]), np.array([1.0, -0.5, 0.3])
    wall = point, normal, moving, sticking
    before = nodes.copy()
    found = np.zeros(200, bool)
    *impulse, lost = stop_at_wall(200, nodes, places, share, found, nodes, False, wall)
    behind = ((places[:, :3] - point) @ normal <= 0.0) & (nodes[:, 3] > 0.0)
    relative = before[:, :3] - moving
    approach = relative @ normal
    if sticking:
        held, wanted = behind, np.tile(moving, (200, 1))
    else:
        held, wanted = behind & (approach < 0.0), before[:, :3] - approach[:, None] * normal
    assert held.any() and (behind & ~held).any() != sticking
    np.testing.assert_array_equal(found, held)
    np.testing.assert_allclose(nodes[held, :3], wanted[held], atol=1e-14)
    np.testing.assert_array_equal(nodes[~held], before[~held])
    gained = nodes[:, :3] - before[:, :3]
    np.testing.assert_allclose(nodes[:, 4:7] - before[:, 4:7], gained, atol=1e-14)
    set_by_wall = nodes[held, 4:7] if sticking else nodes[held, 4:7] @ normal[:, None]
    np.testing.assert_allclose(lost, 0.5 * (share * nodes[:, 3])[held] @ (set_by_wall**2).sum(axis=1), rtol=1e-13)
    np.testing.assert_allclose(impulse, (share * nodes[:, 3]) @ gained, atol=1e-13)
    again = random.normal(size=(200, 8))
    again[:, 3] = nodes[:, 3]
    free = again.copy()
    lost = stop_at_wall(200, again, places, share, found, nodes, True, wall)[3]
    # the nodes that the motion held and no others, those that would leave included
    np.testing.assert_allclose((again[held, :3] - moving) @ normal, 0.0, atol=1e-14)
    np.testing.assert_array_equal(again[~held], free[~held])
    kept = ((again - free)[:, :3] * nodes[:, 4:7]).sum(axis=1)
    np.testing.assert_allclose(lost, 0.5 * (share * nodes[:, 3]) @ kept, rtol=1e-12)
