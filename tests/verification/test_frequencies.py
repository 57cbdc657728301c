"""Frequencies of curved free bodies on Gmsh's meshes, of boxes on lattices, against exact ones, with their order."""

import sys
from importlib import import_module
from pathlib import Path

import numpy as np
import pytest

# as the script finds what stands beside it
sys.path.append(str(Path(__file__).parents[2] / "benchmarks"))
modes = import_module("modes")


@pytest.mark.serial
@pytest.mark.parametrize(
    ("shape", "spacings", "weights", "method", "largest", "order"),
    [
        ("ring", (8, 16), "mesh", {"stabilisation": 0.5}, 5e-3, 0.9),
        ("ring", (16, 24), "mesh", {"stabilisation": 0.35}, 6e-3, 1.4),
        ("disc", (8, 16), "mesh", {"stabilisation": 0.5}, 1e-2, 1.7),
        ("disc", (12, 16), "mesh", {}, 1e-2, 1.6),
        ("sphere", (6, 8), "mesh", {}, 3e-2, 1.7),
        ("column", (6, 8), "mesh", {}, 3e-2, 1.4),
        ("plate", (8, 12), "cells", {}, 2e-2, 1.8),
        ("block", (8, 12), "fourth-order", {}, 1e-3, 3.5),
    ],
)
def test_the_first_frequencies(shape, spacings, weights, method, largest, order, tmp_path):
    if weights == "mesh":
        pytest.importorskip("gmsh")
    sizes = []
    for m in spacings:
        errors, found = modes.errors_of(shape, m, tmp_path, weights, **method)
        assert found.converged
        sizes.append(float(np.sqrt(np.mean(errors**2))))
    assert max(sizes) < largest
    assert np.log(sizes[0] / sizes[1]) / np.log(spacings[1] / spacings[0]) > order
