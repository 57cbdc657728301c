"""What mesh programs leave in their files: groups of several blocks, parts of Abaqus, rounding, unnamed groups."""

import numpy as np
import pytest
from mpi4py import MPI

from parsolid.particles.meshes.abaqus import read_abaqus
from parsolid.particles.meshes.filling import Membership
from parsolid.particles.meshes.imported import import_mesh, read_mesh
from parsolid.particles.meshes.slices import read_slices
from parsolid.particles.meshes.topology import refuse_repeated
from parsolid.scene.named_regions import Region
from parsolid.scene.shapes import MeshFile
from parsolid.scene.validation_errors import SceneError

N = 4
SQUARE = [(i / (N - 1), j / (N - 1)) for j in range(N) for i in range(N)]
TRIANGLES = [
    nodes
    for j in range(N - 1)
    for i in range(N - 1)
    for a in [1 + i + N * j]
    for nodes in ((a, a + 1, a + N + 1), (a, a + N + 1, a + N))
]
LEFT = [(1 + N * j, 1 + N * (j + 1)) for j in range(N - 1)]
LOWER = [(1 + i, 2 + i) for i in range(N - 1)]


def gmsh_41(path, groups, curves, z=lambda i: 0.0, surface=("plate",)):
    """A square as Gmsh 4.1 writes it; groups: name -> (dimension, number); curves: (lines, group names), a name with
    a minus where the group takes the curve against its direction."""
    number = {name: tag for name, (_, tag) in groups.items()}

    def entity(tag, names):
        numbers = (f"{'-' if name[0] == '-' else ''}{number[name.lstrip('-')]}" for name in names)
        return f"{tag} 0 0 0 1 1 0 {len(names)} {' '.join(numbers)} 0"

    blocks = [(1, 1, lines) for lines, _ in curves] + [(2, 2, TRIANGLES)]
    lines = ["$MeshFormat", "4.1 0 8", "$EndMeshFormat", "$PhysicalNames", str(len(groups))]
    lines += [f'{dimension} {tag} "{name}"' for name, (dimension, tag) in groups.items()]
    lines += ["$EndPhysicalNames", "$Entities", f"0 {len(curves)} 1 0"]
    lines += [entity(k, names) for k, (_, names) in enumerate(curves, 1)]
    lines += [entity(1, surface), "$EndEntities", "$Nodes", "1 16 1 16", "2 1 0 16", *map(str, range(1, 17))]
    lines += [f"{x!r} {y!r} {z(i)!r}" for i, (x, y) in enumerate(SQUARE)]
    total = sum(len(own) for _, _, own in blocks)
    lines += ["$EndNodes", "$Elements", f"{len(blocks)} {total} 1 {total}"]
    count = 0
    for tag, (dimension, kind, own) in enumerate(blocks, 1):
        lines.append(f"{dimension} {tag if dimension == 1 else 1} {kind} {len(own)}")
        for nodes in own:
            count += 1
            lines.append(" ".join(map(str, (count, *nodes))))
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return str(path)


def held(path, name, dimension=2):
    """Numbers, from 1, of the nodes in a group."""
    mesh = read_slices(MPI.COMM_SELF, MeshFile.model_construct(file=path, scale=1.0), dimension)
    member = Membership(mesh, {name: Region.model_construct(name=name, group=name)}, np.zeros(len(mesh.nodes)))
    return set((1 + np.flatnonzero(member.nodes())).tolist())


def nodes_of(*curves):
    return {node for lines in curves for line in lines for node in line}


def test_groups_of_several_curves_and_curves_in_several_groups(tmp_path):
    groups = {"outer": (1, 1), "held": (1, 2), "plate": (2, 3)}
    path = gmsh_41(tmp_path / "m.msh", groups, [(LEFT, ["outer", "held"]), (LOWER, ["outer"])])
    assert held(path, "held") == nodes_of(LEFT)
    assert held(path, "outer") == nodes_of(LEFT, LOWER)
    facets = read_mesh(path, 2)[2].facets["outer"][2]
    assert {tuple(row) for row in (facets + 1).tolist()} == {tuple(sorted(line)) for line in [*LEFT, *LOWER]}


