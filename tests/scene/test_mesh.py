"""Particles from meshes: volumes, surfaces and spacings of every element kind, and meshes that are refused."""

import itertools
from pathlib import Path

import meshio
import numpy as np
import pytest
from ranks import first_on_ranks

from parsolid.particles.fillings import filling_of
from parsolid.particles.generation import generate
from parsolid.particles.meshes.gmsh_text import read_gmsh_text
from parsolid.particles.meshes.groups import groups_of
from parsolid.particles.meshes.imported import read_mesh
from parsolid.particles.regions import selected
from parsolid.scene import SceneError, parse_scene

LENGTHS = (2.0, 3.0, 1.0)
COUNTS = (4, 5, 3)
# corners of a square, in order
RING = [(0, 0), (1, 0), (1, 1), (0, 1)]


def grid(dimension, distortion=0.0):
    """Nodes of a box lattice, inner ones moved at random, and its cells in VTK's order."""
    shape = [count + 1 for count in COUNTS[:dimension]]
    lines = [np.linspace(0.0, length, count) for length, count in zip(LENGTHS, shape)]
    points = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, dimension)
    number = np.arange(len(points)).reshape(shape)
    inner = ((points > 1e-9) & (points < np.array(LENGTHS[:dimension]) - 1e-9)).all(axis=1)
    points[inner] += distortion * (np.random.default_rng(1).random((inner.sum(), dimension)) - 0.5)
    corners = RING if dimension == 2 else [(*xy, z) for z in (0, 1) for xy in RING]
    slices = [tuple(slice(c, c + n) for c, n in zip(corner, COUNTS)) for corner in corners]
    return points, np.stack([number[s].ravel() for s in slices], axis=1)


def split(cells):
    """Triangles of quads, tetrahedra of hexahedra (six around a diagonal)."""
    if cells.shape[1] == 4:
        return np.concatenate([cells[:, [0, 1, 2]], cells[:, [0, 2, 3]]])
    corner = {place: number for number, place in enumerate([(*xy, z) for z in (0, 1) for xy in RING])}
    pieces = []
    for order in itertools.permutations(range(3)):
        place, path = [0, 0, 0], [0]
        for axis in order:
            place[axis] = 1
            path.append(corner[tuple(place)])
        pieces.append(cells[:, path])
    return np.concatenate(pieces)


def mesh_scene(folder, dimension, points, cells, name="mesh.vtk", **filling):
    if points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    meshio.write(folder / name, meshio.Mesh(points, cells))
    solid = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    body = {"shape": {"mesh": {"file": name}}, "material": solid} | filling
    return parse_scene({"dimension": dimension, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]}, folder)


KINDS = [(2, "quad"), (2, "triangle"), (3, "hexahedron"), (3, "tetra")]


@pytest.mark.parametrize("placement", ["vertices", "cells"])
@pytest.mark.parametrize(("dimension", "kind"), first_on_ranks(KINDS))
def test_volume_and_surface(shared_path, comm, dimension, kind, placement):
    points, cells = grid(dimension, 0.2)
    if kind in ("triangle", "tetra"):
        cells = split(cells)
    scene = mesh_scene(shared_path, dimension, points, [(kind, cells)], f"{comm.rank}.vtk", placement=placement)
    particle_set = generate(scene, comm)
    lengths = np.array(LENGTHS[:dimension])
    assert comm.allreduce(particle_set.volume.sum()) == pytest.approx(lengths.prod(), rel=1e-13)
    assert particle_set.volume.min() > 0.0
    faces = lengths.prod() / lengths
    np.testing.assert_allclose(comm.allreduce(np.maximum(particle_set.area, 0.0).sum(axis=0)), faces, rtol=1e-12)
    np.testing.assert_allclose(comm.allreduce(np.minimum(particle_set.area, 0.0).sum(axis=0)), -faces, rtol=1e-12)
    number = len(points) if placement == "vertices" else len(cells)
    assert comm.allreduce(len(particle_set)) == number
    assert len(particle_set) == number * (comm.rank + 1) // comm.size - number * comm.rank // comm.size


