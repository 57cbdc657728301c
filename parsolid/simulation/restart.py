"""Checkpoints of a run, its state and that of its outputs, in checkpoint.h5; and how a run goes on from one.

On the same ranks it goes on bit for bit; it may on any other number of ranks.
"""

from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from parsolid.collective import SolverError
from parsolid.methods import method_class
from parsolid.methods.protocol import ParticleSystem
from parsolid.output.checkpoint import numbered, previous_name, read_checkpoint, write_checkpoint
from parsolid.output.crash_report import CONTEXT
from parsolid.output.errors import OutputError, together
from parsolid.output.run_folder import RunFolder
from parsolid.particles.distribution import distribute
from parsolid.particles.particle_set import ParticleSet
from parsolid.per_rank import PerRank, join_per_rank, own_share, split_per_rank
from parsolid.scene import Scene, SceneError
from parsolid.scene.codes import Note
from parsolid.simulation.outputs import Cadence, Output
from parsolid.simulation.scene_changes import changes, completed, contents, faults_and_notes

if TYPE_CHECKING:
    from parsolid.simulation.history import HistoryOutput
    from parsolid.simulation.loop import Simulation
    from parsolid.simulation.reference import ReferenceErrors

# keys of the header of a run's checkpoint
_NEEDED = {
    *("ranks", "time", "step", "last_step", "stable_step", "stable_steps", "jumped", "stage_steps", "method_state"),
    *("initial_energy", "energy_error", "ledger", "checked_step", "energy_check", "momenta", "interactions"),
    *("probes", "errors", "scene"),
}
_PARTICLE_SET = ("identifier", "volume", "spacing", "axes", "body", "area", "area_across", "regions", "surfaces")


class Restart:
    """A checkpoint, read by all ranks; particles are partitioned anew when the number of ranks has changed.

    particle_sets, values: for each system the particles, and all that was kept of them by name.
    """

    def __init__(self, comm: Any, path: Path, allowed: tuple[str, ...] = ()):
        """allowed: keys of the scene that may differ from the checkpoint's, see `scene_changes`. Collective.

        Raises OutputError on all ranks when the file cannot be read, or is not as it was written.
        """
        self.comm, self.path, self.allowed = comm, path, allowed
        self.notes: list[Note] = []
        try:
            header, self.values, rows = read_checkpoint(comm, path)
            self.header = join_per_rank(header, rows)
        except OutputError as error:
            # the checkpoint before, if it can be read
            before, offer = previous_name(path), ""
            with suppress(OutputError):
                time = read_checkpoint(comm, before)[0].get("time", 0.0)
                offer = f"; the one before is whole: --restart {before} goes on from t = {time:.6g} s"
            raise OutputError(f"{error}{offer}") from error
        missing = sorted(_NEEDED - set(self.header))
        if missing:
            raise OutputError(f"{path}: expected the checkpoint of a run, found one without {', '.join(missing)}")
        self.same_ranks = self.header["ranks"] == comm.size
        self.particle_sets: list[ParticleSet] = []
        for values in self.values:
            position, fields = values["reference_position"], {name: values.get(name) for name in _PARTICLE_SET}
            if (axes := fields["axes"]) is not None:
                fields["axes"] = axes.reshape(-1, position.shape[1], position.shape[1])
            known: Any = fields
            self.particle_sets.append(ParticleSet(position=position, **known))

    def distribute(self, scene: Scene) -> None:
        """Partition the particles anew, for another number of ranks; collective."""
        for number, plan in enumerate(scene.systems):
            particle_set, values = self.particle_sets[number], self.values[number]
            owner = method_class(plan.settings).owners(self.comm, scene.part(plan), particle_set)
            moved = distribute(self.comm, particle_set, values, owner)
            self.particle_sets[number], self.values[number] = moved

    def check(self, scene: Scene) -> None:
        """Compare the scene with that of the checkpoint; `notes` tell of what was accepted. Collective.

        Raises SceneError, on all ranks, with every key that may not change (see `scene_changes`), SolverError when the
        scene has another number of systems.
        """
        if len(scene.systems) != len(self.values):
            raise SolverError(
                f"method: expected as many as in the checkpoint, {len(self.values)}, found {len(scene.systems)}"
            )
        tables: dict[str, Any] = {}
        with together(self.comm, "cannot read a file of the scene"):
            if self.comm.rank == 0:
                tables = contents(scene)
        time = self.header["time"]
        before, now = completed(self.header["scene"]), completed(self.comm.bcast(tables))
        found = list(changes(before, now, time))
        faults, self.notes = faults_and_notes(found, self.allowed, self.path, time)
        if scene.end_time < time:
            expected = f"at least {time:.6g} s, the time of the checkpoint {self.path}"
            faults.append(f"end_time: expected {expected}, found {scene.end_time:.6g} s")
        if faults:
            raise SceneError(faults)

    def apply_state(self, systems: list[ParticleSystem], orders: list[np.ndarray]) -> None:
        """Put the systems' state back; orders: (n,) of the particles of each on this rank. Collective.

        Raises SolverError, on all ranks, when the material keeps another state.
        """
        for number, (system, values, order) in enumerate(zip(systems, self.values, orders)):
            kept = system.particles.checkpointed()
            wanted, found = set(kept), set(values)
            if wanted != found and self.allowed:
                expected = f"the state of the checkpoint {self.path} ({', '.join(sorted(found))})"
                raise SolverError(f"bodies.material: expected {expected}, found one with {', '.join(sorted(wanted))}")
            if wanted != found:
                # the scene is the checkpoint's
                missing, extra = (", ".join(sorted(one)) or "nothing" for one in (wanted - found, found - wanted))
                expected = "a checkpoint that this version of parsolid has written, found one of another"
                raise SolverError(f"{self.path}: expected {expected}: {missing} is missing, {extra} is too much")
            for name, rows in kept.items():
                if (rows.shape[1:], rows.dtype) != (values[name].shape[1:], values[name].dtype):
                    raise SolverError(
                        f"bodies.material: expected {name} as in the checkpoint {self.path}, {values[name].dtype} "
                        f"{values[name].shape[1:]}, found {rows.dtype} {rows.shape[1:]}"
                    )
            system.particles.restore({name: rows[order] for name, rows in values.items()})
            system.set_state(self.header[numbered("method_state", number)])
            system.resume()
            if self.allowed:
                system.forget()

    def apply(self, simulation: "Simulation") -> None:
        """Put ledger, balance, clock and steps back. Raises SolverError, on all ranks, for other energy terms."""
        header, ledger = self.header, simulation.ledger
        rows = header["ledger"]
        if rows.shape[1] != len(ledger.values):
            raise SolverError(
                f"method: expected one with the {rows.shape[1]} energy terms of the checkpoint {self.path}, "
                f"found {len(ledger.values)}; an earlier version that has written it goes on with it, and "
                'this one from results with output.fields = ["state"], which [[initial]] takes'
            )
        ledger.initial = header["initial_energy"]
        ledger.values[:] = own_share(self.comm, rows).tolist()
        ledger.begin_step()
        simulation.energy_check.set_state(header["energy_check"], float(rows[:, 1].sum()))
        if simulation.momenta is not None and header["momenta"] is not None:
            simulation.momenta.set_state(header["momenta"])
        simulation.time_steps.jumped, simulation.time_steps.last = header["jumped"], header["last_step"]
        simulation.clock.time, simulation.clock.step = header["time"], header["step"]
        simulation.checked_step, simulation.stable = header["checked_step"], header["stable_step"]
        # earlier versions had no such state
        simulation.doubts = header.get("doubts", simulation.doubts)
        for interaction, state in zip(simulation.interactions, header["interactions"]):
            interaction.set_state(state)
        if self.allowed:
            # what allowed changes did to the energy of the state counts as energy of the start
            jump = (
                simulation.ledger.row(self.comm, *simulation.energies())["energy_error"] - self.header["energy_error"]
            )
            assert simulation.ledger.initial is not None
            simulation.ledger.initial += jump
            if jump:
                text = f"the energy of the state changes by {jump:.4g} J with what was allowed to change"
                self.notes.append(Note("restart-energy", text))


