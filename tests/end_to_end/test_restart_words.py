"""Which scene and which checkpoint `--restart` means, with and without the scene's name."""

from command_line import many
from run_results import assert_same_bits
from small_scenes import SCENES, write

RANKS = 2


def test_a_restart_without_a_scene_goes_on_with_that_of_the_folder(tmp_path):
    scene = write(SCENES["punch"], tmp_path / "my.toml")
    whole, folder, other = (tmp_path / name for name in ("whole", "pieces", "other"))
    empty = tmp_path / "empty"
    empty.mkdir()
    short = ["--max-steps", "8"]
    commands = [
        [scene, "-q", "-o", whole],
        [scene, "-q", "-o", folder, *short],
        # the folder's own scene, the words in the other order, a checkpoint with the scene beside it
        ["--restart", "-q", "-o", folder, *short],
        ["-q", "-o", folder, *short, "--restart", scene],
        ["--restart", folder / "checkpoint.h5", "-q"],
        ["--restart", "-o", empty],
        ["--restart", other / "checkpoint.h5"],
    ]
    ended = many(commands, RANKS, tmp_path / "job")
    assert [ranks[0].status for ranks in ended] == [0, 0, 0, 0, 0, 2, 2], [ranks[0].err for ranks in ended]
    assert_same_bits(folder, whole)
    assert str(empty / "scene.toml") in ended[5][0].err and str(other / "checkpoint.h5") in ended[6][0].err
    assert list(empty.iterdir()) == [] and not other.exists()