@pytest.mark.parametrize("dimension", [2, 3])
def test_regular_mesh_is_the_lattice(shared_path, comm, dimension):
    points, cells = grid(dimension)
    kind = "quad" if dimension == 2 else "hexahedron"
    scene = mesh_scene(shared_path, dimension, points, [(kind, cells)], f"{comm.rank}.vtu")
    data = scene.resolved()
    data["method"]["weights"] = "kernel"
    box = {"box": {"lower": [0.0] * dimension, "upper": list(LENGTHS[:dimension])}}
    data["bodies"][0] |= {"shape": box, "particles": [n + 1 for n in COUNTS[:dimension]]}
    mesh, lattice = generate(scene, comm), generate(parse_scene(data), comm)
    for name in ("identifier", "position", "volume", "area"):
        np.testing.assert_allclose(getattr(mesh, name), getattr(lattice, name), atol=1e-14)


@pytest.mark.parametrize(("dimension", "kind"), KINDS)
def test_elements_turned_inside_out_as_a_whole(tmp_path, dimension, kind):
    points, cells = grid(dimension)
    if kind in ("triangle", "tetra"):
        cells = split(cells)
    mirror = points * np.array([-1.0] + [1.0] * (dimension - 1))
    one = filling_of(mesh_scene(tmp_path, dimension, mirror, [(kind, cells)]).bodies[0], dimension)
    particle_set = one.piece(0, one.count)
    assert particle_set.volume.sum() == pytest.approx(np.prod(LENGTHS[:dimension]))
    assert (particle_set.area * (particle_set.position - particle_set.position.mean(axis=0))).sum() > 0.0


def test_unused_nodes_are_dropped_and_lower_elements_ignored(tmp_path):
    points, cells = grid(3)
    extra = np.concatenate([[[50.0, 50.0, 50.0]], points, [[70.0, 0.0, 0.0]]])
    blocks = [("quad", np.array([[1, 2, 3, 4]])), ("line", np.array([[1, 2]])), ("hexahedron", cells + 1)]
    one = filling_of(mesh_scene(tmp_path, 3, extra, blocks).bodies[0], 3)
    assert one.count == len(points)
    np.testing.assert_array_equal(one.upper, LENGTHS)


def test_scale_and_spacing(tmp_path):
    points, cells = grid(2)
    for placement in ("vertices", "cells"):
        data = mesh_scene(tmp_path, 2, points, [("quad", cells)], placement=placement).resolved()
        data["bodies"][0]["shape"]["mesh"] |= {"file": str(tmp_path / "mesh.vtk"), "scale": 0.001}
        one = filling_of(parse_scene(data).bodies[0], 2)
        particle_set = one.piece(0, one.count)
        assert particle_set.volume.sum() == pytest.approx(6e-6)
        assert (particle_set.spacing >= 0.5e-3 - 1e-12).all() and (particle_set.spacing <= 0.6e-3 + 1e-12).all()


def test_supports_and_regions(shared_path, comm):
    points, cells = grid(3, 0.2)
    for placement, number in (("vertices", 6 * 4), ("cells", None)):
        scene = mesh_scene(shared_path, 3, points, [("tetra", split(cells))], f"{comm.rank}.vtk", placement=placement)
        data = scene.resolved() | {"boundaries": [{"kind": "fixed", "plane": "X = 0"}]}
        scene = parse_scene(data)
        particle_set = generate(scene, comm)
        mask = selected(scene, scene.boundaries[0], particle_set, comm)
        assert number is None or comm.allreduce(int(mask.sum())) == number
        assert comm.allreduce(particle_set.area[mask, 0].sum()) == pytest.approx(-3.0, rel=1e-12)


