"""The same scene on any number of ranks gives the same numbers."""

import pytest
from command_line import all_done, many
from run_results import assert_close, history
from small_scenes import SCENES, write

TOLERANCE = 1e-9
# three are in test_restarted_runs, and in the tests that run on three ranks
RANKS = (1, 2, 4)


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folder with the results of every scene on every number of ranks, in <ranks>/<scene>."""
    folder = tmp_path_factory.mktemp("ranks")
    paths = {name: write(scene, folder / f"{name}.toml") for name, scene in SCENES.items()}
    for ranks in RANKS:
        commands = [[path, "-q", "-o", folder / str(ranks) / name] for name, path in paths.items()]
        all_done(many(commands, ranks, folder / f"job-{ranks}"))
    return folder


@pytest.mark.parametrize("ranks", RANKS[1:])
@pytest.mark.parametrize("name", SCENES)
def test_any_number_of_ranks_gives_the_same_history_and_state(runs, name, ranks):
    assert_close(runs / str(ranks) / name, runs / "1" / name, TOLERANCE)


@pytest.mark.parametrize("name", SCENES)
def test_something_happens_in_these_scenes(runs, name):
    columns = history(runs / "1" / name)
    assert 15 < columns["step"][-1] < 100
    assert columns["kinetic"].max() > 0.0
    assert columns["stored"].max() > 0.0
    assert columns["dissipation_numerical"][-1] + columns.get("viscous_dissipation", [0.0])[-1] > 0.0
    largest = max(columns[name].max() for name in ("kinetic", "stored", "work_external"))
    assert abs(columns["balance"]).max() < 1e-2 * largest
