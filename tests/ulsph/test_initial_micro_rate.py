"""The initial micro-velocity of a body: where it may be stated, and what it begins with."""

import numpy as np
import pytest
from solids import simulation
from ulsph.plates import STEEL, block, scene

from parsolid.scene import SceneError


def flowing(rate, material=STEEL, **rest) -> dict:
    return scene(block([6, 6], [6e-3, 6e-3], material, micro_rate=rate), **rest)


@pytest.mark.serial
def test_it_is_set_by_place_and_held_where_clamped(comm):
    clamp = {"kind": "micro-hard", "box": {"lower": [-1.0, -1.0], "upper": [1.0, 1e-3]}}
    sim = simulation(flowing("1e6*X", boundaries=[clamp]), comm)
    rows = sim.systems[0].particles.owned_rows
    x, y = rows("position").T
    assert np.array_equal(rows("micro_rate"), np.where(y < 1e-3, 0.0, 1e6 * x))
    kinetic, _ = sim.systems[0].energies()
    law = sim.systems[0].laws[0]
    wanted = 0.5 * law.inertia_length**2 * (sim.systems[0].mass * rows("micro_rate") ** 2).sum()
    assert kinetic == pytest.approx(wanted, rel=1e-12)


def test_flow_does_not_run_backwards(comm):
    with pytest.raises(SceneError, match="bodies.0.micro_rate: "):
        simulation(flowing("1e6*(X - 2e-3)"), comm)
