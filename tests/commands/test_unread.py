"""Output that nobody reads any more (`| head`): commands end quietly, a run goes on."""

import os
import sys
from pathlib import Path

import pytest

from parsolid.commands.cli import main
from parsolid.exit_status import DONE, UNREAD

sys.path.insert(0, str(Path(__file__).parents[1] / "end_to_end"))

from small_scenes import PUNCH, write


@pytest.mark.parametrize(
    "words, status",
    [(["check"], UNREAD), (["run", "-o", "out"], DONE), (["run", "nowhere.toml"], 2)],
)
def test_what_nobody_reads_ends_without_a_word(tmp_path, monkeypatch, words, status):
    monkeypatch.chdir(tmp_path)
    if len(words) != 2 or words[0] == "check":
        words = [*words, str(write(PUNCH, tmp_path / "scene.toml"))]
    reading, writing = os.pipe()
    with open(writing, "w", encoding="utf-8") as unread, open(os.dup(writing), "w", encoding="utf-8") as other:
        os.close(reading)
        monkeypatch.setattr(sys, "stdout", unread)
        monkeypatch.setattr(sys, "stderr", other)
        assert main(words) == status
        # nothing is left that the end of the program would try to write
        unread.flush()
        other.flush()
    assert not list(tmp_path.glob("*traceback*"))
