"""The first word of the command line: a command, a scene in its place, or neither."""

import pytest

from parsolid.commands.cli import main, parse


@pytest.mark.parametrize(
    "word, meant", [("runn", " (did you mean 'run'?)"), ("simulate", ""), ("./block", ""), ("", "")]
)
def test_a_word_that_is_no_command_and_no_scene(word, meant, capsys):
    assert main([word, "block.toml"]) == 2
    said = capsys.readouterr().err
    assert said.startswith("parsolid: expected a scene or one of run, check, bench,")
    assert said.rstrip().endswith(f"found {word!r}{meant}")


def test_a_scene_without_a_name_is_not_the_main_example(capsys):
    """What a script's variable that is not set leaves."""
    for command in ("run", "check"):
        assert main([command, ""]) == 2
        assert "expected a readable scene" in capsys.readouterr().err


def test_a_scene_may_stand_in_the_command_s_place(tmp_path):
    (tmp_path / "block").write_text("")
    for words in (["block.toml", "-q"], [str(tmp_path / "block")], ["-q"], []):
        assert parse(words).command == "run"
    assert parse(["check", "block"]).scene == "block"
