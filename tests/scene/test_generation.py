"""Particles of every shape: exact volumes, closed surfaces, ids that do not depend on the number of ranks."""

import itertools
import math

import numpy as np
import pytest

from parsolid.particles.fillings import filling_of
from parsolid.particles.generation import generate
from parsolid.particles.initial_fields import initial_deformation_gradient, initial_displacement, initial_velocity
from parsolid.particles.regions import nearest_particles, selected
from parsolid.scene import parse_scene

MATERIAL = {"kind": "mooney-rivlin", "density": 1100.0, "youngs_modulus": 17e6, "poissons_ratio": 0.45}
BOX = {"box": {"lower": [-1.0, 0.0, 2.0], "upper": [1.0, 3.0, 3.0]}}
RECTANGLE = {"box": {"lower": [-1.0, 0.0], "upper": [1.0, 3.0]}}
SECTOR = {"axis": "Y", "base": [1.0, 2.0, 3.0], "radius": 2.0, "thickness": 0.5, "length": 4.0, "angles": [0.0, 90.0]}
TUBE = {**SECTOR, "angles": [30.0, 390.0]}
RING = {"centre": [1.0, 2.0], "radius": 2.0, "thickness": 0.5}
BALL = {"sphere": {"centre": [1.0, 2.0, 3.0], "radius": 2.0}}
ROD = {"base": [0.0, 1.0, 2.0], "axis": "X", "radius": 1.0, "length": 5.0}
TUBE_VOLUME = 2.0 * math.pi * 2.0 * 0.5 * 4.0

# dimension, shape, filling, exact volume
FILLED = {
    "box nodes": (3, BOX, {"particles": [5, 4, 3]}, 6.0),
    "box cells": (3, BOX, {"particles": [5, 4, 3], "placement": "cells"}, 6.0),
    "box spacing": (3, BOX, {"spacing": 0.3}, 6.0),
    "box spacings": (3, BOX, {"spacing": [0.3, 0.5, 0.2], "placement": "cells"}, 6.0),
    "box jittered": (3, BOX, {"particles": [5, 4, 3], "jitter": 0.2, "seed": 3}, 6.0),
    "single layer": (3, BOX, {"particles": [5, 4, 1]}, 6.0),
    "rectangle": (2, RECTANGLE, {"particles": [5, 4]}, 6.0),
    "sector cells": (3, {"cylindrical_shell": SECTOR}, {"particles": [9, 5, 3], "placement": "cells"}, TUBE_VOLUME / 4),
    "tube": (3, {"cylindrical_shell": TUBE}, {"particles": [24, 5, 3]}, TUBE_VOLUME),
    "tube spacing": (3, {"cylindrical_shell": TUBE}, {"spacing": [0.4, 1.0, 0.25], "jitter": 0.1}, TUBE_VOLUME),
    "ring": (2, {"cylindrical_shell": RING}, {"particles": [24, 3]}, TUBE_VOLUME / 4),
    "half ring": (2, {"cylindrical_shell": {**RING, "angles": [0.0, 180.0]}}, {"particles": [24, 3]}, TUBE_VOLUME / 8),
    "rod": (3, {"cylinder": ROD}, {"spacing": 0.2}, 5.0 * math.pi),
    "sector nodes": (3, {"cylindrical_shell": SECTOR}, {"particles": [9, 5, 3]}, TUBE_VOLUME / 4),
    "rod odd": (3, {"cylinder": ROD}, {"particles": [4, 9, 9], "jitter": 0.2}, 5.0 * math.pi),
    "half rod": (3, {"cylinder": {**ROD, "part": "half"}}, {"spacing": 0.2}, 2.5 * math.pi),
    "quarter rod": (3, {"cylinder": {**ROD, "part": "quarter"}}, {"spacing": 0.1}, 1.25 * math.pi),
    "ball": (3, BALL, {"spacing": 0.3}, 32.0 / 3.0 * math.pi),
    "ball odd": (3, BALL, {"particles": [9, 11, 13]}, 32.0 / 3.0 * math.pi),
    "two particles": (2, RECTANGLE, {"particles": [2, 1]}, 6.0),
    "disc": (2, {"sphere": {"centre": [1.0, 2.0], "radius": 2.0}}, {"spacing": 0.11}, 4.0 * math.pi),
}


