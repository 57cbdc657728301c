"""`parsolid modes`: tables and shapes that it writes, the same on several ranks, and its exit statuses."""

import csv

import numpy as np
import pytest
import tomli_w
from solids import tables

from parsolid.commands.cli import main
from parsolid.output.results import load
from parsolid.output.summary import read_summary


def scene_file(comm, folder, count=9):
    """A free plate of unit sides."""
    path = folder / "plate.toml"
    if comm.rank == 0:
        method = {"weights": "cells", "integrator": "leapfrog"}
        path.write_text(tomli_w.dumps(tables((count, count), upper=[1.0, 1.0], method=method)))
    comm.barrier()
    return path


def test_what_is_written(comm, shared_path):
    folder = shared_path / "out"
    assert main(["modes", str(scene_file(comm, shared_path)), "-n", "3", "-o", str(folder), "-q"]) == 0
    found = read_summary(folder / "modes.json")
    assert (found["rigid"], found["particles"], found["converged"]) == (3, 81, True)
    with (folder / "modes.csv").open(newline="") as file:
        rows = list(csv.DictReader(file))
    assert [row["kind"] for row in rows] == ["rigid"] * 3 + ["elastic"] * 3
    frequencies = [float(row["frequency"]) for row in rows]
    assert frequencies == [one["frequency"] for one in found["modes"]]
    assert sorted(frequencies) == frequencies
    # shapes, each at its number, on the scene's particles
    results = load(folder)
    assert [*results.times] == [1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
    for step in range(6):
        shape = results.rows("displacement", step)
        assert np.linalg.norm(shape, axis=1).max() == pytest.approx(0.05, rel=1e-6)
        place = results.rows("position", step) - shape
        assert place[:, :2] * 8.0 == pytest.approx(np.rint(place[:, :2] * 8.0), abs=1e-5)
    assert np.ptp(results.rows("displacement", 0), axis=0).max() < 1e-6
    assert np.ptp(results.rows("displacement", 3), axis=0).max() > 0.02


@pytest.mark.parametrize(
    "words", [["-n", "0"], ["--set", "bodies.0.material.density=-1"], ["--set", 'method.weights="kernel"']]
)
def test_bad_input_is_refused_and_nothing_written(comm, shared_path, words, capfd):
    folder = shared_path / "out"
    assert main(["modes", str(scene_file(comm, shared_path)), "-o", str(folder), *words]) == 2
    assert not folder.exists()


def test_a_body_of_four_particles_has_as_many_modes_as_there_are(comm, shared_path):
    folder = shared_path / "small"
    assert main(["modes", str(scene_file(comm, shared_path, 2)), "-n", "9", "-o", str(folder), "-q"]) == 0
    assert len(read_summary(folder / "modes.json")["modes"]) <= 8
