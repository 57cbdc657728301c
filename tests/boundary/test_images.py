"""One mirror plane for images of particles and for folds of a grid."""

import numpy as np
import pytest
from kinds import table, tables_of, translated

from parsolid.boundary.mirror_planes import MirrorCodes, MirrorPlane

VELOCITY = np.array([2.0, 3.0, 5.0])


@pytest.mark.parametrize("kind", ["fixed", "roller", "antisymmetric"])
@pytest.mark.parametrize("axis", [0, 1, 2])
def test_an_image_has_what_the_plane_holds_reversed(kind, axis):
    plane = MirrorPlane(axis, 1.5, kind)
    held = plane.held(3)
    assert held.sum() == {"fixed": 3, "roller": 1, "antisymmetric": 2}[kind]
    # half-way between a particle and its image held components vanish, the others are those of both
    between = 0.5 * (VELOCITY + plane.signs() * VELOCITY)
    np.testing.assert_array_equal(between, np.where(held, 0.0, VELOCITY))
    codes = MirrorCodes.of([plane], 1e-9)
    place = np.array([[1.0, 1.0, 1.0]])
    image = place * codes.reflections[0] + codes.shifts[0]
    expected = place.copy()
    expected[0, axis] = 2.0
    np.testing.assert_array_equal(image, expected)


@pytest.mark.parametrize("kind", ["fixed", "roller"])
def test_nodes_behind_a_plane_are_its_images(kind, comm):
    (folded,) = translated(comm, tables_of("mpm", table(kind))).systems[0].conditions.planes
    assert folded.plane == MirrorPlane(0, 0.0, kind) and folded.mirror == (0, 0, 1)
    expected = np.concatenate([folded.plane.signs(), [1.0]] * 2)
    np.testing.assert_array_equal(np.ravel(folded.signs), expected)


def test_planes_of_different_normals_have_images_at_their_edges_and_corners():
    planes = [MirrorPlane(0, 0.0, "roller"), MirrorPlane(0, 4.0, "fixed"), MirrorPlane(1, 0.0, "antisymmetric")]
    codes = MirrorCodes.of(planes, 1e-9)
    assert [len(subset) for subset in codes.planes] == [1, 1, 1, 2, 2]
    # at the edge of the first and the third the image is that of both planes, one after the other
    np.testing.assert_array_equal(codes.signs[3], planes[0].signs() * planes[2].signs())
    assert codes.stress_signs.tolist() == [1.0, 1.0, -1.0, -1.0, -1.0]
    assert codes.too_close(np.array([7.0, 1.0, 1.0])) is None
    assert "found two 4 m apart along X" in codes.too_close(np.array([8.0, 1.0, 1.0]))


def test_particles_near_and_on_planes_are_those_by_their_coordinates():
    planes = [MirrorPlane(0, 4.0, "roller"), MirrorPlane(1, -2.0, "fixed", body=1)]
    codes, corner = MirrorCodes.of(planes, 1e-9), 2
    places = np.array([[4.0, 1.0], [3.7, -2.0], [3.7, -1.8], [4.3, -2.3], [-4.0, 2.0], [3.0, -2.0]])
    body, reach = np.array([1, 1, 1, 0, 1, 1]), np.array([0.5, 0.4])
    assert len(codes.planes[corner]) == 2
    np.testing.assert_array_equal(codes.on_planes(places, corner), [True, True, False, False, False, True])
    np.testing.assert_array_equal(codes.near(places, body, corner, reach), [False, True, True, False, False, False])
    np.testing.assert_array_equal(codes.near(places, body, 0, reach), [True, True, True, True, False, False])
