"""Continue a run from a checkpoint, on the same ranks bit for bit, or on any other number of ranks."""

import json

import numpy as np

from parsolid.collective import SolverError
from parsolid.output.checkpoint import read_checkpoint
from parsolid.particles.distribution import distribute
from parsolid.particles.particle_set import ParticleSet

_CLOUD = ("identifier", "volume", "spacing", "axes", "body", "area")


class Restart:
    """A checkpoint, read by all ranks; particles are partitioned anew when the number of ranks has changed."""

    def __init__(self, comm, path):
        """Collective. Raises OutputError on all ranks when the file cannot be read."""
        self.comm, self.path = comm, path
        self.header, self.values, self.rows = read_checkpoint(comm, path)
        self.same_ranks = self.header["ranks"] == comm.size
        self.stable = self.header["stable_step"]
        dimension = self.values["reference_position"].shape[1]
        self.particle_set = self._cloud(dimension)
        if not self.same_ranks:
            moved = distribute(comm, self.particle_set, self.values)
            self.particle_set, self.values = moved

    def _cloud(self, dimension: int) -> ParticleSet:
        fields = {name: self.values.get(name) for name in _CLOUD}
        if fields["axes"] is not None:
            fields["axes"] = fields["axes"].reshape(-1, dimension, dimension)
        return ParticleSet(position=self.values["reference_position"], **fields)

    def check(self, scene) -> None:
        """Raise SolverError, on all ranks, when the scene has other particles than the checkpoint."""
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
                    raise SolverError(
                        f"bodies.{index}.{key}: expected {old.get(key)} as in the checkpoint {self.path}, found {new.get(key)}"
                    )

    def apply(self, simulation, order: np.ndarray) -> None:
        """Put state, ledger and clock back; order (n,) of the particles on this rank. Raises SolverError, on all ranks, when the material keeps another state."""
        wanted, found = set(simulation.method.table.checkpointed()), set(self.values)
        if wanted != found:
            raise SolverError(
                f"bodies.material: expected the state of the checkpoint {self.path} ({', '.join(sorted(found))}), "
                f"found one with {', '.join(sorted(wanted))}"
            )
        simulation.method.table.restore({name: values[order] for name, values in self.values.items()})
        simulation.method.set_state(self.header["method_state"])
        simulation.method.resume()
        simulation.jumped = self.header["jumped"]
        ledger = simulation.ledger
        if self.rows.shape[1] != len(ledger.values):
            raise SolverError(
                f"method: expected one with the {self.rows.shape[1]} energy terms of the checkpoint {self.path}, "
                f"found {len(ledger.values)}"
            )
        ledger.initial = self.header["initial_energy"]
        if self.same_ranks:
            ledger.values[:] = self.rows[self.comm.rank]
        elif self.comm.rank == 0:
            ledger.values[:] = self.rows.sum(axis=0)
        simulation.clock.time, simulation.clock.step = self.header["time"], self.header["step"]


def header_of(simulation, watch) -> dict:
    """What a restart needs besides the fields; collective."""
    return {
        "ranks": simulation.comm.size,
        "particles": simulation.particles,
        "time": simulation.clock.time,
        "step": simulation.clock.step,
        "stable_step": simulation.stable,
        "jumped": simulation.jumped,
        "method_state": simulation.method.state(),
        "initial_energy": simulation.ledger.initial,
        "largest_energy": watch.largest_energy,
        "probes": watch.probes.state(),
        "errors": watch.errors.found,
        "scene": simulation.scene.resolved(),
    }
