"""A simulation that a script advances itself, with probes and the particles' arrays at hand."""

import os
from collections.abc import Callable, Sequence
from contextlib import ExitStack, closing
from numbers import Real
from pathlib import Path
from types import TracebackType
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.api.scenes import AnyScene, read_scene, require_whole_number, scene_on_all_ranks
from parsolid.collective import SolverError
from parsolid.observables.declared import Observables
from parsolid.output.checkpoint import find_checkpoint
from parsolid.output.run_folder import RunFolder
from parsolid.scene.observed import FIELDS
from parsolid.simulation.history import Probes
from parsolid.simulation.job import FAILED, Job
from parsolid.simulation.loop import FINISHED, STOPPED, Limits, RunFailed
from parsolid.simulation.loop import Simulation as Core
from parsolid.simulation.outputs import Cadence, Callback, EnergyCheckOutput, Output
from parsolid.simulation.restart import Restart


class Simulation:
    """Steps by hand; times [s]. All methods are collective but `arrays` and `field`, which are of this rank.

    core: the parsolid.simulation.loop.Simulation itself.
    """

    def __init__(
        self,
        scene: AnyScene,
        output: str | Path | None = None,
        restart: str | Path | None = None,
        outputs: Sequence[Output] = (),
        comm: Any = MPI.COMM_WORLD,
        trust_code: bool = False,
    ) -> None:
        """scene: a Scene, a TOML file, or tables; output: a folder, where history, fields and checkpoints are written
        as the scene says, or None: nothing is written; restart: a checkpoint, or the folder of the run to go on with;
        outputs: further ones, see `parsolid.Output`; trust_code: laws in files that the scene names are run.

        Raises SceneError, SolverError or OutputError on all ranks.
        """
        if not isinstance(restart, str | os.PathLike | None):
            raise SolverError(f"restart: expected a checkpoint, the folder of a run or None, found {restart!r}")
        stated = scene_on_all_ranks(comm, lambda: read_scene(scene, trust_code=trust_code))
        kept = None
        if restart is not None:
            kept = Restart(comm, find_checkpoint(restart, comm) if Path(restart).is_dir() else Path(restart))
        self.core = Core(comm, stated, kept)
        self._files = ExitStack()
        self._callbacks: list[Output] = list(outputs)
        if kept is not None:
            # what was due at the checkpoint's step has been written
            for one in self._callbacks:
                one.last_step = self.steps
        self._job: Job | None = None
        self._probes: Probes | None = None
        if output is None:
            # the energy that later balances are told by
            self.core.energy_row()
            return
        with ExitStack() as opened:
            folder = opened.enter_context(closing(RunFolder(comm, output, None if kept is None else kept.path)))
            self._job = opened.enter_context(closing(Job(self.core, folder, kept)))
            self._files = opened.pop_all()

    def __repr__(self) -> str:
        return f"<simulation {self.core.scene.title!r} at {self.time:g} s after {self.steps} steps>"

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # an error may be of this rank alone: then nothing collective may follow
        self.close(finish=kind is None)

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self.core.clock.time

    @property
    def steps(self) -> int:
        """Steps taken, those before a restart among them."""
        return self.core.clock.step

    @property
    def finished(self) -> bool:
        """Whether the scene's end_time is reached."""
        return self.time >= self.core.scene.end_time

    def step(self, count: int = 1) -> float:
        """Take so many steps of the stable length, not beyond the scene's end_time; the time reached.

        Raises RunFailed when the state or the energy balance is lost, SolverError for what is no number of steps.
        """
        require_whole_number("step", count)
        if not self.finished:
            self._advance(None, Limits(steps=int(count)))
        return self.time

    def run(self, until: float | None = None) -> float:
        """Take steps and end exactly at a time, or at the scene's end_time; the time reached.

        Raises RunFailed, and SolverError for a time that is over.
        """
        if until is not None and not (isinstance(until, Real) and until >= self.time):
            raise SolverError(f"run: expected a time from the present {self.time:g} s on, found {until!r}")
        self._advance(None if until is None else float(until))
        return self.time

    def _advance(self, until: float | None, limits: Limits | None = None) -> None:
        """Take steps to a time [s] or a limit; a failure ends the run in its folder, too."""
        try:
            self.core.run(until, self._outputs(), limits)
        except RunFailed as failure:
            self._end(FAILED, str(failure).splitlines()[0])
            raise

    def on_step(self, callback: Callable[["Simulation"], object], every: Cadence = Output.every) -> Any:
        """Call a function with this object after every step, or at another cadence; usable as a decorator.

        Raises SolverError for what is no function or no cadence.
        """
        if not callable(callback):
            raise SolverError(f"on_step: expected a function of the simulation, found {callback!r}")
        if not isinstance(every, Cadence):
            raise SolverError(f"every: expected a parsolid.Cadence, found {every!r}")
        called = Callback(callback, every, self)
        # from the next step on
        called.last_step = self.steps
        self._callbacks.append(called)
        return callback

    def _outputs(self) -> list[Output]:
        """What is done with each state: files first, the checkpoint after all that a callback may change."""
        if self._job is None:
            return [*self._callbacks, EnergyCheckOutput()]
        *first, checkpoints, shown = self._job.outputs
        return [*first, *self._callbacks, checkpoints, shown]

    def arrays(self, name: str) -> list[np.ndarray]:
        """A declared field of this rank's particles, one array a system, (n,), (n, d) or tensors by rows in SI units.

        They are views: what is written into them is the state from then on. Taken anew after a step, for particles may
        change their rank or their rows. Raises KeyError, naming what there is.
        """
        found = [system.particles for system in self.core.systems if name in system.particles]
        if not found:
            known = sorted({field for system in self.core.systems for field in system.particles.fields})
            raise KeyError(f"{name}: expected one of {', '.join(known)}")
        return [particles.owned_rows(name) for particles in found]

    def field(self, name: str) -> np.ndarray:
        """A field as files and probes show it, of this rank's particles of all systems: a copy where it is computed.

        Collective for stresses at nodes (`nodal_stress`). Raises KeyError, naming what there is.
        """
        observables = Observables(self.core.systems)
        if not observables.has(name):
            known = [one for one in sorted(FIELDS) if observables.has(one)]
            usual = ", ".join(dict.fromkeys([*observables.usual_fields(), *known]))
            raise KeyError(f"{name}: expected one of {usual}, or one that `arrays` knows")
        observables.prepare([name], self.core.clock.time)
        return observables.field(name)

    def energies(self) -> dict[str, float]:
        """The energy ledger over all ranks [J], with the names of the history's columns."""
        return self.core.energy_row()

    def probes(self) -> dict[str, float]:
        """The scene's probes and reactions in the present state, the same on all ranks: column of the history -> value.

        Reactions are means over the last step.
        """
        if self._probes is None:
            observables = Observables(self.core.systems)
            own = self._job.history.probes if self._job else None
            self._probes = own or Probes(self.core.comm, self.core.scene, observables)
        self._probes.prepare(self.core.clock.time)
        return dict(zip(self._probes.columns, self._probes.sample()))

    def close(self, finish: bool = True) -> None:
        """End the run in its folder with a checkpoint and the summary, and give the folder back.

        finish: False leaves out what all ranks have to do together.
        """
        if finish:
            self._end(FINISHED if self.finished else STOPPED)
        self._job = None
        self._files.close()

    def _end(self, status: str, fault: str | None = None) -> None:
        """Write what the end of a run owes its folder, once."""
        if self._job is not None:
            job, self._job = self._job, None
            job.end(status, fault)
