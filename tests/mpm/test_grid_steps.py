"""What whole passes must keep: momentum, angular momentum, power; mirror planes against a doubled body; rigid walls;
MUSL; partial sums.
"""

import numpy as np
import pytest
from grid_reference import BASES, ORIGIN, SPACING, make_cloud, mirror, space_of, topology, weights_of
from test_grid_transfers import particles, random_affine, random_stress, run_scatter, symmetric

from parsolid.methods.mpm import grid
from parsolid.methods.mpm.gather import gather
from parsolid.methods.mpm.weights import make_basis
from parsolid.numerics.lanes import aligned_zeros
from parsolid.numerics.layout import Axisymmetric

# where the basis plays no part of its own: the usual one, whose kernels runs have, too
FEW = [("quadratic-spline", 2), ("quadratic-spline", 3)]
NO_GRAVITY, LEAST = np.zeros(4), 1e-12


def run_gather(particle_set, transfer, step, rate, remapped=None, space=None):
    moved = (particle_set.nodes, particle_set.motion, step)
    gather(particle_set.interpolation(space), *moved, transfer, rate, remapped, None)


def new_rate(particle_set):
    return aligned_zeros((len(particle_set.motion), 12))


def tensors(rows, count):
    return rows.reshape(-1, 3, 4)[:count, :, :3]


@pytest.mark.every_other
@pytest.mark.parametrize("dimension", [3, 2])
@pytest.mark.parametrize("name", BASES)
def test_momentum_is_kept(name, dimension):
    for transfer in ("flip", "apic"):
        keeps_momentum(name, dimension, transfer)


def keeps_momentum(name, dimension, transfer):
    particle_set = make_cloud(name, dimension)
    n, affine = particles(particle_set), random_affine(particle_set)
    chosen = grid.Flip(0.9) if transfer == "flip" else grid.Apic(affine)
    momentum = particle_set.motion[:n, 3] @ particle_set.motion[:n, 4:7]
    nodes = run_scatter(particle_set, chosen, grid.CauchyStress(random_stress(particle_set)))
    np.testing.assert_allclose(nodes[:, :3].sum(axis=0), momentum, atol=1e-12)
    np.testing.assert_allclose(nodes[:, 4:7].sum(axis=0), 0.0, atol=1e-11)
    grid.update_nodes(0, len(nodes), nodes, 0.01, NO_GRAVITY, 0.0)
    # a rate that nobody reads: one kernel less to compile
    run_gather(particle_set, chosen, 0.01, new_rate(particle_set))
    np.testing.assert_allclose(particle_set.motion[:n, 3] @ particle_set.motion[:n, 4:7], momentum, atol=1e-11)


@pytest.mark.every_other
@pytest.mark.parametrize("dimension", [3, 2])
@pytest.mark.parametrize("name", BASES)
def test_the_affine_transfer_keeps_angular_momentum(name, dimension):
    particle_set = make_cloud(name, dimension)
    transfer, no_stress = grid.Apic(random_affine(particle_set)), aligned_zeros((len(particle_set.motion), 8))
    found = []
    for _ in range(2):
        nodes = run_scatter(particle_set, transfer, grid.CauchyStress(no_stress))
        found.append(np.cross(particle_set.places[:, :3], nodes[:, :3]).sum(axis=0))
        grid.find_velocities(0, len(nodes), nodes, 0.0)
        run_gather(particle_set, transfer, 0.0, new_rate(particle_set))
    np.testing.assert_allclose(found[1], found[0], atol=1e-11)


@pytest.mark.every_other
@pytest.mark.parametrize("dimension", [3, 2])
@pytest.mark.parametrize("name", BASES)
def test_forces_and_velocity_gradients_have_the_same_power(name, dimension):
    particle_set = make_cloud(name, dimension)
    n, stress = particles(particle_set), random_stress(particle_set)
    axisymmetric = name in ("linear", "quadratic-spline") and dimension == 2
    for space in (space_of(dimension), Axisymmetric())[: 1 + axisymmetric]:
        force = run_scatter(particle_set, grid.Flip(1.0), grid.CauchyStress(stress), space=space)[:, 4:7].copy()
        particle_set.nodes[:, :dimension] = np.random.default_rng(9).normal(size=(len(force), dimension))
        rate = new_rate(particle_set)
        run_gather(particle_set, None, 0.0, rate, space=space)
        power = (symmetric(stress[:n]) * tensors(rate, n)).sum()
        assert (force * particle_set.nodes[:, :3]).sum() == pytest.approx(-power, rel=1e-11)