def test_refused_elements(shared_path, comm):
    points, cells = grid(3)
    plane, quads = grid(2)
    twisted = quads.copy()
    twisted[7] = twisted[7, [0, 2, 1, 3]]
    # a copy on nodes of its own has no facet in common with the first
    copied = np.concatenate([quads, quads[:, [1, 2, 3, 0]] + len(plane)])
    cases = [
        (3, points, [("polygon", cells[:, :6])], "found polygon"),
        (3, points, [("quad", cells[:, :4])], "found quad"),
        (2, points, [("hexahedron", cells)], "found hexahedron"),
        (2, np.column_stack([plane, plane[:, 0]]), [("quad", quads)], "different Z"),
        (2, plane, [("quad", twisted)], r"found 1 quad .* \(0.75, 1.5\)"),
        (2, plane, [("quad", quads), ("quad", quads[3:5])], "found 2 quad elements more than once"),
        (2, np.concatenate([plane, plane]), [("quad", copied)], f"found {len(quads)} quad elements more than once"),
        (3, points * [1.0, 1.0, 0.0], [("tetra", split(cells))], "found 360 tetra"),
    ]
    for dimension, nodes, blocks, found in cases:
        scene = mesh_scene(shared_path, dimension, nodes, blocks, f"{comm.rank}.vtk")
        with pytest.raises(SceneError, match=f"^bodies.0.shape.mesh.file: expected.*{found}"):
            generate(scene, comm)


@pytest.mark.parametrize("wrong", [-1, 999])
def test_elements_of_nodes_that_there_are_not(tmp_path, wrong):
    points, cells = grid(2)
    text = ["# vtk DataFile Version 3.0", "mesh", "ASCII", "DATASET UNSTRUCTURED_GRID", f"POINTS {len(points)} double"]
    text += [f"{x} {y} 0" for x, y in points]
    cells = cells.copy()
    cells[3, 2] = wrong
    text += [f"CELLS {len(cells)} {5 * len(cells)}", *(f"4 {' '.join(map(str, cell))}" for cell in cells)]
    text += [f"CELL_TYPES {len(cells)}", *["9"] * len(cells)]
    (tmp_path / "m.vtk").write_text("\n".join(text) + "\n")
    with pytest.raises(SceneError, match=f"found {wrong}"):
        read_mesh(str(tmp_path / "m.vtk"), 2)


@pytest.mark.parametrize(
    ("name", "content"), [("bad.vtk", "no mesh"), ("bad.msh", "no mesh"), ("bad.xyz9", "1 2 3"), ("bad.vtu", "<a>")]
)
def test_unreadable_files(tmp_path, comm, capfd, name, content):
    points, cells = grid(2)
    data = mesh_scene(tmp_path, 2, points, [("quad", cells)]).resolved()
    (tmp_path / name).write_text(content)
    data["bodies"][0]["shape"]["mesh"]["file"] = str(tmp_path / name)
    scene = parse_scene(data)
    with pytest.raises(SceneError, match="^bodies.0.shape.mesh.file: .*bad"):
        generate(scene, comm)
    assert capfd.readouterr().err == ""


def test_plane_that_bounds_no_mesh(shared_path, comm):
    points, cells = grid(3)
    scene = mesh_scene(shared_path, 3, points, [("hexahedron", cells)], f"{comm.rank}.vtk")
    data = scene.resolved() | {"boundaries": [{"kind": "fixed", "plane": "X = 1"}]}
    with pytest.raises(SceneError, match=r"^boundaries.0.plane: .*X = 0 or 2"):
        generate(parse_scene(data), comm)


def bodies_of_meshes(folder, dimension, kind, *shifts):
    """A scene of copies of one grid, shifted."""
    points, cells = grid(dimension)
    cells = split(cells) if kind in ("triangle", "tetra") else cells
    scenes = [mesh_scene(folder, dimension, points + s, [(kind, cells)], f"{i}.vtk") for i, s in enumerate(shifts)]
    data = scenes[0].resolved()
    data["bodies"] = [scene.resolved()["bodies"][0] | {"name": "ab"[i]} for i, scene in enumerate(scenes)]
    return data


