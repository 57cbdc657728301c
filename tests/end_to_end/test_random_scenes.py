"""Random changes of small scenes end with status 0, 2 or 3, say one thing on rank 0, and close their ledger."""

import math
import random

import pytest
from command_line import many
from mutations import mutated
from run_results import history
from small_scenes import SCENES, write

from parsolid.scene.observation import HISTORY_COLUMNS

RANKS, MANY = 2, 30
# a run to its end is short, whatever its scene
LIMITS = ["--max-steps", "3", "--wall-time", "20", "-q"]


@pytest.mark.parametrize("seed", [1, 2])
def test_a_changed_scene_runs_is_refused_or_fails_cleanly(tmp_path, seed):
    chance = random.Random(seed)
    scenes = [mutated(SCENES[chance.choice(sorted(SCENES))], chance) for _ in range(MANY)]
    commands = [
        [write(scene, tmp_path / f"{number}.toml"), "-o", tmp_path / f"out-{number}", *LIMITS]
        for number, scene in enumerate(scenes)
    ]
    seen = set()
    for number, ranks in enumerate(many(commands, RANKS, tmp_path / "job")):
        told = f"{tmp_path / f'{number}.toml'}: {[rank.status for rank in ranks]}\n{ranks[0].err}"
        status = ranks[0].status
        seen.add(status)
        assert status in (0, 2, 3, 75) and {rank.status for rank in ranks} == {status}, told
        assert not any("Traceback" in rank.err for rank in ranks) and not ranks[1].err, told
        assert (tmp_path / f"out-{number}").exists() == (status != 2), told
        if status == 0:
            columns = history(tmp_path / f"out-{number}")
            energies = [columns[name] for name in HISTORY_COLUMNS if name in columns]
            assert len(energies) == 6 and all(math.isfinite(value) for values in energies for value in values), told
    assert {0, 2} <= seen
