"""The launcher of runs on several ranks, and processes that a launcher has started."""

import sys
from types import SimpleNamespace

import pytest

from parsolid.collective import SolverError
from parsolid.commands.cli import main
from parsolid.launcher import launcher, refuse_ranks, refuse_strangers

ONE, TWO = SimpleNamespace(size=1), SimpleNamespace(size=2)
NAMES = ("OMPI_COMM_WORLD_SIZE", "PMI_SIZE", "SLURM_STEP_NUM_TASKS")


@pytest.fixture(autouse=True)
def alone(monkeypatch):
    for name in NAMES:
        monkeypatch.delenv(name, raising=False)


@pytest.mark.parametrize("name", NAMES)
def test_ranks_of_another_mpi_are_refused_by_the_first_in_words(monkeypatch, name):
    monkeypatch.setenv(name, "4")
    rank = {"OMPI_COMM_WORLD_SIZE": "OMPI_COMM_WORLD_RANK", "PMI_SIZE": "PMI_RANK"}.get(name, "SLURM_PROCID")
    monkeypatch.setenv(rank, "0")
    with pytest.raises(SolverError, match=rf"the 4 ranks .*{name}.*each is alone.*MPI4PY_MPIABI.*env -u {name}"):
        refuse_strangers(ONE)
    monkeypatch.setenv(rank, "3")
    with pytest.raises(SystemExit, match="2"):
        refuse_strangers(ONE)
    refuse_strangers(TWO)


def test_one_rank_of_a_launcher_and_none_are_as_ever(monkeypatch):
    refuse_strangers(ONE)
    # mpirun -n 1 within a job of two tasks a node
    monkeypatch.setenv("SLURM_STEP_NUM_TASKS", "2")
    monkeypatch.setenv("PMI_SIZE", "1")
    refuse_strangers(ONE)


@pytest.mark.serial
def test_a_run_is_not_begun_by_each_of_them(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("OMPI_COMM_WORLD_SIZE", "2")
    monkeypatch.setenv("OMPI_COMM_WORLD_RANK", "0")
    assert main(["run", str(tmp_path / "scene.toml"), "-o", str(tmp_path / "results")]) == 2
    assert "each is alone" in capsys.readouterr().err and not (tmp_path / "results").exists()


def test_what_starts_ranks_itself_is_not_started_by_a_launcher(monkeypatch):
    with pytest.raises(SolverError):
        refuse_ranks(TWO, "study")
    refuse_ranks(ONE, "study")
    monkeypatch.setenv("PMI_RANK", "0")
    with pytest.raises(SolverError):
        refuse_ranks(ONE, "study")


def test_ranks_need_a_launcher(monkeypatch):
    assert launcher(1) == []
    assert launcher(2)[1:3] == ["-n", "2"]
    monkeypatch.setattr(sys, "executable", "/nowhere/python")
    monkeypatch.setenv("PATH", "/nowhere")
    with pytest.raises(SolverError):
        launcher(2)