def test_curves_that_groups_take_against_their_direction(tmp_path):
    groups = {"held": (1, 1), "sides": (1, 2), "plate": (2, 3)}
    curves = [(LEFT, ["held", "-sides"]), (LOWER, ["-held"]), (LOWER[:1], ["sides"])]
    path = gmsh_41(tmp_path / "m.msh", groups, curves)
    assert held(path, "held") == nodes_of(LEFT, LOWER)
    assert held(path, "sides") == nodes_of(LEFT, LOWER[:1])
    # the second group has no name
    text = (tmp_path / "m.msh").read_text().replace("$PhysicalNames\n3\n", "$PhysicalNames\n2\n")
    (tmp_path / "m.msh").write_text(text.replace('1 2 "sides"\n', ""))
    assert held(path, "2") == nodes_of(LEFT, LOWER[:1])


def test_two_groups_of_one_name_are_one(tmp_path):
    curves = [(LEFT, ["first"]), (LOWER, ["other"])]
    path = gmsh_41(tmp_path / "m.msh", {"first": (1, 1), "other": (1, 2), "plate": (2, 3)}, curves)
    (tmp_path / "m.msh").write_text((tmp_path / "m.msh").read_text().replace('"first"', '"other"'))
    assert held(path, "other") == nodes_of(LEFT, LOWER)


def test_groups_within_groups_and_lines_in_either_direction(tmp_path):
    groups = {"a": (1, 1), "b b": (1, 2), "Säule": (1, 3), "plate": (2, 4)}
    turned, right = [line[::-1] for line in LEFT], [(N + a, N + b) for a, b in zip(range(0, 9, N), range(N, 13, N))]
    curves = [(turned, ["a", "b b", "Säule"]), (LOWER, ["b b", "Säule"]), (right, ["Säule"])]
    path = gmsh_41(tmp_path / "m.msh", groups, curves)
    assert held(path, "a") == nodes_of(LEFT) and held(path, "b b") == nodes_of(LEFT, LOWER)
    assert held(path, "Säule") == nodes_of(LEFT, LOWER, right)


def test_groups_of_points_of_parts_of_the_plate_and_in_turns(tmp_path):
    blocks = [(15, 5, [(1,), (4,)]), (1, 7, LEFT[:1]), (1, 8, LOWER), (1, 7, LEFT[1:])]
    path = gmsh_22(tmp_path / "m.msh", [*blocks, (2, 2, TRIANGLES[:8]), (2, 3, TRIANGLES[8:])])
    wanted = {"5": {1, 4}, "7": nodes_of(LEFT), "8": nodes_of(LOWER), "2": nodes_of(TRIANGLES[:8])}
    assert {name: held(path, name) for name in wanted} == wanted


def test_rounding_out_of_the_plane_is_no_third_dimension(tmp_path):
    path = gmsh_41(tmp_path / "m.msh", {"plate": (2, 1)}, [], z=lambda i: 1e-17 * (i % 2))
    assert read_mesh(path, 2)[0].shape == (16, 2)
    with pytest.raises(SceneError):
        read_mesh(gmsh_41(tmp_path / "n.msh", {"plate": (2, 1)}, [], z=lambda i: 1e-3 * (i % 2)), 2)


def gmsh_22(path, blocks, extra=()):
    """Version 2.2; blocks: (kind, group number, elements); extra: coordinates of nodes of no element."""
    nodes = [(x, y, 0.0) for x, y in SQUARE] + list(extra)
    elements = [(kind, group, own) for kind, group, rows in blocks for own in rows]
    lines = ["$MeshFormat", "2.2 0 8", "$EndMeshFormat", "$Nodes", str(len(nodes))]
    lines += [f"{i} {x!r} {y!r} {z!r}" for i, (x, y, z) in enumerate(nodes, 1)]
    lines += ["$EndNodes", "$Elements", str(len(elements))]
    for i, (kind, group, own) in enumerate(elements, 1):
        lines.append(" ".join(map(str, (i, kind, 2, group, group, *own))))
    path.write_text("\n".join([*lines, "$EndElements", ""]))
    return str(path)


