"""Directions and numbers that the elements of a mesh have, at its particles, on any number of ranks."""

import meshio
import numpy as np
import pytest
from element_meshes import element_mesh

from parsolid.collective import SolverError
from parsolid.particles.generation import generate
from parsolid.particles.law_values import cell_data_at
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.loop import Simulation

TISSUE = {
    "kind": "holzapfel-gasser-ogden",
    "density": 1000.0,
    "shear_modulus": 1e5,
    "bulk_modulus": 1e6,
    "fibre_modulus": 3e5,
    "fibre_exponent": 2.0,
    "fibre": {"cell_data": "grain"},
}


def turned(places):
    """Directions (n, d) by place, of both signs."""
    angle = 0.9 * places[:, 0] + 0.3 * places[:, 1]
    vectors = np.zeros_like(places)
    vectors[:, 0], vectors[:, 1] = np.cos(angle), np.sin(angle)
    return vectors * np.where(np.arange(len(places)) % 2, 1.0, -3.0)[:, None]


def with_grain(path, dimension, along=3):
    """A mesh file of mixed elements with the directions of their middles."""
    points, blocks = element_mesh("mixed", (along,) * dimension, scale=0.1)
    middles = [points[cells].mean(axis=1) for _, cells in blocks]
    data, start = [], 0
    for places in middles:
        every = turned(np.concatenate(middles))[start : start + len(places)]
        data.append(np.pad(every, ((0, 0), (0, 3 - dimension))))
        start += len(places)
    named = {"grain": data, "lost": [np.nan * one for one in data], "none": [0.0 * one for one in data]}
    meshio.Mesh(np.pad(points, ((0, 0), (0, 3 - dimension))), blocks, cell_data=named).write(path)


def scene(path, dimension, placement, **material):
    shape = {"mesh": {"file": str(path)}}
    body = {"shape": shape, "placement": placement, "material": TISSUE | material}
    return parse_scene({"dimension": dimension, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [body]})


@pytest.mark.parametrize("placement", ["cells", "vertices"])
@pytest.mark.parametrize("dimension", [2, 3])
def test_particles_have_the_directions_of_their_elements(comm, shared_path, dimension, placement):
    path = shared_path / "mixed.vtu"
    if comm.rank == 0:
        with_grain(path, dimension)
    comm.Barrier()
    particles = Simulation(comm, scene(path, dimension, placement)).systems[0].particles
    found, places = particles.owned_rows("fibre"), particles.owned_rows("reference_position")
    np.testing.assert_allclose(np.linalg.norm(found, axis=1), 1.0, rtol=1e-12)
    expected = turned(places)
    expected /= np.linalg.norm(expected, axis=1)[:, None]
    # on nodes the mean of the elements around: at corners the middle of one, half a cell and .08 rad away
    bound = 1e-9 if placement == "cells" else 1.0 - np.cos(0.08)
    assert (1.0 - np.abs(np.einsum("ni,ni->n", found, expected)) < bound).all()


@pytest.mark.parametrize(
    ("stated", "key"),
    [
        ({"cell_data": "grains"}, "fibre.cell_data"),
        ({"cell_data": "lost"}, "fibre.cell_data"),
        ({"cell_data": "none"}, "fibre"),
        ({"vector": ["X - X", "0"]}, "fibre"),
    ],
)
def test_what_is_no_direction_ends_the_set_up(comm, shared_path, stated, key):
    path = shared_path / "mixed.vtu"
    if comm.rank == 0:
        with_grain(path, 2)
    comm.Barrier()
    with pytest.raises(SolverError, match=rf"^bodies\.0\.material\.{key}: expected"):
        Simulation(comm, scene(path, 2, "vertices", fibre=stated))


@pytest.mark.parametrize("left", ["none", "other"])
def test_a_mesh_that_is_no_longer_there_is_told_of_on_all_ranks(comm, shared_path, left):
    """As at a restart, which makes no particles."""
    path = shared_path / "mixed.vtu"
    if comm.rank == 0:
        with_grain(path, 2)
    comm.Barrier()
    stated = scene(path, 2, "cells")
    particle_set = generate(stated, comm)
    comm.Barrier()
    if comm.rank == 0:
        path.unlink()
        if left == "other":
            with_grain(path, 2, 4)
    comm.Barrier()
    with pytest.raises(SceneError, match="^expected"):
        cell_data_at(comm, stated.bodies[0], 2, particle_set.identifier, "grain", 3)


def test_a_body_without_a_mesh_has_no_cell_data(comm):
    box = {"shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}}, "particles": [4, 4], "material": TISSUE}
    data = {"dimension": 2, "end_time": 1.0, "method": {"kind": "tlsph"}, "bodies": [box]}
    with pytest.raises(SolverError, match=r"^bodies\.0\.material\.fibre\.cell_data: expected"):
        Simulation(comm, parse_scene(data))
