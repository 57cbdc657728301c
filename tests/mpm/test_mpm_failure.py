"""Runs of the material point method that go wrong stop on all ranks with one message; scenes that do not suit the grid
are refused.
"""

import numpy as np
import pytest
from mpm.points import SOFT, crossing, scene, taylor_bar
from solids import Record, follow, run_to_end, simulation

from parsolid.collective import SolverError
from parsolid.simulation.loop import RunFailed


def message_of(data, comm, spoil=None) -> str:
    sim = simulation(data, comm)
    if spoil is not None:
        spoil(sim)
    with pytest.raises(RunFailed) as error:
        follow(sim, Record(), 400)
    text = str(error.value)
    assert set(comm.allgather(text)) == {text} and len(set(comm.allgather(sim.clock.step))) == 1
    assert f"step {sim.clock.step}" in text and " on rank " in text and "a smaller method.cfl" in text
    return text


def test_a_step_too_large(comm):
    text = message_of(taylor_bar(cfl=5.0, order="usl"), comm)
    assert "turned inside out" in text or "no longer finite" in text or "equation of state" in text


@pytest.mark.parametrize("place, what", [(1e9, "left the grid"), (np.nan, "no longer finite")])
def test_a_particle_that_is_lost(comm, place, what):
    def lose(sim):
        if comm.rank == comm.size - 1:
            sim.systems[0].particles.owned_rows("position")[3, 0] = place
        # its cell is looked up before the weights of a step are
        assert sim.systems[0].grid.update_cells(sim.systems[0].points) == (comm.rank != comm.size - 1)

    text = message_of(crossing(), comm, lose)
    assert what in text and f"on rank {comm.size - 1}" in text


ROLLER = [{"plane": "X = 0", "kind": "roller"}]
IN_R = {"name": "r", "plane": "X = 0.2", "side": "below"}
AT_A_POINT = {"point": [0.0, 0.0], "kind": "velocity", "velocity": [1.0, "free"]}


WALL = {"plane": "X = 0", "kind": "wall", "side": "above"}


@pytest.mark.serial
@pytest.mark.parametrize(
    "changes, key",
    [
        ({"boundaries": ROLLER, "method": {"origin": [0.013, 0.0]}}, "boundaries.0"),
        ({"boundaries": [ROLLER[0] | {"mirror": False}]}, "boundaries.0.mirror"),
        ({"boundaries": [{"kind": "fixed", "where": "r"}], "regions": [IN_R]}, "boundaries.0.where"),
        ({"boundaries": [ROLLER[0] | {"body": "a"}], "body": {"name": "a"}}, "boundaries.0.body"),
        ({"boundaries": [AT_A_POINT]}, "boundaries.0.point"),
        ({"boundaries": ROLLER, "beside": True}, "boundaries.0"),
        # a wall through a body
        ({"boundaries": [WALL | {"plane": "X = 0.2"}]}, "boundaries.0.plane"),
        ({"boundaries": [WALL | {"side": "below"}]}, "boundaries.0.plane"),
        ({"boundaries": [WALL], "body": {"displacement": ["-0.1", "0"]}}, "boundaries.0.plane"),
        ({"boundaries": [WALL]}, None),
    ],
)
def test_what_does_not_suit_the_grid_is_refused(comm, changes, key):
    data = scene(
        [0.0, 0.0], [0.4, 0.3], 0.05, 0.1, material=SOFT, **{key: changes[key] for key in changes if key != "beside"}
    )
    if "beside" in changes:
        data["bodies"] += scene([-0.9, 0.0], [-0.5, 0.3], 0.05, 0.1, material=SOFT)["bodies"]
    if key is None:
        simulation(data, comm)
        return
    with pytest.raises(SolverError, match=f"{key}: "):
        simulation(data, comm)


@pytest.mark.serial
@pytest.mark.slow
@pytest.mark.parametrize("order, transfer", [("usl", "flip"), ("musl", "flip"), ("usl", "apic"), ("musl", "apic")])
def test_the_balance_is_zero_but_for_the_time_integration(comm, order, transfer):
    """An oscillating block between mirror planes: the balance swings, and about half as far with half the step."""
    planes = [{"plane": f"{axis} = 0", "kind": "roller"} for axis in "XY"]
    swings = []
    for cfl in (0.2, 0.1):
        data = scene(
            [0.0, 0.0],
            [0.8, 0.8],
            0.05,
            0.1,
            material=SOFT,
            boundaries=planes,
            end_time=0.03,
            method={"order": order, "transfer": transfer, "cfl": cfl},
            body={"velocity": ["-4*X", "3*Y"]},
        )
        _, columns = run_to_end(data, comm)
        total = columns["kinetic"][0]
        assert columns["strain_energy"].max() > 0.5 * total and columns["kinetic"].min() < 0.5 * total
        assert (columns["numerical_dissipation"][-1] > 0.0) == (transfer == "apic" or order == "usl")
        swings.append(np.abs(columns["energy_error"]).max() / total)
    assert swings[0] < 2e-3 and 1.7 < swings[0] / swings[1] < 2.3
