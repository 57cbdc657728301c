"""A simulation that a script advances step by step, with access to probes and arrays of particles."""

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
    """A simulation advanced by a script; times in s. All methods but `arrays` and `field` are collective.

    core: the underlying parsolid.simulation.loop.Simulation
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
        """scene: a Scene, a TOML file, or tables; output: a folder for history, fields and checkpoints, or None to
        write nothing; restart: a checkpoint, or the folder of the run to continue; outputs: further outputs, see
        `parsolid.Output`; trust_code: execute files of laws that the scene names.

        Raises SceneError, SolverError or OutputError on all ranks.
        """
        if not isinstance(restart, str | os.PathLike | None):
            raise SolverError(f"restart: expected a checkpoint, the folder of a run or None, found {restart!r}")
        stated = scene_on_all_ranks(comm, lambda: read_scene(scene, trust_code=trust_code))
        state = None
        if restart is not None:
            state = Restart(comm, find_checkpoint(restart, comm) if Path(restart).is_dir() else Path(restart))
        self.core = Core(comm, stated, state)
        self._files = ExitStack()
        self._callbacks: list[Output] = list(outputs)
        if state is not None:
            # outputs of the checkpoint's step are written already
            for callback in self._callbacks:
                callback.last_step = self.steps
        self._job: Job | None = None
        self._probes: Probes | None = None
        if output is None:
            # sets the initial energy of the energy balance
            self.core.energy_row()
            return
        with ExitStack() as opened:
            folder = opened.enter_context(closing(RunFolder(comm, output, None if state is None else state.path)))
            self._job = opened.enter_context(closing(Job(self.core, folder, state)))
            self._files = opened.pop_all()

    def __repr__(self) -> str:
        return f"<simulation {self.core.scene.title!r} at {self.time:g} s after {self.steps} steps>"

    def __enter__(self) -> "Simulation":
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        # after an error, which may be of this rank only, nothing collective may follow
        self.close(finish=kind is None)

    @property
    def time(self) -> float:
        """Time reached [s]."""
        return self.core.clock.time

    @property
    def steps(self) -> int:
        """Number of steps taken, including those before a restart."""
        return self.core.clock.step

    @property
    def finished(self) -> bool:
        """Whether the end_time of the scene is reached."""
        return self.time >= self.core.scene.end_time

    def step(self, count: int = 1) -> float:
        """Take so many stable steps, not beyond the scene's end_time; returns the time reached.

        Raises RunFailed if the state or the energy balance is lost, SolverError for a faulty count.
        """
        require_whole_number("step", count)
        if not self.finished:
            self._advance(None, Limits(steps=int(count)))
        return self.time

    def run(self, until: float | None = None) -> float:
        """Take steps exactly to a time, or to the scene's end_time; returns the time reached.

        Raises RunFailed, and SolverError for a time in the past.
        """
        if until is not None and not (isinstance(until, Real) and until >= self.time):
            raise SolverError(f"run: expected a time from the present {self.time:g} s on, found {until!r}")
        self._advance(None if until is None else float(until))
        return self.time

    def _advance(self, until: float | None, limits: Limits | None = None) -> None:
        """Take steps to a time [s] or a limit; a failure is also recorded in the folder."""
        try:
            self.core.run(until, self._outputs(), limits)
        except RunFailed as failure:
            self._end(FAILED, str(failure).splitlines()[0])
            raise

    def on_step(self, callback: Callable[["Simulation"], object], every: Cadence = Output.every) -> Any:
        """Call a function with this object after every step, or at another cadence; usable as a decorator.

        Raises SolverError for a faulty function or cadence.
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
        """Outputs in their order: checkpoints after callbacks, which may change the state."""
        if self._job is None:
            return [*self._callbacks, EnergyCheckOutput()]
        *first, checkpoints, shown = self._job.outputs
        return [*first, *self._callbacks, checkpoints, shown]

    def arrays(self, name: str) -> list[np.ndarray]:
        """A declared field of this rank's particles, one array per system: (n,), (n, d) or tensors by rows, SI units.

        The arrays are views of the state and can be written. They are valid until the next step, in which particles may
        change rank or row. Raises KeyError with the known names.
        """
        found = [system.particles for system in self.core.systems if name in system.particles]
        if not found:
            known = sorted({field for system in self.core.systems for field in system.particles.fields})
            raise KeyError(f"{name}: expected one of {', '.join(known)}")
        return [particles.owned_rows(name) for particles in found]

    def field(self, name: str) -> np.ndarray:
        """A field of output and probes, of this rank's particles of all systems; a copy if it is computed.

        Collective for `nodal_stress` and `nodal_von_mises_stress`. Raises KeyError with the known names.
        """
        observables = Observables(self.core.systems)
        if not observables.has(name):
            known = [one for one in sorted(FIELDS) if observables.has(one)]
            usual = ", ".join(dict.fromkeys([*observables.usual_fields(), *known]))
            raise KeyError(f"{name}: expected one of {usual}, or one that `arrays` knows")
        observables.prepare([name], self.core.clock.time)
        return observables.field(name)

    def energies(self) -> dict[str, float]:
        """The energy ledger of all ranks [J]: column of the history -> value."""
        return self.core.energy_row()

    def probes(self) -> dict[str, float]:
        """The scene's probes and reactions in the present state: column of the history -> value, the same on all ranks.

        Reactions are means over the last step.
        """
        if self._probes is None:
            observables = Observables(self.core.systems)
            own = self._job.history.probes if self._job else None
            self._probes = own or Probes(self.core.comm, self.core.scene, observables)
        self._probes.prepare(self.core.clock.time)
        return dict(zip(self._probes.columns, self._probes.sample()))

    def close(self, finish: bool = True) -> None:
        """Write the last checkpoint and the summary, and release the folder; finish: False skips collective work."""
        if finish:
            self._end(FINISHED if self.finished else STOPPED)
        self._job = None
        self._files.close()

    def _end(self, status: str, fault: str | None = None) -> None:
        """Write the final outputs of the run, once."""
        if self._job is not None:
            job, self._job = self._job, None
            job.end(status, fault)
