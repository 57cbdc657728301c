"""Continue a run from a checkpoint, on the same ranks bit for bit, or on any other number of ranks."""

import json
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from parsolid.collective import SolverError
from parsolid.methods.protocol import ParticleSystem
from parsolid.output.checkpoint import numbered, read_checkpoint
from parsolid.particles.distribution import distribute
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene

if TYPE_CHECKING:
    from parsolid.simulation.loop import Simulation

_PARTICLE_SET = ("identifier", "volume", "spacing", "axes", "body", "area")


class Restart:
    """A checkpoint, read by all ranks; particles are partitioned anew when the number of ranks has changed.

    particle_sets, values: for each system the particles, and all that was kept of them by name.
    """

    def __init__(self, comm: Any, path: Path):
        """Collective. Raises OutputError on all ranks when the file cannot be read."""
        self.comm, self.path = comm, path
        self.header, self.values, self.rows = read_checkpoint(comm, path)
        self.same_ranks = self.header["ranks"] == comm.size
        self.particle_sets = [_particle_set(values) for values in self.values]
        if not self.same_ranks:
            moved = [distribute(comm, *one) for one in zip(self.particle_sets, self.values)]
            self.particle_sets, self.values = [one[0] for one in moved], [one[1] for one in moved]

    def check(self, scene: Scene) -> None:
        """Raise SolverError, on all ranks, when the scene has other particles than the checkpoint."""
        if len(scene.systems) != len(self.values):
            raise SolverError(
                f"method: expected as many as in the checkpoint, {len(self.values)}, found {len(scene.systems)}"
            )
        then, now = self.header["scene"], scene.resolved()
        if then["dimension"] != now["dimension"]:
            raise SolverError(
                f"dimension: expected that of the checkpoint, {then['dimension']}, found {now['dimension']}"
            )
        if len(then["bodies"]) != len(now["bodies"]):
            raise SolverError(
                f"bodies: expected those of the checkpoint, {len(then['bodies'])}, found {len(now['bodies'])}"
            )
        for index, (old, new) in enumerate(zip(then["bodies"], now["bodies"])):
            for key in ("shape", "particles", "spacing", "placement", "jitter", "seed"):
                # as JSON, because the header has been through it
                if json.dumps(old.get(key)) != json.dumps(new.get(key)):
                    expected = f"{old.get(key)} as in the checkpoint {self.path}"
                    raise SolverError(f"bodies.{index}.{key}: expected {expected}, found {new.get(key)}")

    def apply_state(self, systems: list[ParticleSystem], orders: list[np.ndarray]) -> None:
        """Put the systems' state back; orders: (n,) of the particles of each on this rank. Collective.

        Raises SolverError, on all ranks, when the material keeps another state.
        """
        for number, (system, values, order) in enumerate(zip(systems, self.values, orders)):
            wanted, found = set(system.particles.checkpointed()), set(values)
            if wanted != found:
                raise SolverError(
                    f"bodies.material: expected the state of the checkpoint {self.path} ({', '.join(sorted(found))}), "
                    f"found one with {', '.join(sorted(wanted))}"
                )
            system.particles.restore({name: rows[order] for name, rows in values.items()})
            system.set_state(self.header[numbered("method_state", number)])
            system.resume()

    def apply(self, simulation: "Simulation") -> None:
        """Put ledger, balance, clock and steps back. Raises SolverError, on all ranks, for other energy terms."""
        header, ledger = self.header, simulation.ledger
        if self.rows.shape[1] != len(ledger.values):
            raise SolverError(
                f"method: expected one with the {self.rows.shape[1]} energy terms of the checkpoint {self.path}, "
                f"found {len(ledger.values)}"
            )
        ledger.initial = header["initial_energy"]
        if self.same_ranks:
            ledger.values[:] = self.rows[self.comm.rank]
        elif self.comm.rank == 0:
            ledger.values[:] = self.rows.sum(axis=0)
        simulation.balance.largest = header["largest_energy"]
        simulation.time_steps.jumped = header["jumped"]
        simulation.clock.time, simulation.clock.step = header["time"], header["step"]
        simulation.stable = header["stable_step"]


def _particle_set(values: dict[str, np.ndarray]) -> ParticleSet:
    dimension = values["reference_position"].shape[1]
    fields: dict[str, Any] = {name: values.get(name) for name in _PARTICLE_SET}
    if fields["axes"] is not None:
        fields["axes"] = fields["axes"].reshape(-1, dimension, dimension)
    return ParticleSet(position=values["reference_position"], **fields)


def header_of(simulation: "Simulation", probes: dict[str, Any], errors: dict[str, float]) -> dict[str, Any]:
    """What a restart needs besides the fields, with the state of probes and the errors found so far; collective."""
    systems = enumerate(simulation.systems)
    return {
        "ranks": simulation.comm.size,
        "particles": simulation.particles,
        "time": simulation.clock.time,
        "step": simulation.clock.step,
        "stable_step": simulation.stable,
        "jumped": simulation.time_steps.jumped,
        **{numbered("method_state", number): system.state() for number, system in systems},
        "initial_energy": simulation.ledger.initial,
        "largest_energy": simulation.balance.largest,
        "probes": probes,
        "errors": errors,
        "scene": simulation.scene.resolved(),
    }