def test_a_node_of_no_element_may_lie_off_the_plane(tmp_path):
    path = gmsh_22(tmp_path / "m.msh", [(2, 1, TRIANGLES)], extra=[(0.5, 0.5, 3.0)])
    assert len(read_mesh(path, 2)[1][0][1]) == len(TRIANGLES)


def test_a_number_of_groups_of_two_dimensions_is_no_name(tmp_path):
    path = gmsh_22(tmp_path / "m.msh", [(1, 1, LEFT), (2, 1, TRIANGLES)])
    assert "1" not in read_mesh(path, 2)[2].names


def test_an_element_in_two_blocks_is_refused(tmp_path):
    path = gmsh_22(tmp_path / "m.msh", [(2, 1, TRIANGLES), (1, 2, LEFT), (2, 3, TRIANGLES[:1])])
    with pytest.raises(SceneError):
        refuse_repeated(read_slices(MPI.COMM_SELF, MeshFile.model_construct(file=path, scale=1.0), 2))


NODES = [f"{i}, {x!r}, {y!r}, 0." for i, (x, y) in enumerate(SQUARE, 1)]
ELEMENTS = [f"{i}, {a}, {b}, {c}" for i, (a, b, c) in enumerate(TRIANGLES, 1)]


def abaqus(path, *lines):
    path.write_text("\n".join(["*Heading", *lines, ""]))
    return str(path)


def part(name, kind="CPS3", more=()):
    return [f"*Part, name={name}", "*Node", *NODES, f"*Element, type={kind}", *ELEMENTS, *more, "*End Part"]


def test_parts_of_abaqus_stand_where_their_instances_do(tmp_path):
    sets = ["*Nset, nset=left", "1, 5, 9, 13"]
    placed = ["*Instance, name=A-1, part=A", "*End Instance", "*Instance, name=A-2, part=A", "2., 0., 0."]
    turned = ["2., 0., 0., 2., 0., 1., 90.", "*End Instance", "*End Assembly"]
    path = abaqus(tmp_path / "m.inp", *part("A", more=sets), "*Assembly, name=Asm", *placed, *turned)
    points, blocks, groups, _ = read_mesh(path, 2)
    square = np.array(SQUARE)
    np.testing.assert_allclose(points[:16], square, atol=1e-15)
    # turned by 90 degrees about Z through (2, 0)
    np.testing.assert_allclose(points[16:], np.stack([2.0 - square[:, 1], square[:, 0]], axis=1), atol=1e-15)
    assert sum(len(cells) for _, cells in blocks) == 2 * len(TRIANGLES)
    assert groups.nodes["left"].tolist() == [0, 4, 8, 12, 16, 20, 24, 28]
    assert groups.nodes["A-2.left"].tolist() == [16, 20, 24, 28]


def test_sets_of_an_assembly_belong_to_the_instance_that_they_name(tmp_path):
    lines = [
        "*Assembly, name=Asm",
        "*Instance, name=A-1, part=A",
        "*End Instance",
        "*Nset, nset=low, instance=A-1, generate",
    ]
    path = abaqus(tmp_path / "m.inp", *part("A"), *lines, "1, 4, 1", "*End Assembly")
    assert read_mesh(path, 2)[2].nodes["low"].tolist() == [0, 1, 2, 3]


def test_nodes_in_two_sections_and_sets_in_two_blocks(tmp_path):
    nodes = ["*Node", *NODES[:7], "*Node", *NODES[7:]]
    blocks = ["*Element, type=CPE3, elset=all", *ELEMENTS[:5], "*Element, type=CPE3, elset=all", *ELEMENTS[5:]]
    points, _, groups, _ = read_mesh(abaqus(tmp_path / "m.inp", *nodes, *blocks), 2)
    np.testing.assert_array_equal(points, np.array(SQUARE))
    assert groups.elements["all"].tolist() == list(range(len(TRIANGLES)))


