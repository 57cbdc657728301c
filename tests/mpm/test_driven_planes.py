"""Planes that drive a body: nodes beyond them move with them, and they move with the body."""

import numpy as np
import pytest
from solids import Record, follow, simulation

NEO = {"kind": "neo-hookean", "density": 1000.0, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
LAME, SHEAR = 1e6 * 0.3 / (1.3 * 0.4), 1e6 / 2.6


def block(left: dict, right: dict | None, **rest) -> dict:
    rollers = [{"kind": "roller", "plane": plane} for plane in ("Y = 0", "Y = 0.5")]
    body = {"shape": {"box": {"lower": [0.0, 0.0], "upper": [1.0, 0.5]}}, "particles": [20, 10], "material": NEO}
    return {
        "dimension": 2,
        "method": {"kind": "mpm", "cell": 0.1},
        "bodies": [body | {"placement": "cells"} | rest],
        "boundaries": [{"plane": "X = 0", **left}, *([{"plane": "X = 1", **right}] if right else []), *rollers],
        "output": {"history_steps": 1, "pictures": False},
    }


HELD = {"roller": {"kind": "roller"}, "velocity": {"kind": "velocity", "velocity": ["0", "free"]}}


@pytest.mark.serial
@pytest.mark.parametrize("held", HELD)
@pytest.mark.parametrize("transfer", ["apic", "flip"])
def test_a_bar_that_swings_keeps_its_energy_however_it_is_held(held, transfer, comm):
    """Two periods. Free nodes beyond a plane with a velocity took 11 % of the energy."""
    data = block(HELD[held], None, displacement=["1e-3*X", "0"]) | {"end_time": 0.22}
    data["method"]["transfer"] = transfer
    columns = follow(simulation(data, comm), Record())
    stored = columns["strain_energy"][0]
    assert stored == pytest.approx(0.5 * (LAME + 2.0 * SHEAR) * 1e-6 * 0.5, rel=0.01)
    assert np.abs(columns["energy_error"]).max() < 0.05 * stored


GRIDS = {
    "quadratic": {},
    "flip": {"transfer": "flip"},
    "cubic": {"basis": "cubic-spline"},
    # the plane in the middle between nodes
    "halfway": {"origin": [0.05, 0.0]},
}


@pytest.mark.serial
@pytest.mark.parametrize("grid", GRIDS)
def test_a_plane_at_rest_holds_like_a_plane_of_symmetry(grid, comm):
    """Four periods: the energy that is left. Nodes behind a plane that are at rest, too, took 8 to 20 % more."""
    kept = {}
    for held, boundary in HELD.items():
        data = block(boundary, None, displacement=["1e-3*X", "0"]) | {"end_time": 0.44}
        data["method"] |= GRIDS[grid]
        columns = follow(simulation(data, comm), Record())
        energy = columns["strain_energy"] + columns["kinetic"]
        kept[held] = energy[-1] / energy[0]
        assert np.abs(columns["energy_error"]).max() < 0.045 * energy[0]
        # what stands still does no work
        assert np.abs(columns["external_work"]).max() < 1e-12 * energy[0]
    assert kept["velocity"] > kept["roller"] - 0.02 and kept["velocity"] < 1.02


@pytest.mark.serial
@pytest.mark.parametrize(
    "grid, boundary, told",
    [
        ({"origin": [0.025, 0.0]}, HELD["velocity"], ["badly-held"]),
        ({"basis": "linear"}, HELD["velocity"], ["badly-held"]),
        ({"origin": [0.05, 0.0]}, HELD["velocity"], []),
        ({"basis": "linear"}, HELD["roller"], []),
        # it moves with what it drives
        ({"origin": [0.025, 0.0]}, {"kind": "velocity", "velocity": ["0.1*t", "free"]}, []),
    ],
)
def test_planes_at_rest_that_hold_badly_are_told(grid, boundary, told, comm):
    """After four periods such planes left .77 to .79 and 1.08 of the energy, planes of symmetry .84 and .99."""
    data = block(boundary, None) | {"end_time": 1.0}
    data["method"] |= grid
    assert [one.code for one in simulation(data, comm).warnings] == told


@pytest.mark.serial
@pytest.mark.parametrize("strain, most", [(0.1, 0.05), (0.4, 0.08)])
def test_a_block_that_is_pulled_does_not_part_from_what_pulls_it(strain, most, comm):
    """Slowly against its waves: the mean of P11 = lambda (J - 1) + mu (F - 1/F), by the energy."""
    pull = {"kind": "velocity", "velocity": ["0.5", "free"]}
    data = block(HELD["roller"], pull, velocity=["0.5*X", "0"]) | {"end_time": 2.0 * strain}
    sim = simulation(data, comm)
    columns = follow(sim, Record())
    F = 1.0 + strain
    energy = 0.5 * (0.5 * LAME * strain**2 - SHEAR * np.log(F) + 0.5 * SHEAR * (F**2 - 1.0))
    late = columns["time"] > 1.9 * strain
    assert columns["strain_energy"][late].mean() == pytest.approx(energy, rel=2.0 * most)
    assert np.abs(columns["energy_error"]).max() < 0.02 * columns["strain_energy"].max()
    highest = comm.allreduce(float(sim.systems[0].particles.owned_rows("position")[:, 0].max()), max)
    assert highest == pytest.approx(F * 0.975, rel=0.03)
