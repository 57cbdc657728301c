"""Meshes that ranks share: the same particles as on one rank, and from an imported file; files that are damaged."""

import json
import shutil

import h5py
import numpy as np
import pytest
from element_meshes import KINDS, element_mesh
from mpi4py import MPI

from parsolid.checksums import digest
from parsolid.commands.cli import main
from parsolid.particles.generation import generate
from parsolid.particles.meshes.around import elements_around
from parsolid.particles.meshes.elements import ELEMENTS
from parsolid.particles.meshes.imported import import_mesh, read_mesh
from parsolid.scene import SceneError, parse_scene

ALL = [(d, kind) for d in KINDS for kind in KINDS[d]]
COUNTS = {2: (9, 5), 3: (5, 4, 3)}
NAMES = ("identifier", "position", "volume", "spacing", "area", "area_across", "regions", "surfaces")
# of elements in input files of Abaqus, by dimension, kind and nodes
TYPES = {(2, "triangle", 3): "CPS3", (2, "quad", 4): "CPS4", (2, "side", 2): "T2D2"}
TYPES |= {(3, "tetra", 4): "C3D4", (3, "pyramid", 5): "C3D5", (3, "wedge", 6): "C3D6", (3, "hexahedron", 8): "C3D8"}
TYPES |= {(3, "side", 3): "S3", (3, "side", 4): "S4"}
EXACT = ("identifier", "position", "regions")


def write(path, dimension, kind, seed=3):
    """A mesh with nodes of no element, elements in random order, and groups of nodes, elements and facets."""
    points, blocks = element_mesh(kind, COUNTS[dimension])
    rng = np.random.default_rng(seed)
    number = rng.permutation(len(points) + 5)[: len(points)]
    moved = np.full((len(points) + 5, 3), 50.0)
    moved[:, 2] = 0.0
    moved[number, :dimension] = points
    blocks = [(name, number[rng.permutation(cells)]) for name, cells in blocks]
    kind, some = blocks[0][0], blocks[0][1][rng.random(len(blocks[0][1])) < 0.3]
    facets = [facet for facet in ELEMENTS[kind].facets if len(facet) == len(ELEMENTS[kind].facets[0])]
    sides = np.concatenate([some[:, facet] for facet in facets])
    lines = ["*Node", *(f"{i}, {x!r}, {y!r}, {z!r}" for i, (x, y, z) in enumerate(moved.tolist(), 1))]
    sets, count = {"some": [], "sides": []}, 0
    for name, cells in [*blocks, ("side", sides)]:
        numbers = count + 1 + np.arange(len(cells))
        lines += [f"*Element, type={TYPES[dimension, name, cells.shape[1]]}"]
        lines += [", ".join(map(str, [i, *(nodes + 1)])) for i, nodes in zip(numbers, cells)]
        sets["sides" if name == "side" else "some"].append(numbers[(name == "side") | (rng.random(len(cells)) < 0.3)])
        count += len(cells)
    lines += ["*Nset, nset=nodes", *map(str, 1 + number[points[:, 0] < 2.1])]
    for name, numbers in sets.items():
        lines += [f"*Elset, elset={name}", *map(str, np.concatenate(numbers))]
    path.write_text("\n".join([*lines, ""]))


def scene_of(path, dimension, placement, scale=0.5):
    law = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
    body = {"shape": {"mesh": {"file": str(path), "scale": scale}}, "material": law, "placement": placement}
    regions = [
        {"name": "low", "formula": "X < 0.9"},
        {"name": "both", "all_of": ["low", "some"]},
        {"name": "not", "none_of": ["sides", "nodes"]},
    ]
    held = [{"kind": "fixed", "where": name} for name in ("low", "both", "not", "some", "sides", "nodes")]
    method = {"kind": "tlsph", "weights": "kernel"}
    return parse_scene(
        {"dimension": dimension, "end_time": 1.0, "method": method, "bodies": [body], "regions": regions}
        | {"boundaries": held}
    )


def gathered(comm, particle_set):
    return {name: np.concatenate(comm.allgather(getattr(particle_set, name))) for name in NAMES}


@pytest.mark.parametrize("placement", ["vertices", "cells"])
@pytest.mark.parametrize(("dimension", "kind"), ALL)
def test_particles_are_those_of_one_rank_and_of_the_imported_file(shared_path, comm, dimension, kind, placement):
    plain, imported = shared_path / f"{kind}.inp", shared_path / f"{kind}.h5"
    if comm.rank == 0:
        write(plain, dimension, kind)
        import_mesh(str(plain), str(imported))
    comm.Barrier()
    alone = gathered(MPI.COMM_SELF, generate(scene_of(plain, dimension, placement), MPI.COMM_SELF))
    found = gathered(comm, generate(scene_of(plain, dimension, placement), comm))
    other = gathered(comm, generate(scene_of(imported, dimension, placement), comm))
    assert alone["regions"].any(axis=0).all() and alone["surfaces"].any()
    for name in NAMES:
        scale = np.abs(alone[name]).max()
        np.testing.assert_allclose(found[name], alone[name], rtol=0.0, atol=0.0 if name in EXACT else 1e-14 * scale)
        np.testing.assert_array_equal(found[name], other[name])


