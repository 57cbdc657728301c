"""The batch script without a batch system: it stops on the warning signal, goes back into the queue and goes on."""

import os
import signal
import subprocess
import sys

from command_line import ROOT, environment, finish, launcher, wait_for
from run_results import summary
from small_scenes import PUNCH, changed, write

SCRIPT = ROOT / "slurm" / "run.sbatch"


def submit(tmp_path, scene, folder, restarts: int = 0) -> subprocess.Popen:
    """Start the script as a batch system would; `scontrol` only notes what it was asked."""
    python = f'exec {sys.executable} "$@"'
    programs = tmp_path / "programs"
    programs.mkdir(exist_ok=True)
    for name, does in {"scontrol": f'echo "$@" >> {tmp_path}/asked', "python": python}.items():
        (programs / name).write_text(f"#!/bin/sh\n{does}\n")
        (programs / name).chmod(0o755)
    values = environment() | {"SLURM_JOB_ID": "17", "SLURM_NTASKS": "2", "PARSOLID_LAUNCH": " ".join(launcher(2))}
    values |= {"SLURM_RESTART_COUNT": str(restarts), "PARSOLID_MOST_RESTARTS": "1"}
    values["PATH"] = os.pathsep.join([str(programs), values["PATH"]])
    command = ["bash", SCRIPT, scene, folder, "-q"]
    pipes = {"stdout": subprocess.PIPE, "stderr": subprocess.PIPE}
    return subprocess.Popen(command, env=values, text=True, start_new_session=True, **pipes)


def warned(job, folder, number=signal.SIGUSR1) -> tuple[int, str]:
    """Send the warning signal, or another, once steps are taken; exit status and output."""
    before = (folder / "history.csv").stat().st_ino if (folder / "history.csv").exists() else None
    wait_for(lambda: (folder / "history.csv").exists() and (folder / "history.csv").stat().st_ino != before, job)
    os.kill(job.pid, number)
    result = finish(job)
    assert "Traceback" not in result.err, result.err
    return result.status, result.out


def test_the_script_puts_its_job_back_and_restarts(tmp_path):
    long = write(changed(PUNCH, {"end_time": 1.0, "output.fields_interval": 0.1}), tmp_path / "scene.toml")
    folder = tmp_path / "run"
    status, out = warned(submit(tmp_path, long, folder), folder)
    assert status == 0 and "back into the queue" in out
    assert (tmp_path / "asked").read_text() == "requeue 17\n"
    first = summary(folder)
    assert first["status"] == "interrupted"
    # put back as often as it may be: it stops for good, with the status that says that there is more to do
    status, out = warned(submit(tmp_path, long, folder, restarts=1), folder)
    assert status == 75 and out == "" and (tmp_path / "asked").read_text() == "requeue 17\n"
    second = summary(folder)
    assert second["status"] == "interrupted" and second["steps"] > first["steps"]
    # cancelled: a checkpoint, and not put back though it might be
    status, out = warned(submit(tmp_path, long, folder), folder, signal.SIGTERM)
    assert status == 75 and out == "" and (tmp_path / "asked").read_text() == "requeue 17\n"
    assert summary(folder)["steps"] > second["steps"]


def test_the_scripts_are_sound():
    for script in (SCRIPT, SCRIPT.with_name("study.sbatch")):
        subprocess.run(["bash", "-n", script], check=True)
    missing = subprocess.run(["bash", SCRIPT], capture_output=True, text=True)
    assert missing.returncode != 0 and "expected SCENE DIR" in missing.stderr
