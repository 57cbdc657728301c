"""Tools with mass: what they exchange with bodies, and what is kept on any number of ranks and over a restart."""

from functools import partial

import numpy as np
import pytest
from tools.tool_scenes import METHODS, SPACING, block, run

from parsolid.scene.observation import stored_energy

MASS, RADIUS = 120.0, 0.25
# of the energy, at .2 ms
UNBALANCED = {"tlsph-cells": 0.01, "ulsph": 0.004, "mpm": 0.004}


def hit(method: str, dimension=2, **tool) -> dict:
    """A disc or ball that hits the top of a free block off its middle, spinning, with friction."""
    counts = (8, 5) if dimension == 2 else (5, 5, 4)
    top, turns = counts[-1] * SPACING, 8.0 if dimension == 2 else [3.0, -4.0, 5.0]
    centre = [0.55 * counts[0] * SPACING] * (dimension - 1) + [top + RADIUS + 0.01]
    velocity = [0.5] * (dimension - 1) + [-3.0]
    ball = {"name": "ball", "shape": {"sphere": {"centre": centre, "radius": RADIUS}}, "mass": MASS, "spin": turns}
    return block(method, counts) | {"end_time": 0.03, "tools": [ball | {"velocity": velocity, "friction": 0.3} | tool]}


def light(method: str, mass: float, friction: float = 0.0) -> dict:
    """A disc of a mass [kg] at 40 m/s onto a free block of 9 x 9 cells of 17 kg each."""
    data = block(method, (9, 9))
    data["bodies"][0]["material"] = data["bodies"][0]["material"] | {"density": 17.0 / SPACING**2}
    shape = {"sphere": {"centre": [0.55 * 9 * SPACING, 9 * SPACING + RADIUS + 0.01], "radius": RADIUS}}
    disc = {"name": "disc", "shape": shape, "mass": mass, "velocity": [0.0, -40.0], "friction": friction}
    return data | {"end_time": {0.1: 4e-3, 1.0: 8e-3, 10.0: 2e-2}[mass], "tools": [disc]}


@pytest.mark.parametrize("mass", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("method", METHODS)
def test_a_light_disc_leaves_no_faster_than_it_came(method, mass):
    """The step knows its mass before it touches; 80 J became hundreds to thousands when it did not.

    Energy is kept within 1 % in every step, also by the plain sum without the kinetic offset, which vanishes when the
    disc has left, but for waves in the block; and the scheme gives none.
    """
    sim, watch = run(light(method, mass))
    energy, speed = watch["kinetic"][0], np.linalg.norm(sim.interactions[0].tools[0].body.pose.velocity)
    assert watch["contact_energy"].max() > 0.6 * energy and abs(watch["contact_energy"][-1]) < 1e-12 * energy
    assert 10.0 < speed < 40.0
    assert max(watch["kinetic"].max(), watch[stored_energy(watch)].max()) < 1.01 * energy
    # pairs of ulsph change their weights where they begin to pull
    assert np.abs(watch["energy_error"]).max() < (4e-4 if method == "ulsph" else 2e-4) * energy
    assert np.abs(watch["energy_error"] + watch["kinetic_offset"]).max() < 0.01 * energy
    assert abs(watch["kinetic_offset"][-1]) < 1e-3 * energy
    assert watch["numerical_dissipation"].min() > -5e-3 * energy


@pytest.mark.parametrize("method", METHODS)
def test_a_disc_bounces(method):
    data = hit(method)
    data["method"]["maximum_step"] = 2e-4
    sim, watch = run(data)
    tool, linear = sim.interactions[0].tools[0].body, watch["momentum"][-1]
    assert np.abs(watch["ball.force_y"]).max() > 100.0 and tool.pose.velocity[1] > 0.0
    assert abs(tool.pose.spin[2] - 8.0) > 0.5
    assert np.abs(linear + tool.mass * tool.pose.velocity[:2] - MASS * np.array([0.5, -3.0])).max() < 1e-10 * MASS
    assert np.abs(watch["energy_error"]).max() < UNBALANCED.get(method, 5e-4) * watch["kinetic"][0]
    assert np.all(np.diff(watch["friction_dissipation"]) >= 0.0) and watch["friction_dissipation"][-1] > 0.0


@pytest.mark.parametrize(
    "scene", [partial(hit, "tlsph", friction=0.0), partial(light, "ulsph", 10.0)], ids=["tlsph", "ulsph"]
)
def test_energy_is_of_second_order(scene):
    """Also where pairs of `ulsph` begin to pull."""
    found = []
    for step in (1e-4, 5e-5):
        data = scene()
        data["method"]["maximum_step"] = step
        found.append(np.abs(run(data)[1]["energy_error"]).max())
    assert found[1] < (0.31 if scene.func is hit else 0.4) * found[0], found
