"""Scenes of `runs/` changed at random, read in this process: a scene or a message, never anything else."""

import random
import sys
from pathlib import Path

import pytest

from parsolid.scene import SceneError, parse_scene

ROOT = Path(__file__).parents[2]
sys.path[:0] = [str(ROOT), str(ROOT / "tests" / "end_to_end")]

from mutations import mutated  # noqa: E402

from checks.scene_attack import shipped  # noqa: E402

SCENES = shipped()


@pytest.mark.parametrize("seed", range(4))
def test_a_changed_scene_is_read_or_refused(seed):
    chance = random.Random(seed)
    read, refused = 0, []
    for _ in range(50):
        name = chance.choice(sorted(SCENES))
        scene = mutated(SCENES[name], chance)
        try:
            parse_scene(scene, (ROOT / name).parent)
            read += 1
        except SceneError as error:
            refused.append(str(error).strip())
    assert 0 < read < 50 and all(refused)
