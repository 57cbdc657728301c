"""What one rank compiles for all runs without a fault for every method: in a run a fault is hidden, and costs time."""

from pathlib import Path

import pytest

from parsolid.methods.small_scene import small_scene
from parsolid.scene import load_scene
from parsolid.simulation import warmup

RUNS = Path(__file__).parents[2] / "runs"
SCENES = ("tlsph/punch", "peridynamics/plate", "peridynamics/branching", "peridynamics/vibrating_bar", "mpm/taylor")


@pytest.mark.slow
@pytest.mark.parametrize("name", SCENES)
def test_every_kernel_that_only_several_ranks_need_is_compiled(name):
    scene = load_scene(RUNS / f"{name}.toml")
    for system in scene.systems:
        warmup.compile_kernels(small_scene(scene.part(system), system.settings))
