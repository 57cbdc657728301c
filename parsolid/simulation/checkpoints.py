"""Checkpoints of a run: its state and that of its outputs, in checkpoint.h5."""

from typing import Any

import numpy as np

from parsolid.output.checkpoint import numbered, write_checkpoint
from parsolid.output.crash_report import CONTEXT
from parsolid.output.errors import together
from parsolid.output.run_folder import RunFolder
from parsolid.per_rank import PerRank, split_per_rank
from parsolid.simulation.history import HistoryOutput
from parsolid.simulation.loop import Simulation
from parsolid.simulation.outputs import Cadence, Output
from parsolid.simulation.reference import ReferenceErrors
from parsolid.simulation.scene_changes import contents


class CheckpointOutput(Output):
    """Checkpoints at the scene's cadence unless another is given; written after the other outputs of a state.

    history, errors: whose state goes into the checkpoint.
    """

    def __init__(
        self,
        simulation: Simulation,
        folder: RunFolder,
        history: HistoryOutput,
        errors: ReferenceErrors,
        every: Cadence | None = None,
    ):
        """Collective."""
        stated = simulation.scene.output
        self.every = every or Cadence(stated.checkpoint_interval, stated.checkpoint_steps, stated.checkpoint_wall)
        self.path, self.history, self.errors = folder.checkpoint, history, errors
        # read when the run starts; rank 0's goes into the file
        self._scene: dict[str, Any] = {}
        with together(simulation.comm, "cannot read a file of the scene"):
            if simulation.comm.rank == 0:
                self._scene = contents(simulation.scene)

    def write(self, simulation: Simulation) -> None:
        # a method may pack its fields when it is asked for its state
        header, own = split_per_rank(header_of(simulation, self.history.probes.state(), self.errors.found, self._scene))
        fields = [system.particles.checkpointed() for system in simulation.systems]
        write_checkpoint(simulation.comm, self.path, header, fields, np.array(own))
        now = simulation.clock
        simulation.last_checkpoint = CONTEXT.checkpoint = f"{self.path} (step {now.step}, t = {now.time:.6g} s)"

    def write_last(self, simulation: Simulation) -> None:
        """Write the state in which a run ends, unless it has been written; collective."""
        if self.last_step != simulation.clock.step:
            self.write(simulation)
            self.last_step = simulation.clock.step


def header_of(
    simulation: Simulation, probes: dict[str, Any], errors: dict[str, float], scene: dict[str, Any]
) -> dict[str, Any]:
    """What a restart needs besides the fields; the state of probes, the errors found so far, the `contents` of the
    scene.

    Collective.
    """
    systems = enumerate(simulation.systems)
    return {
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
        "energy_check": simulation.energy_check.state(),
        "momenta": None if simulation.momenta is None else simulation.momenta.state(),
        "probes": probes,
        "errors": errors,
        "scene": scene,
    }
