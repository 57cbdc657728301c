"""Outputs of a run: what is done with its state while it goes on, each at a cadence of its own."""

import time as clock
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from parsolid.simulation.time_step import SLIVER

if TYPE_CHECKING:
    from parsolid.simulation.loop import Clock, Simulation


@dataclass(frozen=True)
class Cadence:
    """How often an output is due: after so much simulated time [s], so many steps, so many seconds of the wall clock.

    Whichever is over first counts; what is left out never is. times: simulated times [s] at which it is due besides,
    and at which a step ends exactly.
    """

    time: float | None = None
    steps: int | None = None
    wall: float | None = None
    times: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        """Raises ValueError for what no output can be due after."""
        if self.time is not None and not self.time > 0.0:
            raise ValueError(f"time: expected a positive number of seconds, found {self.time}")
        if self.wall is not None and not self.wall >= 0.0:
            raise ValueError(f"wall: expected a number of seconds >= 0, found {self.wall}")
        if self.steps is not None and not (self.steps >= 1 and self.steps == int(self.steps)):
            raise ValueError(f"steps: expected a whole number of at least 1, found {self.steps}")

    def due(self, now: "Clock") -> bool:
        """Whether a state is due by its time and step, the same on all ranks."""
        if now.time in self.times:
            return True
        if now.step == 0:
            return False
        if self.steps is not None and now.step % self.steps == 0:
            return True
        if self.time is None:
            return False
        before = now.time - now.step_size
        return int(now.time / self.time * (1 + SLIVER)) > int(before / self.time * (1 + SLIVER))


class Output:
    """Something to be done with the states of a run, at a cadence; every method is called on all ranks.

    every: its cadence; last_step: the step whose state has been written, and is not again; last_wall: reading of the
    performance counter [s] at the last write.
    """

    every = Cadence(steps=1)
    last_step: int | None = None
    last_wall: float | None = None

    def due(self, simulation: "Simulation") -> bool:
        """Whether the state is due, besides by the wall clock; the same on all ranks."""
        return self.every.due(simulation.clock)

    def write(self, simulation: "Simulation") -> None:
        """Do with the state at the end of a step what the output is for; collective."""
        raise NotImplementedError


class Callback(Output):
    """Calls a function at a cadence, by default after every step; on all ranks."""

    def __init__(self, function: Callable[[Any], object], every: Cadence = Output.every, argument: Any = None):
        """argument: what the function is called with, the simulation unless given."""
        self.function, self.every, self._argument = function, every, argument

    def write(self, simulation: "Simulation") -> None:
        self.function(simulation if self._argument is None else self._argument)


class EnergyCheckOutput(Output):
    """Checks the energy balance every so many steps, where no history does."""

    every = Cadence(steps=32)

    def write(self, simulation: "Simulation") -> None:
        simulation.energy_row()


class Outputs:
    """The outputs of a run, written in their order; times: at which a step must end [s]."""

    def __init__(self, outputs: Sequence[Output]) -> None:
        self._outputs = list(outputs)
        self.times = {time for one in self._outputs for time in one.every.times}
        self.with_wall_times = [(one, one.every.wall) for one in self._outputs if one.every.wall is not None]
        for one, _ in self.with_wall_times:
            one.last_wall = clock.perf_counter() if one.last_wall is None else one.last_wall

    def wall_times_over(self) -> list[float]:
        """For each output with a wall time 1.0 where it is over on this rank's clock; ranks agree on it with a step."""
        now = clock.perf_counter()
        return [float(now - (one.last_wall or 0.0) > seconds) for one, seconds in self.with_wall_times]

    def write_due(self, simulation: "Simulation", over: Sequence[bool] = ()) -> None:
        """Write what is due and has not been written of this state; over: as agreed by all ranks. Collective."""
        requested = {id(one) for (one, _), late in zip(self.with_wall_times, over) if late}
        for one in self._outputs:
            if one.last_step != simulation.clock.step and (id(one) in requested or one.due(simulation)):
                simulation.clock.count_processor()
                one.write(simulation)
                one.last_step, one.last_wall = simulation.clock.step, clock.perf_counter()

    def write_all(self, simulation: "Simulation") -> None:
        """Write this state, where it has not been written, before a run that has failed ends; collective."""
        simulation.clock.count_processor()
        for one in self._outputs:
            if one.last_step != simulation.clock.step:
                one.write(simulation)
                one.last_step = simulation.clock.step
