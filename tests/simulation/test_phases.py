"""Where the time of a run went, from what each rank has counted."""

import pytest

from parsolid.simulation.phases import PHASES, Phases, of_all_ranks


def test_each_second_of_a_rank_is_in_one_phase():
    phases = Phases()
    phases.set_up, phases.waiting, phases.contact, phases.sent = 2.0, 7.0, 7.0, 5.0
    phases.begin()
    phases.sent, phases.waiting, phases.contact, phases.output = 0.5, 0.25, 1.0, 3.0
    seconds = dict(zip(PHASES, phases.seconds(first_step=4.0, loop=14.0)))
    expected = {"set_up": 2.0, "first_step": 4.0, "forces": 8.5, "communication": 0.75, "contact": 1.0, "output": 3.0}
    assert seconds == expected


def test_all_ranks_hear_of_the_busiest(comm):
    mine = [1.0, 2.0, 1.0 + comm.rank, 0.5, 1.0, 0.0]
    found = of_all_ranks(comm, mine, wall=20.0, work_processor=0.5 + comm.rank)
    mean = 2.0 + 0.5 * (comm.size - 1)
    assert found["load_imbalance"] == pytest.approx((1.0 + comm.size) / mean)
    assert found["communication_share"] == pytest.approx(0.5 / (mean + 0.5))
    assert found["work_processor_seconds_by_rank"] == [0.5 + rank for rank in range(comm.size)]
    assert found["phases_by_rank"]["forces"] == [1.0 + rank for rank in range(comm.size)]
    assert sum(found["phases"].values()) == pytest.approx(20.0)
