"""Regions with a name: who is in them, how much surface is, what is refused."""

import numpy as np
import pytest
from grouped_meshes import block, ring

from parsolid.particles.generation import generate
from parsolid.scene import SceneError, parse_scene


def marked(data: dict, comm, *regions: dict):
    """Particles of a scene of whose regions each is held."""
    data["regions"] = list(regions)
    used = {name for one in regions for key in ("all_of", "any_of", "none_of") for name in one.get(key, ())}
    data["boundaries"] = [{"kind": "fixed", "where": one["name"]} for one in regions if one["name"] not in used]
    return generate(parse_scene(data), comm)


def sums(particle_set, comm, number: int) -> tuple[int, np.ndarray]:
    """Particles of a region, and the sum of its surface, on all ranks."""
    d = particle_set.position.shape[1]
    mine = particle_set.surfaces[:, number * d : (number + 1) * d]
    return comm.allreduce(int(particle_set.regions[:, number].sum())), comm.allreduce(mine.sum(axis=0))


@pytest.mark.parametrize("placement", ["vertices", "cells"])
def test_a_side_of_a_box_has_its_area_however_it_is_named(square, comm, placement):
    square["bodies"][0]["placement"] = placement
    box = {"box": {"lower": [-1.0, 1.99], "upper": [9.0, 9.0]}}
    regions = [
        {"name": "axis", "plane": "Y = 2"},
        {"name": "formula", "formula": "Y > 1.999"},
        {"name": "shape", "shape": box},
        {"name": "oblique", "plane": {"point": [5.0, 2.0], "normal": [0.0, 3.0]}},
        {"name": "beyond", "plane": {"point": [5.0, 1.999], "normal": [0.0, 3.0]}, "side": "above"},
        {"name": "below", "plane": "Y = 1.999", "side": "below"},
        {"name": "not", "none_of": ["below"]},
    ]
    particle_set = marked(square, comm, *regions)
    for number in (0, 1, 2, 3, 4, 6):
        count, area = sums(particle_set, comm, number)
        assert count == 3, regions[number]["name"]
        np.testing.assert_allclose(area, [0.0, 1.0], atol=1e-14, err_msg=regions[number]["name"])


@pytest.mark.parametrize(("height", "expected"), [(1.2, 6), (0.0, 15)])
def test_half_spaces_take_no_cells_that_they_touch_from_outside(square, comm, height, expected):
    square["bodies"][0]["placement"] = "cells"
    plane = {"name": "plane", "plane": f"Y = {height}", "side": "above"}
    shape = {"name": "shape", "shape": {"box": {"lower": [-1.0, height], "upper": [9.0, 9.0]}}}
    particle_set = marked(square, comm, plane, shape)
    assert [sums(particle_set, comm, i)[0] for i in (0, 1)] == [expected, expected]
    with pytest.raises(SceneError, match=r"boundaries\.0"):
        marked(square, comm, {"name": "above", "plane": "Y = 2", "side": "above"})


def test_combinations(square, comm):
    particle_set = marked(
        square,
        comm,
        {"name": "left", "plane": "X = 0"},
        {"name": "low", "plane": "Y = 0"},
        {"name": "corner", "all_of": ["left", "low"]},
        {"name": "both", "any_of": ["left", "low"]},
    )
    assert [sums(particle_set, comm, i)[0] for i in range(4)] == [5, 3, 1, 7]
    # a corner has no length of either side
    np.testing.assert_array_equal(sums(particle_set, comm, 2)[1], 0.0)
    np.testing.assert_allclose(sums(particle_set, comm, 3)[1], [-2.0, -1.0], atol=1e-14)


