"""summary.json and where its numbers come from."""

import json
import subprocess
import sys

import numpy as np
import pytest
from mpi_launch import clean_environment

from parsolid.output import OutputError
from parsolid.output.summary import git_hash, peak_memory_bytes, provenance, write_summary

pytestmark = pytest.mark.serial


def test_keys_keep_their_order_and_numbers_become_json(tmp_path):
    summary = {
        "scene": "Säule",
        "z": np.int64(3),
        "a": np.float32(0.5),
        "nan": float("nan"),
        "errors": {"u": np.inf, "v": [1.0]},
    }
    write_summary(tmp_path / "summary.json", summary)
    found = json.loads((tmp_path / "summary.json").read_text())
    assert list(found) == list(summary)
    assert found == {"scene": "Säule", "z": 3, "a": 0.5, "nan": None, "errors": {"u": None, "v": [1.0]}}
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_a_place_that_cannot_be_written_is_named(tmp_path):
    with pytest.raises(OutputError, match="missing/summary.json"):
        write_summary(tmp_path / "missing" / "summary.json", {})


def test_peak_memory_counts_what_was_touched():
    code = "from parsolid.output.summary import peak_memory_bytes as p; a = p(); b = b'x' * 2**27; print(a, p())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=clean_environment())
    before, after = map(int, found.stdout.split())
    assert 0.9 * 2**27 < after - before < 1.5 * 2**27
    assert peak_memory_bytes() > 2**24


def test_provenance_names_commit_and_versions():
    found = provenance()
    assert {"parsolid", "python", "numpy", "numba", "h5py", "hdf5", "mpi"} <= set(found["versions"])
    assert all(found["versions"].values())
    commit = git_hash()
    assert commit is None or len(commit.removesuffix("-modified")) == 40