def test_sets_of_abaqus_in_steps_of_sets_and_in_any_case(tmp_path):
    lines = ["*NODE , NSET = All", *NODES, "*ELEMENT , TYPE = cps3, ELSET=Plate", *ELEMENTS, "** a comment"]
    lines += ["*nset , nset = Left, generate", "1, 13, 4", "*Nset, nset=a", "2,", "3", "*Nset, nset=both", "Left, a"]
    path = abaqus(tmp_path / "m.inp", *lines, "*Elset, elset=s, generate", "1, 5, 2")
    wanted = {"All": set(range(1, 17)), "Left": {1, 5, 9, 13}, "both": {1, 2, 3, 5, 9, 13}}
    wanted["s"] = nodes_of([TRIANGLES[0], TRIANGLES[2], TRIANGLES[4]])
    assert {name: held(path, name) for name in wanted} == wanted


@pytest.mark.parametrize(
    "name, kind", [("C3D8R", "hexahedron"), ("C3D4", "tetra"), ("CPE4R", "quad"), ("CAX3", "triangle")]
)
def test_element_types_of_abaqus(tmp_path, name, kind):
    count = {"hexahedron": 8, "tetra": 4, "quad": 4, "triangle": 3}[kind]
    row = ", ".join(map(str, range(1, count + 1)))
    path = abaqus(tmp_path / "m.inp", "*Node", *NODES, f"*Element, type={name}", f"1, {row}")
    assert [block.type for block in read_abaqus(path).cells] == [kind]
    for wrong, word in ((["*Element, type=DC2D9"], "DC2D9"), (["*Element, type=CPS3", "1, 1, 2, 99"], "99")):
        with pytest.raises(SceneError, match=word):
            read_mesh(abaqus(tmp_path / "m.inp", "*Node", *NODES, *wrong), 2)


CORNERS = {0: "0 0 0", 1: "1 0 0", 2: "1 1 0", 3: "0 1 0"}


@pytest.mark.parametrize("order", [[0, 1, 2, 3], [1, 0, 3, 2]])
def test_nodes_in_any_order_from_zero_on(tmp_path, order):
    rows = "\n".join(f"{number} {CORNERS[number]}" for number in order)
    text = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n{rows}\n$EndNodes\n"
    (tmp_path / "m.msh").write_text(text + "$Elements\n1\n1 3 2 1 1 0 1 2 3\n$EndElements\n")
    points, blocks, *_ = read_mesh(str(tmp_path / "m.msh"), 2)
    assert points[blocks[0][1][0]].tolist() == [[0, 0], [1, 0], [1, 1], [0, 1]]


def test_node_zero_is_refused_where_meshio_takes_another(tmp_path):
    text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n$Nodes\n1 4 0 3\n2 1 0 4\n0\n1\n2\n3\n"
    text += "\n".join(CORNERS.values()) + "\n$EndNodes\n$Elements\n1 1 1 1\n2 1 3 1\n1 0 1 2 3\n$EndElements\n"
    (tmp_path / "m.msh").write_text(text)
    with pytest.raises(SceneError):
        read_mesh(str(tmp_path / "m.msh"), 2)


def test_flat_elements_are_not_imported(tmp_path):
    nodes = "\n".join(f"{i + 1} {place}" for i, place in enumerate(["0 0 0", "1 0 0", "0 1 0", "2 0 0"]))
    text = f"$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n4\n{nodes}\n$EndNodes\n"
    (tmp_path / "m.msh").write_text(text + "$Elements\n2\n1 2 2 1 1 1 2 3\n2 2 2 1 1 1 2 4\n$EndElements\n")
    with pytest.raises(SceneError):
        import_mesh(str(tmp_path / "m.msh"), str(tmp_path / "m.h5"))
    assert not (tmp_path / "m.h5").exists()
