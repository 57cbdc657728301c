"""What nobody has foreseen ends on all ranks with one line, its traceback in a file, and a checkpoint to go on from."""

import pytest
from command_line import all_done, finish, many, start, wait_until_free
from run_results import history
from small_scenes import PUNCH, changed, write

RANKS = 2
ERROR_OF_THE_PROGRAM = 1
# a fault in the fifth step, on some of the ranks
FAULTY = """
import sys
from mpi4py import MPI
from parsolid.simulation import outputs
write_due = outputs.Outputs.write_due

def faulty(self, simulation, over):
    if simulation.clock.step == 5 and simulation.comm.rank in ({ranks}):
        raise {error}
    write_due(self, simulation, over)

outputs.Outputs.write_due = faulty
from parsolid.commands.cli import main
sys.exit(main())
"""


@pytest.mark.parametrize(("ranks", "error"), [("1,", "ZeroDivisionError('of nothing')"), ("0, 1", "MemoryError")])
def test_an_error_of_the_program_ends_all_ranks_with_one_line(tmp_path, ranks, error):
    scene = write(changed(PUNCH, {"output.checkpoint_steps": 2}), tmp_path / "scene.toml")
    program = ("-c", FAULTY.format(ranks=ranks, error=error))
    job = finish(start([scene, "-q", "-o", tmp_path / "run"], RANKS, program=program), 60.0)
    assert job.status == ERROR_OF_THE_PROGRAM
    said = [line for line in job.err.splitlines() if line.startswith("parsolid: ")]
    kind = error.partition("(")[0]
    assert len(said) == 1 and said[0].startswith(f"parsolid: expected no error, found {kind}"), job.err
    assert f"the traceback is in {tmp_path / 'run' / 'traceback.txt'}" in said[0]
    assert f"last checkpoint: {tmp_path / 'run' / 'checkpoint.h5'} (step 4, t = " in said[0]
    assert "Traceback" not in job.err
    kept = (tmp_path / "run" / "traceback.txt").read_text()
    assert kept.startswith("Traceback") and "in faulty" in kept and kind in kept
    if ranks == "1,":
        # a restart goes on, keeps the file under another name, and tells its own error anew
        job = finish(start([scene, "-q", "-o", tmp_path / "run", "--restart"], RANKS, program=program), 60.0)
        assert job.status == ERROR_OF_THE_PROGRAM and (tmp_path / "run" / "traceback.1.txt").read_text() == kept
    wait_until_free(tmp_path / "run")
    all_done(many([[scene, "-q", "-o", tmp_path / "run", "--restart"]], RANKS, tmp_path / "job"))
    assert history(tmp_path / "run")["time"][-1] == PUNCH["end_time"]


def test_an_error_before_there_is_a_folder_leaves_its_traceback_here(tmp_path):
    scene = write(PUNCH, tmp_path / "scene.toml")
    faulty = FAULTY.format(ranks="0, 1", error="KeyError(3)")
    broken = "from parsolid.api import running; running.warm_up = None"
    program = "-c", faulty.replace("outputs.Outputs.write_due = faulty", broken)
    job = finish(start([scene, "-q", "-o", tmp_path / "run"], RANKS, tmp_path, program), 60.0)
    (kept,) = tmp_path.glob("parsolid-*-traceback.txt")
    assert job.status == ERROR_OF_THE_PROGRAM and str(kept) in job.err and "last checkpoint" not in job.err
    assert "TypeError" in kept.read_text() and not (tmp_path / "run").exists()
