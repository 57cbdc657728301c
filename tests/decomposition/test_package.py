"""The package as a whole: cheap to import, alone, the same bits every time."""

import subprocess
import sys

import numpy as np
import pytest
from point_sets import point_set, share

from decomposition.bisection import bisect
from decomposition.halo import Halo
from decomposition.migration import migrate
from decomposition.pair_search import half_pairs


@pytest.mark.serial
def test_import_is_cheap_and_alone():
    code = "import sys, decomposition; print([n for n in ('numba', 'mpi4py', 'numpy') if n in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
    names = ", ".join(f"decomposition.{name}" for name in ("boxes", "measured_load", "shared_nodes", "slices"))
    code = f"import sys, {names}; "
    code += "print([n for n in sys.modules if n.startswith('parsolid')])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"


def test_the_same_input_gives_the_same_order(comm):
    points = point_set("lattice", 3)
    results = []
    for _ in range(2):
        mine = points[share(comm, len(points))]
        mine = migrate(comm, bisect(comm, mine), {"points": mine})["points"]
        halo = Halo(comm, mine, 0.3)
        everywhere = np.concatenate((mine, halo.ghost_positions()))
        results.append((everywhere, *half_pairs(everywhere, halo.owned, 0.3)))
    for first, second in zip(*results):
        np.testing.assert_array_equal(first, second)
