"""The manual builds as HTML without a warning, with the pages that are made from the code."""

import subprocess
import sys
from pathlib import Path

import pytest

pytestmark = [pytest.mark.serial, pytest.mark.slow]
ROOT = Path(__file__).parents[2]


def test_the_manual_builds_without_warnings(tmp_path):
    command = [sys.executable, "-m", "sphinx", "-q", "-W", "--keep-going", str(ROOT / "docs"), str(tmp_path)]
    built = subprocess.run(command, capture_output=True, text=True, cwd=ROOT)
    assert built.returncode == 0, built.stderr[-2000:]
    pages = {
        name: (tmp_path / f"{name}.html").read_text(encoding="utf-8")
        for name in ("generated/keys", "generated/codes", "api")
    }
    assert "method.tlsph.weights" in pages["generated/keys"] and "few-layers" in pages["generated/codes"]
    assert 'id="parsolid.run"' in pages["api"] and 'id="parsolid.Simulation.step"' in pages["api"]
