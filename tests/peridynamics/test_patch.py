"""A uniform stress under consistent tractions and mirror rollers is exact, whatever the law and the particles."""

import numpy as np
import pytest
from peridynamics.bonds_of_bodies import scene
from solids import run_to_end

E, NU, PULL = 3.0, 0.3, 0.03


@pytest.mark.serial
@pytest.mark.parametrize("influence", ["constant", "cubic-spline"])
@pytest.mark.parametrize(("dimension", "plane"), [(1, None), (2, "stress"), (2, "strain"), (3, None)])
@pytest.mark.parametrize("placement", ["cells", "vertices"])
@pytest.mark.parametrize("bulk", ["relaxing", "elastic"])
def test_patch(comm, dimension, plane, placement, influence, bulk):
    letters = "XYZ"[:dimension]
    method = {
        "horizon_ratio": 3.0,
        "influence": influence,
        "solution": {"kind": "quasi-static", "step": 1.0, "tolerance": 1e-10},
    }
    if plane is not None:
        method["plane"] = plane
    data = scene(dimension, placement=placement, jitter=0.0, material={"bulk": bulk}, method=method)
    data["boundaries"] = [{"plane": f"{letter} = 0", "kind": "roller"} for letter in letters]
    pull = [PULL] + [0.0] * (dimension - 1)
    data["boundaries"].append({"plane": "X = 1", "kind": "traction", "traction": pull})
    sim, _ = run_to_end(data, comm)
    rows = sim.systems[0].particles.owned_rows
    along, across = PULL / E, -NU * PULL / E
    if plane == "strain":
        along, across = PULL * (1.0 - NU**2) / E, -PULL * NU * (1.0 + NU) / E
    exact = rows("reference_position") * np.array([along, across, across])[:dimension]
    np.testing.assert_allclose(rows("displacement"), exact, atol=1e-8 * along)
