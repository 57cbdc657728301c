"""What whole passes must keep: momentum, angular momentum, power; mirror planes against a doubled body; rigid walls;
MUSL.
"""

import itertools

import numpy as np
import pytest
from grid_reference import BASES, ORIGIN, SPACING, make_cloud, mirror, topology, weights_of
from test_grid_transfers import give, particles, random_affine, random_stress, symmetric

from parsolid.methods.mpm.conditions import stop_at_wall
from parsolid.methods.mpm.grid import accelerate, fold, unfold, velocities_of_momentum
from parsolid.methods.mpm.shape_functions import make_basis
from parsolid.methods.mpm.transfer import grid_to_particles

# the usual basis, whose kernels runs have, too: `test_grid_transfers` has the sums of all
FEW = [("quadratic-spline", 2), ("quadratic-spline", 3)]
LEAST = 1e-12


def take(particle_set, fraction, slope, step, rate, remapped=None, axisymmetric=False):
    """What the particles take from the nodes."""
    cells = particle_set.cells._replace(axisymmetric=axisymmetric)
    moved = (particle_set.nodes, remapped, step, particle_set.motion)
    grid_to_particles(particle_set.basis, cells, *moved, fraction, slope, rate, None)


def new_rate(particle_set):
    return np.zeros((len(particle_set.motion), 12))


def tensors(rows, count):
    return rows.reshape(-1, 3, 4)[:count, :, :3]


@pytest.mark.parametrize("name, dimension", FEW)
def test_momentum_is_kept(name, dimension):
    for transfer in ("flip", "apic"):
        keeps_momentum(name, dimension, transfer)


def keeps_momentum(name, dimension, transfer):
    particle_set = make_cloud(name, dimension)
    n, affine = particles(particle_set), random_affine(particle_set)
    fraction, slope = (0.9, None) if transfer == "flip" else (0.0, affine)
    momentum = particle_set.motion[:n, 3] @ particle_set.motion[:n, 4:7]
    nodes = give(particle_set, slope, random_stress(particle_set))
    np.testing.assert_allclose(nodes[:, :3].sum(axis=0), momentum, atol=1e-12)
    np.testing.assert_allclose(nodes[:, 4:7].sum(axis=0), 0.0, atol=1e-11)
    accelerate(len(nodes), nodes, 0.01, 0.0)
    # a rate that nobody reads: one kernel less to compile
    take(particle_set, fraction, slope, 0.01, new_rate(particle_set))
    np.testing.assert_allclose(particle_set.motion[:n, 3] @ particle_set.motion[:n, 4:7], momentum, atol=1e-11)


@pytest.mark.parametrize("name, dimension", FEW)
def test_the_affine_transfer_keeps_angular_momentum(name, dimension):
    particle_set = make_cloud(name, dimension)
    slope, no_stress = random_affine(particle_set), np.zeros((len(particle_set.motion), 8))
    found = []
    for _ in range(2):
        nodes = give(particle_set, slope, no_stress)
        found.append(np.cross(particle_set.places[:, :3], nodes[:, :3]).sum(axis=0))
        velocities_of_momentum(len(nodes), nodes, 0.0)
        take(particle_set, 0.0, slope, 0.0, new_rate(particle_set))
    np.testing.assert_allclose(found[1], found[0], atol=1e-11)


@pytest.mark.parametrize("name, dimension", FEW)
def test_forces_and_velocity_gradients_have_the_same_power(name, dimension):
    particle_set = make_cloud(name, dimension)
    n, stress = particles(particle_set), random_stress(particle_set)
    for axisymmetric in (False, True)[: 1 + (dimension == 2)]:
        force = give(particle_set, None, stress, axisymmetric=axisymmetric)[:, 4:7].copy()
        particle_set.nodes[:, :dimension] = np.random.default_rng(9).normal(size=(len(force), dimension))
        rate = new_rate(particle_set)
        # velocities that nobody reads: one kernel less to compile
        take(particle_set, 0.0, None, 0.0, rate, axisymmetric=axisymmetric)
        power = (symmetric(stress[:n]) * tensors(rate, n)).sum()
        assert (force * particle_set.nodes[:, :3]).sum() == pytest.approx(-power, rel=1e-11)


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


def half_body(name, planes):
    """Particles in two directions above planes of indices (x, y) or None, and the same with their mirror images: two
    clouds.
    """
    random = np.random.default_rng(4)
    count = 40
    motion, stress, halves = (
        np.zeros((count + 4, 8)),
        np.zeros((count + 4, 8)),
        np.zeros((count + 4, 4)) + 0.5,
    )
    corner = ORIGIN[:2] + SPACING * np.array([1.0 if index is None else index for index in planes])
    motion[:count, :2] = corner + SPACING * random.uniform(0.0, 2.5, (count, 2))
    motion[:count, 3], motion[:count, 4:6], motion[:count, 7] = (
        1.0 + random.uniform(size=count),
        random.normal(size=(count, 2)),
        0.1,
    )
    stress[:count, [0, 1, 2, 6]] = random.normal(size=(count, 4))
    halves[:count, :2] = random.uniform(0.1, 0.5, (count, 2))
    arrays = [motion[:count], stress[:count], halves[:count]]
    for d, index in enumerate(planes):
        if index is None:
            continue
        images = [array.copy() for array in arrays]
        images[0][:, d] = 2.0 * corner[d] - images[0][:, d]
        images[0][:, 4 + d] *= -1.0
        images[1][:, 6] *= -1.0
        arrays = [np.concatenate(pair) for pair in zip(arrays, images)]
    doubled = [np.zeros((len(array) + 4, array.shape[1])) for array in arrays]
    for target, array in zip(doubled, arrays):
        target[: len(array)] = array
    return count, (motion, stress, halves), len(arrays[0]), doubled


def make_small_cloud(name, count, motion, halves):
    basis = make_basis(name, halves)
    cells, places = topology(basis, motion, count, 2)
    return make_cloud(name, 2)._replace(
        basis=basis, halves=halves, motion=motion, cells=cells, places=places, nodes=np.zeros((len(places), 8))
    )


@pytest.mark.parametrize(
    "name, planes", list(zip(BASES, itertools.cycle([(1.0, 2.5), (1.5, None), (None, 2.0), (1.0, None)])))
)
def test_a_mirror_plane_is_the_other_half_of_the_body(name, planes):
    count, (motion, stress, halves), total, (all_motion, all_stress, all_halves) = half_body(name, planes)
    half = make_small_cloud(name, count, motion, halves)
    whole = make_small_cloud(name, total, all_motion, all_halves)
    step = 0.01
    give(half, None, stress)
    give(whole, None, all_stress)
    folds = []
    for d, index in enumerate(planes):
        if index is not None:
            signs = np.ones(8)
            signs[[d, 4 + d]] = -1.0
            folds.append((*mirror(half, d, index, 1), signs))
    for one in folds:
        fold(*one, half.nodes)
    for particle_set in (half, whole):
        accelerate(len(particle_set.nodes), particle_set.nodes, step, LEAST)
    for one in reversed(folds):
        unfold(*one, half.nodes)
    rates = []
    for particle_set in (half, whole):
        rates.append(new_rate(particle_set))
        take(particle_set, 0.9, None, step, rates[-1])
    np.testing.assert_allclose(half.motion[:count], whole.motion[:count], atol=1e-11)
    np.testing.assert_allclose(rates[0][:count], rates[1][:count], atol=1e-9)


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
