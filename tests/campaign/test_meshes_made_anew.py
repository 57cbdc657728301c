"""Meshes made anew within their own surface: shape, size and groups stay; probes and bars of coarse runs of meshes."""

from pathlib import Path

import meshio
import numpy as np
import pytest
from element_meshes import element_mesh
from mpi4py import MPI
from solids import RUBBER

from parsolid.campaign.coarsening import NotCoarsened, coarsen, parsed
from parsolid.campaign.error_bars import error_table
from parsolid.campaign.estimate import OF_MESHES, Series, spacing_bar
from parsolid.campaign.in_process import InProcess
from parsolid.campaign.recovery import with_recovery_probe
from parsolid.campaign.variants import SPACING, Variant, coarse_variants
from parsolid.particles.fillings import filling_of
from parsolid.particles.meshes.elements import facet_areas, lumped_volumes
from parsolid.particles.meshes.imported import import_mesh, read_mesh
from parsolid.scene import SceneError, load_scene, parse_scene

pytest.importorskip("gmsh")
pytestmark = pytest.mark.serial
RUNS = Path(__file__).parents[2] / "runs"


def scene_of(file, dimension, **shape):
    body = {"shape": {"file": str(file), **shape}, "material": RUBBER}
    return {"dimension": dimension, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]}


def block(path, kind, counts):
    """A mesh of a block with the group "end" of nodes at its lower end and "half" of elements in its lower half."""
    points, blocks = element_mesh(kind, counts, 0.3)
    d = len(counts)
    mesh = meshio.Mesh(np.pad(points, ((0, 0), (0, 3 - d))), blocks)
    mesh.point_sets = {"end": np.flatnonzero(points[:, 0] == 0.0)}
    mesh.cell_sets = {
        "half": [np.flatnonzero(points[cells].mean(axis=1)[:, 0] < 0.5 * counts[0]) for _, cells in blocks]
    }
    meshio.write(path, mesh)
    return path


@pytest.mark.parametrize("factor", [1.7, 0.8])
@pytest.mark.parametrize(
    "kind, counts", [("quad", (12, 6)), ("triangle", (12, 6)), ("hexahedron", (8, 4, 4)), ("wedge", (8, 4, 4))]
)
def test_shape_size_and_groups_stay(tmp_path, kind, counts, factor):
    path = block(tmp_path / "block.inp", kind, counts)
    bodies = [
        parse_scene(scene_of(path, len(counts), scale=0.01, **more)).bodies[0] for more in ({}, {"size_factor": factor})
    ]
    given, made = (read_mesh(str(path), len(counts), body.shape.model) for body in bodies)
    (simplex, cells) = made.blocks[0]
    assert len(made.blocks) == 1 and cells.shape[1] == len(counts) + 1
    volume = lumped_volumes(simplex, made.points[cells])[0].sum(axis=1)
    assert volume.sum() == pytest.approx(np.prod(counts), rel=1e-9)
    sizes = [np.median(filling_of(body, len(counts)).rows["spacing"]) for body in bodies]
    assert sizes[1] == pytest.approx(factor * sizes[0], rel=0.3)
    # all nodes of the end, and no others
    assert set(made.groups.nodes["end"]) == set(np.flatnonzero(made.points[:, 0] < 1e-9))
    lower = volume[made.groups.elements["half"]].sum()
    assert lower == pytest.approx(np.prod(counts) / 2, rel=0.25)
    assert given.groups.names == made.groups.names


