"""Scenes of a few particles for `tests.soak`: each method alone; bodies that meet, are tied, or pressed by tools."""

import sys
from pathlib import Path

for room in ("end_to_end", "contact", "mixed", "tools"):
    sys.path.insert(0, str(Path(__file__).parent / room))

import bodies_apart  # noqa: E402
import meeting  # noqa: E402
import small_scenes  # noqa: E402
import test_fracture_runs as fracture  # noqa: E402
import tied_blocks  # noqa: E402
import tool_scenes  # noqa: E402

# checkpoints at every second step, so that many ends fall into the writing of one
OUTPUT = {"output.checkpoint_steps": 2, "output.history_steps": 1, "output.pictures": False}


def _scenes() -> dict[str, dict]:
    notched = small_scenes.changed(fracture.NOTCHED, {"bodies.0.particles": [20, 20], "end_time": 30e-6})
    bars = meeting.bars(n=6, wide=2, speed=0.2, end_time=1.0)
    flow, points = (
        tied_blocks.blocks("flow", "sph", end_time=1e-4),
        tied_blocks.blocks("bonds", "points", end_time=2e-4),
    )
    apart = bodies_apart.tables(end_time=1e-4)
    pressed = tool_scenes.block("tlsph", velocity=["0", "-3"]) | {"tools": [tool_scenes.floor()], "end_time": 8e-3}
    dropped = tool_scenes.block("mpm", velocity=["0", "-3"]) | {"tools": [tool_scenes.floor()], "end_time": 8e-3}
    more = {"notched": notched, "bars": bars, "flow-tied": flow, "points-tied": points, "apart": apart}
    return small_scenes.SCENES | more | {"pressed": pressed, "dropped": dropped}


SCENES = {name: small_scenes.changed(scene, OUTPUT) for name, scene in _scenes().items()}
