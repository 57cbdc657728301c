"""Forces of tools against numerical derivatives of their energy, for every shape; distances of meshes against boxes."""

import numpy as np
import pytest

from parsolid.contact.friction import gap_correction
from parsolid.contact.tools.forces import RESULTANT, Particles, RigidShape, press
from parsolid.contact.tools.rigid_body import rotation_matrix, turn
from parsolid.contact.tools.shapes import BALL, BOX, CYLINDER, MESH, PLANE, Shape, distance
from parsolid.contact.tools.surface import make_surface

CORNERS = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.3, 0.3) for z in (-0.2, 0.2)])
FACES = [[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6], [0, 6, 4]]
BALL_SHAPE, ROD = Shape(BALL, size=(0.4, 0.0, 0.0)), Shape(CYLINDER, (0.0, 0.0, 1.0), (0.3, 0.25, 0.0))
BLOCK = Shape(BOX, size=(0.5, 0.3, 0.2))
BLOCK_OF_TRIANGLES = Shape(MESH, surface=make_surface(CORNERS, np.array([*FACES, [1, 5, 7], [1, 7, 3]])))
SHAPES = {
    "plane": Shape(PLANE, (0.6, 0.0, 0.8)),
    "ball": BALL_SHAPE,
    "rod": ROD,
    "block": BLOCK,
    "mesh": BLOCK_OF_TRIANGLES,
}
WALL = Shape(PLANE, (1.0, 0.0, 0.0))
PLACE, ROTATION = np.array([0.1, -0.05, 0.02]), rotation_matrix(turn(np.array([2.0, 1.0, 2.0]) / 3.0, 0.8))
HERE = np.zeros(3), np.eye(3)


def pressed(shape, places, friction=0.0, record=None, follows=True, level=None, frame=(PLACE, ROTATION), **more):
    """Forces, impulses over a time of 1 s (n, 3), their sums, and what `press` returns; particles of radius 0.1 and
    stiffness 3; level: depths at the start of the step. more: speed, longest and velocity."""
    n = len(places)
    force, impulse = np.zeros((2, n, 3))
    velocity, level, known = (
        more.get("velocity", np.zeros((n, 3))),
        np.zeros(n) if level is None else level,
        level is not None,
    )
    numbers = np.full(n, 0.1), np.full(n, 3.0), more.get("square", np.zeros(n)), level
    record = np.zeros((0, 0)) if record is None else record
    particles = Particles(
        n, np.zeros(n, np.int64), np.ones(1, bool), places, velocity, *numbers, record, force, impulse, np.zeros(n)
    )
    tool = RigidShape(shape, *frame, 2.0, friction, more.get("speed", 0.0), more.get("longest", 0.0))
    sums = np.zeros(1, RESULTANT)
    found = press(tool, particles, 0.0, known, follows, 1.0, sums)
    return force, impulse, sums[0], found


@pytest.mark.parametrize("name", SHAPES)
def test_the_force_is_the_gradient_of_the_energy(name):
    shape, places = SHAPES[name], np.random.default_rng(3).uniform(-0.7, 0.7, (60, 3))
    found, _, sums, _ = pressed(shape, places)
    assert np.abs(found).max(axis=1).astype(bool).sum() > 5
    step, wrong = 1e-6, 0
    for i in range(len(places)):
        for k in range(3):
            moved = places.copy()
            moved[i, k] += step
            ahead = pressed(shape, moved)[2]["stored"]
            moved[i, k] -= 2.0 * step
            slope = -(ahead - pressed(shape, moved)[2]["stored"]) / (2.0 * step)
            wrong += abs(found[i, k] - slope) > 1e-6
    assert wrong == 0
    assert np.allclose(sums["force"], found.sum(axis=0))
    assert np.allclose(sums["moment"], np.cross(places - PLACE, found).sum(axis=0))


def test_friction_sticks_as_a_spring_and_slips_at_its_limit():
    place, rubs = np.array([[0.05, 0.0, 0.0]]), {"friction": 0.2, "record": np.zeros((1, 7))}
    normal = pressed(WALL, place, **rubs)[0]
    along = ROTATION @ np.array([0.0, 0.6, 0.8])
    stuck, _, sums, _ = pressed(WALL, place + 1e-4 * along, **rubs)
    assert np.allclose(sums["force"], stuck[0]) and np.allclose(
        sums["moment"], np.cross(place[0] + 1e-4 * along - PLACE, stuck[0])
    )
    assert np.allclose(stuck - normal, -0.5 * 6.0 * 1e-4 * along[None], atol=1e-12) and sums["lost"] == 0.0
    assert abs(sums["stuck"] - 0.25 * 6.0 * 1e-8) < 1e-18
    slid, _, sums, _ = pressed(WALL, place + along, **rubs)
    assert abs(np.linalg.norm(slid - normal) - 0.2 * np.linalg.norm(normal)) < 1e-12 and sums["lost"] > 0.0
    assert np.array_equal(pressed(WALL, place + along, follows=False, **rubs)[0], slid)


