"""Runs that go wrong say so, on all ranks."""

import numpy as np
import pytest
from solids import Record, StepsToEnd, follow, simulation, tables

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


def test_what_bonds_give_that_break_counts_whatever_others_take(comm):
    """In every step by itself: over all steps of the run more is taken than given."""
    glass = {"kind": "linear-elastic", "density": 2440.0, "youngs_modulus": 72e9, "poissons_ratio": 0.3}
    body = {"placement": "cells", "velocity": ["20*sin(200*X)", "20*cos(170*Y)"]}
    method = {"kind": "peridynamics", "solution": {"kind": "explicit"}, "damage": {"fracture_energy": 135.0}}
    sim = simulation(tables((20, 20), [0.1, 0.1], material=glass, method=method, body=body), comm)
    taken = follow(sim, Record(), 150)["fracture_dissipation"]
    sim.energy_row()
    given = -np.minimum(np.diff(taken), 0.0).sum()
    assert taken[-1] > 0.0 and given > 0.03 * sim.energy_check.largest
    assert sim.energy_check.gained == pytest.approx(given, rel=1e-9)
    assert sim.energy_check.verdict(sim.energy_scale)["energy_check_code"] == "energy-given"
    assert sim.systems[0].state()["given"] == sim.systems[0].given
