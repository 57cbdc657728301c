"""Runs of the scenes of `cases`, each made once in a session, for all contracts that read it."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import pytest
from cases import CASES
from mpi4py import MPI
from solids import Record, late_impulse

from parsolid.output.run_folder import RunFolder
from parsolid.scene import Scene, parse_scene
from parsolid.scene.observation import stored_energy
from parsolid.simulation.job import Job
from parsolid.simulation.loop import Limits, Simulation
from parsolid.simulation.restart import Restart

OUTPUT = {"history_steps": 1, "fields_times": [], "pictures": False}


def motion(sim) -> dict[str, np.ndarray]:
    """Momentum and angular momentum of all particles [kg m/s, kg m^2/s], with impulses that are on their way, and the
    sums of their parts' magnitudes."""
    sums, turning = np.zeros(4), np.zeros(4)
    for system in sim.systems:
        rows, owned = system.particles.owned_rows, system.owned
        p, x = np.zeros((2, owned, 3))
        p[:, : system.dimension] = (system.mass * system.share)[:owned, None] * rows("velocity") + late_impulse(system)
        x[:, : system.dimension] = rows("position")
        moment = np.cross(x, p)
        sums += [*p.sum(axis=0), np.linalg.norm(p, axis=1).sum()]
        turning += [*moment.sum(axis=0), np.linalg.norm(moment, axis=1).sum()]
    return {"momentum": sim.comm.allreduce(sums), "angular": sim.comm.allreduce(turning)}


@dataclass
class Run:
    """What a run leaves: its folder, the record of its steps (ledger and motion) and its summary."""

    folder: Path
    columns: dict[str, np.ndarray]
    summary: dict

    @cached_property
    def largest_energy(self) -> float:
        """Of what bodies had, or were given [J]."""
        stored = stored_energy(self.columns)
        return max(float(np.abs(self.columns[name]).max()) for name in ("kinetic", stored, "external_work"))


class Runs:
    """Runs by name, on all ranks or on the first alone; collective."""

    def __init__(self, comm, folder: Path) -> None:
        self.comm, self.folder = comm, folder
        self._scenes: dict[str, Scene] = {}
        self._runs: dict[tuple[str, str], Run | None] = {}

    def scene(self, name: str) -> Scene:
        """The scene; its files are there for all ranks."""
        if name not in self._scenes:
            place = self.folder / f"{list(CASES).index(name)}"
            if self.comm.rank == 0:
                place.mkdir()
            self.comm.Barrier()
            data = CASES[name].make(place)
            output = OUTPUT if "fields" not in CASES[name].tags else data["output"]
            self._scenes[name] = parse_scene(data | {"output": output})
        return self._scenes[name]

    def _run(self, name: str, kind: str, *pieces: tuple) -> Run | None:
        """A run in pieces (communicator, steps of the whole run or None for its end), each a restart of the one before;
        of those of one rank others hear nothing."""
        if (name, kind) not in self._runs:
            scene, run = self.scene(name), None
            folder = self.folder / f"{list(CASES).index(name)}-{kind}"
            for number, (comm, until) in enumerate(pieces):
                if comm is self.comm or self.comm.rank == 0:
                    restart = Restart(comm, folder / "checkpoint.h5") if number else None
                    sim, record = Simulation(comm, scene, restart), Record(motion)
                    job = Job(sim, RunFolder(comm, folder, restart and restart.path), restart, outputs=[record])
                    sim.run(None, job.outputs, Limits(until and until - sim.clock.step))
                    job.finish()
                    run = Run(folder, record.columns(), job.summary("finished"))
                    job.close()
                    job.folder.close()
                self.comm.Barrier()
            self._runs[name, kind] = run
        return self._runs[name, kind]

    def whole(self, name: str) -> Run:
        """On all ranks, in one piece."""
        return self._run(name, "whole", (self.comm, CASES[name].steps))

    def alone(self, name: str) -> Run | None:
        """On the first rank alone, which gets it."""
        return self._run(name, "alone", (MPI.COMM_SELF, CASES[name].steps))

    def in_pieces(self, name: str) -> Run:
        """On all ranks, stopped and restarted."""
        return self._run(name, "pieces", *((self.comm, until) for until in (*CASES[name].stops, CASES[name].steps)))

    def from_one_rank(self, name: str) -> Run:
        """Begun on the first rank alone, and continued on all."""
        return self._run(name, "begun", (MPI.COMM_SELF, CASES[name].stops[-1]), (self.comm, CASES[name].steps))


@pytest.fixture(scope="session")
def runs(comm, tmp_path_factory) -> Runs:
    """The runs of this session."""
    return Runs(comm, Path(comm.bcast(str(tmp_path_factory.mktemp("contracts")))))
