"""A run that was stopped and restarted ends where the uninterrupted one does, and so does one on other ranks."""

import json
import shutil

import pytest
from command_line import all_done, many
from run_results import assert_close, assert_same_bits, history, state, summary
from small_scenes import PUNCH, SCENES, changed, write

from parsolid.scene.observation import stored_energy

RANKS = 2
# steps taken before each interruption
PIECES = (1, 11)
# on three all go on from a checkpoint; of each method one that changes most what a rank has
ON_FOUR = ("moving", "driven", "flight", "plates")
ON_OTHERS = {1: ("punch", "moving", "driven", "impact"), 3: ("moved", "column", "pulled", "flight", "plates")}


def restarts(paths, folder, *more, names=tuple(SCENES)):
    return [[paths[name], "-q", "-o", folder / name, "--restart", *more] for name in names]


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Results of every scene: whole, in pieces on the same ranks, and restarted on 1 and 3 ranks from the first
    pieces.
    """
    folder = tmp_path_factory.mktemp("restarts")
    paths = {name: write(scene, folder / f"{name}.toml") for name, scene in SCENES.items()}
    commands = [[path, "-q", "-o", folder / "whole" / name] for name, path in paths.items()]
    first = "--max-steps", PIECES[0]
    commands += [[path, "-q", "-o", folder / "pieces" / name, *first] for name, path in paths.items()]
    for steps in PIECES[1:]:
        commands += restarts(paths, folder / "pieces", "--max-steps", steps)
    for name in ON_FOUR:
        earlier = folder / "pieces" / name / "checkpoint.previous.h5"
        commands.append([paths[name], "-q", "-o", folder / "elsewhere" / name, "--restart", earlier])
    # what comes back after a kill is in test_killed_runs
    all_done(many(commands, RANKS, folder / "job"))
    for ranks in ON_OTHERS:
        shutil.copytree(folder / "pieces", folder / f"on-{ranks}")
    for ranks, names in ({RANKS: tuple(SCENES)} | ON_OTHERS).items():
        place = folder / ("pieces" if ranks == RANKS else f"on-{ranks}")
        all_done(many(restarts(paths, place, names=names), ranks, folder / f"job-{place.name}"))
    return folder


@pytest.fixture(scope="module")
def on_ranks(runs):
    """Folders of the whole runs of every scene by number of ranks; three are in the tests that run on three ranks."""
    for ranks, names in {1: SCENES, 4: ON_FOUR}.items():
        commands = [[runs / f"{name}.toml", "-q", "-o", runs / str(ranks) / name] for name in names]
        all_done(many(commands, ranks, runs / f"job-{ranks}"))
    return {1: runs / "1", RANKS: runs / "whole", 4: runs / "4"}


@pytest.mark.parametrize("name", SCENES)
def test_restarted_on_the_same_ranks_gives_the_same_bits(runs, name):
    assert_same_bits(runs / "pieces" / name, runs / "whole" / name)
    assert state(runs / "whole" / name)[0]["step"] > sum(PIECES) + 5


@pytest.mark.parametrize("name, ranks", [(name, ranks) for ranks, names in ON_OTHERS.items() for name in names])
def test_restarted_on_other_ranks_gives_the_same_numbers(runs, name, ranks):
    assert_close(runs / f"on-{ranks}" / name, runs / "whole" / name, 1e-9)
    assert summary(runs / f"on-{ranks}" / name)["ranks"] == ranks


@pytest.mark.parametrize("name", ON_FOUR)
def test_restarted_from_a_checkpoint_elsewhere_fills_a_folder_of_its_own(runs, name):
    found, wanted = history(runs / "elsewhere" / name), history(runs / "whole" / name)
    # the last checkpoint but one is at the end of the last piece but one
    first = sum(PIECES[:-1])
    for column in wanted:
        assert found[column].tolist() == wanted[column][first + 1 :].tolist()
    fields, expected = state(runs / "elsewhere" / name)[1], state(runs / "whole" / name)[1]
    assert all(fields[field].tobytes() == expected[field].tobytes() for field in expected)


def test_summary_of_a_restarted_run_compares_all_rows_with_the_reference(tmp_path):
    reference = {"t": [0.0, 1e-3, 2e-3, 5e-3], "E0": 1e6, "series": {"K": [1e6, 2e6, 0.0, 1e6]}}
    (tmp_path / "reference.json").write_text(json.dumps(reference))
    compared = changed(PUNCH, {"reference": {"series": "reference.json", "columns": {"kinetic": "K"}}})
    scene = write(compared, tmp_path / "scene.toml")
    whole, pieces = tmp_path / "whole", tmp_path / "pieces"
    in_pieces = [scene, "-q", "-o", pieces]
    commands = [[scene, "-q", "-o", whole], [*in_pieces, "--max-steps", 12], [*in_pieces, "--restart"]]
    all_done(many(commands, 1, tmp_path / "job"))
    assert summary(whole)["errors"]["kinetic"] > 0.1
    assert summary(pieces)["errors"] == summary(whole)["errors"]
    assert summary(pieces)["energy_error_share"] == summary(whole)["energy_error_share"]


def test_a_finished_run_goes_on_to_a_later_end(tmp_path):
    scene = write(PUNCH, tmp_path / "scene.toml")
    folder, short = tmp_path / "run", [scene, "-q", "-o", tmp_path / "run", "--end-time", "2e-3"]
    commands = [short, [*short, "--restart"], [scene, "-q", "-o", folder, "--restart"]]
    (tmp_path / "direct").mkdir()
    all_done(many([*commands, [scene, "-q", "-o", tmp_path / "direct"]], RANKS, tmp_path / "job"))
    columns, direct = history(folder), history(tmp_path / "direct")
    assert columns["step"].tolist() == list(range(len(columns["step"])))
    assert 2e-3 in columns["time"] and columns["time"][-1] == 5e-3
    assert summary(folder)["status"] == "finished" and summary(folder)["end_time"] == 5e-3
    # the first part's last step was cut short to land on its end, so this is as close as the time integration
    assert columns["strain_energy"][-1] == pytest.approx(direct["strain_energy"][-1], rel=0.02)


@pytest.mark.parametrize("name, ranks", [*((name, 2) for name in SCENES), *((name, 4) for name in ON_FOUR)])
def test_any_number_of_ranks_gives_the_same_history_and_state(on_ranks, name, ranks):
    assert_close(on_ranks[ranks] / name, on_ranks[1] / name, 1e-9)


@pytest.mark.parametrize("name", SCENES)
def test_something_happens_in_these_scenes(on_ranks, name):
    columns = history(on_ranks[1] / name)
    assert 15 < columns["step"][-1] < 100
    assert columns["kinetic"].max() > 0.0
    stored = stored_energy(columns)
    assert columns[stored].max() > 0.0
    assert columns["numerical_dissipation"][-1] + columns.get("viscous_dissipation", [0.0])[-1] > 0.0
    largest = max(columns[name].max() for name in ("kinetic", stored, "external_work"))
    assert abs(columns["energy_error"]).max() < 1e-2 * largest
