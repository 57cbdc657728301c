"""Material points in contact stay with their rank while lists hold, and leave before sums would miss them."""

from mixed.test_methods_meet import CLOSING, SPEED, bars
from solids import Record, follow

from parsolid.scene import parse_scene
from parsolid.simulation.loop import Simulation

STEPS = 50


def flying_bars() -> dict:
    """Two bars of material points that meet while both fly along, and across the cells of all ranks."""
    data = bars("points", "points", end_time=1.5 / SPEED, output={"history_steps": 1, "fields_times": []})
    for body in data["bodies"]:
        body["velocity"][0] = 0.5 * SPEED + 3.0 * body["velocity"][0]
    return data


def test_lists_hold_for_many_steps(comm):
    scene = parse_scene(flying_bars())
    sim = Simulation(comm, scene)
    found = follow(sim, Record(), STEPS)
    assert found["contact_energy"].max() > 1e-3 * 25.0 * (3.0 * CLOSING) ** 2
    # at the looks of the storage's order alone, and where lists are used up
    assert sim.interactions[0].rebuilds < 0.15 * STEPS
    moved = comm.allreduce(sum(system.grid.migrated for system in sim.systems))
    assert comm.size == 1 or moved > 20
