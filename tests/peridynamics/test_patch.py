"""A uniform stress under consistent tractions and mirror rollers is exact, whatever the law and the particles."""

import numpy as np
import pytest
from peridynamics.bonds_of_bodies import scene
from solids import run_to_end

E, NU, PULL = 3.0, 0.3, 0.03
NODES, IRREGULAR = {"placement": "vertices"}, {"jitter": 0.2}
CASES = {
    "bar": (1, {}, {}),
    "bar of nodes": (1, NODES, {"influence": "cubic-spline"}),
    "plane stress": (2, {}, {"plane": "stress", "influence": "constant"}),
    "plane stress, nodes": (2, NODES, {"plane": "stress"}),
    "plane strain, wide": (2, {}, {"plane": "strain", "horizon_ratio": 4.0}),
    "plane strain, nodes": (2, NODES, {"plane": "strain", "influence": "cubic-spline"}),
    "space": (3, {}, {"influence": "cubic-spline"}),
    "space, nodes": (3, NODES, {"influence": "constant", "horizon_ratio": 2.0}),
    "irregular": (2, IRREGULAR, {"traction": "consistent-everywhere"}),
    "irregular nodes": (2, NODES | IRREGULAR, {"traction": "consistent-everywhere"}),
}


@pytest.mark.serial
@pytest.mark.parametrize("bulk", ["relaxing", "elastic"])
@pytest.mark.parametrize("case", CASES)
def test_patch(comm, case, bulk):
    dimension, body, method = CASES[case]
    method = {"horizon_ratio": 3.0, "solution": {"kind": "quasi-static", "step": 1.0, "tolerance": 1e-10}} | method
    data = scene(dimension, **{"jitter": 0.0} | body, material={"bulk": bulk}, method=method)
    data["boundaries"] = [{"plane": f"{letter} = 0", "kind": "roller"} for letter in "XYZ"[:dimension]]
    pull = [PULL] + [0.0] * (dimension - 1)
    data["boundaries"].append({"plane": "X = 1", "kind": "traction", "traction": pull})
    sim, _ = run_to_end(data, comm)
    rows = sim.systems[0].particles.owned_rows
    along, across = PULL / E, -NU * PULL / E
    if dimension == 2 and method.get("plane") != "stress":
        along, across = PULL * (1.0 - NU**2) / E, -PULL * NU * (1.0 + NU) / E
    exact = rows("reference_position") * np.array([along, across, across])[:dimension]
    np.testing.assert_allclose(rows("displacement"), exact, atol=1e-8 * along)
