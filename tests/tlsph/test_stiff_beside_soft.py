"""A soft bar bonded to a stiff one: rounding of the stiff one's energy is no imbalance of the soft one's load."""

import pytest
from solids import Record, follow, simulation, tables

NEO = {"kind": "neo-hookean", "density": 1e3, "poissons_ratio": 0.3}


@pytest.mark.parametrize("ratio", [1e2, 1e4])
def test_a_load_that_begins_on_a_soft_bar_is_accounted_for(ratio, comm):
    """The first steps of a load that grows from nothing, whose energies are below the rounding of J times the modulus
    of the stiff bar."""
    planes = [
        {"plane": "X = 0", "kind": "roller"},
        {"plane": "X = 1", "kind": "traction", "traction": ["1e2*ramp(t, 0, 0.2)", "0"]},
    ]
    data = tables([10, 4], method={"integrator": "leapfrog"}, boundaries=planes, body={"placement": "cells"})
    bar = data["bodies"][0]
    data["bodies"] = [
        bar
        | {"name": name, "material": NEO | {"youngs_modulus": young}}
        | {"shape": {"box": {"lower": [lower, 0.0], "upper": [lower + 0.5, 0.2]}}}
        for name, young, lower in (("stiff", 1e6 * ratio, 0.0), ("soft", 1e6, 0.5))
    ]
    data["bond"] = [{"bodies": ["stiff", "soft"]}]
    sim = simulation(data, comm)
    follow(sim, Record(lambda one: one.energy_row()), 40)
    assert sim.clock.step == 40 and sim.energy_check.violation is None
