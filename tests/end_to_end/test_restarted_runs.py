"""Restarts and ranks from the command line: what `contracts` does not see of them."""

import json

import pytest
from command_line import all_done, many
from run_results import history, state, summary
from small_scenes import PUNCH, SCENES, changed, write

RANKS = 2
# of each method a scene that changes most what a rank has
NAMES = ("moving", "driven", "flight", "plates")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """Folders of results on 2 ranks: whole, and stopped twice, and continued in another folder."""
    folder, commands = tmp_path_factory.mktemp("restarts"), []
    for name in NAMES:
        path = write(SCENES[name], folder / f"{name}.toml")
        pieces = [path, "-q", "-o", folder / "pieces" / name]
        commands += [[path, "-q", "-o", folder / "whole" / name], [*pieces, "--max-steps", 1]]
        commands.append([*pieces, "--restart", "--max-steps", 11])
        earlier = folder / "pieces" / name / "checkpoint.previous.h5"
        commands.append([path, "-q", "-o", folder / "elsewhere" / name, "--restart", earlier])
    all_done(many(commands, RANKS, folder / "job"))
    return folder


@pytest.mark.parametrize("name", NAMES)
def test_restarted_from_a_checkpoint_elsewhere_fills_a_folder_of_its_own(runs, name):
    found, wanted = history(runs / "elsewhere" / name), history(runs / "whole" / name)
    # the last checkpoint but one is at the end of the first piece
    for column in wanted:
        assert found[column].tolist() == wanted[column][2:].tolist()
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