def test_groups_of_a_mesh_have_their_facets(square, shared_path, comm):
    name = str(shared_path / "ring.msh")
    if comm.rank == 0:
        ring(name, 1.0, 2.0, 3)
    comm.Barrier()
    square["bodies"][0] = {"shape": {"mesh": {"file": name}}, "material": square["bodies"][0]["material"]}
    half = {"name": "half", "formula": "X >= -1e-9"}
    particle_set = marked(square, comm, half, {"name": "front", "all_of": ["bore", "half"]})
    around = 28
    chord = 2 * np.sin(np.pi / around)
    count, area = sums(particle_set, comm, 1)
    assert count == around // 2 + 1
    # the diameter, seen along X, inwards
    np.testing.assert_allclose(area, [-2.0, 0.0], atol=1e-12)
    # groups that are named directly come after
    bore = particle_set.regions[:, 2] == 1
    assert comm.allreduce(int(bore.sum())) == around
    total = comm.allreduce(np.linalg.norm(particle_set.surfaces[:, 4:6], axis=1).sum())
    assert total == pytest.approx(around * chord * np.cos(np.pi / around), rel=1e-12)


def test_cell_sets_and_point_sets_of_other_formats(square, tmp_path, comm):
    from meshio import Mesh, write

    points = np.array([[0.0, 0.0], [1.0, 0.0], [1.0, 1.0], [0.0, 1.0]])
    mesh = Mesh(np.column_stack([points, np.zeros(4)]), [("triangle", [[0, 1, 2], [0, 2, 3]])])
    mesh.point_sets, mesh.cell_sets = {"corner": np.array([0])}, {"lower": [np.array([0])]}
    name = str(tmp_path / "m.inp")
    write(name, mesh)
    square["bodies"][0] = {"shape": {"mesh": {"file": name}}, "material": square["bodies"][0]["material"]}
    one, other = {"name": "a", "group": "corner"}, {"name": "b", "group": "lower"}
    particle_set = marked(square, comm, one, other)
    assert [sums(particle_set, comm, i)[0] for i in (0, 1)] == [1, 3]


def test_a_region_without_particles_is_told_by_what_names_it(square, comm):
    square["regions"] = [{"name": "a", "formula": "X > 7"}]
    square["probes"], square["boundaries"] = [{"name": "p", "where": "a", "fields": ["velocity"]}], []
    with pytest.raises(SceneError, match="^probes.0.where: "):
        generate(parse_scene(square), comm)


def test_a_group_that_no_mesh_has_is_told_with_those_there_are(square, tmp_path, comm):
    file = block(tmp_path / "m.msh", 0.0)
    square["bodies"][0] = {"shape": {"mesh": {"file": file}}, "material": square["bodies"][0]["material"]}
    square["boundaries"] = [{"kind": "fixed", "where": "botom"}]
    with pytest.raises(SceneError, match=r"^boundaries.0.where: .*did you mean 'bottom'"):
        generate(parse_scene(square), comm)


TURN = {"kind": "rotation", "where": "left", "centre": [0.0, 0.0], "angle": "0.1*t"}
HELD = {"kind": "fixed", "where": "left"}
MOVED = {"kind": "velocity", "where": "left", "velocity": ["1", "0"]}


@pytest.mark.parametrize(
    ("first", "second", "refused"),
    [
        (TURN, HELD, True),
        (HELD, TURN, True),
        (HELD, HELD, True),
        (TURN, MOVED, True),
        (HELD, MOVED, True),
        (MOVED, HELD, True),
        (HELD, MOVED | {"velocity": ["1", "free"]}, False),
        (MOVED, MOVED | {"velocity": ["free", "2"]}, True),
        (MOVED | {"velocity": ["1", "free"]}, MOVED | {"velocity": ["free", "2"]}, False),
        (TURN | {"body": "a"}, HELD | {"body": "b"}, False),
        (HELD, TURN | {"where": "low"}, False),
    ],
)
def test_a_region_whose_motion_is_said_is_held_or_moved_by_nothing_else(square, first, second, refused):
    regions = [{"name": "left", "plane": "X = 0"}, {"name": "low", "plane": "Y = 0"}]
    used = {one["where"] for one in (first, second)}
    square["bodies"] = [square["bodies"][0] | {"name": name} for name in ("a", "b")]
    square["boundaries"], square["regions"] = [first, second], [one for one in regions if one["name"] in used]
    if refused:
        with pytest.raises(SceneError, match=r"^boundaries\.1\.where: "):
            parse_scene(square)
    else:
        assert len(parse_scene(square).boundaries) == 2
