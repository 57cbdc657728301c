"""Continue a run from a checkpoint, on the same ranks bit for bit, or on any other number of ranks."""

import numpy as np

from parsolid.distribution import distribute, sort_for_speed
from parsolid.output.checkpoint import read_checkpoint
from parsolid.scene.cloud import Cloud

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
        self.cloud = self._cloud(dimension)
        if not self.same_ranks:
            moved = distribute(comm, self.cloud, self.values)
            self.cloud, self.values = moved

    def _cloud(self, dimension: int) -> Cloud:
        fields = {name: self.values.get(name) for name in _CLOUD}
        if fields["axes"] is not None:
            fields["axes"] = fields["axes"].reshape(-1, dimension, dimension)
        return Cloud(position=self.values["reference_position"], **fields)

    def order(self, cloud, laws: list) -> np.ndarray:
        """Order (n,) of the particles on this rank: as in the checkpoint on the same ranks."""
        if self.same_ranks:
            return np.arange(len(cloud.position))
        return sort_for_speed(self.comm, cloud, laws)

    def apply(self, simulation, order: np.ndarray) -> None:
        """Put state, ledger and clock back."""
        simulation.method.table.restore({name: values[order] for name, values in self.values.items()})
        simulation.method.resume()
        ledger = simulation.ledger
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
        "initial_energy": simulation.ledger.initial,
        "largest_energy": watch.largest_energy,
        "probes": watch.probes.state(),
        "errors": watch.errors.found,
        "scene": simulation.scene.resolved(),
    }


