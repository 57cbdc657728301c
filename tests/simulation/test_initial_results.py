"""A start from the results of another run: as they are on the same particles, interpolated on others."""

import numpy as np
import pytest
from solids import SOFT, gathered, run_into, simulation, tables

from parsolid.scene import SceneError, parse_scene

SHEARED = {"velocity": ["0.3*Y", "0.1*X - 0.2*Y"], "displacement": ["0.02*Y", "0.01*X"]}


def first_run(folder, comm, **output):
    """Some steps of a sheared square whose fields are written at its start and at its end."""
    data = tables((7, 7), material=SOFT, body=SHEARED, end_time=0.1, output={"fields_interval": 0.1} | output)
    return run_into(folder, comm, parse_scene(data)).simulation


def started(particles, folder, comm, **initial):
    data = tables(particles, material=SOFT, initial=[{"results": str(folder)} | initial])
    return simulation(data, comm)


def test_other_particles_take_what_is_between(shared_path, comm):
    first_run(shared_path / "press", comm)
    now = started((10, 8), shared_path / "press", comm, time=0.0)
    X, x, v = gathered(now, "reference_position", "position", "velocity")
    np.testing.assert_allclose(x - X, np.column_stack([0.02 * X[:, 1], 0.01 * X[:, 0]]), atol=1e-8)
    np.testing.assert_allclose(v, np.column_stack([0.3 * X[:, 1], 0.1 * X[:, 0] - 0.2 * X[:, 1]]), atol=1e-7)


def test_what_the_results_do_not_have_is_refused(tmp_path):
    from mpi4py import MPI

    first_run(tmp_path / "press", MPI.COMM_SELF)
    first_run(tmp_path / "poor", MPI.COMM_SELF, fields=["velocity"])
    for initial, message in (
        ({"time": 0.05}, r"initial.0.time: expected a time of its fields \(0, 0.1\), found 0.05"),
        ({"fields": ["temperature"]}, r"initial.0.fields.0: expected results with the field 'temperature'"),
        ({"velocity": [0, 0]}, "initial.0.velocity: expected a formula or results, not both"),
        ({"results": str(tmp_path / "poor")}, "initial.0.results: expected results with the field 'displacement'"),
        ({"results": str(tmp_path / "none")}, "initial.0.results: expected an existing folder"),
    ):
        with pytest.raises(SceneError, match=message):
            started((7, 7), tmp_path / "press", MPI.COMM_SELF, **initial)
    data = tables((7, 7), [3.0, 1.0], material=SOFT, initial=[{"results": str(tmp_path / "press")}])
    with pytest.raises(
        SceneError,
        match="initial.0.results: expected velocity of particles of the results near by at every particle, found nan",
    ):
        simulation(data)
