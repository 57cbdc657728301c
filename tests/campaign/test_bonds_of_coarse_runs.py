"""Coarser runs have the bonds of the scene that they are made from, also where their particles reach farther."""

import numpy as np
import pytest
from ranks import first_on_ranks

from parsolid.api.running import RunOptions, run_scene
from parsolid.campaign.coarsening import parsed
from parsolid.campaign.pareto import plan_of
from parsolid.campaign.variants import coarse_variants, level_of
from parsolid.scene import SceneError, parse_scene
from parsolid.simulation.loop import Simulation

SOFT = {"kind": "neo-hookean", "density": 1.0, "youngs_modulus": 1.0, "poissons_ratio": 0.3}
COPPER = {"kind": "elastic-plastic", "library": "OFHC copper, Johnson-Cook"}
CASES = {
    "tlsph": ({"kind": "tlsph", "kernel": "wendland-c2"}, SOFT),
    "updated": ({"kind": "tlsph", "kernel": "wendland-c2", "reference": "updated", "update_every": 3}, SOFT),
    "peridynamics": ({"kind": "peridynamics", "horizon_ratio": 3.0, "solution": {"kind": "explicit"}}, SOFT),
    "ulsph": ({"kind": "ulsph"}, COPPER),
}
# [m]: two cells of the scene and a little, less than one of its coarsest run
SPACING, GAP = 0.0625, 0.13


def tables(method: str, bond: bool) -> dict:
    """Two halves of a block, bonded or one body, and a block that flies away from it along X behind a gap."""
    settings, material = CASES[method]
    ends = [(-1.0, -0.5, -1e-3), (-0.5, 0.0, -1e-3)] if bond else [(-1.0, 0.0, -1e-3)]
    bodies = [
        {
            "name": f"body {number}",
            "shape": {"box": {"lower": [lower, 0.0], "upper": [upper, 1.0]}},
            "spacing": SPACING,
            "placement": "cells",
            "material": material,
            "velocity": [speed, 0.0],
        }
        for number, (lower, upper, speed) in enumerate([*ends, (GAP, GAP + 1.0, 1e-3)])
    ]
    found = {"dimension": 2, "end_time": 1e-3, "method": settings, "bodies": bodies}
    return found | ({"bond": [{"bodies": ["body 0", "body 1"]}]} if bond else {})


@pytest.mark.parametrize("method, bond", first_on_ranks([("tlsph", True), *((method, False) for method in CASES)]))
def test_bodies_that_are_apart_stay_apart_in_coarse_runs(comm, method, bond):
    scene = parse_scene(tables(method, bond))
    Simulation(comm, scene)
    variants, refused = coarse_variants(scene, False)
    assert len(variants) == 2 and not refused
    with pytest.raises(SceneError):
        Simulation(comm, parse_scene(variants[0].scene.resolved()))
    sim = Simulation(comm, variants[0].scene)
    # bodies in free flight: any force on them changes a velocity
    assert sim.run() == "finished"
    for system in sim.systems:
        velocity, body = (system.particles.owned_rows(name) for name in ("velocity", "body"))
        expected = np.where(body == len(scene.bodies) - 1, 1e-3, -1e-3)
        np.testing.assert_allclose(velocity[:, 0], expected, rtol=1e-12)


def test_levels_of_a_search_have_the_bonds_of_the_scene(comm):
    scene = parse_scene(tables("tlsph", True))
    level = level_of(scene, 3.4)
    with pytest.raises(SceneError):
        Simulation(comm, parse_scene(level.tables))
    Simulation(comm, parsed(level.tables, False, level.ratio))
    plan = plan_of(scene, "kinetic", [], False)
    assert plan.ratios[0] > 2.0
    Simulation(comm, plan.variant(plan.configurations[0].option, 0).scene)


@pytest.mark.parametrize("asked", [{"error_bars": True}, {"target": ("kinetic=50%",)}])
def test_touching_bodies_that_no_table_names_are_refused_before_coarse_runs(comm, shared_path, asked):
    found = tables("tlsph", True)
    del found["bond"]
    with pytest.raises(SceneError) as error:
        run_scene(comm, parse_scene(found), shared_path / "run", RunOptions(**asked), 0.0)
    assert [fault.code for fault in error.value.faults] == ["touching"]
    assert not (shared_path / "run").exists()
