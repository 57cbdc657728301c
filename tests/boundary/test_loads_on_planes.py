"""Loads on planes of bodies from meshes: on the facets that lie in the plane, not on oblique ones beside them."""

from types import SimpleNamespace

import meshio
import numpy as np
import pytest
from element_meshes import KINDS, element_mesh
from mpi4py import MPI
from solids import SOFT, set_random_state, simulation, tables

from parsolid.boundary.walls import Walls
from parsolid.collective import SolverError
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.particles.generated import declare_generated
from parsolid.particles.generation import generate
from parsolid.scene import parse_scene
from parsolid.scene.base_model import Plane

COUNTS = {2: (4, 3), 3: (3, 2, 3)}
AREA = {2: 4.0, 3: 9.0}
# of placement; nodes have weights of their mesh, elements those of a kernel
METHODS = {"vertices": {}, "cells": {"weights": "kernel"}}


def leaning(path, dimension: int, kind: str, placement: str, boundaries: list, comm) -> dict:
    """Raw tables of a block whose sides lean and widen towards the plane Y = top, on which its area is the same."""
    points, blocks = element_mesh(kind, COUNTS[dimension])
    height = points[:, 1] - COUNTS[dimension][1]
    points[:, 0] += height * (0.4 - 0.1 * points[:, 0])
    points[:, 2:] -= 0.3 * height[:, None]
    if comm.rank == 0:
        space = np.pad(points, ((0, 0), (0, 3 - dimension)))
        meshio.write(path, meshio.Mesh(space, blocks), file_format="gmsh22", binary=False)
    comm.Barrier()
    data = tables(COUNTS[dimension], method=METHODS[placement], boundaries=boundaries)
    data["bodies"] = [{"shape": {"mesh": {"file": str(path)}}, "material": SOFT, "placement": placement}]
    return data


@pytest.mark.parametrize("placement", METHODS)
@pytest.mark.parametrize(("dimension", "kind"), [(2, "triangle"), (2, "quad"), (3, "tetra"), (3, "hexahedron")])
def test_a_traction_has_the_area_of_the_facets_in_its_plane(shared_path, comm, dimension, kind, placement):
    traction = [0.3, -0.2, 0.1][:dimension]
    plane = f"Y = {COUNTS[dimension][1]}"
    load = {"kind": "traction", "plane": plane, "traction": traction}
    sim = simulation(leaning(shared_path / "m.msh", dimension, kind, placement, [load], comm), comm)
    forces = sim.systems[0].conditions.surface_forces(0.0)
    total = comm.allreduce(forces.sum(axis=1))
    np.testing.assert_allclose(total, AREA[dimension] * np.array(traction), rtol=1e-13)


@pytest.mark.serial
@pytest.mark.parametrize("dimension", KINDS)
@pytest.mark.parametrize(
    "load",
    [
        {"kind": "traction", "traction": [0.3, -0.2, 0.1]},
        {"kind": "pressure", "pressure": 0.7},
        {"kind": "spring", "stiffness": 2.0, "along": "normal"},
    ],
    ids=lambda one: one["kind"],
)
def test_a_load_on_a_plane_is_that_on_the_plane_with_a_name(shared_path, comm, dimension, load):
    plane = f"Y = {COUNTS[dimension][1]}"
    if "traction" in load:
        load = load | {"traction": load["traction"][:dimension]}
    forces = []
    for place in ({"plane": plane}, {"where": "top"}):
        data = leaning(shared_path / "m.msh", dimension, "mixed", "vertices", [load | place], comm)
        sim = simulation(data | ({"regions": [{"name": "top", "plane": plane}]} if "where" in place else {}), comm)
        set_random_state(sim)
        forces.append(sim.systems[0].conditions.surface_forces(0.0))
    found, wanted = forces
    largest = comm.allreduce(np.abs(wanted).max(initial=0.0))
    assert largest > 0.01
    np.testing.assert_allclose(found, wanted, rtol=0.0, atol=1e-14 * largest)


@pytest.mark.parametrize("axis", "XY")
def test_a_wall_stands_beside_a_ring_whose_spacings_differ_wherever_it_is(axis):
    shell = {"centre": [0, 0], "radius": 1, "thickness": 0.3}
    body = {"shape": {"cylindrical_shell": shell}, "particles": [24, 13], "material": SOFT}
    wall = {"kind": "wall", "side": "below", "plane": f"{axis} = 1.17"}
    method = {"kind": "mpm", "cell": 0.6}
    scene = parse_scene({"dimension": 2, "end_time": 1.0, "method": method, "bodies": [body], "boundaries": [wall]})
    particle_set = generate(scene, MPI.COMM_SELF)
    particles = Particles(particle_set.body)
    declare_generated(particles, particle_set)
    particles.declare(Field("position", 2, "m", mirror="vector"), particle_set.position)

    def stand(wall):
        of = {"of": lambda kind: [("wall", wall)], "reaction_of": lambda wall: None}
        return Walls(MPI.COMM_SELF, SimpleNamespace(particles=particles, dimension=2, **of))

    stand(scene.boundaries[0])
    with pytest.raises(SolverError):
        stand(scene.boundaries[0].model_copy(update={"plane": Plane.parse(f"{axis} = 1.12")}))