@pytest.mark.parametrize(("dimension", "kind"), ALL)
def test_elements_go_to_the_ranks_of_their_nodes(shared_path, comm, dimension, kind):
    path = shared_path / "mesh.inp"
    if comm.rank == 0:
        write(path, dimension, kind)
    comm.Barrier()
    body = scene_of(path, dimension, "vertices").bodies[0]
    count = len(generate(scene_of(path, dimension, "vertices"), MPI.COMM_SELF))
    rank_of = np.random.default_rng(5).integers(0, comm.size, count)
    alone = elements_around(MPI.COMM_SELF, body, dimension, 7 + np.arange(count), {})
    mine = elements_around(comm, body, dimension, 7 + np.flatnonzero(rank_of == comm.rank), {})
    assert (mine.extent, mine.of_second_order) == (alone.extent, alone.of_second_order)
    for name, cells in alone.blocks:
        own = cells[(rank_of[cells - 7] == comm.rank).any(axis=1)]
        np.testing.assert_array_equal(dict(mine.blocks)[name] if len(own) else own, own)


# --- files ----------------------------------------------------------------------------------------------------------


@pytest.fixture
def imported(shared_path, comm):
    if comm.rank == 0:
        write(shared_path / "part.inp", 3, "mixed")
        import_mesh(str(shared_path / "part.inp"), str(shared_path / "part.h5"))
    comm.Barrier()
    return shared_path / "part.h5"


def test_one_rank_reads_the_whole_of_it(imported):
    plain, other = (read_mesh(str(path), 3) for path in (imported.with_suffix(".inp"), imported))
    assert plain.of_second_order == other.of_second_order and plain.groups.names == other.groups.names
    np.testing.assert_array_equal(plain.points, other.points)
    for (kind, cells), (same, theirs) in zip(plain.blocks, other.blocks, strict=True):
        assert kind == same and np.array_equal(cells, theirs)
    for name, members in plain.groups.elements.items():
        np.testing.assert_array_equal(members, other.groups.elements[name])


def refused(comm, path, dimension=3):
    """The key and what is said of a file, the same on all ranks."""
    with pytest.raises(SceneError) as caught:
        generate(scene_of(path, dimension, "vertices"), comm)
    told = comm.allgather(caught.value.faults)
    assert all(faults == told[0] for faults in told) and len(told[0]) == 1
    key, _, text = told[0][0].partition(": ")
    assert key == "bodies.0.shape.mesh.file" and text.startswith("expected ") and ", found " in text
    return text


def changed(comm, path, change):
    """A copy of a file, changed by one rank."""
    other = path.with_name("other.h5")
    if comm.rank == 0:
        shutil.copy(path, other)
        with h5py.File(other, "r+") as file:
            change(file)
    comm.Barrier()
    return other


@pytest.mark.parametrize("name", ["points", "elements/2", "groups/nodes/0", "groups/elements/0", "groups/facets/0"])
def test_a_changed_number_is_damage(imported, comm, name):
    def change(file):
        rows = file[name][()]
        rows.ravel()[-1] += 1
        file[name][...] = rows

    assert name in refused(comm, changed(comm, imported, change))


def test_other_files_are_refused(imported, comm):
    for key, value in (("format", "another"), ("version", 0), ("version", 2)):
        refused(comm, changed(comm, imported, lambda file, key=key, value=value: file.attrs.update({key: value})))
    refused(comm, changed(comm, imported, lambda file: file.attrs.clear()))
    refused(comm, changed(comm, imported, lambda file: file.pop("header")))
    refused(comm, changed(comm, imported, lambda file: file.pop("points")))
    refused(comm, imported, 2)

    def longer(file):
        rows = file["points"][()]
        del file["points"]
        file["points"] = np.concatenate([rows, rows[:1]])

    refused(comm, changed(comm, imported, longer))

    def header(file):
        values = json.loads(file["header"][()].tobytes())
        values["kinds"] = values["kinds"][::-1]
        del file["header"]
        file["header"] = np.void(json.dumps(values).encode())

    refused(comm, changed(comm, imported, header))


@pytest.mark.parametrize("part", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_torn_file_is_refused(imported, comm, part):
    other = imported.with_name("torn.h5")
    if comm.rank == 0:
        whole = imported.read_bytes()
        other.write_bytes(whole[: int(part * len(whole))])
    comm.Barrier()
    refused(comm, other)


def test_the_command(shared_path, comm, capfd):
    mesh, target = shared_path / "part.inp", shared_path / "new.h5"
    if comm.rank == 0:
        write(mesh, 2, "mixed")
    comm.Barrier()
    assert main(["import", str(mesh), str(target)]) == 0
    whole = target.read_bytes()
    comm.Barrier()
    # what is there stays
    assert main(["import", str(mesh), str(target)]) == 2 and target.read_bytes() == whole
    assert main(["import", str(target), str(shared_path / "again.h5")]) == 2
    assert main(["import", str(shared_path / "none.inp"), str(shared_path / "none.h5")]) == 2
    assert main(["import", str(mesh), str(shared_path / "no/folder.h5")]) == 2
    assert main(["import", str(mesh), str(shared_path / "new.txt")]) == 2
    assert sorted(path.name for path in shared_path.iterdir()) == ["new.h5", "part.inp"]
    with h5py.File(target) as file:
        text = file["checksums"][()].tobytes().partition(b"\n")
        assert text[0].decode() == digest(text[2]) and file.attrs["format"] == "parsolid mesh"
