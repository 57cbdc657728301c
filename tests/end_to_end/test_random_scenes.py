"""Random changes of small scenes end with status 0, 2 or 3, say one thing on rank 0, and close their ledger."""

import copy
import math
import random

import pytest
from command_line import many
from run_results import ENERGIES, history
from small_scenes import SCENES, write

RANKS, MANY = 2, 40
# a run to its end is short, whatever its scene
LIMITS = ["--max-steps", "3", "--wall-time", "20", "-q"]
VALUES = (0, 1, -1, 2, 7, 0.5, -3.5, 1e-12, 1e12, 1e300, 1e-320, "", "X", "1e308", "nowhere", [], {}, True, "sin(X)/X")


def leaves(value, place=()):
    entries = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, part in entries:
        yield (*place, key)
        yield from leaves(part, (*place, key))


def mutated(scene: dict, chance: random.Random) -> dict:
    """One to three places of a scene with another value, scaled, doubled, or without one."""
    scene = copy.deepcopy(scene)
    for _ in range(chance.randint(1, 3)):
        *path, last = chance.choice([place for place in leaves(scene) if place[0] != "output"])
        place = scene
        for key in path:
            place = place[key]
        old, way = place[last], chance.random()
        if way < 0.4 and isinstance(old, int | float) and not isinstance(old, bool):
            place[last] = type(old)(old * chance.choice((0.5, 2, 3, -1)))
        elif way < 0.5 and isinstance(old, list):
            place[last] = old + old
        elif way < 0.65:
            del place[last]
        else:
            place[last] = copy.deepcopy(chance.choice(VALUES))
    return scene


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
            assert all(math.isfinite(value) for name in ENERGIES for value in columns[name]), told
    assert {0, 2} <= seen