@pytest.mark.parametrize("name", ["linear", "quadratic-spline"])
def test_hoop_stress_and_hoop_rate(name):
    particle_set = make_cloud(name, 2)
    n, stress = particles(particle_set), random_stress(particle_set)
    stress[:, [0, 1, 6]] = 0.0
    w, _, _ = weights_of(particle_set, name)
    radius = particle_set.motion[:n, 0].copy()
    nodes = run_scatter(particle_set, grid.Flip(1.0), grid.CauchyStress(stress), space=Axisymmetric())
    np.testing.assert_allclose(nodes[:, 4], -w.T @ (stress[:n, 2] / radius), atol=1e-12)
    assert not nodes[:, 5:7].any()
    grid.update_nodes(0, len(nodes), nodes, 0.01, NO_GRAVITY, 0.0)
    rate = new_rate(particle_set)
    run_gather(particle_set, None, 0.0, rate, space=Axisymmetric())
    np.testing.assert_allclose(tensors(rate, n)[:, 2, 2], (w @ nodes[:, 0]) / radius, atol=1e-12)


@pytest.mark.parametrize("name, dimension", FEW)
def test_first_piola_kirchhoff_stress(name, dimension):
    particle_set = make_cloud(name, dimension)
    rows = random_affine(particle_set)
    _, gradient, _ = weights_of(particle_set, name)
    force = -np.einsum("pab,pib->ia", tensors(rows, particles(particle_set)), gradient)
    whole = run_scatter(particle_set, grid.Flip(1.0), grid.FirstPiolaKirchhoffStress(rows), None)
    np.testing.assert_allclose(whole[:, 4:7], force, atol=2e-12)
    alone = run_scatter(particle_set, grid.Flip(1.0), grid.FirstPiolaKirchhoffStress(rows), None, motion=False)
    np.testing.assert_allclose(alone[:, 4:7], force, atol=2e-12)
    assert not alone[:, :4].any()


@pytest.mark.parametrize("name, dimension", FEW)
def test_partial_sums_of_cells_add_up_to_the_same_bits(name, dimension):
    particle_set = make_cloud(name, dimension)
    stress = grid.CauchyStress(random_stress(particle_set))
    whole = run_scatter(particle_set, grid.Flip(1.0), stress, None).copy()
    partials = aligned_zeros((*particle_set.grid.stencil.shape, 8))
    nodes = run_scatter(particle_set, grid.Flip(1.0), stress, None, partials=partials)
    assert not nodes.any()
    for cell, slots in zip(partials, particle_set.grid.stencil):
        nodes[slots] += cell
    np.testing.assert_array_equal(nodes, whole)


@pytest.mark.parametrize("name, dimension", FEW)
def test_velocities_mapped_back_move_nothing_else(name, dimension):
    """MUSL: positions go with the new nodal velocities, gradients are those of the particles' velocities on
    the grid.
    """
    particle_set = make_cloud(name, dimension)
    n, step = particles(particle_set), 0.01
    w, gradient, _ = weights_of(particle_set, name)
    before = particle_set.motion[:n].copy()
    nodes = run_scatter(particle_set, grid.Flip(1.0), grid.CauchyStress(random_stress(particle_set)), None).copy()
    particle_set.nodes[:] = nodes
    grid.update_nodes(0, len(nodes), particle_set.nodes, step, NO_GRAVITY, 0.0)
    moved = particle_set.nodes.copy()
    run_gather(particle_set, grid.Flip(1.0), step, None)
    np.testing.assert_array_equal(particle_set.motion[:n, :4], before[:, :4])
    remapped = run_scatter(particle_set, grid.Flip(1.0), None, None).copy()
    grid.find_velocities(0, len(nodes), remapped, LEAST)
    momentum, mass = w.T @ (before[:, 3:4] * particle_set.motion[:n, 4:7]), (w.T @ before[:, 3])[:, None]
    wanted = np.divide(momentum, mass, where=mass > LEAST, out=np.zeros_like(momentum))
    np.testing.assert_allclose(remapped[:, :3], wanted, atol=1e-11)
    particle_set.nodes[:] = moved
    rate, velocity = new_rate(particle_set), particle_set.motion[:n, 4:].copy()
    run_gather(particle_set, None, step, rate, remapped)
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
        aligned_zeros((count + 4, 8)),
        aligned_zeros((count + 4, 8)),
        aligned_zeros((count + 4, 4)) + 0.5,
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
    doubled = [aligned_zeros((len(array) + 4, array.shape[1])) for array in arrays]
    for target, array in zip(doubled, arrays):
        target[: len(array)] = array
    return count, (motion, stress, halves), len(arrays[0]), doubled


def make_small_cloud(name, count, motion, halves):
    basis = make_basis(name, halves)
    cells, places = topology(basis, motion, count, 2)
    return make_cloud(name, 2)._replace(
        basis=basis, halves=halves, motion=motion, grid=cells, places=places, nodes=aligned_zeros((len(places), 8))
    )


