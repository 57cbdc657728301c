"""Bars of unlike materials: the step of bonded ones, and rounding of a stiff one's energy, which is no imbalance of the
soft one's load."""

import numpy as np
import pytest
from solids import Record, follow, simulation, tables

NEO = {"kind": "neo-hookean", "density": 1e3, "poissons_ratio": 0.3}


@pytest.mark.serial
@pytest.mark.parametrize("ratio", [1e2, 1e4])
def test_a_load_that_begins_on_a_soft_bar_is_accounted_for(ratio, comm):
    """The first steps of a load that grows from nothing, whose energies are below the rounding of J times the modulus
    of the stiff bar."""
    planes = [
        {"plane": "X = 0", "kind": "roller"},
        {"plane": "X = 1", "kind": "traction", "traction": ["1e2*ramp(t, 0, 0.2)", "0"]},
    ]
    data = tables([10, 4], boundaries=planes, body={"placement": "cells"})
    del data["method"]
    data["methods"] = [{"kind": "tlsph", "kernel": "wendland-c2", "name": name} for name in ("of stiff", "of soft")]
    bar = data["bodies"][0]
    data["bodies"] = [
        bar
        | {"name": name, "method": f"of {name}", "material": NEO | {"youngs_modulus": young}}
        | {"shape": {"box": {"lower": [lower, 0.0], "upper": [lower + 0.5, 0.2]}}}
        for name, young, lower in (("stiff", 1e6 * ratio, 0.0), ("soft", 1e6, 0.5))
    ]
    data["tie"] = [{"bodies": ["stiff", "soft"]}]
    sim = simulation(data, comm)
    follow(sim, Record(lambda one: one.energy_row()), 40)
    assert sim.clock.step == 40 and sim.energy_check.violation is None


@pytest.mark.serial
@pytest.mark.parametrize("integrator", ["leapfrog", "ssp-rk3"])
@pytest.mark.parametrize("stiffness, density", [(10.0, 10.0), (5.0, 29.0), (1.0, 1e3)])
def test_a_light_bar_bonded_to_a_heavy_one_is_stable_at_the_usual_step(stiffness, density, integrator, comm):
    """Free bars: what is stored and moves never grows. At the step of either bar alone it grew without end."""
    data = tables([5, 4], method={"integrator": integrator}, body={"placement": "cells"})
    bar = data["bodies"][0]
    materials = NEO | {"youngs_modulus": 1e6}, NEO | {"youngs_modulus": 1e6 * stiffness, "density": 1e3 * density}
    data["bodies"] = [
        bar
        | {"name": name, "material": material, "velocity": ["0.1*sin(9*X)", "0.1*cos(20*X)"]}
        | {"shape": {"box": {"lower": [lower, 0.0], "upper": [lower + 0.25, 0.2]}}}
        for name, material, lower in zip(("light", "heavy"), materials, (0.0, 0.25))
    ]
    data["bond"] = [{"bodies": "all"}]
    columns = follow(simulation(data, comm), Record(), 400)
    energy = columns["strain_energy"] + columns["kinetic"]
    assert energy.max() < 1.001 * energy[0] and np.abs(columns["energy_error"]).max() < 1e-2 * energy[0]