def test_a_surface_without_an_edge_and_groups_of_facets(tmp_path):
    """A ball, whose surface has no map to a plane, with its upper half as a group of facets."""
    import gmsh

    gmsh.initialize(readConfigFiles=False, interruptible=False)
    gmsh.option.setNumber("General.Terminal", 0)
    ball = gmsh.model.occ.addSphere(0, 0, 0, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMax", 0.25)
    gmsh.model.addPhysicalGroup(3, [ball], name="ball")
    gmsh.model.addPhysicalGroup(2, [tag for _, tag in gmsh.model.getEntities(2)], name="skin")
    gmsh.model.mesh.generate(3)
    gmsh.write(str(tmp_path / "ball.msh"))
    gmsh.finalize()
    stated = parse_scene(scene_of(tmp_path / "ball.msh", 3, size_factor=1.5)).bodies[0].shape.model
    made = read_mesh(stated.file, 3, stated)
    skin = made.groups.facets["skin"][3]
    area = np.linalg.norm(facet_areas(made.points[skin], np.zeros((len(skin), 3))), axis=1)
    assert area.sum() == pytest.approx(4 * np.pi, rel=0.1)
    volume = lumped_volumes("tetra", made.points[made.blocks[0][1]])[0].sum()
    assert volume == pytest.approx(4 / 3 * np.pi, rel=0.12)


def test_what_is_not_made_anew_is_refused(tmp_path):
    path = block(tmp_path / "block.inp", "triangle", (6, 3))
    with pytest.raises(SceneError) as error:
        parse_scene(scene_of(path, 2, group="half", size_factor=2.0))
    assert [fault.key for fault in error.value.faults] == ["bodies.0.shape.mesh.size_factor"]
    import_mesh(str(path), str(tmp_path / "block.h5"))
    for shape in ({"file": path, "group": "half"}, {"file": tmp_path / "block.h5"}):
        with pytest.raises(NotCoarsened):
            coarsen(parse_scene(scene_of(dimension=2, **shape)), 2.0)
    with pytest.raises(SceneError) as error:
        filling_of(parse_scene(scene_of(tmp_path / "block.h5", 2, size_factor=2.0)).bodies[0], 2)
    assert error.value.faults[0].key == "size_factor"


def test_bars_of_meshes_are_those_of_unlike_ones():
    times, ratios = np.linspace(0, 1, 11), np.array([1.0, 1.5, 2.25])

    def bar(*values):
        return spacing_bar(Series(times, np.outer(values, times), ratios), 2.0, 1.0, OF_MESHES)

    assert bar(1.0, 1.01, 1.0025).error[-1] == pytest.approx(2 * 0.01)
    exact = bar(*(1.0 + 0.01 * ratios**2))
    assert exact.error[-1] == pytest.approx(1.75 * 0.01, rel=1e-6) and exact.order == pytest.approx(2.0, abs=0.02)
    # an order below 1 is none of a mesh
    assert bar(*(1.0 + 0.01 * ratios**0.3)).used == 1.0


def test_the_bar_of_a_bushing_of_quads_holds_what_finer_elements_say(tmp_path):
    scene = load_scene(RUNS / "tlsph" / "bushing_static.toml", ["output={history_interval=0.5, pictures=false}"])
    found, _ = coarse_variants(scene, False)
    fine = parsed(coarsen(scene, 0.6, 0.0).tables, False, 1.0)
    runner = InProcess(MPI.COMM_WORLD, tmp_path)
    last = [Variant(one, SPACING, 1.0) for one in (scene, fine)]
    *runs, own, exact = [runner.run(one).history if one in last else runner.run(one) for one in (*found, *last)]
    bar = error_table(scene, own, runs).bars["bore.moment"].error[-1]
    assert 0.0 < abs(own["bore.moment"][-1] - exact["bore.moment"][-1]) < bar < 0.1 * own["bore.moment"][-1]


def test_an_imported_mesh_has_bars_by_recovery(tmp_path):
    """The same bushing, of which no coarser mesh is made: bars of equilibria hold the finer torque and energy."""
    import_mesh(str(RUNS / "tlsph" / "meshes" / "bushing.msh"), str(tmp_path / "bushing.h5"))
    overrides = ["output={history_interval=0.5, pictures=false}"]
    given = load_scene(RUNS / "tlsph" / "bushing_static.toml", overrides)
    shape = f"bodies.0.shape={{file={str(tmp_path / 'bushing.h5')!r}}}"
    scene = load_scene(RUNS / "tlsph" / "bushing_static.toml", [*overrides, shape])
    assert coarse_variants(scene, False)[0] == []
    fine = parsed(coarsen(given, 0.6, 0.0).tables, False, 1.0)
    runner = InProcess(MPI.COMM_WORLD, tmp_path)
    own, exact = (runner.run(Variant(one, SPACING, 1.0)).history for one in (with_recovery_probe(scene, False), fine))
    bars = error_table(scene, own, []).bars
    for column in ("bore.moment", "strain_energy"):
        assert 0.0 < abs(own[column][-1] - exact[column][-1]) < bars[column].error[-1] < 0.1 * abs(own[column][-1])
