"""What a mesh is refused for, its quality in numbers, and its size in words."""

import meshio
import numpy as np
import pytest
from element_meshes import element_mesh
from mpi4py import MPI
from solids import simulation

from parsolid.api.check_advice import quality_advice, size_advice
from parsolid.api.report import check_scene
from parsolid.particles.meshes import slices
from parsolid.particles.meshes.files import read_file
from parsolid.particles.meshes.quality import quality_of
from parsolid.particles.meshes.slices import read_slices
from parsolid.scene import SceneError, parse_scene
from parsolid.scene.shapes import BodyMesh

SOFT = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
TRIANGLE = ([[0, 0], [1, 0], [0, 1]], [("triangle", [[0, 1, 2]])])


def scene_of(folder, points, blocks, dimension, **shape):
    file, points = folder / "part.vtu", np.asarray(points, float)
    if MPI.COMM_WORLD.rank == 0:
        full = np.zeros((len(points), 3))
        full[:, :dimension] = points
        meshio.write(file, meshio.Mesh(full, [(kind, np.array(cells)) for kind, cells in blocks]))
    MPI.COMM_WORLD.Barrier()
    bodies = [{"shape": {"file": str(file), **shape}, "material": SOFT}]
    return {"dimension": dimension, "end_time": 1e-4, "method": {"kind": "tlsph"}, "bodies": bodies}


def cubes(*lower):
    """Unit cubes of tetrahedra, nodes of each at its lower corner, joined where they are at one place."""
    points, blocks = element_mesh("hexahedron", (1, 1, 1), 0.0)
    cells = np.array(blocks[0][1])
    places = np.concatenate([points + corner for corner in lower])
    different, number = np.unique(places, axis=0, return_inverse=True)
    rows = number.ravel().reshape(len(lower), -1)
    return different, [("hexahedron", np.concatenate([row[cells] for row in rows]))]


FAULTS = {
    "element": ([[0, 0], [1, 0], [2, 0], [0, 1]], [("triangle", [[0, 1, 2], [0, 1, 3]])], 2),
    "repeated": (*TRIANGLE[:1], [("triangle", [[0, 1, 2], [0, 1, 2]])], 2),
    "double-node": (
        [[0, 0], [1, 0], [0, 1], [1, 0], [0, 1], [1, 1]], [("triangle", [[0, 1, 2], [3, 5, 4]])], 2,
    ),
    "edge-contact": ([[0, 0], [1, 0], [0, 1], [-1, 0], [0, -1]], [("triangle", [[0, 1, 2], [0, 3, 4]])], 2),
    "hanging-node": (
        [[0, 0], [2, 0], [2, 2], [0, 2], [3, 0], [3, 1], [2, 1], [3, 2]],
        [("quad", [[0, 1, 2, 3], [1, 4, 5, 6], [6, 5, 7, 2]])], 2,
    ),
    "self-overlap": (
        [[0, 0], [1, 0], [0, 1], [0.2, 0.2], [1.2, 0.3], [0.3, 1.2]], [("triangle", [[0, 1, 2], [3, 4, 5]])], 2,
    ),
}  # fmt: skip


@pytest.mark.parametrize("code", FAULTS)
def test_faults(shared_path, comm, code):
    points, blocks, dimension = FAULTS[code]
    with pytest.raises(SceneError) as error:
        simulation(scene_of(shared_path, points, blocks, dimension), comm)
    (fault,) = error.value.faults
    assert (fault.code, fault.key) == (code, "bodies.0.shape.mesh.file")
    assert fault.found.startswith(("1 ", "2 ", "3 ", "6 ", "4 ", "5 ")) and "(" in fault.found


def test_nodes_in_the_middle_of_faces_and_edges(shared_path, comm):
    """A cube of tetrahedra beside one of a hexahedron with a node in the middle of the face and on one edge."""
    points, blocks = cubes([0, 0, 0])
    more = [[2, 0, 0], [2, 1, 0], [2, 0, 1], [2, 1, 1], [1, 0.5, 0.5], [1, 0.5, 0.0]]
    number = {tuple(row): i for i, row in enumerate(np.concatenate([points, more]).tolist())}
    middle, edge, far = number[1, 0.5, 0.5], number[1, 0.5, 0.0], number[2, 0, 0]
    ring = [number[1, y, z] for y, z in ((0, 0), (0, 1), (1, 1), (1, 0))]
    sides = [(ring[0], ring[1]), (ring[1], ring[2]), (ring[2], ring[3]), (ring[3], edge), (edge, ring[0])]
    blocks = [*blocks, ("tetra", [[a, b, middle, far] for a, b in sides])]
    with pytest.raises(SceneError) as error:
        simulation(scene_of(shared_path, np.concatenate([points, more]), blocks, 3), comm)
    assert [(one.code, one.found.split()[0]) for one in error.value.faults] == [("hanging-node", "2")]


def test_solids_that_share_an_edge(shared_path, comm):
    with pytest.raises(SceneError) as error:
        simulation(scene_of(shared_path, *cubes([0, 0, 0], [1, 1, 0]), 3), comm)
    assert [(one.code, one.found.split()[0]) for one in error.value.faults] == [("edge-contact", "1")]
    assert "(1, 1, " in error.value.faults[0].found
    simulation(scene_of(shared_path, *cubes([0, 0, 0], [1, 1, 0], [1, 0, 0]), 3), comm)


