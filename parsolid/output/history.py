"""The history of a run: one row of numbers a line in history.csv."""

import csv
import os
from collections.abc import Sequence
from pathlib import Path
from typing import TextIO

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
        self._file: TextIO | None = None

    def resume(self, at_step: int) -> None:
        """Go on with the file: keep the rows up to and including a step, drop the later ones.

        A file that is not there is begun. Raises OutputError when it has other columns.
        """
        rows: list[list[str]] = []
        if self.path.exists():
            found, rows = _read(self.path)
            if found != self._columns:
                raise OutputError(f"{self.path}: cannot go on: expected the columns {self._columns}, found {found}")
        self._begin([row for row in rows if int(row[0]) <= at_step])

    def append(self, row: Sequence[float | None]) -> None:
        """Add a row: numbers in the order of the columns, None for an empty cell. Raises OutputError."""
        if len(row) != len(self._columns):
            raise ValueError(f"row: expected {len(self._columns)} values, found {len(row)}")
        file = self._begin([]) if self._file is None else self._file
        try:
            # one write a row: a killed run leaves at most one line without its end
            file.write(",".join(map(_text, row)) + "\n")
            file.flush()
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {words(error)}") from error

    def close(self) -> None:
        """Close the file; a later row opens none."""
        if self._file is not None:
            self._file.close()

    def _begin(self, rows: list[list[str]]) -> TextIO:
        """Write beside and rename, so that a run killed here loses no row."""
        partial = self.path.with_name(self.path.name + ".partial")
        try:
            with open(partial, "w", newline="") as file:
                csv.writer(file, lineterminator="\n").writerows([self._columns, *rows])
                file.flush()
                os.fsync(file.fileno())
            os.replace(partial, self.path)
            # stays open between rows
            self._file = open(self.path, "a", newline="")  # noqa: SIM115
            return self._file
        except OSError as error:
            raise OutputError(f"cannot write {self.path}: {words(error)}") from error


def read_history(path: Path | str) -> dict[str, list[float]]:
    """Column name -> values; an empty cell is read as NaN. Raises OutputError when the file is no history."""
    columns, rows = _read(Path(path))
    return {name: [float(row[i] or "nan") for row in rows] for i, name in enumerate(columns)}


def _read(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        text = path.read_text()
    except OSError as error:
        raise OutputError(f"cannot read {path}: {words(error)}") from error
    # what comes after the last line's end was being written when the run was killed
    columns, *rows = csv.reader(text[: text.rfind("\n") + 1].splitlines()) if "\n" in text else ([],)
    if columns[:1] != ["step"]:
        raise OutputError(f"{path}: not a history (first column: expected 'step', found {columns[:1]})")
    return columns, [row for row in rows if len(row) == len(columns)]


def _text(value: float | None) -> str:
    if value is None:
        return ""
    return str(value) if isinstance(value, (int, np.integer)) else f"{value:.17g}"
