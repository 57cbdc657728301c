"""The code of docs/python.md and of the notebook, block after block, on any number of ranks."""

import json
import re
import runpy
from pathlib import Path

import pytest

pytestmark = pytest.mark.slow
DOCS = Path(__file__).parents[2] / "docs"


def run(name, blocks, folder, monkeypatch):
    """The names that blocks of code leave, run in a folder."""
    assert len(blocks) >= 6
    monkeypatch.chdir(folder)
    names = {}
    for number, block in enumerate(blocks, 1):
        exec(compile(block, f"{name}, block {number}", "exec"), names)
    return names


def test_the_page_runs(comm, shared_path, monkeypatch):
    pytest.importorskip("pandas")
    page = (DOCS / "python.md").read_text()
    names = run("page", re.findall(r"^```python\n(.*?)^```", page, re.DOTALL | re.MULTILINE), shared_path, monkeypatch)
    assert comm.allreduce(len(names["position"])) == 81 * comm.size


@pytest.mark.serial
def test_the_notebook_runs(comm, shared_path, monkeypatch):
    pytest.importorskip("pandas")
    pytest.importorskip("matplotlib")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    cells = json.loads((DOCS / "from_python.ipynb").read_text())["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    names = run("notebook", code, shared_path, monkeypatch)
    assert names["results"].summary["status"] == "finished"
    # the brake is felt
    assert abs(names["braked"][-1, 1] - 1.0) < abs(names["free"]["corner.displacement_y"]).max()


@pytest.mark.serial
def test_the_example_of_a_stepped_scene(comm, shared_path, monkeypatch):
    """Twice the static deflection of a beam: w L^4/(8 E' I), and 1.2 w L^2/(2 G h) of its shear."""
    pytest.importorskip("matplotlib")
    monkeypatch.setenv("MPLBACKEND", "Agg")
    monkeypatch.chdir(shared_path)
    names = runpy.run_path(str(DOCS.parent / "examples" / "cantilever.py"))
    weight, plane, shear = 1100.0 * 9.81 * 0.1, 1e6 / (1.0 - 0.3**2), 1e6 / 2.6
    static = weight * 0.4**4 / 8.0 / (plane * 0.1**3 / 12.0) + 1.2 * weight * 0.4**2 / 2.0 / (shear * 0.1)
    assert names["lowest"] == pytest.approx(-2.0 * static, rel=0.05)
    comm.Barrier()
    assert (shared_path / "cantilever.png").stat().st_size > 1000
