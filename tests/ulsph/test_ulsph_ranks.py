"""Bodies that touch in contact by compression alone, on any number of ranks."""

import numpy as np
import pytest
from solids import simulation
from ulsph.plates import impact


@pytest.mark.parametrize(
    "speed, contact, least, most",
    [
        (0.0, "compression", 0.0, 0.0),
        (0.0, "welded", 0.0, 0.0),
        # bodies that fly apart feel nothing of one another, and do when welded
        (-5.0, "compression", 0.0, 1e-9),
        (-5.0, "welded", 1e-9, 5.0),
    ],
)
def test_bodies_that_touch_stay_at_rest_and_part_freely(speed, contact, least, most, comm):
    sim = simulation(impact(across=7, along=12, speed=speed, method={"contact": contact}), comm)
    for _ in range(5):
        sim.take_step(2e-8)
    velocity = sim.systems[0].particles.owned_rows("velocity")[:, 0]
    changed = max(comm.allgather(np.abs(np.abs(velocity) - abs(speed)).max(initial=0.0)))
    assert least <= changed <= most
