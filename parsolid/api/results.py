"""What a run left in its folder, for Python: history as a table, fields as arrays that are read when asked for."""

import json
from collections.abc import Iterator, Mapping
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from parsolid.commands.plot.results import Results
from parsolid.output.errors import OutputError, words
from parsolid.output.field_sums import rows_of_step
from parsolid.output.vtkhdf import Layout
from parsolid.scene import SceneError
from parsolid.scene.validation_errors import suggestion, told


def load(directory: str | Path) -> "RunResults":
    """The results in a folder. Raises SceneError when it holds no run."""
    return RunResults(directory)


class RunResults:
    """A run's folder. Everything is read when it is first asked for; lengths [m], times [s], energies [J].

    directory: where it is; fields: time -> fields at that time.
    """

    def __init__(self, directory: str | Path) -> None:
        """Raises SceneError when the folder holds no run."""
        self._results = Results(directory)
        self.directory = self._results.directory
        self.fields = FieldsOverTime(self._results)

    def __repr__(self) -> str:
        return f"<results of {self._results.title!r} in {self.directory}>"

    @property
    def columns(self) -> dict[str, np.ndarray]:
        """The history: name -> values, one a row. Raises SceneError when there is none, and for no such column."""
        return _Columns(self._results.history)

    @cached_property
    def history(self) -> Any:
        """The history as a pandas.DataFrame with the time [s] as its index. Raises ImportError without pandas."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("history: pandas is not installed: pip install 'parsolid[notebook]'") from error
        return pandas.DataFrame(self.columns).set_index("time", drop=False).rename_axis(index="t")

    @cached_property
    def scene(self) -> dict[str, Any]:
        """The scene's tables with all defaults, as the run resolved them."""
        return dict(self._results.tables)

    @cached_property
    def summary(self) -> dict[str, Any]:
        """summary.json. Raises OutputError when there is none: the run has not ended."""
        path = self.directory / "summary.json"
        try:
            found: dict[str, Any] = json.loads(path.read_text(encoding="utf-8"))
        except (OSError, ValueError) as error:
            raise OutputError(f"cannot read {path}: {words(error) if isinstance(error, OSError) else error}") from error
        return found

    @property
    def errors(self) -> dict[str, np.ndarray]:
        """Error bars: column -> half width (n,) at the rows of the history; empty for a run without --error-bars.

        What is known of each (order, parts, verdict) is in summary["error_bars"].
        """
        return dict(self._results.bars)

    def plot(self, *columns: str, axes: Any = None) -> Any:
        """Draw columns of the history over time (the energies unless named); the matplotlib axes.

        Raises SceneError for a name that is no column.
        """
        history = self.columns
        names = columns or tuple(name for name in ("kinetic", "stored", "work_external", "balance") if name in history)
        drawn = [(name, history[name]) for name in names]
        if axes is None:
            from matplotlib import pyplot

            axes = pyplot.figure().add_subplot()
        for name, values in drawn:
            axes.plot(history["time"], values, label=name)
        axes.set_xlabel("time [s]")
        axes.legend()
        return axes

    def to_pyvista(self, time: float) -> Any:
        """The particles and all fields at the stored time next to `time` [s], as a pyvista.PolyData."""
        import pyvista

        now = self.fields[time]
        cloud = pyvista.PolyData(np.array(now["position"]))
        for name in now:
            if name != "position":
                values = now[name]
                cloud.point_data[name] = values.reshape(len(values), -1) if values.ndim > 1 else values
        return cloud


class _Columns(dict[str, np.ndarray]):
    def __missing__(self, name: str) -> np.ndarray:
        known = f"expected a column of the history, one of {', '.join(self)}"
        raise SceneError([f"columns: {known}; found {told(name)}{suggestion(name, self)}"])


class FieldsOverTime(Mapping[float, "FieldsAtTime"]):
    """Stored times [s] -> fields; a time between two stored ones means the nearer one."""

    def __init__(self, results: Results) -> None:
        self._results = results

    @property
    def times(self) -> np.ndarray:
        """Times at which fields were written [s]. Raises SceneError when there are none."""
        return self._results.times

    def __len__(self) -> int:
        return len(self.times)

    def __iter__(self) -> Iterator[float]:
        return iter(self.times.tolist())

    def __getitem__(self, time: float) -> "FieldsAtTime":
        """Fields at the stored time next to `time`. Raises SceneError for a time out of the run's."""
        return FieldsAtTime(self._results, self._results.steps_at([float(time)], "fields")[0])


class FieldsAtTime(Mapping[str, np.ndarray]):
    """Name -> values of all particles, in the order of their identifiers: (n,), vectors (n, 3), tensors (n, 3, 3).

    position [m], and what the scene's output.fields names. Plane vectors have a third
    component of zero. A field is read from the file each time it is asked for. Of a scene of several methods the
    particles of one system stand after those of another, with NaN where a system has no such field.
    """

    def __init__(self, results: Results, step: int) -> None:
        self._results, self._step = results, step
        self.time = float(results.times[step])

    def __repr__(self) -> str:
        return f"<fields at {self.time:g} s: {', '.join(self)}>"

    def __len__(self) -> int:
        return len(list(iter(self)))

    def __iter__(self) -> Iterator[str]:
        layouts = [layout for _, layout in self._results.blocks]
        varying = (name for layout in layouts for name in layout.varying)
        return iter(dict.fromkeys(["position", *varying, *(name for layout in layouts for name in layout.constant)]))

    def __getitem__(self, name: str) -> np.ndarray:
        """Values of a field. Raises SceneError when the file holds no such field."""
        if name not in self:
            raise SceneError([f"fields: expected one of {', '.join(self)}; found {told(name)}{suggestion(name, self)}"])
        pieces = [self._of_block(path, layout, name) for path, layout in self._results.blocks]
        shape = next(piece.shape[1:] for piece in pieces if piece is not None)
        counts = [layout.particles for _, layout in self._results.blocks]
        filled = [np.full((n, *shape), np.nan) if piece is None else piece for n, piece in zip(counts, pieces)]
        values = filled[0] if len(filled) == 1 else np.concatenate(filled)
        return values.reshape(-1, 3, 3) if values.shape[1:] == (9,) else values

    def _of_block(self, path: Path, layout: Layout, name: str) -> np.ndarray | None:
        """One system's values, None where it has no such field."""
        if name != "position" and name not in layout.varying and name not in layout.constant:
            return None
        whole = "VTKHDF/Points" if name == "position" else f"VTKHDF/PointData/{name}"
        with h5py.File(path, "r", locking=False) as file:
            return rows_of_step(file, path, whole, self._step, layout.particles, name in layout.constant)

    def __contains__(self, name: object) -> bool:
        return name in list(iter(self))
