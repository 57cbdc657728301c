"""Whole runs in which bonds break: the same on any number of ranks, restarted anywhere, with all energy accounted
for.
"""

import shutil

import numpy as np
import pytest
from command_line import all_done, many
from run_results import assert_close, assert_same_bits, history, state
from small_scenes import write

STEEL = {"kind": "linear-elastic", "density": 8000.0, "youngs_modulus": 190e9, "poissons_ratio": 0.3}

# Kalthoff and Winkler's plate on a coarse lattice, hit harder
NOTCHED = {
    "title": "Small notched plate",
    "dimension": 2,
    "end_time": 40e-6,
    "method": {
        "kind": "peridynamics",
        "plane": "strain",
        "damage": {"fracture_energy": 22130.0},
        "pre_cracks": [{"segment": [[-0.01, 0.025], [0.05, 0.025]]}],
    },
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0], "upper": [0.1, 0.1]}},
            "particles": [40, 40],
            "placement": "cells",
            "material": STEEL,
        }
    ],
    "boundaries": [
        {"kind": "roller", "plane": "Y = 0"},
        {
            "kind": "velocity",
            "box": {"lower": [-0.001, -0.001], "upper": [0.004, 0.025]},
            "velocity": ["25*tanh(t/0.5e-6)", "free"],
        },
    ],
    "probes": [
        {"name": "bonds", "quantity": "broken_bonds"},
        {"name": "corner", "at": [0.1, 0.1], "fields": ["displacement", "damage"]},
    ],
    "output": {"history_steps": 1, "fields_interval": 20e-6, "pictures": False},
}

# a viscoelastic block in space with a cut through part of it, pulled apart; bonds break by their energy
BLOCK = {
    "title": "Block pulled apart",
    "dimension": 3,
    "end_time": 0.03,
    "method": {
        "kind": "peridynamics",
        "horizon_ratio": 2,
        "influence": "linear",
        "damage": {"criterion": "energy", "fracture_energy": 600.0},
        "pre_cracks": [{"plane": "X = 0.5", "box": {"lower": [0.0, -0.1, -0.1], "upper": [1.0, 0.3, 1.1]}}],
    },
    "bodies": [
        {
            "shape": {"box": {"lower": [0.0, 0.0, 0.0], "upper": [1.0, 0.8, 0.6]}},
            "particles": [10, 8, 6],
            "placement": "cells",
            "material": {
                "kind": "prony",
                "density": 1000.0,
                "youngs_modulus": 2e6,
                "poissons_ratio": 0.3,
                "terms": [{"ratio": 1.0, "tau": 1e-3}, {"ratio": 0.5, "tau": 1e-2}],
            },
        }
    ],
    "boundaries": [
        {"kind": "roller", "plane": "X = 0"},
        {
            "kind": "velocity",
            "box": {"lower": [0.85, -1.0, -1.0], "upper": [1.1, 2.0, 2.0]},
            "velocity": ["2*tanh(t/2e-3)", "free", "free"],
        },
    ],
    "probes": [{"name": "bonds", "quantity": "broken_bonds"}],
    "output": {"history_steps": 1, "fields_interval": 0.015, "pictures": False},
}

SCENES = {"notched": NOTCHED, "block": BLOCK}
# of the largest energy: what leapfrog leaves open when forces jump, of second order in the step
BALANCE = {"notched": 3e-3, "block": 3e-3}


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Results of both scenes on 1, 2 and 3 ranks, and restarted half way on 2 and on 3 ranks."""
    folder = tmp_path_factory.mktemp("fracture")
    paths = {name: write(scene, folder / f"{name}.toml") for name, scene in SCENES.items()}
    for ranks in (1, 2):
        whole = [[path, "-q", "-o", folder / str(ranks) / name] for name, path in paths.items()]
        all_done(many(whole, ranks, folder / f"job-{ranks}"))
    halves = {name: history(folder / "2" / name)["step"][-1] * 3 // 4 for name in paths}
    begun = [
        [path, "-q", "-o", folder / "again" / name, "--max-steps", int(halves[name])] for name, path in paths.items()
    ]
    all_done(many(begun, 2, folder / "job-begun"))
    shutil.copytree(folder / "again", folder / "elsewhere")
    again, elsewhere = (
        [[path, "-q", "-o", folder / place / name, "--restart"] for name, path in paths.items()]
        for place in ("again", "elsewhere")
    )
    all_done(many(again, 2, folder / "job-again"))
    # on three ranks in one job with the whole runs
    whole = [[path, "-q", "-o", folder / "3" / name] for name, path in paths.items()]
    all_done(many(whole + elsewhere, 3, folder / "job-3"))
    return folder


@pytest.mark.parametrize("name", SCENES)
def test_bonds_break_and_all_energy_is_accounted_for(runs, name):
    columns = history(runs / "2" / name)
    broken, released = columns["bonds.broken_bonds"], columns["fracture_dissipation"]
    assert 100 < broken[-1] < 1e5 and np.all(np.diff(broken) >= 0.0)
    assert broken[len(broken) * 3 // 4] not in (0.0, broken[-1])
    largest = max(np.abs(columns[energy]).max() for energy in ("kinetic", "strain_energy", "external_work"))
    assert released[-1] > 0.01 * largest
    assert np.abs(columns["energy_error"]).max() < BALANCE[name] * largest


@pytest.mark.parametrize("ranks", [2, 3])
@pytest.mark.parametrize("name", SCENES)
def test_any_number_of_ranks_breaks_the_same_bonds(runs, name, ranks):
    one, other = state(runs / str(ranks) / name)[1], state(runs / "1" / name)[1]
    orders = [np.argsort(fields["identifier"]) for fields in (one, other)]
    assert np.array_equal(one["broken_bonds"][orders[0]], other["broken_bonds"][orders[1]])
    assert_close(runs / str(ranks) / name, runs / "1" / name, 1e-9)


@pytest.mark.parametrize("name", SCENES)
def test_restarted_with_broken_bonds_gives_the_same_bits(runs, name):
    assert_same_bits(runs / "again" / name, runs / "2" / name)


@pytest.mark.parametrize("name", SCENES)
def test_restarted_on_other_ranks_gives_the_same_numbers(runs, name):
    assert_close(runs / "elsewhere" / name, runs / "2" / name, 1e-9)
