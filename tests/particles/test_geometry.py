"""Geometry that Gmsh meshes: CAD files and closed surfaces, sizes, groups, and what is refused."""

import os
import sys

import meshio
import numpy as np
import pytest
from mpi4py import MPI
from solids import gathered, run_alone_and_on_all, simulation

from parsolid.scene import SceneError, parse_scene
from parsolid.scene.shapes import GEOMETRY

gmsh = pytest.importorskip("gmsh")
SOFT = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}


def write(path, shape, dimension=3):
    """A file of geometry that a function makes with OpenCASCADE; by one rank."""
    if MPI.COMM_WORLD.rank == 0:
        gmsh.initialize(readConfigFiles=False, interruptible=False)
        gmsh.option.setNumber("General.Terminal", 0)
        shape(gmsh.model.occ)
        gmsh.model.occ.synchronize()
        gmsh.write(str(path))
        gmsh.finalize()
    MPI.COMM_WORLD.Barrier()
    return str(path)


def plate(occ):
    """A plate of 20 x 10 x 4 mm with a hole of radius 2 mm."""
    occ.cut([(3, occ.addBox(0, 0, 0, 20, 10, 4))], [(3, occ.addCylinder(10, 5, -1, 0, 0, 6, 2))])


def scene_of(dimension=3, **shape):
    bodies = [{"name": "part", "shape": shape, "material": SOFT}]
    return {"dimension": dimension, "end_time": 1e-4, "method": {"kind": "tlsph"}, "bodies": bodies}


def generated(data, *names):
    sim = simulation(data)
    return gathered(sim, *names)


@pytest.mark.serial
def test_a_broken_pipe_stays_an_error_of_the_write(tmp_path):
    """Gmsh makes it end the program, in the middle of a run of which nobody reads the output."""
    file = write(tmp_path / "plate.step", plate)
    simulation(scene_of(file=file, size=4e-3, scale=1e-3))
    reader, writer = os.pipe()
    os.close(reader)
    with pytest.raises(BrokenPipeError):
        os.write(writer, b"nobody reads this")
    os.close(writer)


@pytest.mark.serial
@pytest.mark.parametrize("ending", ["step", "brep", "iges"])
def test_volume_and_size(tmp_path, ending):
    file = write(tmp_path / f"plate.{ending}", plate)
    counts = []
    for size in (2e-3, 1.5e-3):
        volume, X, edge = generated(
            scene_of(file=file, size=size, scale=1e-3), "volume", "reference_position", "spacing"
        )
        exact = (20 * 10 - np.pi * 4) * 4 * 1e-9
        assert volume.sum() == pytest.approx(exact, rel=0.02)
        np.testing.assert_allclose(X.max(axis=0) - X.min(axis=0), [0.02, 0.01, 0.004], rtol=1e-6)
        assert 0.4 * size < np.median(edge) < 1.3 * size
        counts.append(len(X))
    assert counts[1] > 1.3 * counts[0]


@pytest.mark.serial
def test_sizes_around_curves_and_at_faces(tmp_path):
    file = write(tmp_path / "plate.step", plate)
    nodes = {}
    for key, more in {"plain": {"around": 0}, "around": {"around": 24}}.items():
        X = generated(scene_of(file=file, size=2e-3, scale=1e-3, **more), "reference_position")[0]
        rim = np.abs(np.hypot(X[:, 0] - 0.01, X[:, 1] - 0.005) - 2e-3) < 1e-6
        nodes[key] = np.sum(rim & (X[:, 2] < 1e-9))
    assert nodes["around"] >= 24 > nodes["plain"]
    # the end at X = 0: which of the faces it is, is told by a wrong name
    with pytest.raises(SceneError) as error:
        simulation(scene_of(file=file, size=2e-3, scale=1e-3, refine=[{"where": "fillet", "size": 5e-4}]))
    (fault,) = error.value.faults
    assert (fault.code, fault.key) == ("unknown-name", "bodies.0.shape.mesh.refine.0.where")
    assert "'face-1'" in fault.expected and "fillet" in fault.found
    data = scene_of(file=file, size=2e-3, scale=1e-3, around=0, refine=[{"where": "face-1", "size": 5e-4}])
    data["boundaries"] = [{"where": "face-1", "kind": "fixed"}]
    X, edge, regions = generated(data, "reference_position", "spacing", "regions")
    here = regions[:, 0] > 0
    assert 0 < here.sum() < len(X)
    assert np.median(edge[here]) < 1e-3 and np.median(edge[~here]) > 1.2 * np.median(edge[here])


