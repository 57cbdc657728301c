"""The wall time may end in the middle of any write: what is being written is finished, and a restart loses nothing."""

import numpy as np
import pytest
from solids import punch, run_into

from parsolid.output.history import read_history
from parsolid.output.run_folder import RunFolder
from parsolid.output.slabs import open_serial
from parsolid.scene import parse_scene
from parsolid.simulation.field_output import FieldOutput
from parsolid.simulation.history import HistoryOutput
from parsolid.simulation.job import Job
from parsolid.simulation.loop import INTERRUPTED, Limits, Simulation, StopRequest
from parsolid.simulation.restart import CheckpointOutput, Restart

OUTPUT = {"history_steps": 1, "checkpoint_steps": 2, "fields_times": [1e-3, 2e-3, 3e-3]}
# the call of an output's `write` in which the time ends
WRITES = {"history": (HistoryOutput, 1), "fields": (FieldOutput, 2), "checkpoint": (CheckpointOutput, 2)}
WRITES |= {"first fields": (FieldOutput, 1)}


def until_stopped(comm, scene, folder, limits: Limits) -> tuple[str, Job]:
    """A run with its files, as far as the limits let it come."""
    job = Job(Simulation(comm, scene), RunFolder(comm, folder))
    status = job.simulation.run(None, job.outputs, limits, StopRequest())
    job.finish()
    job.close()
    job.folder.close()
    return status, job


def written(folder, comm) -> list[bytes]:
    """Columns of the history; times and values of a field."""
    comm.Barrier()
    with open_serial(folder / "fields.vtkhdf", "r") as file:
        fields = [file[f"VTKHDF/{name}"][()].tobytes() for name in ("PointData/velocity", "Steps/Values")]
    return [np.array(values).tobytes() for values in read_history(folder / "history.csv").values()] + fields


@pytest.fixture(scope="module")
def scene():
    return parse_scene(punch((5, 5), end_time=3e-3, output=OUTPUT))


@pytest.mark.parametrize("name", WRITES)
def test_the_time_that_ends_in_a_write_loses_nothing(comm, shared_path, scene, name, monkeypatch):
    limits, (owner, number) = Limits(), WRITES[name]
    write, calls = owner.write, []

    def late(self, *arguments):
        calls.append(name)
        # the last rank's clock alone, in the midst of the run
        if len(calls) == number and comm.rank == comm.size - 1:
            limits.wall = 0.0
        write(self, *arguments)

    with monkeypatch.context() as patch:
        patch.setattr(owner, "write", late)
        status, stopped = until_stopped(comm, scene, shared_path / "pieces", limits)
    assert status == INTERRUPTED and stopped.checkpoints.last_step == stopped.simulation.clock.step
    run_into(shared_path / "pieces", comm, scene, restart=Restart(comm, shared_path / "pieces" / "checkpoint.h5"))
    whole = run_into(shared_path / "whole", comm, scene).simulation
    assert 0 < stopped.simulation.clock.step < whole.clock.step
    assert written(shared_path / "pieces", comm) == written(shared_path / "whole", comm)


def test_a_run_goes_on_through_links_and_leaves_what_they_point_to(comm, shared_path, scene):
    folder, other = shared_path / "pieces", shared_path / "other"
    run_into(folder, comm, scene, 4)
    kept = {}
    if comm.rank == 0:
        other.mkdir()
        for path in (folder / "history.csv", folder / "checkpoint.h5"):
            path.rename(other / path.name)
            path.symlink_to(other / path.name)
            kept[path.name] = (other / path.name).read_bytes()
    comm.Barrier()
    run_into(folder, comm, scene, restart=Restart(comm, folder / "checkpoint.h5"))
    run_into(shared_path / "whole", comm, scene)
    assert written(folder, comm) == written(shared_path / "whole", comm)
    comm.Barrier()
    if comm.rank == 0:
        assert {name: (other / name).read_bytes() for name in kept} == kept
        # a link alone, in a folder of its own
        (shared_path / "own").mkdir()
        (shared_path / "own" / "checkpoint.h5").symlink_to(other / "checkpoint.h5")
    comm.Barrier()
    restart = Restart(comm, shared_path / "own" / "checkpoint.h5")
    last = run_into(shared_path / "own", comm, scene, restart=restart).simulation
    assert read_history(shared_path / "own" / "history.csv")["step"] == [5.0, 6.0] and last.clock.step == 6
