"""The tip of cracks, on any number of ranks."""

from types import SimpleNamespace

import numpy as np
import pytest

from parsolid.methods.peridynamics.cracks import Patch, distance
from parsolid.methods.peridynamics.fracture import Fracture


@pytest.mark.parametrize("ends", [0, 4, 6], ids=["nowhere", "near", "far"])
def test_the_tip_is_the_farthest_of_damaged_particles_and_of_equally_far_ones_the_last(comm, ends):
    X = np.array([(i, j) for i in range(9) for j in range(7)], float)
    damage = 0.9 * ((X[:, 0] < ends) & (np.abs(X[:, 1] - 3.0) < 2.0))
    patch = Patch(np.array([0.0, 3.0, -0.5]), np.array([2.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0]))
    mine, on_cracks = slice(comm.rank, None, comm.size), X[damage > 0.0]
    own = {"_initial": np.zeros(len(X))[mine], "patches": [patch], "positions": X[mine]}
    tip = Fracture.tip(SimpleNamespace(comm=comm, damage=SimpleNamespace(damage=damage[mine]), **own))
    rows = np.column_stack((distance(patch, on_cracks), on_cracks)).tolist()
    assert np.array_equal(tip, max(rows)[1:] if rows else [np.nan, np.nan], equal_nan=True)
