"""Angular momentum of material points, what their slopes carry included."""

import numpy as np
import pytest
from mpm.points import SOFT, scene
from solids import run_steps, run_to_end

from parsolid.methods.mpm.transfer import particles_to_grid
from parsolid.observables.declared import Observables
from parsolid.observables.quantities import AngularMomentum


def told(sim) -> np.ndarray:
    """Of all ranks."""
    return sim.comm.allreduce(AngularMomentum("spin", ["x", "y", "z"]).part(Observables(sim.systems)))


def of_nodes(sim) -> np.ndarray:
    """sum x_i cross p_i of what particles give to the nodes."""
    system = sim.systems[0]
    nodes, points = system.nodes, system.points
    nodes.follow_cells()
    nodes.clear(nodes.motion)
    slope, stress = points.storage("velocity_slope"), points.storage("stress_and_volume")
    particles_to_grid(points.basis, nodes.cells, points.motion, slope, stress, None, nodes.motion)
    found = np.cross(nodes.places[:, :3], nodes.motion[: nodes.count, :3]).sum(axis=0)
    return found if system.dimension == 3 else found[2:]


# nodes that ranks share would count twice
@pytest.mark.serial
@pytest.mark.parametrize(
    "basis, dimension, transfer",
    [
        ("linear", 2, "apic"),
        ("cubic-spline", 2, "aflip"),
        ("quadratic-spline", 2, "apic"),
        ("quadratic-spline", 3, "aflip"),
    ],
)
def test_what_is_told_is_that_of_the_nodes(basis, dimension, transfer, comm):
    """In the order of `cases`, whose kernels are compiled."""
    rest = ["9*X - 3*Y"] if dimension == 3 else []
    body = {"velocity": ["-20*Y + 3*X", "20*X + 5*Y", *rest]}
    method = {"basis": basis, "transfer": transfer, "order": "usl"}
    data = scene([0.03] * dimension, [0.43] * dimension, 0.05, 0.1, material=SOFT, method=method, body=body)
    sim, _ = run_steps(data, 2, comm)
    np.testing.assert_allclose(told(sim), of_nodes(sim), rtol=1e-12, atol=1e-10)
    own = sim.systems[0].shown("own_angular_momentum", 0, sim.systems[0].owned).sum(axis=0)
    assert np.abs(own).max() > 1e-2 * np.abs(told(sim)).max()


@pytest.mark.parametrize(("more", "most"), [({"transfer": "apic", "order": "usl"}, 1e-8), ({"transfer": "apic"}, 1e-4)])
def test_points_in_contact_keep_what_is_told(more, most, comm):
    """But for nodes of next to no mass, and where places follow what strains (MUSL). Without slopes 1e-2 is lost."""
    data = scene([0.0, 0.0], [0.4, 0.4], 0.05, 0.1, material=SOFT, method=more, end_time=6e-3)
    other = {"shape": {"box": {"lower": [0.41, 0.2], "upper": [0.81, 0.6]}}, "name": "right"}
    data["bodies"] = [
        data["bodies"][0] | {"name": "left", "velocity": [8.0, 0.0]},
        data["bodies"][0] | other | {"velocity": [-8.0, 0.0]},
    ]
    data["contact"] = [{"bodies": ["left", "right"], "friction": 0.3}]
    sim, columns = run_to_end(data, comm, lambda sim: {"spin": told(sim)[0]})
    assert columns["contact_energy"].max() > 0.02 * columns["kinetic"][0]
    assert np.abs(columns["spin"] - columns["spin"][0]).max() < most * np.abs(columns["spin"][0])
