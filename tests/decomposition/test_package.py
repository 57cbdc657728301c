"""The package as a whole: cheap to import, alone, the same bits every time."""

import re
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from point_sets import point_set, share

from decomposition.bisection import bisect
from decomposition.halo import Halo
from decomposition.migration import migrate
from decomposition.pair_search import half_pairs

PAGE = Path(__file__).parents[2] / "docs" / "decomposition.md"


@pytest.mark.serial
def test_import_is_cheap_and_alone():
    code = "import sys, decomposition; print([n for n in ('numba', 'mpi4py', 'numpy') if n in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
    names = ", ".join(f"decomposition.{name}" for name in ("boxes", "shared_nodes", "slices"))
    code = f"import sys, {names}; "
    code += "print([n for n in sys.modules if n.startswith('parsolid')])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_the_program_of_the_page_is_the_same_on_any_ranks(comm):
    """Beside all points at once, by a matrix of their distances."""
    found: dict = {}
    exec(re.search(r"```python\n(.*?)```", PAGE.read_text(), re.DOTALL).group(1), found)
    points = np.random.default_rng(1).random((1000, 3))
    near = np.linalg.norm(points[:, None] - points, axis=2) < found["reach"]
    heat = (points[:, 0] < 0.5).astype(float)
    for _ in range(50):
        heat += 0.005 * (near @ heat - near.sum(axis=1) * heat)
    assert found["kept"] == pytest.approx(found["total"], rel=1e-12)
    assert found["total"] == (points[:, 0] < 0.5).sum()
    assert found["spread"] == pytest.approx(heat @ points[:, 0], rel=1e-12)


def test_the_same_input_gives_the_same_order(comm):
    points = point_set("lattice", 3)
    results = []
    for _ in range(2):
        mine = points[share(comm, len(points))]
        mine = migrate(comm, bisect(comm, mine), {"points": mine})["points"]
        halo = Halo(comm, mine, 0.3)
        everywhere = halo.with_ghosts(mine)
        results.append((everywhere, *half_pairs(everywhere, halo.owned, 0.3)))
    for first, second in zip(*results):
        np.testing.assert_array_equal(first, second)
