"""summary.json and where its numbers come from."""

import json
import subprocess
import sys

import numpy as np
import pytest
from mpi_launch import clean_environment

from parsolid.checksums import with_checksum
from parsolid.output import OutputError
from parsolid.output.results import load
from parsolid.output.summary import git_hash, peak_memory_bytes, provenance, read_summary, write_summary
from parsolid.scene import SceneError

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
    assert list(found) == [*summary, "checksum"] and len(found.pop("checksum")) == 32
    assert read_summary(tmp_path / "summary.json") == found
    assert found == {"scene": "Säule", "z": 3, "a": 0.5, "nan": None, "errors": {"u": None, "v": [1.0]}}
    assert [path.name for path in tmp_path.iterdir()] == ["summary.json"]


def test_a_changed_digit_of_a_summary_or_a_resolved_scene_is_told(tmp_path):
    summary, scene = tmp_path / "summary.json", tmp_path / "scene.toml"
    write_summary(summary, {"energy": 1.25, "words": "Säule", "none": None})
    scene.write_text(with_checksum('dimension = 2\ntitle = "1.25"\n'))
    assert load(tmp_path).title == "1.25" and load(tmp_path).summary["energy"] == 1.25
    for path, read in ((summary, lambda: load(tmp_path).summary), (scene, lambda: load(tmp_path))):
        text = path.read_text()
        path.write_text(text.replace("1.25", "1.35"))
        with pytest.raises((OutputError, SceneError)):
            read()
        path.write_text(text)
    (tmp_path / "list.json").write_text("[]")
    with pytest.raises(OutputError):
        read_summary(tmp_path / "list.json")
    # those of earlier versions have no checksum
    scene.write_text("dimension = 2\n")
    summary.write_text('{"energy": 1.5}')
    assert load(tmp_path).summary == {"energy": 1.5}
    # written again, with more, it has its own
    write_summary(summary, read_summary(summary) | {"more": [1, 2]})
    write_summary(summary, json.loads(summary.read_text()) | {"energy": 2.0})
    assert read_summary(summary) == {"energy": 2.0, "more": [1, 2]}


def test_peak_memory_counts_what_was_touched():
    code = "from parsolid.output.summary import peak_memory_bytes as p; a = p(); b = b'x' * 2**27; print(a, p())"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, check=True, env=clean_environment())
    before, after = map(int, found.stdout.split())
    assert 0.9 * 2**27 < after - before < 1.5 * 2**27
    assert peak_memory_bytes() > 2**24


def test_provenance_names_commit_and_versions():
    found, commit = provenance(), git_hash()
    assert {"parsolid", "python", "numpy", "numba", "h5py", "hdf5", "mpi"} <= set(found["versions"])
    assert all(found["versions"].values()) and (commit is None or len(commit.removesuffix("-modified")) == 40)