def whole(scene, comm):
    """All particles on every rank, in the order of their ids; only for the small clouds of tests."""
    particle_set = generate(scene, comm)
    names = ("identifier", "position", "volume", "spacing", "body", "area")
    return {name: np.concatenate(comm.allgather(getattr(particle_set, name))) for name in names}


@pytest.mark.parametrize(("dimension", "shape", "filling", "volume"), FILLED.values(), ids=FILLED)
def test_particles_of_a_shape(scene_of, comm, dimension, shape, filling, volume):
    """Their volume is exact, their surface closed, they lie within the bounds, and any pieces make the whole."""
    scene = scene_of(dimension, shape, **filling)
    particle_set, one = whole(scene, comm), filling_of(scene.bodies[0], dimension)
    position, area = particle_set["position"], particle_set["area"]
    assert particle_set["volume"].sum() == pytest.approx(volume, rel=1e-13)
    np.testing.assert_array_equal(particle_set["identifier"], np.arange(one.count))
    assert len(np.unique(position, axis=0)) == one.count
    assert (position >= one.lower - 1e-12).all() and (position <= one.upper + 1e-12).all()
    # the chords of a sector's particles close up to the rule's error in the angle
    sector = "cylindrical_shell" in shape and filling.get("particles", [0])[0] == 9
    assert np.abs(area.sum(axis=0)).max() <= (5e-3 if sector else 1e-3) * np.abs(area).sum()
    for parts in (1, 2, 7):
        ends = [one.count * i // parts for i in range(parts + 1)]
        pieces = [filling_of(scene.bodies[0], dimension).piece(a, b) for a, b in itertools.pairwise(ends)]
        for name in ("identifier", "position", "volume", "spacing", "area"):
            np.testing.assert_array_equal(np.concatenate([getattr(p, name) for p in pieces]), particle_set[name])


def test_ranks_have_equal_contiguous_shares(cube, comm):
    box = {"box": {"lower": [5.0, 0.0, 0.0], "upper": [6.0, 1.0, 1.0]}}
    cube["bodies"].append(cube["bodies"][0] | {"name": "other", "shape": box, "particles": [4, 4, 4]})
    particle_set = generate(parse_scene(cube), comm)
    total = 3 * 5 * 7 + 64
    np.testing.assert_array_equal(
        particle_set.identifier, np.arange(total * comm.rank // comm.size, total * (comm.rank + 1) // comm.size)
    )
    np.testing.assert_array_equal(particle_set.body, particle_set.identifier >= 105)
    assert (particle_set.position[particle_set.body == 1, 0] >= 5.0).all()


def test_box_areas_sum_to_its_faces(scene_of, comm):
    for placement in ("vertices", "cells"):
        particle_set = whole(scene_of(3, BOX, particles=[5, 4, 3], placement=placement), comm)
        np.testing.assert_allclose(np.maximum(particle_set["area"], 0.0).sum(axis=0), [3.0, 2.0, 6.0], rtol=1e-14)
        np.testing.assert_allclose(np.minimum(particle_set["area"], 0.0).sum(axis=0), [-3.0, -2.0, -6.0], rtol=1e-14)


def test_corner_of_a_box(scene_of, comm):
    particle_set = whole(scene_of(3, BOX, particles=[5, 4, 3]), comm)
    np.testing.assert_array_equal(particle_set["position"][0], [-1.0, 0.0, 2.0])
    np.testing.assert_allclose(particle_set["spacing"][0], [0.5, 1.0, 0.5])
    assert particle_set["volume"][0] == pytest.approx(0.5 * 1.0 * 0.5 / 8)
    np.testing.assert_allclose(particle_set["area"][0], [-1.0 * 0.5 / 4, -0.5 * 0.5 / 4, -0.5 * 1.0 / 4])


def test_spacing_that_does_not_fit_is_rounded(scene_of):
    one = filling_of(scene_of(2, RECTANGLE, spacing=0.7).bodies[0], 2)
    assert one.shape == (4, 5)
    np.testing.assert_allclose(one.piece(0, 1).spacing, [[2.0 / 3.0, 0.75]])


def test_shell_follows_its_axes(scene_of):
    one = filling_of(scene_of(3, {"cylindrical_shell": SECTOR}, particles=[9, 5, 3]).bodies[0], 3)
    particle_set = one.piece(0, one.count)
    np.testing.assert_allclose(
        particle_set.axes @ particle_set.axes.transpose(0, 2, 1), np.tile(np.eye(3), (one.count, 1, 1)), atol=1e-15
    )
    radial = (particle_set.position - [1.0, 2.0, 3.0]) * [1.0, 0.0, 1.0]
    radius = np.linalg.norm(radial, axis=1)
    np.testing.assert_allclose(particle_set.axes[:, 2], radial / radius[:, None], atol=1e-15)
    np.testing.assert_array_equal(particle_set.axes[:, 1], np.tile([0.0, 1.0, 0.0], (one.count, 1)))
    np.testing.assert_allclose(particle_set.spacing[:, 0], radius * (math.pi / 2) / 8, rtol=1e-14)
    # about Y the angle runs from Z to X; the ends lie on the planes of symmetry exactly
    np.testing.assert_array_equal(particle_set.position[:15, 0], 1.0)
    np.testing.assert_array_equal(particle_set.position[-15:, 2], 3.0)
    np.testing.assert_allclose(one.lower, [1.0, 2.0, 3.0], atol=1e-15)
    np.testing.assert_allclose(one.upper, [3.25, 6.0, 5.25])


def test_shell_areas(scene_of):
    one = filling_of(scene_of(3, {"cylindrical_shell": TUBE}, particles=[24, 5, 3], placement="cells").bodies[0], 3)
    particle_set = one.piece(0, one.count)
    outward = (particle_set.area * particle_set.axes[:, 2]).sum(axis=1)
    assert outward[outward > 0].sum() == pytest.approx(2.0 * math.pi * 2.25 * 4.0)
    assert outward[outward < 0].sum() == pytest.approx(-2.0 * math.pi * 1.75 * 4.0)
    assert particle_set.area[:, 1].max() > 0 and np.maximum(particle_set.area[:, 1], 0).sum() == pytest.approx(
        2.0 * math.pi * 2.0 * 0.5
    )


def test_clipped_shapes_are_where_they_should_be(scene_of):
    body = scene_of(3, FILLED["ball"][1], **FILLED["ball"][2]).bodies[0]
    one = filling_of(body, 3)
    position = one.piece(0, one.count).position - [1.0, 2.0, 3.0]
    lattice = [line.coordinate(np.arange(line.count)) for line in one.lines]
    grid = np.stack(np.meshgrid(*lattice, indexing="ij"), axis=-1).reshape(-1, 3) - [1.0, 2.0, 3.0]
    inside = grid[(grid**2).sum(axis=1) < 4.0]
    assert sorted(map(tuple, position.round(12))) == sorted(map(tuple, inside.round(12)))
    assert np.abs(position.mean(axis=0)).max() < 1e-13
    assert one.volume == pytest.approx((4.0 / 13.0) ** 3, rel=0.05)


def test_rod_ends_have_the_exact_area(scene_of):
    one = filling_of(scene_of(3, {"cylinder": ROD}, spacing=0.2).bodies[0], 3)
    area = one.piece(0, one.count).area
    assert np.maximum(area[:, 0], 0.0).sum() == pytest.approx(math.pi, rel=1e-13)
    assert np.maximum(area[:, 1], 0.0).sum() == pytest.approx(2.0 * 5.0, rel=0.02)


def test_jitter_moves_inner_particles_only_and_evenly(scene_of):
    def of(dimension, shape, count, **more):
        return filling_of(scene_of(dimension, shape, **more).bodies[0], dimension).piece(0, count)

    smooth = of(3, BOX, 60, particles=[5, 4, 3])
    moved, other = (of(3, BOX, 60, particles=[5, 4, 3], jitter=0.3, seed=seed) for seed in (0, 1))
    steps = (moved.position - smooth.position) / smooth.spacing
    inner = (smooth.area == 0.0).all(axis=1)
    assert (steps[~inner] == 0.0).all()
    assert 0.05 < np.abs(steps[inner]).max() <= 0.3
    assert (other.position[inner] != moved.position[inner]).all()

    cells = {"particles": [300, 300], "placement": "cells"}
    moved, smooth = of(2, RECTANGLE, 90_000, jitter=0.4, **cells), of(2, RECTANGLE, 90_000, **cells)
    steps = (moved.position - smooth.position) / smooth.spacing
    assert np.abs(steps.mean(axis=0)).max() < 3e-3
    np.testing.assert_allclose(steps.std(axis=0), 0.4 / math.sqrt(3.0), rtol=0.01)
    assert abs(np.corrcoef(steps.T)[0, 1]) < 0.01 and abs(np.corrcoef(steps[1:, 0], steps[:-1, 0])[0, 1]) < 0.01


def test_initial_fields(cube, comm):
    cube["bodies"][0] |= {"velocity": ["Y", "0", "-X"], "displacement": ["0.1*X", "0", "0"]}
    beside = {"box": {"lower": [1.0, 0.0, 0.0], "upper": [2.0, 1.0, 1.0]}}
    second = {"shape": beside, "particles": [2, 2, 2], "material": MATERIAL}
    second["deformation_gradient"] = [["2", "X", "0"], ["0", "1", "0"], ["0", "0", "1"]]
    cube["bodies"].append(second)
    scene = parse_scene(cube | {"bond": [{"bodies": "all"}]})
    particle_set = generate(scene, comm)
    velocity = initial_velocity(scene, particle_set.body, particle_set.position)
    first = particle_set.body == 0
    np.testing.assert_array_equal(velocity[first, 0], particle_set.position[first, 1])
    assert (velocity[~first] == 0.0).all()
    np.testing.assert_allclose(
        initial_displacement(scene, particle_set.body, particle_set.position)[first, 0],
        0.1 * particle_set.position[first, 0],
    )
    gradient, given = initial_deformation_gradient(scene, particle_set.body, particle_set.position)
    np.testing.assert_array_equal(given, ~first)
    np.testing.assert_array_equal(gradient[~first, 0, 1], particle_set.position[~first, 0])
    assert (gradient[first] == np.eye(3)).all()


FIXED = ["0", "0", "0"]
REGIONS = {
    "plane": ({"kind": "fixed", "plane": "Y = 2"}, 3 * 7),
    "inner plane": ({"kind": "velocity", "plane": "Y = 1", "velocity": FIXED}, 3 * 7),
    "box": ({"kind": "velocity", "box": {"lower": [0.0, 0.0, 0.0], "upper": [0.5, 0.5, 0.5]}, "velocity": FIXED}, 8),
    "ball": ({"kind": "velocity", "ball": {"centre": [0.5, 1.0, 1.5], "radius": 0.5}, "velocity": FIXED}, 7),
    "point": ({"kind": "velocity", "point": [0.4, 1.1, 1.5], "velocity": FIXED}, 1),
    "tied point": ({"kind": "velocity", "point": [0.25, 0.25, 0.25], "velocity": FIXED}, 1),
    "traction": ({"kind": "traction", "plane": "X = 1", "traction": FIXED}, 5 * 7),
    "other body": ({"kind": "velocity", "plane": "Y = 1", "velocity": FIXED, "body": "other"}, 16),
}


@pytest.mark.parametrize(("boundary", "number"), REGIONS.values(), ids=REGIONS)
def test_regions(cube, comm, boundary, number):
    other = {"lower": [5.0, 0.0, 0.0], "upper": [6.0, 1.0, 1.0]}
    if boundary.get("body"):
        cube["bodies"].append({"name": "other", "shape": {"box": other}, "particles": [4, 4, 4], "material": MATERIAL})
    cube["boundaries"] = [boundary]
    scene = parse_scene(cube)
    mask = selected(scene, scene.boundaries[0], generate(scene, comm), comm)
    assert comm.allreduce(int(mask.sum())) == number


@pytest.mark.parametrize("jitter", [0.0, 0.3])
def test_plane_of_cells(cube, comm, jitter):
    cube["bodies"][0] |= {"placement": "cells", "jitter": jitter}
    cube["boundaries"] = [{"kind": "roller", "plane": "Y = 2"}]
    scene = parse_scene(cube)
    particle_set = generate(scene, comm)
    mask = selected(scene, scene.boundaries[0], particle_set, comm)
    np.testing.assert_array_equal(mask, particle_set.area[:, 1] > 0.0)


def test_nearest_particles(cube, comm):
    particle_set = generate(parse_scene(cube), comm)
    names, distance = nearest_particles(
        comm, particle_set.identifier, particle_set.position, [[0.0, 0.0, 0.0], [9.0, 2.0, 3.0], [0.25, 0.0, 0.0]]
    )
    np.testing.assert_array_equal(names, [0, 104, 0])
    np.testing.assert_allclose(distance, [0.0, 8.0, 0.25])


def test_large_lattice_is_made_in_pieces_only(scene_of):
    huge = filling_of(scene_of(3, BOX, particles=[4000, 4000, 4000]).bodies[0], 3)
    assert huge.count == 64 * 10**9
    piece = huge.piece(huge.count - 10, huge.count)
    np.testing.assert_array_equal(piece.position[-1], [1.0, 3.0, 3.0])


def test_four_quarters_are_a_whole_rod(scene_of, comm):
    """A quarter has the whole rod's particles above both planes, with the same volumes."""
    rods = {
        part: whole(scene_of(3, {"cylinder": {**ROD, "part": part}}, spacing=0.2), comm)
        for part in ("whole", "quarter")
    }
    kept = (rods["whole"]["position"][:, 1] > 1.0) & (rods["whole"]["position"][:, 2] > 2.0)
    np.testing.assert_allclose(rods["quarter"]["position"], rods["whole"]["position"][kept], atol=1e-12)
    np.testing.assert_allclose(rods["quarter"]["volume"], rods["whole"]["volume"][kept], rtol=1e-12)


@pytest.mark.parametrize(
    "filling, coarsest",
    [
        ({"spacing": [0.2, 0.5], "placement": "cells"}, 0.5),
        ({"spacing": [0.5, 0.2], "placement": "cells"}, 0.5),
        # of 8 steps each is 4^(1/8) of the one before
        ({"particles": [9, 9], "grading": [[1.0], [1.0, 4.0]]}, 3.0 * (1.0 - 4.0 ** (-1 / 8)) / (1.0 - 0.25)),
    ],
)
def test_the_coarsest_spacing_is_that_of_the_widest_step(filling, coarsest):
    body = {"shape": RECTANGLE, "material": MATERIAL} | filling
    method = {"kind": "tlsph", "weights": "best", "integrator": "leapfrog"}
    scene = parse_scene({"dimension": 2, "end_time": 1.0, "method": method, "bodies": [body]})
    whole_box = filling_of(scene.bodies[0], 2)
    assert whole_box.coarsest == pytest.approx(coarsest)
    places = whole_box.piece(0, whole_box.count).position
    assert max(np.diff(np.unique(places[:, axis])).max() for axis in (0, 1)) == pytest.approx(coarsest)
