"""Two columns of a CSV file: as numbers, and as a function of the first column."""

import csv
import os

import numpy as np


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def read_csv_table(path: str, column: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """First column and a column of values, (rows,) each, of a CSV file with or without a line of names.

    column: name of the column of values (default: the second column). Blank lines are skipped. Raises ValueError with
    the faulty line.
    """
    file_name = os.path.basename(path)
    try:
        with open(path, newline="", encoding="utf-8-sig") as file:
            reader = csv.reader(file)
            lines = [(reader.line_num, [word.strip() for word in row]) for row in reader if any(map(str.strip, row))]
    except (OSError, ValueError, csv.Error) as error:
        raise ValueError(f"no CSV file {file_name!r} ({getattr(error, 'strerror', None) or error})") from None
    names: list[str] = []
    if lines and all(_number(word) is None for word in lines[0][1]):
        names = lines.pop(0)[1]
    if column is not None and column not in names:
        raise ValueError(f"no column {column!r} among {', '.join(names) or '(no names)'} of {file_name!r}")
    number = 1 if column is None else names.index(column)
    rows = []
    for line, words in lines:
        pair = [_number(words[k]) if k < len(words) else None for k in (0, number)]
        if None in pair or not np.isfinite(np.array(pair, float)).all():
            text = ",".join(words)
            raise ValueError(f"line {line} of {file_name!r} without two finite numbers between commas: {text!r}")
        rows.append(pair)
    if not rows:
        raise ValueError(f"no rows of numbers in {file_name!r}")
    places, values = np.array(rows, float).T
    return places, values


class Table:
    """Two columns of a CSV file: linear between rows, constant outside; a repeated abscissa is a jump."""

    def __init__(self, path: str, column: str | None = None) -> None:
        """column: name of the column of values (default: the second). Raises ValueError for a faulty file."""
        self.places, self.values = read_csv_table(path, column)
        if (np.diff(self.places) < 0.0).any():
            raise ValueError(f"a first column that falls in {os.path.basename(path)!r}")

    def at(self, places: np.ndarray) -> np.ndarray:
        """Values at abscissae; at a jump the value after it."""
        return np.interp(places, self.places, self.values)

    def slope(self, places: np.ndarray) -> np.ndarray:
        """Slopes at abscissae, at a corner the slope after it; 0 outside the table."""
        after = np.searchsorted(self.places, places, side="right")
        inside = (after > 0) & (after < len(self.places))
        end = np.where(inside, after, 1)
        if len(self.places) == 1:
            return np.zeros(np.shape(places))
        rise, run = self.values[end] - self.values[end - 1], self.places[end] - self.places[end - 1]
        return np.where(inside, rise / np.where(run > 0.0, run, 1.0), 0.0)

    @property
    def jumps(self) -> np.ndarray:
        """Abscissae at which the values jump."""
        return self.places[1:][np.diff(self.places) == 0.0]
