"""The impact on any number of ranks and through a restart, with lists made anew."""

import csv
import json

import numpy as np
import pytest
import tomli_w
from solids import simulation
from ulsph.plates import STEEL, block, impact, scene

from parsolid.commands.cli import main


def run(sim, steps):
    system = sim.systems[0]
    sim.stable = sim.stable or sim.comm.allreduce(system.stable_step(), min_of())
    for _ in range(steps):
        sim.take_step(2e-8)
    return system


def min_of():
    from mpi4py import MPI

    return MPI.MIN


def gathered(comm, system, name):
    """A field by identifier, on all ranks."""
    rows = system.particles.owned_rows
    pieces = comm.allgather((rows("identifier").copy(), rows(name).copy()))
    order = np.argsort(np.concatenate([piece[0] for piece in pieces]))
    return np.concatenate([piece[1] for piece in pieces])[order]


def test_fields_do_not_depend_on_ranks(comm):
    """gamma to 1e-7 of its greatest value after 60 steps of the impact, as on one rank."""
    data = impact(across=9, along=30)
    many, one = simulation(data, comm), simulation(data)
    for sim in (many, one):
        run(sim, 60)
    for name in ("plastic_strain", "position", "temperature"):
        mine, alone = gathered(comm, many.systems[0], name), one.systems[0].particles.owned_rows(name)
        alone = alone[np.argsort(one.systems[0].particles.owned_rows("identifier"))]
        assert np.abs(mine - alone).max() <= 1e-7 * np.abs(alone).max()


def test_two_laws_keep_their_speeds_of_sound(comm):
    """The speed of sound of a ghost is that of its own law: as on one rank, to rounding."""
    data = impact(across=7, along=13)
    data["bodies"][1]["material"] = STEEL | {"density": 7000.0, "shear_modulus": 6e10, "bulk_modulus": 1.2e11}
    many, one = simulation(data, comm), simulation(data)
    for sim in (many, one):
        run(sim, 40)
    alone = one.systems[0].particles.owned_rows("velocity")
    alone = alone[np.argsort(one.systems[0].particles.owned_rows("identifier"))]
    assert np.abs(gathered(comm, many.systems[0], "velocity") - alone).max() <= 1e-11 * np.abs(alone).max()


def spinning() -> dict:
    """A square that turns, so that its lists are made anew."""
    return scene(block([24, 24], [24e-3, 24e-3], velocity=["-3e4*(Y - 0.012)", "3e4*(X - 0.012)"]), end_time=3.5e-5)


def test_momentum_is_kept_while_lists_are_made_anew(comm):
    data = spinning()
    sim = simulation(data, comm)
    system = run(sim, 300)
    momentum = comm.allreduce((system.mass[:, None] * system.particles.owned_rows("velocity")).sum(axis=0))
    size = comm.allreduce((system.mass * np.linalg.norm(system.particles.owned_rows("velocity"), axis=1)).sum())
    assert np.abs(momentum).max() < 1e-12 * size
    assert system.pairs.builds > 3
    assert comm.allreduce(system.pairs.late) == 0


@pytest.mark.slow
def test_restart_is_bitwise(comm, shared_path):
    """Stopped between two lists and continued, with migration before and after: the last rows have the same digits."""
    data = spinning() | {"end_time": 4e-6}
    data["method"]["skin"] = 0.03
    data["bodies"][0]["velocity"] = ["-6e4*(Y - 0.012)", "6e4*(X - 0.012)"]
    if comm.rank == 0:
        (shared_path / "scene.toml").write_text(tomli_w.dumps(data))
    comm.barrier()
    whole, parts = shared_path / "whole", shared_path / "parts"
    arguments = ["run", str(shared_path / "scene.toml"), "-q", "--set", "output.history_steps=1"]
    arguments += ["--set", "output.pictures=false"]
    assert main([*arguments, "-o", str(whole)]) == 0
    assert main([*arguments, "-o", str(parts), "--max-steps", "37"]) == 0
    stopped = (parts / "summary.json").read_text()
    comm.barrier()
    assert main([*arguments, "-o", str(parts), "--restart"]) == 0
    if comm.rank == 0:
        first, second = ([*csv.reader(open(folder / "history.csv"))] for folder in (whole, parts))
        assert first[-1] == second[-1]
        assert len(first) == len(second) > 60
        half, end = (json.loads(text)["migrated_particles"] for text in (stopped, (parts / "summary.json").read_text()))
        assert comm.size == 1 or 0 < half < end


@pytest.mark.parametrize("contact", ["compression", "welded"])
def test_bodies_that_touch_at_rest_stay_at_rest(contact, comm):
    data = impact(across=7, along=12, speed=0.0, method={"contact": contact})
    system = run(simulation(data, comm), 5)
    assert np.abs(system.particles.owned_rows("velocity")).max(initial=0.0) == 0.0


def test_bodies_part_freely(comm):
    """Bodies that fly apart feel nothing of one another in compression-only contact, and do when welded."""
    for contact, free in (("compression", True), ("welded", False)):
        data = impact(across=7, along=12, speed=-5.0, method={"contact": contact})
        system = run(simulation(data, comm), 5)
        spread = np.abs(np.abs(system.particles.owned_rows("velocity")[:, 0]) - 5.0).max(initial=0.0)
        assert (comm.allreduce(spread, max_of()) < 1e-9) == free


def max_of():
    from mpi4py import MPI

    return MPI.MAX
