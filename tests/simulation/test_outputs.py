"""When outputs are due, that each state is written once, and that the reduction of a step begins within it."""

import pytest
from solids import punch, simulation

from parsolid.simulation.loop import FINISHED, STOPPED, Clock, Limits
from parsolid.simulation.outputs import Cadence, Callback, Output


@pytest.mark.parametrize("stated", [{"steps": 0}, {"steps": -1}, {"steps": 1.5}, {"time": 0.0}, {"wall": float("nan")}])
def test_a_cadence_at_which_nothing_is_due_is_refused(stated):
    with pytest.raises(ValueError, match=f"^{next(iter(stated))}:"):
        Cadence(**stated)


@pytest.mark.parametrize(
    "cadence, due",
    [
        (Cadence(), []),
        (Cadence(steps=2), [2, 4, 6]),
        (Cadence(time=0.25), [3, 5]),
        (Cadence(times=(0.0, 0.3)), [0, 3]),
        (Cadence(time=0.25, steps=6, times=(0.1,)), [1, 3, 5, 6]),
        (Cadence(wall=1.0), []),
    ],
)
def test_an_output_is_due_by_time_steps_or_given_times(cadence, due):
    times = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6]
    states = [Clock(time=time, step=step, step_size=0.1 if step else 0.0) for step, time in enumerate(times)]
    assert [now.step for now in states if cadence.due(now)] == due


class Steps(Output):
    """The steps and times of states that it has been asked to write."""

    def __init__(self, every: Cadence) -> None:
        self.every, self.seen = every, []

    def write(self, simulation) -> None:
        self.seen.append((simulation.clock.step, simulation.clock.time))


def test_a_state_is_written_once_over_several_calls_and_times_are_met_exactly(comm):
    sim = simulation(punch((5, 5), end_time=4e-3), comm)
    every, some = Steps(Cadence(steps=1, times=(0.0,))), Steps(Cadence(times=(1.1e-3, 2.3e-3)))
    called = []
    outputs = [every, some, Callback(lambda now: called.append(now.clock.step))]
    assert sim.run(1.5e-3, outputs) == FINISHED and sim.clock.time == 1.5e-3
    assert sim.run(outputs=outputs, limits=Limits(steps=1)) == STOPPED
    assert sim.run(outputs=outputs) == FINISHED and sim.clock.time == 4e-3
    assert [step for step, _ in every.seen] == list(range(sim.clock.step + 1))
    assert [time for _, time in some.seen] == [1.1e-3, 2.3e-3]
    assert called == list(range(1, sim.clock.step + 1))


def test_a_wall_time_that_is_over_on_one_rank_is_over_on_all(comm):
    sim = simulation(punch((5, 5), end_time=3e-3), comm)
    # the last rank's clock alone
    late = Steps(Cadence(wall=0.0 if comm.rank == comm.size - 1 else 1e9))
    sim.run(outputs=[late], limits=Limits(steps=3))
    assert comm.allgather(late.seen) == [late.seen] * comm.size and late.seen[-1][0] == 3
