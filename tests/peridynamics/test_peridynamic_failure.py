"""Runs that go wrong say so, on all ranks."""

import pytest
from solids import Record, StepsToEnd, follow, simulation

from parsolid.simulation.loop import RunFailed


def test_matter_turned_inside_out_ends_the_run(comm):
    box = {"lower": [0.0, 0.0], "upper": [1.0, 1.0]}
    material = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 3.0, "poissons_ratio": 0.3}
    body = {
        "shape": {"box": box},
        "particles": [6, 6],
        "placement": "cells",
        "velocity": ["-3*X", "-6*Y"],
        "material": material,
    }
    crushed = simulation(
        {
            "dimension": 2,
            "end_time": 1.0,
            "method": {"kind": "peridynamics", "solution": {"kind": "explicit"}},
            "bodies": [body],
            "boundaries": [{"kind": "roller", "plane": "Y = 0"}],
        },
        comm,
    )
    with pytest.raises(RunFailed, match=r"the Jacobian is -[\d.e-]+, not positive.*\n.*\n +particle +\d+ on rank"):
        follow(crushed, Record(), policy=StepsToEnd)