def test_a_box_of_triangles_is_a_box():
    places = np.random.default_rng(1).uniform(-0.8, 0.8, (300, 3))
    assert np.allclose(pressed(BLOCK_OF_TRIANGLES, places)[0], pressed(BLOCK, places)[0], atol=1e-9)


def test_distances_are_negative_inside_and_those_of_the_surface_outside():
    third = 3.0**-0.5
    wanted = [
        (BALL_SHAPE, (0.0, 0.0, 0.0), -0.4),
        (BALL_SHAPE, (0.3, 0.0, 0.4), 0.1),
        (Shape(PLANE, (third, third, third)), (0.1, 0.2, -0.4), -0.1 * third),
        (ROD, (0.0, 0.0, 0.0), -0.25),
        (ROD, (0.28, 0.0, 0.1), -0.02),
        (ROD, (0.6, 0.0, 0.65), 0.5),
        (BLOCK, (0.0, 0.0, 0.15), -0.05),
        (BLOCK, (0.8, 0.7, 0.2), 0.5),
        (BLOCK_OF_TRIANGLES, (0.0, 0.0, 0.15), -0.05),
        (BLOCK_OF_TRIANGLES, (0.8, 0.7, 0.2), 0.5),
    ]
    for shape, place, away in wanted:
        found, *normal = distance(shape, *place, np.inf)
        assert found == pytest.approx(away, abs=1e-12), (shape, place)
        assert np.linalg.norm(normal) == pytest.approx(1.0)


def test_the_nearest_place_of_oblique_triangles():
    """Of tetrahedra: the nearest of the feet on planes and edges of their faces."""
    chance, faces = np.random.default_rng(4), np.array([[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]])
    for _ in range(20):
        points = chance.normal(size=(4, 3))
        if np.linalg.det(points[1:] - points[0]) < 0.0:
            points = points[[1, 0, 2, 3]]
        shape = Shape(MESH, surface=make_surface(points, faces))
        for place in 3.0 * chance.normal(size=(40, 3)):
            feet, heights = [], []
            for corners in points[faces]:
                edges = np.roll(corners, -1, axis=0) - corners
                normal = np.cross(edges[0], edges[1])
                heights.append((place - corners[0]) @ normal)
                foot = place - normal * heights[-1] / (normal @ normal)
                if (np.cross(edges, foot - corners) @ normal >= 0.0).all():
                    feet.append(foot)
                along = np.einsum("ij,ij->i", place - corners, edges) / (edges**2).sum(axis=1)
                feet.extend(corners + np.clip(along, 0.0, 1.0)[:, None] * edges)
            away = np.linalg.norm(place - feet, axis=1).min()
            wanted = away if max(heights) > 0.0 else -away
            assert distance(shape, *place, np.inf)[0] == pytest.approx(wanted, abs=1e-12)


def test_particles_that_the_tool_reaches_limit_the_step():
    """Of three particles at 0.1, 0.3 and 0.9 from a half-space, by the speed of the tool and their own."""
    places = np.array([[0.2, 0.0, 0.0], [0.4, 0.0, 0.0], [1.0, 0.0, 0.0]])
    velocity, square = np.array([[0.0, 0, 0], [0.0, 1.5, 0], [0.0, 0, 0]]), np.array([1.0, 3.0, 9.0])
    for time, limit in ((0.0, 0.0), (0.05, 0.0), (0.11, 1.0), (0.13, 3.0), (0.5, 3.0), (0.95, 9.0)):
        moves = {"speed": 1.0, "longest": 0.5 * time, "velocity": velocity, "square": square}
        assert pressed(WALL, places, frame=HERE, **moves)[3][1] == limit, time


def test_what_an_impulse_has_besides_acts_along_the_normal():
    """A particle that has come from a depth to another: by `gap_correction`, away from the shape."""
    for before in (0.02, -0.05, 0.09):
        level = np.full(1, before)
        force, impulse, *_ = pressed(WALL, np.array([[0.03, 0.0, 0.0]]), level=level, frame=HERE)
        assert level[0] == pytest.approx(0.07)
        np.testing.assert_allclose(force[0], [6.0 * 0.07, 0.0, 0.0])
        np.testing.assert_allclose(impulse[0], [6.0 * gap_correction(before, level[0]), 0.0, 0.0])
