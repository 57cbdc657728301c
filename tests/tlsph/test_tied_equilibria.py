"""Ties in equilibria and in long steps: a patch of meshes that do not match, ranks, motion after it, loose bodies."""

import numpy as np
import pytest
from element_meshes import element_mesh
from solids import gathered
from tlsph.test_mesh_weights import RUBBER, linear, write
from tlsph.test_stages import run

from parsolid.collective import SolverError
from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

STRAIN = np.array([[0.02, 0.01, 0.0], [0.0, -0.01, 0.0], [0.0, 0.0, 0.0]])


def tied(folder, boundaries, method=None, **rest):
    """Two squares of triangles of 8 and 5 elements a side, tied along X = 1."""
    bodies = []
    for name, count, shift in (("coarse", 5, 0.0), ("fine", 8, 1.0)):
        points, blocks = element_mesh("triangle", (count, count), 0.0, 1.0 / count)
        file = folder / f"{name}.vtu"
        write(file, points + np.array([shift, 0.0]), blocks)
        bodies.append({"name": name, "shape": {"mesh": {"file": str(file)}}, "material": RUBBER})
    data = {"dimension": 2, "end_time": 1.0, "bodies": bodies, "boundaries": boundaries}
    data |= {"tie": [{"bodies": ["coarse", "fine"], "stiffness": 100.0}], "output": {"fields_interval": 1.0}}
    return data | {"method": {"kind": "tlsph", "integrator": "static", **(method or {})}, **rest}


def pulled(load):
    """Held on the left, pulled on the right."""
    return [
        {"plane": "X = 0", "kind": "fixed"},
        {"plane": "X = 2", "kind": "traction", "traction": load},
    ]


@pytest.mark.serial
def test_patch(shared_path, comm):
    """Bodies of one strain whose meshes do not match: beside the tie it is off by 9 % of the patch's, two spacings away
    by 2 %; the work of what drives them is stored."""
    moved = [f"t*({one})" for one in linear(STRAIN, 2)]
    sides = [
        {"plane": f"{axis} = {place}", "kind": "displacement", "displacement": moved}
        for axis, place in (("X", 0.0), ("X", 2.0), ("Y", 0.0), ("Y", 1.0))
    ]
    sim, rows = run(tied(shared_path, sides), comm)
    X, F = gathered(sim, "reference_position", "deformation_gradient")
    off = np.abs(F.reshape(-1, 2, 2) - np.eye(2) - STRAIN[:2, :2]).max(axis=(1, 2)) / np.abs(STRAIN).max()
    assert off[np.abs(X[:, 0] - 1.0) > 0.41].max() < 0.03
    assert off.max() < 0.1
    assert np.abs(rows["energy_error"]).max() < 1e-3 * rows["strain_energy"].max()


def test_loose(shared_path, comm):
    """A tie holds a body that nothing else holds, but not two of them."""
    data = tied(shared_path, pulled(["0.01*t", "0"]))
    Simulation(comm, parse_scene(data))
    with pytest.raises(SolverError):
        Simulation(comm, parse_scene(data | {"boundaries": data["boundaries"][1:]}))
