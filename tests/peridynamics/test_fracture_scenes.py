"""Cracks of runs/peridynamics against closed forms and published observations, on any number of ranks."""

import math
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from solids import Record, follow, simulation, supports, tables

from parsolid.commands.cli import main
from parsolid.output.history import read_history

_SCENES = Path(__file__).parents[2] / "runs" / "peridynamics"
pytestmark = pytest.mark.verification


def run(folder, scene, *overrides, status=0):
    """History of a scene of runs/peridynamics with overrides; collective."""
    sets = [part for override in ("output.pictures=false", *overrides) for part in ("--set", override)]
    assert main([str(_SCENES / scene), "-q", "-o", str(folder), *sets]) == status
    return {name: np.array(values) for name, values in read_history(folder / "history.csv").items()}


@pytest.mark.parametrize("step, stretch", [(0.1, 0.05), (0.25, 0.03)])
def test_creep_fails_within_one_step_of_the_closed_form(shared_path, step, stretch):
    changes = [f"method.solution.step={step}", f"method.damage.critical_stretch={stretch}", "bodies.0.particles=[20]"]
    history = run(shared_path, "delayed_failure.toml", *changes, status=3)
    exact = -10.0 * math.log((1.0 - stretch / 0.1) / 0.9)
    broken = history["bonds.broken_bonds"] > 0.0
    failure = history["time"][np.argmax(broken)]
    assert broken[-1] and exact <= failure < exact + step
    # the strain is uniform: nothing holds any more, and all that was stored is released
    stored = history["strain_energy"][np.argmax(broken) - 1]
    assert abs(history["strain_energy"][-1]) < 1e-12 * stored
    assert history["fracture_dissipation"][-1] == pytest.approx(stored, rel=0.1)
    # the trapezoidal rule of the loads' work leaves something open before, the breaking adds no more than a step does
    assert abs(history["energy_error"][-1] - history["energy_error"][np.argmax(broken) - 1]) < 1e-4 * stored


@pytest.mark.long
def test_kalthoff_winkler_crack_runs_off_at_seventy_degrees(shared_path):
    history = run(shared_path, "kalthoff_winkler.toml", "bodies.0.particles=[100, 100]", "end_time=80e-6")
    x, y = (history[f"crack.crack_tip_{axis}"] for axis in "xy")
    upward = y > 0.025
    tip = np.nanargmax(np.where(upward, y, np.nan))
    assert 60.0 < math.degrees(math.atan2(y[tip] - 0.025, x[tip] - 0.05)) < 75.0
    assert np.abs(history["energy_error"]).max() < 2e-3 * history["external_work"].max()


@pytest.mark.long
def test_a_crack_branches_with_the_bond_based_law_and_not_with_correspondence(shared_path):
    branches = {}
    nosb = ["bodies.0.material.kind='linear-elastic'", "bodies.0.material.poissons_ratio=0.3333"]
    for name, more in (("bond-based", []), ("correspondence", nosb)):
        history = run(shared_path / name, "branching.toml", "bodies.0.particles=[200, 80]", *more)
        y = history["crack.crack_tip_y"]
        branches[name] = np.nanmax(np.abs(y - 0.02))
    assert branches["bond-based"] > 5e-3 and branches["correspondence"] < 1e-3


@pytest.mark.parametrize("kind", ["linear-elastic", "prony", "neo-hookean", "bond-based"])
def test_what_a_break_changes_is_what_an_evaluation_of_all_bonds_finds(kind, comm):
    """Forces, stored energy and what was released, where a rank has bonds that fail and where it has none."""
    constants = {"kind": kind, "density": 1.0, "youngs_modulus": 1.0}
    if kind != "bond-based":
        constants["poissons_ratio"] = 0.3
    if kind == "prony":
        constants["terms"] = [{"modulus": 0.5, "tau": 0.3}]
    data = tables(
        (10, 8),
        method={"kind": "peridynamics", "horizon_ratio": 3, "plane": "strain", "damage": {"critical_stretch": 0.02}},
        material=constants,
        body={"velocity": ["0.2*where(X < 0.4, -1, 1)", "0.05*X"]},
        boundaries=supports(Y=(0.0, "roller")),
    )
    sim = simulation(data, comm)
    follow(sim, Record(), 2)
    system, booked = sim.systems[0], {}
    while not system.fracture.ranks_find():
        follow(sim, Record(), 1)
    stored = system.forces.stored_energy()
    system.fracture.break_bonds(SimpleNamespace(add_term=booked.__setitem__))
    force, left = system.forces.force.copy(), system.forces.stored_energy()
    system.forces.evaluate_anew()
    size, whole = comm.allreduce(np.abs(force).max(initial=0.0)), comm.allreduce(stored)
    assert comm.allreduce(booked["fracture_dissipation"]) > 1e-4 * whole > 0.0
    assert np.abs(system.forces.force - force).max(initial=0.0) < 1e-12 * size
    assert abs(system.forces.stored_energy() - left) < 1e-12 * whole
    assert abs(booked["fracture_dissipation"] - (stored - left)) < 1e-12 * whole