def test_a_rank_may_read_nodes_of_no_element_alone(shared_path, comm):
    far = [[9, i] for i in range(40)]
    square = [[0, 0], [1, 0], [1, 1], [0, 1]]
    sim = simulation(scene_of(shared_path, square + far, [("triangle", [[0, 1, 2], [0, 2, 3]])], 2), comm)
    assert comm.allreduce(sim.systems[0].owned) == 4


@pytest.mark.parametrize(
    "second, more, told", [([0, 2, 3], 0, []), ([0, 3, 2], 3, ["unused-nodes", "turned-elements"])]
)
def test_what_is_left_out_or_turned_is_told(shared_path, comm, second, more, told):
    """And the body is the same."""
    square = [[0, 0], [1, 0], [1, 1], [0, 1]] + [[9, i] for i in range(more)]
    sim = simulation(scene_of(shared_path, square, [("triangle", [[0, 1, 2], second])], 2), comm)
    notes = [note for note in size_advice(sim) if note.code != "part-size"]
    assert [note.code for note in notes] == told
    assert [note.text.split()[1] for note in notes] == ["3", "1"][: len(told)]
    assert comm.allreduce(sim.systems[0].particles.owned_rows("volume").sum()) == pytest.approx(1.0)


def test_a_quad_beside_two_triangles_is_no_hinge(shared_path, comm):
    points, blocks = cubes([0, 0, 0])
    number = {tuple(row): i for i, row in enumerate(points.tolist())}
    a, b, c, d = (number[1, y, z] for y, z in ((0, 0), (1, 0), (1, 1), (0, 1)))
    halves = [[a, b, c, len(points)], [a, c, d, len(points)]]
    simulation(scene_of(shared_path, np.concatenate([points, [[2, 0.5, 0.5]]]), [*blocks, ("tetra", halves)], 3), comm)


@pytest.mark.parametrize(
    ("kind", "d", "aspect"),
    [("quad", 2, 1.0), ("hexahedron", 3, 1.0), ("wedge", 3, 2.0), ("triangle", 2, 2.0), ("pyramid", 3, 2.0)],
)
def test_quality_of_regular_elements(shared_path, comm, kind, d, aspect):
    """Of halves of squares and cubes and of sixths of a cube the longest edge over the least height."""
    data = scene_of(shared_path, *element_mesh(kind, (3, 2, 2)[:d], 0.0, 0.5), d)
    stated = BodyMesh.model_construct(file=data["bodies"][0]["shape"]["file"], scale=1.0)
    found = quality_of(read_slices(comm, stated, d))
    assert found.worst == pytest.approx(aspect, rel=1e-9) and found.high == pytest.approx(aspect, rel=1e-2)
    assert found.shortest == pytest.approx(0.5 if kind != "pyramid" else 0.25 * 3**0.5, rel=1e-9)


def test_the_finest_element_is_told(shared_path, comm):
    points, blocks = element_mesh("quad", (20, 20), 0.0)
    points[:, 0] = np.where(points[:, 0] > 19.5, 19.05, points[:, 0])
    stated = BodyMesh.model_construct(
        file=scene_of(shared_path, points, blocks, 2)["bodies"][0]["shape"]["file"], scale=1.0
    )
    found = quality_of(read_slices(comm, stated, 2))
    assert found.shortest == pytest.approx(0.05) and found.place[0] == pytest.approx(19.025)
    assert found.worst == pytest.approx(1.0 / 0.05) and found.high > 19.0
    alone = quality_of(read_slices(MPI.COMM_SELF, stated, 2))
    assert (alone.worst, alone.high, alone.shortest, alone.short) == (
        found.worst,
        found.high,
        found.shortest,
        found.short,
    )


@pytest.mark.serial
@pytest.mark.parametrize(("scale", "unit", "doubtful"), [(1e-3, "mm", False), (1.0, "m", False), (1e9, "km", True)])
def test_size_in_words(tmp_path, scale, unit, doubtful):
    data = scene_of(tmp_path, *element_mesh("quad", (3, 2), 0.0), 2, scale=scale)
    sim = simulation(data)
    notes = {note.code: note.text for note in (*size_advice(sim), *quality_advice(sim))}
    assert notes["part-size"].endswith(f" {unit}") and "mesh-quality" in notes
    assert ("mesh-scale" in notes) == doubtful


@pytest.mark.serial
def test_a_check_with_a_picture_reads_a_mesh_once(tmp_path, monkeypatch):
    pytest.importorskip("matplotlib")
    scene, read = parse_scene(scene_of(tmp_path, *element_mesh("quad", (3, 2), 0.0), 2)), []
    monkeypatch.setattr(slices, "read_file", lambda *stated: read.append(stated) or read_file(*stated))
    report = check_scene(MPI.COMM_SELF, scene, picture=tmp_path / "scene.png")
    assert "mesh-quality" in [note.code for note in report.notes] and len(read) == 1
