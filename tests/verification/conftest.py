"""Short whole runs of the scenes in runs/."""

import json
from pathlib import Path

import numpy as np
import pytest

from parsolid.commands.cli import main
from parsolid.output.history import read_history

RUNS = Path(__file__).parents[2] / "runs"


@pytest.fixture
def run(comm, shared_path):
    """Runs a scene with overrides and gives its errors and its history (rows,) by column."""

    def errors_and_history(name: str, *overrides: str) -> tuple[dict, dict]:
        words = [
            word for one in (*overrides, "output.pictures=false", "output.fields_times=[0]") for word in ("--set", one)
        ]
        assert main(["run", str(RUNS / f"{name}.toml"), "-o", str(shared_path / "run"), "--quiet", *words]) == 0
        summary = json.loads((shared_path / "run" / "summary.json").read_text())
        history = read_history(shared_path / "run" / "history.csv")
        return summary["errors"], {name: np.array(values) for name, values in history.items()}

    return errors_and_history