@pytest.mark.every_other
@pytest.mark.parametrize("planes", [(1.0, None), (1.5, None), (None, 2.0), (1.0, 2.5)])
@pytest.mark.parametrize("name", BASES)
def test_a_mirror_plane_is_the_other_half_of_the_body(name, planes):
    count, (motion, stress, halves), total, (all_motion, all_stress, all_halves) = half_body(name, planes)
    half = make_small_cloud(name, count, motion, halves)
    whole = make_small_cloud(name, total, all_motion, all_halves)
    step = 0.01
    run_scatter(half, grid.Flip(1.0), grid.CauchyStress(stress))
    run_scatter(whole, grid.Flip(1.0), grid.CauchyStress(all_stress))
    folds = []
    for d, index in enumerate(planes):
        if index is not None:
            signs = np.ones((1, 8))
            signs[0, [d, 4 + d]] = -1.0
            folds.append((*mirror(half, d, index, 1), signs))
    for fold in folds:
        grid.fold_mirror(*fold, half.nodes)
    for particle_set in (half, whole):
        grid.update_nodes(0, len(particle_set.nodes), particle_set.nodes, step, NO_GRAVITY, LEAST)
    for fold in reversed(folds):
        grid.spread_mirror(*fold, half.nodes)
    rates = []
    for particle_set in (half, whole):
        rates.append(new_rate(particle_set))
        run_gather(particle_set, grid.Flip(0.9), step, rates[-1])
    np.testing.assert_allclose(half.motion[:count], whole.motion[:count], atol=1e-11)
    np.testing.assert_allclose(rates[0][:count], rates[1][:count], atol=1e-9)


@pytest.mark.parametrize("dimension", [2, 3])
def test_light_nodes_stand_still_and_gravity_adds_to_all_others(dimension):
    particle_set = make_cloud("quadratic-spline", dimension)
    nodes = run_scatter(particle_set, grid.Flip(1.0), None, None)
    least = float(np.median(nodes[:, 3]))
    mass, velocity = nodes[:, 3].copy(), nodes[:, :3] / np.maximum(nodes[:, 3:4], 1e-300)
    gravity = np.array([1.0, -2.0, 0.5, 0.0])
    grid.update_nodes(0, len(nodes), nodes, 0.1, gravity, least)
    light = mass <= least
    assert light.any() and not nodes[light].any()
    np.testing.assert_allclose(nodes[~light, :3], velocity[~light] + 0.1 * gravity[:3], atol=1e-13)
    np.testing.assert_allclose(nodes[~light, 4:7], np.tile(0.1 * gravity[:3], ((~light).sum(), 1)), atol=1e-15)
    np.testing.assert_array_equal(nodes[~light, 3], mass[~light])


@pytest.mark.parametrize("sticking", [0.0, 1.0])
def test_a_rigid_wall(sticking):
    """Nodes behind the wall take its normal velocity if they approach it, all of it if they stick; the impulse is what
    they got.
    """
    random = np.random.default_rng(1)
    places, nodes = random.uniform(-1.0, 1.0, (200, 4)), random.normal(size=(200, 8))
    nodes[:, 3] = random.uniform(0.0, 1.0, 200)
    nodes[:20, 3] = 0.0
    share = random.uniform(0.0, 1.0, 200)
    normal = np.array([0.6, 0.8, 0.0, 0.0])
    wall = grid.RigidWall(np.array([0.1, 0.2, 0.3, 0.0]), normal, np.array([1.0, -0.5, 0.3, 0.0]), sticking)
    before = nodes.copy()
    found = np.zeros(200, bool)
    *impulse, lost = grid.obey_wall(0, 200, nodes, places, share, found, nodes, False, wall)
    behind = ((places - wall.point)[:, :3] @ normal[:3] <= 0.0) & (nodes[:, 3] > 0.0)
    relative = before[:, :3] - wall.velocity[:3]
    approach = relative @ normal[:3]
    if sticking:
        held, wanted = behind, np.tile(wall.velocity[:3], (200, 1))
    else:
        held, wanted = behind & (approach < 0.0), before[:, :3] - approach[:, None] * normal[:3]
    assert held.any() and (behind & ~held).any() != bool(sticking)
    np.testing.assert_array_equal(found, held)
    np.testing.assert_allclose(nodes[held, :3], wanted[held], atol=1e-14)
    np.testing.assert_array_equal(nodes[~held], before[~held])
    gained = nodes[:, :3] - before[:, :3]
    np.testing.assert_allclose(nodes[:, 4:7] - before[:, 4:7], gained, atol=1e-14)
    set_by_wall = nodes[held, 4:7] if sticking else nodes[held, 4:7] @ normal[:3, None]
    np.testing.assert_allclose(lost, 0.5 * (share * nodes[:, 3])[held] @ (set_by_wall**2).sum(axis=1), rtol=1e-13)
    np.testing.assert_allclose(impulse, (share * nodes[:, 3]) @ gained, atol=1e-13)
    again = random.normal(size=(200, 8))
    again[:, 3] = nodes[:, 3]
    free = again.copy()
    lost = grid.obey_wall(0, 200, again, places, share, found, nodes, True, wall)[3]
    # the nodes that the motion held and no others, those that would leave included
    np.testing.assert_allclose((again[held, :3] - wall.velocity[:3]) @ normal[:3], 0.0, atol=1e-14)
    np.testing.assert_array_equal(again[~held], free[~held])
    kept = ((again - free)[:, :3] * nodes[:, 4:7]).sum(axis=1)
    np.testing.assert_allclose(lost, 0.5 * (share * nodes[:, 3]) @ kept, rtol=1e-12)
