"""Failure in the material point method: a plate that breaks, on any ranks and through a restart; deletion; refusals."""

import numpy as np
import pytest
from mpm.points import COPPER, scene
from solids import run_steps

CRITERIA = [{"kind": "maximum-tension", "strength": 1.5e9}]
SPREAD = {"modulus": 10.0, "seed": 3}


def torn(method=None, *, speed=200.0, end_time=4e-7, **failure) -> dict:
    """A block whose ends fly apart, of matter with some spread of strength."""
    material = COPPER | {"failure": {"criteria": CRITERIA, "scatter": SPREAD} | failure}
    body = {"velocity": [f"{speed}*X/4e-3", "0"]}
    data = scene([-4e-3, 0.0], [4e-3, 2e-3], 5e-4, 1e-3, material=material, end_time=end_time, body=body)
    if method is not None:
        data["method"] = method
    return data


METHODS = {"mpm": None, "ulsph": {"kind": "ulsph"}}


@pytest.mark.parametrize("method", METHODS)
def test_momentum_is_that_of_what_is_left_and_of_what_was_deleted(method):
    data = torn(METHODS[method], speed=800.0, after="delete")
    data["bodies"][0]["velocity"] = ["800*X/4e-3 + 300", "50"]
    sim, _ = run_steps(data, 45)
    system, d = sim.systems[0], 2
    left = system.mass[: system.owned] @ system.particles.owned_rows("velocity")[:, :d]
    gone = system.measure("deleted_momentum")[1]
    total = 8930.0 * 16e-6 * np.array([300.0, 50.0])
    assert np.abs(gone).max() > 0.1 * total[0]
    assert left + gone == pytest.approx(total, abs=1e-9 * total[0])


@pytest.mark.parametrize("method", METHODS)
def test_tools_let_go_of_what_is_deleted(method):
    ball = {"name": "ball", "shape": {"sphere": {"centre": [0.0, 3e-3], "radius": 1e-3}}, "friction": 0.2}
    failure = {"criteria": [{"kind": "plastic-strain", "strain": 0.05}], "after": "delete"}
    data = scene([-2e-3, 0.0], [2e-3, 2e-3], 5e-4, 1e-3, material=COPPER | {"failure": failure}, end_time=1.0)
    data["tools"] = [ball | {"mass": 0.2, "free": ["Y"], "velocity": [0.0, -400.0]}]
    # with the default, apic, nothing is left after 30 steps
    data["method"] = METHODS[method] or data["method"] | {"transfer": "flip"}
    sim, rows = run_steps(data, 60)
    given = rows["kinetic"][0]
    assert sim.systems[0].measure("deleted_mass")[1][0] > 0.0 and rows["deleted_internal_energy"][-1] > 0.0
    # most of what is deleted was pressed by the ball
    assert np.abs(rows["energy_error"]).max() < 1e-3 * given
    # what has no mass shortens no step
    steps = np.diff(rows["time"])
    assert steps.min() > 0.05 * steps.max()
