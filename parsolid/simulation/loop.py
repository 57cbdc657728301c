"""The loop: advance, look, write."""

import time as clock
from dataclasses import dataclass, field

import numpy as np

from decomposition.reduction import MinimumAhead
from parsolid.methods import method_class
from parsolid.particles.distribution import distribute, take
from parsolid.simulation.diagnosis import describe_failure
from parsolid.simulation.ledger import Ledger
from parsolid.simulation.signals import StopRequest

FINISHED, STOPPED, INTERRUPTED = "finished", "stopped", "interrupted"


class RunFailed(RuntimeError):
    """The run went wrong; the message, the same on every rank, says when, where and what to try."""


@dataclass
class Limits:
    """Where to stop before the scene's end: number of steps, reading of the performance counter [s]."""

    steps: int | None = None
    wall: float | None = None


@dataclass
class Clock:
    """Time [s], step number and seconds spent, of this run and of those it continues."""

    time: float = 0.0
    step: int = 0
    began: float = field(default_factory=clock.perf_counter)
    loop_seconds: float = 0.0
    # of this rank's processor, which other work on the machine does not lengthen
    loop_processor_seconds: float = 0.0
    # the first step of a program also loads or compiles the kernels
    first_step_seconds: float = 0.0
    first_step_processor_seconds: float = 0.0
    waiting_seconds: float = 0.0


class Simulation:
    """One scene on all ranks of a communicator, from its particles to its last step."""

    def __init__(self, comm, scene, restart=None):
        """restart: `restart.Restart` to continue from, or None for a new run. Collective.

        Raises SceneError or SolverError on all ranks when the scene cannot be set up.
        """
        self.comm, self.scene, self.clock, self.ledger = comm, scene, Clock(), Ledger(scene.method.ledger_terms)
        # the time of the jump that the last step of length 0 was for
        self.jumped: float | None = None
        if restart:
            restart.check(scene)
        method = method_class(scene.method.kind)
        particle_set = restart.particle_set if restart else distribute(comm, self._generate())
        order = (
            method.sort(comm, scene, particle_set)
            if not (restart and restart.same_ranks)
            else np.arange(len(particle_set))
        )
        self.particle_set = take(particle_set, order)
        self.method = method(comm, scene, self.particle_set)
        if restart:
            restart.apply(self, order)
        else:
            self.method.begin(scene, self.particle_set)
        self.minimum = MinimumAhead(comm, 4)
        self.failed, self.failed_somewhere, self.checkpoint_wanted, self.broken_balance = False, False, False, None
        self.last_checkpoint: str | None = None
        # the step agreed on for the current state; a restart takes it from the checkpoint, for the same bits
        self.stable = restart.stable if restart else None
        self.first_step = self.clock.step
        self.particles = comm.allreduce(self.method.owned)
        self.setup_seconds = clock.perf_counter() - self.clock.began

    def _generate(self):
        from parsolid.scene import generate

        return generate(self.scene, self.comm)

    def run(self, watch, limits: Limits, stop: StopRequest) -> str:
        """Advance to the scene's end (FINISHED), a number of steps (STOPPED), a signal or a wall time (INTERRUPTED). Collective.

        `watch` (see `output.watch`) is told of every step. Raises RunFailed on all ranks.
        """
        end = self.scene.end_time
        self.first_step = self.clock.step
        stable = self.method.stable_step() if self.stable is None else self.stable
        self.minimum.begin(np.array([stable, 0.0, 0.0, -float(self.method.news)]))
        while True:
            self.stable, interrupted, checkpoint = self._result()
            self.checkpoint_wanted = checkpoint < 0.0
            self._check(self.stable)
            watch.look(self)
            self._check_balance()
            if self.clock.time >= end:
                return FINISHED
            if interrupted < 0.0:
                return INTERRUPTED
            if limits.steps is not None and self.clock.step - self.first_step >= limits.steps:
                return STOPPED
            late = limits.wall is not None and clock.perf_counter() > limits.wall
            wishes = (float(stop.received is not None or late), float(watch.wall_checkpoint_due()))
            self._advance(self._next(watch), wishes)

    def _next(self, watch) -> tuple[float, float]:
        """(step, time it leads to) [s]: of length 0 where loads jump."""
        time = self.clock.time
        if time in self.method.jumps and self.jumped != time:
            self.jumped = time
            return watch.clip(time, 0.0)
        return watch.clip(time, self._limit(self.stable))

    def take_step(self, step: float) -> None:
        """One time step [s] and the reduction that goes with it, whatever the stable step is; collective."""
        self._advance((step, self.clock.time + step), (0.0, 0.0))
        self._result()

    def _result(self) -> np.ndarray:
        waiting = clock.perf_counter()
        result = self.minimum.result()
        self.clock.waiting_seconds += clock.perf_counter() - waiting
        self.method.news_anywhere = bool(result[3] < 0.0)
        return result[:3]

    def _limit(self, stable: float) -> float:
        longest = self.scene.method.maximum_step
        return stable if longest is None else min(stable, longest)

    def _advance(self, advance: tuple[float, float], wishes: tuple[float, float]) -> None:
        """One step to a time; the next stable step and wishes (to stop, to write a checkpoint) are agreed on meanwhile."""
        step, arrival = advance
        began, processor_began = clock.perf_counter(), clock.process_time()

        def announce(sound: bool, stable: float) -> None:
            healthy = sound and not self.failed and np.isfinite(stable)
            stable = stable if healthy or self.method.owned == 0 else -1.0
            self.minimum.begin(np.array([stable, -wishes[0], -wishes[1], -float(self.method.news)]))

        if not self.method.advance(self.clock.time, step, self.ledger, announce):
            self.failed = True
        self.clock.time = arrival
        self.clock.step += 1
        self._count(clock.perf_counter() - began, clock.process_time() - processor_began)

    def _count(self, seconds: float, processor_seconds: float) -> None:
        """Add what a step took, on the wall and on this rank's processor [s]."""
        spent = self.clock
        spent.loop_seconds += seconds
        spent.loop_processor_seconds += processor_seconds
        if spent.step == self.first_step + 1:
            spent.first_step_seconds, spent.first_step_processor_seconds = seconds, processor_seconds

    def _check(self, stable: float) -> None:
        """Raise RunFailed on all ranks when the agreed step says that something went wrong."""
        floor = self.scene.method.minimum_step or 1e-12 * self.scene.end_time
        if stable >= floor:
            return
        # the agreed step is negative when a stage of any rank was not sound
        self.failed_somewhere = stable < 0.0
        raise RunFailed(
            describe_failure(self, f"the stable time step {stable:.3g} s fell below the floor {floor:.3g} s")
        )

    def _check_balance(self) -> None:
        if self.broken_balance is not None:
            raise RunFailed(describe_failure(self, f"the energy balance is off by {self.broken_balance:.4g} J"))
