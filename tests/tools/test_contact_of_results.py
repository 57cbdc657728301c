"""A run goes on from another's state with what lies between bodies: friction's springs, tools where they are."""

import json

import numpy as np
import pytest
from mpi4py import MPI
from simulation.test_state_of_results import goes_on
from solids import assert_same_fields, gathered, run_into, simulation
from tools.tool_scenes import METHODS, block, floor

from parsolid.collective import SolverError
from parsolid.scene import parse_scene
from parsolid.scene.previous_results import TOOLS

ROLLING = {"name": "ball", "shape": {"sphere": {"centre": [0.5, 0.74], "radius": 0.25}}, "friction": 0.3, "mass": 300.0}


def slid(method: str) -> dict:
    """A block between a floor that slides and a ball that is thrown on it."""
    data = block(method, (6, 5), lower=[0.2, 0.0], velocity=[1.0, -1.0])
    data["method"] = data["method"] | {"maximum_step": 1e-4}
    floor_too = floor() | {"motion": {"velocity": ["2", "0"]}, "friction": 0.4}
    return data | {"tools": [floor_too, ROLLING | {"velocity": [1.0, -3.0], "spin": 5.0}], "end_time": 4e-3}


def compare(whole, later, stick: str) -> None:
    assert whole.clock.step == 2 * later.clock.step
    names = ["position", "velocity", stick]
    assert all(np.abs(values).max() > 0.0 for values in gathered(whole, *names))
    assert_same_fields(later, whole, names, 1e-11)


@pytest.mark.serial
@pytest.mark.parametrize("method", METHODS)
def test_tools_go_on(method, shared_path, comm):
    whole, later = goes_on(shared_path / "whole", comm, slid(method))
    compare(whole, later, "stick_ball")
    for old, new in zip(whole.interactions[0].tools, later.interactions[0].tools):
        for name, value in old.body.state().items():
            np.testing.assert_allclose(new.body.state()[name], value, rtol=1e-10, atol=1e-12, err_msg=name)


def test_bodies_in_contact_go_on(shared_path, comm):
    data = block("tlsph", (6, 4), velocity=[2.0, -1.0], lower=[0.0, 0.401])
    below = block("tlsph", (8, 4))["bodies"][0] | {"name": "below"}
    data |= {"bodies": [*data["bodies"], below], "contact": [{"bodies": ["block", "below"], "friction": 0.3}]}
    data |= {"method": data["method"] | {"maximum_step": 1e-4}, "end_time": 4e-3}
    compare(*goes_on(shared_path / "whole", comm, data), "contact_stick")


def test_what_no_tool_or_contact_can_go_on_from_is_refused(tmp_path):
    data = slid("tlsph")
    run_into(tmp_path, MPI.COMM_SELF, parse_scene(data | {"output": {"fields": ["state"]}}), 1)
    assert list(json.loads((tmp_path / TOOLS).read_text())["tools"][0]) == ["floor", "ball"]
    later = data | {"initial": [{"results": str(tmp_path), "fields": ["state"]}]}
    ball = {key: value for key, value in data["tools"][1].items() if key not in ("mass", "velocity", "spin")}
    with pytest.raises(SolverError, match="tools.1.mass: expected 'ball' to move as in initial.0.results, found there"):
        simulation(later | {"tools": [data["tools"][0], ball]})
    # a tool of another name stands where the scene says
    other = simulation(later | {"tools": [data["tools"][0], ball | {"name": "other"}]}).interactions[0].tools[1]
    assert other.body.pose.place.tolist() == [0.5, 0.74, 0.0] and not other.resumed