@pytest.mark.serial
def test_physical_groups_are_bodies_that_share_nodes(tmp_path):
    script = """SetFactory("OpenCASCADE");
    Rectangle(1) = {0, 0, 0, 1, 1}; Rectangle(2) = {1, 0, 0, 1, 1};
    BooleanFragments{ Surface{1}; Delete; }{ Surface{2}; Delete; }
    Physical Surface("soft") = {1}; Physical Surface("hard") = {2};
    Mesh.MeshSizeMax = 0.3;"""
    (tmp_path / "two.geo").write_text(script)
    data = scene_of(2, file=str(tmp_path / "two.geo"), group="soft")
    data["bodies"].append(
        {"name": "other", "shape": {"file": str(tmp_path / "two.geo"), "group": "hard"}, "material": SOFT}
    )
    sim = simulation(data)
    X, body = gathered(sim, "reference_position", "body")
    shared = sum(len(np.unique(X[(body == i) & (np.abs(X[:, 0] - 1.0) < 1e-9)], axis=0)) for i in (0, 1))
    assert shared >= 8 and X[body == 0, 0].max() == X[body == 1, 0].min() == pytest.approx(1.0)
    assert sim.systems[0].meshes.shared is not None


@pytest.mark.serial
@pytest.mark.parametrize("inside", [0, 1, 2, None])
def test_closed_surfaces_of_iges_are_parts_and_cavities(tmp_path, inside):
    """A sphere beside a box, in it, and in a box in a cavity of it; a box without a face is refused."""

    def box_and_sphere(occ):
        box = occ.addBox(0, 0, 0, 10, 10, 10)
        if inside is None:
            occ.synchronize()
            occ.remove([(3, box)])
            occ.remove([(2, 6)])
            return
        sphere = occ.addSphere(5 if inside else 20, 5, 5, 3)
        if inside:
            occ.cut([(3, box)], [(3, sphere)])
        if inside == 2:
            occ.addBox(4, 4, 4, 2, 2, 2)

    scene = scene_of(file=write(tmp_path / "part.iges", box_and_sphere), size=1.5e-3, scale=1e-3)
    if inside is None:
        with pytest.raises(SceneError) as error:
            simulation(scene)
        (fault,) = error.value.faults
        assert (fault.code, fault.key) == ("geometry", "bodies.0.shape.mesh.file")
        return
    exact = 1e-6 + (-1 if inside else 1) * 36e-9 * np.pi + (8e-9 if inside == 2 else 0.0)
    assert generated(scene, "volume")[0].sum() == pytest.approx(exact, rel=0.02)


def tetrahedron(path, triangles):
    points = np.array([[0.0, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]])
    meshio.write(path, meshio.Mesh(points, [("triangle", np.array(triangles))]), file_format="stl")
    return str(path)


@pytest.mark.serial
def test_closed_and_open_surfaces(tmp_path):
    faces = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]]
    volume = generated(scene_of(file=tetrahedron(tmp_path / "whole.stl", faces), size=0.3), "volume")[0]
    assert volume.sum() == pytest.approx(1.0 / 6.0, rel=1e-9)
    with pytest.raises(SceneError) as error:
        simulation(scene_of(file=tetrahedron(tmp_path / "open.stl", faces[:3]), size=0.3))
    (fault,) = error.value.faults
    assert (fault.code, fault.key) == ("open-surface", "bodies.0.shape.mesh.file") and fault.found.startswith("3 ")


@pytest.mark.serial
@pytest.mark.parametrize("ending", GEOMETRY)
def test_every_kind_of_geometry_has_a_size(tmp_path, ending):
    (tmp_path / f"part{ending}").touch()
    model = parse_scene(scene_of(file=str(tmp_path / f"part{ending}"), size=1e-3)).bodies[0].shape.model
    assert model.size == 1e-3


@pytest.mark.serial
def test_refused(tmp_path, monkeypatch):
    file = write(tmp_path / "plate.step", plate)
    (tmp_path / "broken.step").write_text("ISO-10303-21;\nnothing\n")
    for data, code in (
        (scene_of(file=file, scale=1e-3), "geometry"),
        (scene_of(2, file=file, size=2e-3, scale=1e-3), None),
        (scene_of(file=file, size=1e-3), "geometry"),
        (scene_of(file=str(tmp_path / "broken.step"), size=1e-3), "geometry"),
    ):
        with pytest.raises(SceneError) as error:
            simulation(data)
        assert code is None or [one.code for one in error.value.faults] == [code]
    mesh = tmp_path / "m.vtu"
    meshio.write(mesh, meshio.Mesh(np.eye(3)[[2, 0, 1]], [("triangle", [[0, 1, 2]])]))
    with pytest.raises(SceneError) as error:
        parse_scene(scene_of(2, file=str(mesh), size=1e-3))
    assert [one.key for one in error.value.faults] == ["bodies.0.shape.mesh.size"]
    monkeypatch.setitem(sys.modules, "gmsh", None)
    with pytest.raises(SceneError) as error:
        simulation(scene_of(file=file, size=1e-3, scale=1e-3))
    assert [one.code for one in error.value.faults] == ["geometry"]


def test_all_ranks_have_one_mesh(shared_path, comm):
    """Histories on all ranks and on one agree to 1e-9 of their maxima."""
    file = write(shared_path / "plate.step", plate)
    data = scene_of(file=file, size=3e-3, scale=1e-3, around=8)
    data |= {"end_time": 2e-3, "boundaries": [{"plane": "X = 0", "kind": "fixed"}]}
    data["bodies"][0]["velocity"] = ["0", "0", "X"]
    assert len(run_alone_and_on_all(data, comm)["time"]) > 5
