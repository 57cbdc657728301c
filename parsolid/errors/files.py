"""history_error.csv: the bars of the columns of history.csv, row by row; for one rank alone."""

from pathlib import Path

import numpy as np

from parsolid.errors.bars import ErrorTable
from parsolid.output.history import History, read_history

NAME = "history_error.csv"


def history_of(folder: Path) -> dict[str, np.ndarray]:
    """The history of a folder: column -> values (n,). Raises OutputError."""
    return {name: np.array(values) for name, values in read_history(folder / "history.csv").items()}


def write_error_columns(path: Path, table: ErrorTable) -> None:
    """One row a row of the history: step, time and the bar of every column that has one. Raises OutputError."""
    file = History(path, ["step", "time", *(f"{name}_error" for name in table.bars)])
    steps = table.steps if table.steps is not None else np.arange(len(table.times))
    for row, (step, time) in enumerate(zip(steps, table.times)):
        errors = [float(bar.error[row]) for bar in table.bars.values()]
        file.append([int(step), float(time), *(None if np.isnan(error) else error for error in errors)])
    file.close()
