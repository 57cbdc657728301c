"""`parsolid bench` of every method, with few particles."""

import math
import re
from importlib import import_module

import pytest

from parsolid.commands.bench import METHODS
from parsolid.commands.cli import main

# kernels that no other test compiles
LONG = ("tlsph", "mpm")


@pytest.mark.parametrize(
    "method", [pytest.param(name, marks=[pytest.mark.slow] if name in LONG else []) for name in METHODS]
)
def test_every_method_has_speeds_of_its_kernels(method):
    tables = import_module(f"parsolid.commands.bench.{method}").kernel_tables(64)
    assert tables
    for _, names, rows in tables:
        assert rows and all(len(row) == len(names) for row in rows)
        for row in rows:
            numbers = [float(value) for value in row if re.fullmatch(r"[\d.]+(e[+-]\d+)?", str(value))]
            assert numbers and all(math.isfinite(number) and number >= 0.0 for number in numbers)


@pytest.mark.parametrize("method", METHODS)
def test_steps_of_all_ranks_are_compared_with_those_of_one(method, comm, capsys, monkeypatch):
    """Without the tables of kernels; on one rank the speed-up is that of the same steps."""
    module = import_module(f"parsolid.commands.bench.{method}")
    monkeypatch.setattr(module, "kernel_tables", lambda particles: [])
    assert main(["bench", "--method", method, "--scaling", "216"]) == 0
    if comm.rank == 0:
        lines = [re.findall(r"[\d.]+(?:e[+-]\d+)?", line) for line in capsys.readouterr().out.splitlines()]
        rows = [[float(number) for number in line] for line in lines if len(line) == 4]
        assert [row[0] for row in rows] == [1.0, comm.size] and rows[0][1] == rows[1][1] > 0.0
        assert all(number > 0.0 for row in rows for number in row)
