"""The loop over the steps of a scene: advance systems and interactions, agree on the next step, write outputs."""

import time as clock
from collections.abc import Sequence
from dataclasses import dataclass, field
from math import inf
from typing import Any, NoReturn

from decomposition.timer import COMMUNICATION
from parsolid.boundary.conditions import COMMON_START, EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.collective import minimum
from parsolid.contact.interactions import build_interactions
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.codes import Warned
from parsolid.scene.formulas import NOT_FINITE
from parsolid.simulation.agreement import StepAgreement
from parsolid.simulation.diagnosis import (
    Found,
    coldest_particle,
    describe_failure,
    describe_meetings,
    meetings_in_words,
)
from parsolid.simulation.energy_check import EnergyCheck, EnergyLimits, MomentumBalance, isolated
from parsolid.simulation.ledger import ledger_of, names_of_terms, viscous_terms_of
from parsolid.simulation.outputs import Output, Outputs
from parsolid.simulation.phases import Phases
from parsolid.simulation.representation import representation
from parsolid.simulation.restart import Restart
from parsolid.simulation.setup import build_systems
from parsolid.simulation.signals import StopRequest
from parsolid.simulation.time_step import Subcycling, TimeSteps

FINISHED, STOPPED, INTERRUPTED = "finished", "stopped", "interrupted"
# a system is asked for its validity in rows that are this far apart at least
_STEPS_BETWEEN_DOUBTS = 20


class RunFailed(RuntimeError):
    """The run went wrong; the message, the same on every rank, says when, where and what to try."""


@dataclass
class Limits:
    """Where to stop before the end: number of steps, reading of the performance counter [s]."""

    steps: int | None = None
    wall: float | None = None


@dataclass
class Clock:
    """Time [s], step number, length of the last step [s], and seconds spent, of this run and of those it continues."""

    time: float = 0.0
    step: int = 0
    step_size: float = 0.0
    began: float = field(default_factory=clock.perf_counter)
    loop_seconds: float = 0.0
    # of this rank's processor, which other work on the machine does not lengthen
    loop_processor_seconds: float = 0.0
    # the first step of a program also loads or compiles the kernels
    first_step_seconds: float = 0.0
    first_step_processor_seconds: float = 0.0
    # of each system, on this rank: time in its steps but the first, without that spent on messages
    work: list[float] = field(default_factory=list)
    # reading of the processor's clock since which `loop_processor_seconds` is to be counted, None where it is complete
    uncounted_since: float | None = None

    def count_processor(self) -> float:
        """Count what steps have taken of the processor since the last count, which it gives [s].

        Not done in every step of one rank: the reading takes as long as several calls of kernels.
        """
        if self.uncounted_since is None:
            return 0.0
        seconds, self.uncounted_since = clock.process_time() - self.uncounted_since, None
        self.loop_processor_seconds += seconds
        return seconds