class CheckpointOutput(Output):
    """Checkpoints at the scene's cadence, written after the other outputs of a state.

    history, errors: whose state goes into the checkpoint.
    """

    def __init__(
        self,
        simulation: "Simulation",
        folder: RunFolder,
        history: "HistoryOutput",
        errors: "ReferenceErrors",
    ):
        """Collective."""
        stated = simulation.scene.output
        self.every = Cadence(stated.checkpoint_interval, stated.checkpoint_steps, stated.checkpoint_wall)
        self.path, self.history, self.errors = folder.checkpoint, history, errors
        # read when the run starts; rank 0's goes into the file
        self._scene: dict[str, Any] = {}
        with together(simulation.comm, "cannot read a file of the scene"):
            if simulation.comm.rank == 0:
                self._scene = contents(simulation.scene)

    def write(self, simulation: "Simulation") -> None:
        # a method may pack its fields when it is asked for its state
        # what a restart needs besides the fields; the state of probes, the errors found so far, the `contents` of the
        # scene
        systems = enumerate(simulation.systems)
        header, own = split_per_rank(
            {
                "ranks": simulation.comm.size,
                "particles": simulation.particles,
                "time": simulation.clock.time,
                "step": simulation.clock.step,
                "last_step": simulation.time_steps.last,
                "stable_step": simulation.stable,
                "stable_steps": simulation.subcycling.stable,
                "jumped": simulation.time_steps.jumped,
                "stage_steps": simulation.stage_steps,
                **{numbered("method_state", number): system.state() for number, system in systems},
                "interactions": [interaction.state() for interaction in simulation.interactions],
                "ledger": PerRank(*simulation.ledger.values),
                "initial_energy": simulation.ledger.initial,
                "energy_error": simulation.ledger.row(simulation.comm, *simulation.energies())["energy_error"],
                "checked_step": simulation.checked_step,
                "doubts": simulation.doubts,
                "energy_check": simulation.energy_check.state(),
                "momenta": None if simulation.momenta is None else simulation.momenta.state(),
                "probes": self.history.probes.state(),
                "errors": self.errors.found,
                "scene": self._scene,
            }
        )
        fields = [system.particles.checkpointed() for system in simulation.systems]
        write_checkpoint(simulation.comm, self.path, header, fields, np.array(own))
        now = simulation.clock
        simulation.last_checkpoint = CONTEXT.checkpoint = f"{self.path} (step {now.step}, t = {now.time:.6g} s)"

    def write_last(self, simulation: "Simulation") -> None:
        """Write the state in which a run ends, unless it has been written; collective."""
        if self.last_step != simulation.clock.step:
            self.write(simulation)
            self.last_step = simulation.clock.step
