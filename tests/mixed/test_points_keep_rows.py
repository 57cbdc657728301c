"""Material points in contact stay with their rank while lists hold, and leave before sums would miss them."""

import numpy as np
from solids import Record, follow, run_into
from test_methods_meet import CLOSING, SPEED, bars, momenta

from parsolid.scene import parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.loop import Simulation
from parsolid.simulation.restart import Restart

STEPS = 50


def flying_bars() -> dict:
    """Two bars of material points that meet while both fly along, and across the cells of all ranks."""
    data = bars("points", "points", end_time=1.5 / SPEED, output={"history_steps": 1, "fields_times": []})
    for body in data["bodies"]:
        body["velocity"][0] = 0.5 * SPEED + 3.0 * body["velocity"][0]
    return data


def test_lists_hold_for_many_steps_and_ranks_do_not_matter(comm):
    scene = parse_scene(flying_bars())
    sims = [Simulation(one, scene) for one in (comm.Split(comm.rank), comm)]
    whole, spread = (follow(sim, Record(momenta), STEPS) for sim in sims)
    assert whole["contact_energy"].max() > 1e-3 * 25.0 * (3.0 * CLOSING) ** 2
    for name in ("kinetic", stored_energy(whole), "contact_energy", "energy_error", "momenta"):
        scale = np.abs(whole["momenta" if name == "momenta" else "kinetic"]).max()
        np.testing.assert_allclose(spread[name], whole[name], rtol=0.0, atol=1e-11 * scale, err_msg=name)
    # at the looks of the storage's order alone, and where lists are used up
    assert sims[1].interactions[0].rebuilds < 0.15 * STEPS
    moved = comm.allreduce(sum(system.grid.migrated for system in sims[1].systems))
    assert comm.size == 1 or moved > 20


def test_a_restart_with_particles_in_cells_of_others_has_the_same_bits(comm, shared_path):
    scene = parse_scene(flying_bars())
    # not where ranks have just given away what left their cells
    whole = run_into(shared_path / "whole", comm, scene, steps=STEPS).simulation
    first = run_into(shared_path / "pieces", comm, scene, steps=29).simulation
    guests = comm.allreduce(sum(len(system.grid.off_cell_particles()) for system in first.systems))
    assert comm.size == 1 or guests > 0
    restart = Restart(comm, shared_path / "pieces" / "checkpoint.h5")
    again = run_into(shared_path / "pieces", comm, scene, steps=STEPS - 29, restart=restart).simulation
    for found, wanted in zip(again.systems, whole.systems):
        rows = wanted.particles.checkpointed()
        assert all(rows[name].tobytes() == values.tobytes() for name, values in found.particles.checkpointed().items())
    assert np.array_equal(whole.ledger.values, again.ledger.values)
