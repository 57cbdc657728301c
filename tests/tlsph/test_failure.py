"""A run that goes wrong stops on all ranks within a step and says when, where and what to try."""

import re

import numpy as np
import pytest
from solids import Record, column, follow, punch, simulation

from parsolid.scene.formulas import Formula
from parsolid.simulation.loop import RunFailed


def minimum_jacobian(sim) -> dict:
    return {
        "jacobian": min(sim.comm.allgather(float(sim.systems[0].particles.owned_rows("jacobian").min(initial=np.inf))))
    }


def failed(data: dict, comm, checkpoint=None):
    """(the simulation, its record, the message) of a run that must fail."""
    sim = simulation(data, comm)
    sim.last_checkpoint = checkpoint
    record = Record(minimum_jacobian)
    with pytest.raises(RunFailed) as error:
        follow(sim, record, 2000)
    return sim, record, str(error.value)


@pytest.mark.parametrize("scene", [punch, lambda **keys: column((5, 9, 5), **keys)], ids=["punch", "column"])
def test_a_step_too_large_ends_in_one_clear_message_on_every_rank(scene, comm):
    # a formula without a value in another run of this process says nothing of this one
    Formula("log(X)").evaluate(np.zeros((1, 2)))
    sim, record, message = failed(scene(method={"cfl": 3.0}), comm, "somewhere/checkpoint.h5")
    assert set(comm.allgather(message)) == {message} and len(set(comm.allgather(sim.clock.step))) == 1
    # all states that were looked at are sound, and the one after the last of them is not
    assert np.all(record.columns()["jacobian"] > 0.0) and len(record.rows) == sim.clock.step
    assert np.isfinite([list(row.values()) for row in record.rows]).all()
    assert f"step {sim.clock.step}" in message and f"{sim.clock.time:.9g} s" in message
    assert "not positive" in message or "no longer finite" in message
    assert "somewhere/checkpoint.h5" in message and "method.cfl (it is 3;" in message
    names_its_particle(sim, comm, message)


def names_its_particle(sim, comm, message: str) -> None:
    found = re.search(r"particle +(\d+) on rank (\d+).*at X = \(([^)]*)\), now x = \(([^)]*)\)", message)
    assert found, message
    identifier, rank = int(found[1]), int(found[2])
    mine = np.flatnonzero(sim.systems[0].particles.owned_rows("identifier") == identifier)
    assert comm.allgather(len(mine)) == [int(r == rank) for r in range(comm.size)]
    if comm.rank == rank:
        place = sim.systems[0].particles.owned_rows("reference_position")[mine[0]]
        np.testing.assert_allclose([float(x) for x in found[3].split(",")], place, rtol=1e-5, atol=1e-12)
        jacobian = sim.systems[0].particles.owned_rows("jacobian")[mine[0]]
        assert not jacobian > 0.0 or not np.isfinite(sim.systems[0].particles.owned_rows("velocity")[mine[0]]).all()


def test_a_step_below_the_floor_is_told(comm):
    data = punch(method={"minimum_step": 1.0})
    _, record, message = failed(data, comm)
    assert not record.rows and "fell below the floor 1 s" in message and "none was written" in message
