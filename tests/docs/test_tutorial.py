"""The tutorials work as they stand: files are written, commands run, code executed, in their order."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from parsolid.commands.cli import main

pytestmark = [pytest.mark.serial, pytest.mark.slow]
PAGE = Path(__file__).parents[2] / "docs" / "tutorial.md"
BLOCK = re.compile(r"(?:<!-- file: (\S+) -->\n)?```(toml|sh|python)\n(.*?)```", re.DOTALL)


def test_the_tutorials(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    said = io.StringIO()
    with contextlib.redirect_stdout(said):
        for name, language, text in BLOCK.findall(PAGE.read_text(encoding="utf-8")):
            if language == "toml":
                Path(name).write_text(text)
            for line in text.splitlines() if language == "sh" else ():
                program, *words = shlex.split(line)
                assert program == "parsolid" and main(words) == 0, line
            if language == "python":
                exec(compile(text, str(PAGE), "exec"), {})
    lines = said.getvalue()
    assert "[chosen-weights]" in lines and "energy check ok" in lines and "largest force" in lines
    assert re.search(r"tip\.displacement_y -0\.069 \+- 0\.0014 ", lines)
    assert all(
        (tmp_path / "results/strip/pictures" / f"{name}.png").is_file() for name in ("energies", "von_mises_stress")
    )
    assert (tmp_path / "results/drop/pictures/probes.png").is_file()
