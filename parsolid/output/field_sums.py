"""Checksums of fields, in fields.sums beside fields.vtkhdf: a line a step, the sums of all its data sets.

A damaged number is found where it is read: by results and pictures, and by a run that starts from them.
"""

import json
import os
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from parsolid.checksums import sum_of_rows
from parsolid.output.errors import OutputError, words


def sums_path(path: Path) -> Path:
    """Of a file of fields."""
    return path.with_suffix(".sums")


def append_sums(path: Path, step: int, time: float, sums: dict[str, int]) -> None:
    """Add a step at a time [s] to those of a file of fields, in which steps before may be without; for one rank alone.

    Raises OSError.
    """
    if len(_lines(path) or ()) != step:
        return
    with open(sums_path(path), "a", encoding="utf-8") as file:
        file.write(json.dumps({"time": time, "sums": sums}) + "\n")


def keep_sums(path: Path, count: int) -> None:
    """Drop the steps from a number on, which are written anew; for one rank alone. Raises OSError."""
    lines = _lines(path)
    if lines is None or len(lines) <= count:
        return
    partial = sums_path(path).with_name(sums_path(path).name + ".partial")
    partial.write_text("".join(f"{line}\n" for line in lines[:count]), encoding="utf-8")
    os.replace(partial, sums_path(path))


def check_step(path: Path, step: int, count: int) -> None:
    """Compare all of a step of a file of fields, count rows a data set, with its checksums; for one rank alone.

    Raises OutputError where it is damaged.
    """
    lines = _lines(path) or []
    try:
        names = [json.loads(line)["sums"] for line in (*lines[:1], *lines[step : step + 1])]
        with h5py.File(path, "r", locking=False) as file:
            for name in names[-1] if names else ():
                rows_of_step(file, path, name, step, count)
            for name in set(names[0]) - set(names[-1]) if names else ():
                rows_of_step(file, path, name, step, count, constant=True)
    except (OSError, ValueError, KeyError) as error:
        raise OutputError(f"{path}: damaged: {words(error)}") from error


def move_sums(path: Path, new: Path) -> None:
    """Let the checksums follow a file of fields that is renamed; for one rank alone. Raises OSError."""
    if sums_path(path).exists():
        sums_path(path).rename(sums_path(new))


def rows_of_step(file: Any, path: Path, name: str, step: int, count: int, constant: bool = False) -> np.ndarray:
    """Rows (count, ...) of a data set of an open file of fields, "VTKHDF/Points" and the like, at a step; constant: the
    same at every step. Raises OutputError where they are not as they were written.
    """
    first = 0 if constant else step * count
    try:
        rows: np.ndarray = file[name][first : first + count]
    except OSError as error:
        raise OutputError(f"{path}: damaged: {name}: {words(error)}") from error
    lines = _lines(path)
    if lines is None or (0 if constant else step) >= len(lines):
        return rows
    try:
        stated = json.loads(lines[0 if constant else step])["sums"].get(name)
    except (ValueError, KeyError, AttributeError, TypeError) as error:
        raise OutputError(f"{sums_path(path)}: damaged: line {step + 1} is no checksum") from error
    if stated is not None and stated != sum_of_rows(rows, 0):
        raise OutputError(f"{path}: damaged: {name} at step {step} is not as it was written (checksums differ)")
    return rows


def _lines(path: Path) -> list[str] | None:
    """The whole lines of the checksums; None without any."""
    try:
        text = sums_path(path).read_text(encoding="utf-8", errors="replace")
    except OSError:
        return None
    return text[: text.rfind("\n") + 1].splitlines()
