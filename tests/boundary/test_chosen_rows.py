"""Which particles a condition means, first at any layout of theirs, and what it says of them at a jump."""

from types import SimpleNamespace

import numpy as np
import pytest
from kinds import table, tables_of
from mpi4py import MPI
from test_rows import contained

from parsolid.boundary.heating import HeatSupply
from parsolid.boundary.loads import accelerations
from parsolid.boundary.mirror_planes import MirrorPlane
from parsolid.boundary.prescribed import NotFree
from parsolid.boundary.rows import Chosen
from parsolid.boundary.surface_loads import Pressed, Pulled, Sprung
from parsolid.exact import SOLUTIONS
from parsolid.particles.container import Particles
from parsolid.particles.generation import generate
from parsolid.scene import load_scene, parse_scene

RUNS = __file__.rpartition("tests")[0] + "runs"


def test_rows_are_looked_up_at_whatever_layout_they_are_asked_for_first():
    for changes in range(4):
        particles = Particles(np.zeros(8, np.int64))
        for _ in range(changes):
            particles.remove(np.array([0]))
        chosen = Chosen(particles, lambda here=particles: np.arange(here.owned) % 2 == 1)
        assert particles.layout == changes and chosen.rows.tolist() == list(range(1, particles.owned, 2))


def test_a_plane_is_meant_for_all_bodies_or_for_one():
    body = np.array([0, 1, 1, 2])
    assert MirrorPlane(0, 0.5, "roller").concerns(body).tolist() == [True] * 4
    assert MirrorPlane(0, 0.5, "roller", 1).concerns(body).tolist() == [False, True, True, False]


@pytest.mark.parametrize("held", [True, False])
def test_what_is_held_or_prescribed_is_not_free(held):
    particles = SimpleNamespace(layout=0, owned=3)
    clamp = np.array([[1.0, 0.0, 1.0, 1.0], [1.0, 1.0, 1.0, 1.0], [0.0, 0.0, 0.0, 0.0]]) if held else None
    prescribed = SimpleNamespace(entries=(np.array([1]), np.array([0])))
    free = NotFree(particles, prescribed, lambda: clamp)
    assert free.mask(2).tolist() == [[False, held], [True, False], [held, held]]
    # nothing is looked up again until rows have changed
    prescribed.entries = (np.zeros(0, int), np.zeros(0, int))
    assert free.mask(2)[1, 0]
    particles.layout, clamp = 1, None
    assert free.mask(2) is None


def test_heat_enters_particles_at_its_plane_and_not_those_of_a_step_behind():
    scene = parse_scene(tables_of("mpm", table("heat_flux")))
    comm, spacing = MPI.COMM_SELF, 0.125
    particle_set = generate(scene, comm)
    # another surface that looks the same way, one spacing farther
    behind = np.isclose(particle_set.position[:, 0], 1.5 * spacing)
    particle_set.area[behind, 0] = particle_set.area[particle_set.position[:, 0] < spacing, 0]
    particles = contained(particle_set)
    rows, power = HeatSupply(scene, particles, False).powers(0, 0.0)
    assert (power > 0.0).all() and rows.tolist() == np.flatnonzero(particle_set.position[:, 0] < spacing).tolist()


def test_a_manufactured_load_is_the_body_force_of_its_solution():
    scene = load_scene(f"{RUNS}/mpm/vortex.toml")
    solution = SOLUTIONS[scene.reference.exact].of_scene(scene)
    chance = np.random.default_rng(3)
    place = chance.uniform(0.8, 1.2, (5, 2)) * [1.0, 0.2]
    particles = Particles(np.zeros(5, np.int64))
    particles.owned_rows = {"reference_position": place, "body": np.zeros(5, np.int64)}.__getitem__
    load = accelerations(scene, particles)
    for time in (0.1, 0.4):
        wanted = solution.body_force(place, time)
        assert np.array_equal(load.at(time)[:, :2], wanted) and np.abs(wanted).max() > 0.0


@pytest.mark.parametrize("d", [2, 3])
def test_forces_on_surfaces_are_those_of_present_areas_and_motions(d):
    chance, rows = np.random.default_rng(d), np.array([1, 3])
    F, A = np.eye(d) + 0.2 * chance.normal(size=(4, d, d)), chance.normal(size=(2, d))
    place, start, velocity = chance.normal(size=(3, 4, d))
    fields = {"position": place, "reference_position": start, "velocity": velocity, "deformation_gradient": F}
    normals, areas = A / np.linalg.norm(A, axis=1)[:, None], np.linalg.norm(A, axis=1)
    surface = SimpleNamespace(
        particles=SimpleNamespace(owned_rows=lambda name: fields[name].reshape(4, -1)),
        chosen=SimpleNamespace(rows=rows),
        vectors=lambda rows: A,
        normals=lambda rows: normals,
        areas=lambda rows: areas,
    )
    course = SimpleNamespace(evaluate=lambda places, time, before: (7.0 + time - before) * np.ones((len(places), 1)))
    found, forces = Pressed(SimpleNamespace(course=course), surface).forces(2.0, True)
    cofactor = np.linalg.det(F)[:, None, None] * np.linalg.inv(F).swapaxes(1, 2)
    assert found is rows
    np.testing.assert_allclose(forces, -8.0 * np.einsum("kij,kj->ki", cofactor[rows], A), rtol=1e-12)
    forces = Pulled(SimpleNamespace(course=course), surface).forces(2.0, False)[1]
    np.testing.assert_allclose(forces, 9.0 * areas[:, None], rtol=1e-12)
    for normal in (False, True):
        one, mass = SimpleNamespace(stiffness=3.0, damping=0.5, normal=normal), np.array([2.0, 5.0])
        sprung = Sprung(one, surface, lambda rows: mass)
        traction = -3.0 * (place - start)[rows] - 0.5 * velocity[rows]
        if normal:
            traction = np.einsum("ki,kj,kj->ki", normals, normals, traction)
        np.testing.assert_allclose(sprung.forces(2.0, False)[1], traction * areas[:, None], rtol=1e-12)
        fastest = max(np.sqrt(3.0 * a / m) + 0.5 * a / m for a, m in zip(areas, mass))
        assert 0.0 < sprung.largest_step < 1.7 / fastest < 2.0 * sprung.largest_step