class Simulation:
    """One scene on all ranks of a communicator, from its particles to its last step.

    systems: methods with their bodies, see `setup`; interactions: what acts between their particles besides.
    """

    def __init__(self, comm: Any, scene: Scene, restart: Restart | None = None, meshes: dict[Any, Any] | None = None):
        """restart: to continue from, or None for a new run; meshes: see `generation.generate`. Collective.

        Raises SceneError or SolverError on all ranks when the scene cannot be set up.
        """
        self.comm, self.scene, self.clock = comm, scene, Clock()
        limits = EnergyLimits.of(system.settings for system in scene.systems)
        scaled = any(one.settings.inertia_factor > 1.0 for one in scene.systems)
        self.ledger, self.energy_check = ledger_of(scene), EnergyCheck(limits, viscous_terms_of(scene), scaled)
        if restart:
            restart.check(scene)
        # of runs before this one in the same process
        NOT_FINITE.clear()
        self.systems, self.particle_sets = build_systems(comm, scene, restart, meshes)
        self.warnings = representation(comm, scene, self.systems)
        # None where something acts from outside
        self.momenta = MomentumBalance(comm, self.systems) if isolated(scene) else None
        self._ledgers = [self.ledger.of(names) for names in names_of_terms(scene)]
        self.clock.work, self.phases = [0.0] * len(self.systems), Phases()
        self.interactions: list[Interaction] = build_interactions(comm, scene, self.systems)
        for system in self.systems:
            system.interactions = self.interactions
        self.time_steps = TimeSteps.of(scene, self.systems)
        # systems whose particles have a temperature; the lowest [K] of all ranks between the last two rows, and that of
        # this rank since the last row
        self._warm = [one for one in self.systems if "temperature" in one.particles]
        self.coldest = self._lowest_since_row = inf
        # of this rank, where a temperature below zero was the lowest of all
        self._coldest_particle: Found | None = None
        # step of the last row that was checked
        self.checked_step = 0
        # what systems have said of their state beyond the method, and the step at which they were asked
        self.doubts: list[str | None] = [None] * len(self.systems)
        self._asked_step = 0
        # the step agreed on for the current state; a restart takes it from the checkpoint, for the same bits
        self.stable: float | None = None
        # of each system, where any takes several steps in a common one
        self.subcycling = Subcycling(comm, self.systems, restart.header["stable_steps"] if restart else None)
        if restart:
            restart.apply(self)
        # forces at the start; those of a checkpoint stay, which found anew differ in the last bits
        acted_on = [system.particles for system in self.systems if EXTERNAL_FORCE in system.particles]
        kept = [particles.owned_rows(EXTERNAL_FORCE).copy() for particles in acted_on]
        for particles in acted_on:
            particles.owned_rows(EXTERNAL_FORCE)[:] = 0.0
        for interaction in self.interactions:
            interaction.begin(self.clock.time)
        for particles, force in zip(acted_on, kept if restart else []):
            particles.owned_rows(EXTERNAL_FORCE)[:] = force
        self.agreement = StepAgreement(comm, self.systems, self.interactions, self.subcycling)
        # the step at which each stage of the scene has begun
        self.stage_steps: list[int] = restart.header["stage_steps"] if restart else [0]
        self.failed_somewhere = False
        # whether any system has ended its step before the end of it
        self._ended = any(system.reached is not None for system in self.systems)
        self.last_checkpoint: str | None = None
        self.first_step = self.clock.step
        self.particles: int = comm.allreduce(sum(system.owned for system in self.systems))
        self.setup_seconds = clock.perf_counter() - self.clock.began

    def run(
        self,
        until: float | None = None,
        outputs: Sequence[Output] = (),
        limits: Limits | None = None,
        stop: StopRequest | None = None,
    ) -> str:
        """Advance to a time [s] (FINISHED), by a number of steps (STOPPED), to a signal or wall time (INTERRUPTED).

        until: the scene's end unless given, and never beyond it; a step ends exactly there. Each output is written
        when it is due, the state at hand first. Collective. Raises RunFailed on all ranks.
        """
        end = self.scene.end_time if until is None else min(until, self.scene.end_time)
        due, limits, first = Outputs(outputs), limits or Limits(), self.clock.step

        def stop_requested() -> bool:
            late = limits.wall is not None and clock.perf_counter() > limits.wall
            return late or (stop is not None and stop.received is not None)

        for system in self.systems:
            if system.stopped:
                # what an earlier call has ended within a step goes on
                self._ended = system.stopped = False
            if len(self.systems) == 1:
                # others would have ended the step already
                system.stop_requested = stop_requested
        self.phases.set_up = self.phases.set_up or clock.perf_counter() - self.clock.began
        self.time_steps.land_on({end, *due.times})
        requests = 1 + len(due.with_wall_times)
        self.agreement = StepAgreement(self.comm, self.systems, self.interactions, self.subcycling, requests)
        if self.stable is None:
            self.agreement.start()
        else:
            self.agreement.resume(self.stable)
        try:
            while True:
                self.stable, (interrupted, *over) = self._agreed()
                floor = self.time_steps.floor
                if self.stable < floor:
                    # the agreed step is negative when a stage of any rank was not sound
                    self.failed_somewhere = self.stable < 0.0
                    what = f"the stable time step {self.stable:.3g} s fell below the floor {floor:.3g} s"
                    self._fail("the state was lost within the step" if self.failed_somewhere else what)
                began = clock.perf_counter()
                due.write_due(self, over)
                self.phases.output += clock.perf_counter() - began
                if any(system.stopped for system in self.systems):
                    return INTERRUPTED
                if self._ended:
                    due.write_all(self)
                    self._fail("there is no way on")
                self._check_row_and_meetings()
                unsettled = any(system.unsettled for system in self.systems)
                if self.clock.time >= end and not unsettled:
                    return FINISHED
                if interrupted:
                    return INTERRUPTED
                if limits.steps is not None and self.clock.step - first >= limits.steps:
                    return STOPPED
                asked = (float(stop_requested()), *due.wall_times_over())
                settling = 0.0, self.clock.time
                self.advance(*(settling if unsettled else self.time_steps.next(self.clock.time, self.stable)), asked)
        finally:
            self.clock.count_processor()

    def _agreed(self) -> tuple[float, list[bool]]:
        """Stable step [s] and requests of all ranks."""
        waiting = clock.perf_counter()
        result = self.agreement.result()
        self.phases.waiting += clock.perf_counter() - waiting
        if self.clock.step <= self.first_step + 1:
            self.phases.begin()
        started = len(self.stage_steps) - 1
        if started == len(self.scene.stages) or self.clock.time < self.scene.stages[started].start or result[0] < 0.0:
            return result
        # a stage begins now, with its own settings: agree on its first step
        for system, ledger in zip(self.systems, self._ledgers):
            system.begin_stage(self.clock.time, ledger)
        self.stage_steps.append(self.clock.step)
        self.time_steps.take_limits(self.systems)
        self.agreement.start()
        return self.agreement.result()[0], result[1]

    def take_step(self, step: float) -> float:
        """One time step [s] and the reduction that goes with it, whatever the stable step is; that of the state after
        it [s]. Collective.
        """
        self.advance(step, self.clock.time + step)
        self.clock.count_processor()
        return self._agreed()[0]

    def advance(self, step: float, arrival: float, requests: Sequence[float] = ()) -> None:
        """One step [s] to a time [s]; `agreement` begins while the last system completes it. Collective.

        requests: of this rank, which all ranks hear of with the next stable step.
        """
        spent, start, ended, self._ended = self.clock, self.clock.time, arrival, False
        began = clock.perf_counter()
        if spent.uncounted_since is None:
            spent.uncounted_since = clock.process_time()
        sent_processor = COMMUNICATION.processor_seconds
        self.agreement.begin_step(requests)
        self.ledger.begin_step()
        # those of places that are solved for are found with these
        moving = self.interactions and any(system.bounded for system in self.systems)
        for interaction in self.interactions if moving else ():
            interaction.start_step(start, step, self.ledger)
        started = moment = clock.perf_counter()
        for number, system in enumerate(self.systems):
            sent = COMMUNICATION.seconds
            # several steps of its own are under the external forces that there are; of the last the second part waits
            count = self.subcycling.count(number, step)
            if COMMON_START in system.particles:
                system.particles.owned_rows(COMMON_START)[:] = system.particles.owned_rows("position")
            for k in range(count - 1):
                system.substep, time = k, start + k * (step / count)
                if not system.advance(time, step / count, self._ledgers[number], self._note_unsound):
                    self.agreement.unsound = True
                # what all ranks must act on, they have
                system.rebuild_anywhere = False
            system.substep = count - 1
            system.advance_positions(start + (count - 1) * (step / count), step / count, self._ledgers[number])
            moment = self._count_work(number, moment, sent)
        positions = moment
        if moving:
            self._find_external_forces(arrival, step)
        forces = moment = clock.perf_counter()
        for number, system in enumerate(self.systems):
            sent, own = COMMUNICATION.seconds, step / system.substeps
            time = start + (system.substeps - 1) * own
            if not system.complete_step(time, own, self._ledgers[number], self.agreement.reporter(system)):
                self.agreement.unsound = True
            reached = system.reached
            if reached is not None:
                self._ended, ended = True, min(ended, reached)
            moment = self._count_work(number, moment, sent)
        if self._ended:
            # as far as systems have come, which may be nowhere
            step = ended - start
            if arrival == start:
                self.time_steps.jumped = None
        if self._warm:
            self._update_lowest_temperature()
        spent.time, spent.step_size = ended, step
        if step > 0.0 or not self._ended:
            # a stop request without progress leaves the length of the last step, which bounds the next one
            spent.step, self.time_steps.last = spent.step + 1, step
        if self.interactions:
            self.phases.contact += started - began + forces - positions
        self.phases.sent_processor += COMMUNICATION.processor_seconds - sent_processor
        spent.loop_seconds += moment - began
        if spent.step == self.first_step + 1:
            spent.first_step_seconds, spent.first_step_processor_seconds = moment - began, spent.count_processor()
        elif self.comm.size > 1:
            # ranks wait for one another between steps
            spent.count_processor()

    def _count_work(self, number: int, began: float, sent: float) -> float:
        """Count what a part of a step of one system took that began at a reading of the clock, with so many seconds in
        messages before it; the present reading."""
        now, messages = clock.perf_counter(), COMMUNICATION.seconds - sent
        self.phases.sent += messages
        if self.clock.step > self.first_step:
            # without what the first step of a program loads
            self.clock.work[number] += now - began - messages
        return now

    def _note_unsound(self, sound: bool, stable: float) -> None:
        """What a system reports of a step that is not its last in the common one."""
        self.agreement.unsound |= not sound

    def _find_external_forces(self, time: float, step: float) -> None:
        """Forces of all interactions at the end of a step [s] at a time [s].

        A system with several steps of its own has had the forces F of the start in all of them, and takes half of one
        with the new ones F': the rest of (F + F') step/2 is an impulse.
        """
        acted_on = [system for system in self.systems if EXTERNAL_FORCE in system.particles]
        before = [system.particles.owned_rows(EXTERNAL_FORCE).copy() for system in acted_on if system.substeps > 1]
        for system in acted_on:
            system.particles.owned_rows(EXTERNAL_FORCE)[:] = 0.0
        for interaction in self.interactions:
            interaction.evaluate(time, step, self.ledger)
            self.agreement.unsound |= not interaction.sound()
        for system, force in zip((one for one in acted_on if one.substeps > 1), before):
            owned, rest = system.particles.owned_rows, 0.5 * step * (1.0 - 1.0 / system.substeps)
            owned(EXTERNAL_IMPULSE)[:] += rest * (owned(EXTERNAL_FORCE) - force)

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles in the current state."""
        return self.agreement.stable_step()

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles."""
        kinetic, stored = self.systems[0].energies()
        others: list[ParticleSystem | Interaction] = [*self.systems[1:], *self.interactions]
        for one in others:
            more = one.energies()
            kinetic, stored = kinetic + more[0], stored + more[1]
        return kinetic, stored

    @property
    def energy_scale(self) -> float:
        """An energy [J], the same on all ranks, of which the balance has the round-off in any case."""
        parts: list[ParticleSystem | Interaction] = [*self.systems, *self.interactions]
        return sum(part.energy_scale for part in parts)

    def energy_row(self) -> dict[str, float]:
        """The ledger's row [J] of the present state over all ranks; checked before the next step. Collective."""
        row = self.ledger.row(self.comm, *self.energies())
        steps, self.checked_step = self.clock.step - self.checked_step, self.clock.step
        jump = steps > 0 and self.clock.step_size == 0.0
        counted = None if jump else steps
        given = sum(system.given for system in self.systems)
        now = self.ledger.initial or 0.0, counted, self.ledger.last_work, given
        self.energy_check.check(row, self.energy_scale, *now)
        if self.momenta is not None:
            self.momenta.check()
        if self._warm:
            self._update_lowest_temperature()
            self.coldest = minimum(self.comm, self._lowest_since_row)
            if self._lowest_since_row > self.coldest:
                self._coldest_particle = None
            self._lowest_since_row = inf
        if self.clock.step >= self._asked_step + _STEPS_BETWEEN_DOUBTS:
            self.validity_warnings()
        return row

    def _update_lowest_temperature(self) -> None:
        """Conduction may undershoot beside a sudden step and recover before the next row."""
        found = [float(one.particles.owned_rows("temperature").min(initial=inf)) for one in self._warm]
        lowest = min(found)
        if lowest < min(self._lowest_since_row, 0.0):
            self._coldest_particle = coldest_particle(self, self._warm[found.index(lowest)])
        self._lowest_since_row = min(self._lowest_since_row, lowest)

    def validity_warnings(self) -> list[str | None]:
        """Why the state is or was beyond what the method of each system describes, None for the others; collective.

        What has turned too far and then burst shows nothing of it at the end, so that earlier messages are kept.
        """
        self._asked_step = self.clock.step
        self.doubts = [system.validity_warning() or before for system, before in zip(self.systems, self.doubts)]
        return self.doubts

    def _check_row_and_meetings(self) -> None:
        """Raise RunFailed on all ranks when the last row of the ledger is not what it may be, or where bodies have met
        that no table names; warn of these where the scene says so."""
        check = self.energy_check
        if not self.coldest >= 0.0:
            self._fail(f"an absolute temperature has fallen to {self.coldest:.6g} K", self._coldest_particle)
        if check.violation is not None:
            share, limit = check.relative(abs(check.violation), self.energy_scale), check.limits.balance_limit
            off = f"the energy balance is off by {check.violation:.4g} J, {share or 0.0:.2g} of the largest energy"
            self._fail(f"{off} (method.balance_limit = {limit:g})")
        for part in self.interactions:
            met, part.met = part.met, []
            if met and self.scene.undeclared_contact != "warn":
                raise RunFailed(describe_meetings(self, met))
            if met:
                text = f"without [[contact]] {meetings_in_words(self.scene, met)} at t = {self.clock.time:.6g} s"
                self.warnings.append(Warned("undeclared-contact", text))

    def _fail(self, what: str, there: Found | None = None) -> NoReturn:
        raise RunFailed(describe_failure(self, what, there))
