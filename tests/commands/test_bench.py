"""`parsolid bench` of every method, with few particles."""

import math
from importlib import import_module

import pytest

from parsolid.commands.bench import METHODS
from parsolid.commands.cli import main


@pytest.mark.parametrize("method", METHODS)
def test_every_method_has_speeds_of_its_kernels(method):
    tables = import_module(f"parsolid.commands.bench.{method}").kernel_tables(64)
    assert tables
    for _, names, rows in tables:
        assert rows and all(len(row) == len(names) for row in rows)
        for row in rows:
            numbers = [float(value) for value in row if str(value).replace(".", "").replace("e+", "").isdigit()]
            assert numbers and all(math.isfinite(number) and number >= 0.0 for number in numbers)


def test_steps_of_all_ranks_are_compared_with_those_of_one(comm, capsys):
    assert main(["bench", "--method", "mpm", "--particles", "64", "--scaling", "512"]) == 0
    if comm.rank == 0:
        rows = [line.split() for line in capsys.readouterr().out.splitlines() if line.strip()]
        assert [row[0] for row in rows[-2:]] == ["1", str(comm.size)]
        assert float(rows[-1][2]) > 0.0 and float(rows[-1][3]) > 0.0
