"""Rigid round tools on blocks against Hertz (Johnson, Contact Mechanics, sections 4.2 and 3.4)."""

from pathlib import Path

import numpy as np
import pytest
from solids import recorded
from tools.tool_scenes import motion

from parsolid.scene import load_scene
from parsolid.simulation.loop import Simulation

SCENES = Path(__file__).parents[2] / "runs" / "tools"


def pressed(comm, particles: int, *overrides: str):
    """The half-model of a cylinder on a block at the end; force [N/m], places (n,) [m] and pressures (n,) [Pa]."""
    scene = load_scene(SCENES / "hertz.toml", [f"bodies.0.particles=[{particles}, {particles}]", *overrides])
    sim = Simulation(comm, scene)
    columns = recorded(sim, motion)
    touch = sim.interactions[0].tools[0].touches[0]
    rows, particles = touch.rows, touch.system.particles
    area = np.abs(particles.owned_rows("area")[rows, 1])
    return (
        columns,
        particles.owned_rows("position")[rows, 0],
        -particles.owned_rows("external_force")[rows, 1] / area,
    )


@pytest.mark.parametrize(
    "particles, width, high",
    [(33, 0.03, 0.08), pytest.param(65, 0.01, 0.05, marks=[pytest.mark.slow, pytest.mark.serial])],
)
def test_line_contact(comm, particles, width, high):
    """Half-width and peak from the pressures, p^2 = p0^2 (1 - x^2/a^2), for the force that the tool feels."""
    watch, place, pressure = pressed(comm, particles)
    force, modulus = 2.0 * watch["cylinder.force_y"][-1], 10.0 / (1.0 - 0.3**2)
    half = np.sqrt(4.0 * force / (np.pi * modulus))
    peak = 2.0 * force / (np.pi * half)
    x, p = (np.concatenate(comm.allgather(values)) for values in (place, pressure))
    inner = p > 0.3 * peak
    slope, square = np.polyfit(x[inner] ** 2, p[inner] ** 2, 1)
    assert abs(np.sqrt(-square / slope) / half - 1.0) < width
    assert abs(np.sqrt(square) / peak - 1.0) < high
