"""The history of a run: one row of numbers a line in history.csv, and a checksum a line in history.sums.

A row that is damaged on the disk is found when the file is read or gone on with.
"""

import csv
import os
import zlib
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any, TextIO

import numpy as np

from parsolid.output.errors import OutputError, words


class History:
    """Appends rows to a CSV file; for one rank alone. Every row is out of the program when `append` returns.

    Parameters: path; columns, their names, the first being "step". The file is begun anew with the first row, unless
    `resume` is called before. Numbers are written with 17 digits, so that reading them gives the same bits.
    """

    def __init__(self, path: Path | str, columns: list[str]):
        if not columns or columns[0] != "step":
            raise ValueError(f"columns: expected the first to be 'step', found {columns[:1]}")
        self.path = Path(path)
        self._columns = list(columns)
        self._files: tuple[TextIO, ...] = ()

    def resume(self, at_step: int) -> None:
        """Go on with the file: keep the rows up to and including a step, drop the later ones.

        A file that is not there is begun. Raises OutputError when it has other columns.
        """
        rows: list[list[str]] = []
        if self.path.exists():
            found, rows = _read(self.path)
            if found != self._columns:
                raise OutputError(f"{self.path}: cannot go on: expected the columns {self._columns}, found {found}")
        steps = _numbers(self.path, rows, int, [0])
        self._begin([",".join(row) for row, (step,) in zip(rows, steps) if step <= at_step])

    def append(self, row: Sequence[float | None]) -> None:
        """Add a row: numbers in the order of the columns, None for an empty cell. Raises OutputError."""
        if len(row) != len(self._columns):
            raise ValueError(f"row: expected {len(self._columns)} values, found {len(row)}")
        if not self._files:
            self._begin([])
        text = ",".join(map(_text, row))
        try:
            # one write a row: a killed run leaves at most one line without its end, and one row without its checksum
            for file, line in zip(self._files, (text, _checksum(text))):
                file.write(line + "\n")
                file.flush()
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {words(error)}") from error

    def close(self) -> None:
        """Close the file; a later row opens none."""
        for file in self._files:
            file.close()

    def _begin(self, rows: list[str]) -> None:
        """Write beside and rename, so that a run killed here loses no row."""
        lines = [",".join(self._columns), *rows]
        try:
            # the rows first: killed between the two renames, every row that is left has its checksum
            for path, content in ((self.path, lines), (_sums_of(self.path), map(_checksum, lines))):
                partial = path.with_name(path.name + ".partial")
                with open(partial, "w", newline="") as file:
                    file.writelines(f"{line}\n" for line in content)
                    file.flush()
                    os.fsync(file.fileno())
                os.replace(partial, path)
            # stay open between rows
            self._files = tuple(open(path, "a", newline="") for path in (self.path, _sums_of(self.path)))  # noqa: SIM115
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {words(error)}") from error


def read_history(path: Path | str) -> dict[str, list[float]]:
    """Column name -> values; an empty cell is read as NaN. Raises OutputError when the file is no history."""
    columns, rows = _read(Path(path))
    values = _numbers(Path(path), rows, lambda text: float(text or "nan"), range(len(columns)))
    return {name: [row[i] for row in values] for i, name in enumerate(columns)}


def _numbers(path: Path, rows: list[list[str]], kind: Callable[[str], Any], places: Iterable[int]) -> list[list[Any]]:
    """Cells of rows as numbers. Raises OutputError with the line of the first that is none."""
    places, result = list(places), []
    for line, row in enumerate(rows, 2):
        try:
            result.append([kind(row[place]) for place in places])
        except ValueError:
            raise OutputError(f"{path}: damaged: line {line} holds what is no number") from None
    return result


def _read(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        text = path.read_text()
    except (OSError, UnicodeDecodeError) as error:
        raise OutputError(f"cannot read {path}: {words(error)}") from error
    # what comes after the last line's end was being written when the run was killed
    lines = text[: text.rfind("\n") + 1].splitlines()
    _compare(path, lines)
    columns, *rows = csv.reader(lines) if lines else ([],)
    if columns[:1] != ["step"]:
        raise OutputError(f"{path}: not a history (first column: expected 'step', found {columns[:1]})")
    return columns, [row for row in rows if len(row) == len(columns)]


def _sums_of(path: Path) -> Path:
    return path.with_suffix(".sums")


def _checksum(line: str) -> str:
    return f"{zlib.crc32(line.encode()):08x}"


def _compare(path: Path, lines: list[str]) -> None:
    """Raise OutputError unless lines have the checksums that were written with them; without any none is compared.

    The last line may lack one, where the run was killed between the two.
    """
    try:
        stated = _sums_of(path).read_text().split()
    except (OSError, UnicodeDecodeError):
        return
    found = [_checksum(line) for line in lines]
    wrong = [number for number, (one, other) in enumerate(zip(stated, found), 1) if one != other]
    if wrong or len(found) - len(stated) > 1:
        line = wrong[0] if wrong else len(stated) + 1
        raise OutputError(f"{path}: damaged: line {line} is not as it was written (checksums differ)")


def _text(value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, (int, np.integer)) else f"{value:.17g}"