@pytest.mark.parametrize(("dimension", "kind"), first_on_ranks(KINDS))
@pytest.mark.parametrize("shift", [(0.0, 0.0, 0.0), (1.9, 0.0, 0.0), (0.5, 0.6, 0.5)])
def test_meshes_in_one_another_are_refused_with_their_names(shared_path, comm, dimension, kind, shift):
    folder = shared_path / str(comm.rank)
    folder.mkdir()
    data = bodies_of_meshes(folder, dimension, kind, np.zeros(dimension), np.array(shift[:dimension]))
    with pytest.raises(SceneError, match=r"^bodies.\d: .*('a'.*'b'|'b'.*'a')"):
        generate(parse_scene(data), comm)
    apart = bodies_of_meshes(folder, dimension, kind, np.zeros(dimension), np.array([2.0, 0.3, 0.0][:dimension]))
    assert comm.allreduce(len(generate(parse_scene(apart | {"bond": [{"bodies": ["a", "b"]}]}), comm))) > 10


def test_a_box_in_a_mesh_and_one_in_its_notch(shared_path, comm):
    points, cells = grid(2)
    # without the elements of one corner
    cells = cells[(points[cells].mean(axis=1) > [1.0, 1.2]).any(axis=1)]
    folder = shared_path / str(comm.rank)
    folder.mkdir()
    data = mesh_scene(folder, 2, points, [("quad", cells)]).resolved()
    for upper, refused in (([1.0, 1.2], False), ([1.01, 1.2], True), ([0.9, 1.3], True)):
        box = {"shape": {"box": {"lower": [0.0, 0.0], "upper": upper}}, "particles": [5, 5]}
        bodies = [data["bodies"][0], data["bodies"][0] | box]
        scene = parse_scene(data | {"bodies": bodies, "bond": [{"bodies": "all"}]})
        if refused:
            with pytest.raises(SceneError, match=r"^bodies.\d: .*'bodies.1'.*'bodies.0'"):
                generate(scene, comm)
        else:
            generate(scene, comm)


@pytest.mark.parametrize(("dimension", "kind"), first_on_ranks(KINDS))
@pytest.mark.parametrize("shift", [(0.25, 0.0, 0.0), (1.9, 0.1, 0.2), (0.25, 0.3, 0.1)])
def test_a_mesh_in_itself_is_refused(shared_path, comm, dimension, kind, shift):
    points, cells = grid(dimension, 0.2)
    cells = split(cells) if kind in ("triangle", "tetra") else cells
    twice = [(kind, np.concatenate([cells, cells + len(points)]))]
    both = np.concatenate([points, points + np.array(shift[:dimension])])
    body = mesh_scene(shared_path, dimension, both, twice, f"{comm.rank}.vtk").bodies[0]
    with pytest.raises(SceneError, match="lie in itself"):
        filling_of(body, dimension, comm)
    # side by side, with nodes that hang
    both[len(points) :] = points + np.array([2.0, 0.3, 0.2][:dimension])
    body = mesh_scene(shared_path, dimension, both, twice, f"{comm.rank}.vtk").bodies[0]
    assert filling_of(body, dimension, comm).count == len(both)


def test_text_of_gmsh_is_read_as_meshio_reads_it(tmp_path):
    source = Path(__file__).parents[2] / "runs/tlsph/meshes/bushing.msh"
    ours, theirs = read_gmsh_text(source), meshio.read(source)
    assert np.array_equal(ours.points, theirs.points)
    assert [block.type for block in ours.cells] == [block.type for block in theirs.cells]
    assert all(np.array_equal(*map(np.asarray, (a.data, b.data))) for a, b in zip(ours.cells, theirs.cells))
    found, wanted = groups_of(ours, 2), groups_of(theirs, 2)
    assert found.names == wanted.names == {"rubber", "bore", "outside"}
    for name in found.names:
        mine, other = (
            [one.elements.get(name), *one.facets.get(name, {}).values(), one.nodes.get(name)] for one in (found, wanted)
        )
        assert any(one is not None for one in mine)
        assert all(a is b is None or np.array_equal(a, b) for a, b in zip(mine, other, strict=True))
    text = source.read_text()
    # what is not plain is meshio's
    for other in ("$Comments\nx\n$EndComments\n" + text, text + "$Periodic\n0\n$EndPeriodic\n", text[:-4000]):
        (tmp_path / "other.msh").write_text(other)
        assert read_gmsh_text(tmp_path / "other.msh") is None
