"""`parsolid bench` of every method, with few particles."""

import re

import pytest

from parsolid.commands import bench
from parsolid.commands.cli import main


@pytest.mark.parametrize("method", bench.METHODS)
def test_all_cases_are_scenes(method):
    for settings, material in bench.CASES[method]:
        bench.bench_scene(method, 64, settings, material)


# those that compile most run with --long
SOME = [pytest.param(one, marks=[pytest.mark.long] * (one in ("mpm", "ulsph"))) for one in bench.METHODS]


@pytest.mark.parametrize("method", SOME)
def test_steps_of_all_ranks_are_compared_with_those_of_one(method, comm, capsys, monkeypatch):
    """With the first case alone; on one rank the speed-up is that of the same steps."""
    monkeypatch.setitem(bench.CASES, method, bench.CASES[method][:1])
    assert main(["bench", "--method", method, "--particles", "64", "--scaling", "216"]) == 0
    if comm.rank == 0:
        lines = [re.findall(r"[\d.]+(?:e[+-]\d+)?", line) for line in capsys.readouterr().out.splitlines()]
        rows = [[float(number) for number in line] for line in lines if len(line) == 4 and "." not in line[0]][-2:]
        assert [row[0] for row in rows] == [1.0, comm.size] and rows[0][1] == rows[1][1] > 0.0
        assert all(number > 0.0 for row in rows for number in row)
