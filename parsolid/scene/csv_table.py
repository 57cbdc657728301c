"""Two columns of a CSV file, for loads that change in time; the first line may have names, none of them a number."""

import csv
import os

import numpy as np


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None


def read_csv_table(path: str, column: str | None = None) -> tuple[np.ndarray, np.ndarray]:
    """Places and values (rows,) of a file of two or more columns of numbers; a first line of numbers is a row.

    column: name of the values' column, the second one unless given. Blank lines are left out. Raises ValueError with
    the line at fault.
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
            raise ValueError(
                f"line {line} of {file_name!r} without two finite numbers between commas: {','.join(words)!r}"
            )
        rows.append(pair)
    if not rows:
        raise ValueError(f"no rows of numbers in {file_name!r}")
    places, values = np.array(rows, float).T
    return places, values
