"""Bodies in contact of which one alone lies on a symmetry plane: behind it there is nothing for the other to feel."""

import numpy as np
import pytest
from mpi4py import MPI
from solids import recorded

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

LAW = {"density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
KINDS = {
    "leapfrog": ({"kind": "tlsph", "integrator": "leapfrog", "dissipation": 0.0}, "neo-hookean"),
    "stages": ({"kind": "tlsph"}, "neo-hookean"),
    "peridynamics": ({"kind": "peridynamics"}, "linear-elastic"),
}


def along(sim: Simulation) -> dict[str, float]:
    """Momentum [N s] along the plane."""
    system = sim.systems[0]
    mass = system.mass[: system.owned] * system.share[: system.owned]
    return {"momentum": float(mass @ system.particles.owned_rows("velocity")[:, 0])}


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("both", [False, True])
def test_momentum_along_the_plane_is_kept(kind, both):
    """Of nodes on it 3 % were lost in each impact, and 3 % of the energy came from nowhere."""
    method, law = KINDS[kind]
    bodies = []
    for name, low, v in (("left", [-0.505, 0.0], 0.02), ("right", [0.0, 0.0 if both else -0.1], -0.02)):
        box = {"lower": low, "upper": [low[0] + 0.5, low[1] + 0.4]}
        body = {"name": name, "shape": {"box": box}, "particles": [11, 9], "placement": "vertices"}
        bodies.append(body | {"velocity": [v, 0.0], "material": LAW | {"kind": law}})
    planes = [{"plane": "Y = 0", "kind": "roller", "body": name} for name in ("left", "right")[: 1 + both]]
    data = {"dimension": 2, "end_time": 0.8, "method": method, "bodies": bodies, "boundaries": planes}
    data |= {"contact": [{"bodies": ["left", "right"], "friction": 0.2}], "output": {"fields_times": []}}
    found = recorded(Simulation(MPI.COMM_SELF, parse_scene(data)), along)
    energy, scale = found["kinetic"][0], np.sqrt(2.0 * found["kinetic"][0] * 0.4)
    assert found["contact_energy"].max() > 0.05 * energy
    assert np.abs(found["momentum"] - found["momentum"][0]).max() < 1e-13 * scale
    assert np.abs(found["energy_error"]).max() < 1e-3 * energy
