"""The one reader of a run's folder: scene, history, error bars, summary, and fields as arrays."""

import json
import tomllib
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from parsolid.checksums import matches_checksum
from parsolid.output.errors import OutputError, words
from parsolid.output.fields import rows_of_step
from parsolid.output.history import read_history
from parsolid.output.run_folder import FIELDS
from parsolid.output.summary import read_summary
from parsolid.output.vtkhdf import Layout, collected, published
from parsolid.scene import SceneError
from parsolid.scene.error_recovery import Repairs, validate_with_recovery
from parsolid.scene.methods import context_of, known_methods
from parsolid.scene.observation import DISSIPATIONS, HISTORY_COLUMNS
from parsolid.scene.validation_errors import RENAMED, describe, suggestion

_COMPONENTS = {"x": 0, "y": 1, "z": 2}
_TENSOR = [f"{row}{column}" for row in "xyz" for column in "xyz"]


@dataclass(frozen=True)
class Frame:
    """The particles at one time [s]: position (n, 3) [m] and the values (n,) of the field that is shown.

    along (n,) [m]: the coordinate across which bodies are cut, None where they are whole.
    """

    time: float
    position: np.ndarray
    values: np.ndarray
    along: np.ndarray | None = None


def load(directory: str | Path) -> "Results":
    """The results in a folder. Raises SceneError when it holds no run."""
    return Results(directory)


class Results:
    """A run's folder. Everything is read when it is first asked for; lengths [m], times [s], energies [J].

    directory: where it is; title, dimension: of the scene; scene: its tables with all defaults, as the run resolved
    them; fields: time -> fields at that time.
    """

    def __init__(self, directory: Path | str) -> None:
        """Raises SceneError when the folder holds no run."""
        self.directory = Path(directory)
        self.fields_path = self.directory / FIELDS
        scene = self.directory / "scene.toml"
        try:
            text = scene.read_text(encoding="utf-8")
            self.scene: dict[str, Any] = tomllib.loads(text)
        except OSError as error:
            raise SceneError(
                [f"{self.directory}: expected the folder of a run, found no scene.toml ({words(error)})"]
            ) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SceneError([f"{scene}: expected TOML, found a fault: {error}"]) from None
        if not matches_checksum(text):
            raise SceneError([f"{scene}: damaged: it is not as it was written (checksums differ)"])
        self.dimension = self.scene.get("dimension")
        if self.dimension not in (1, 2, 3):
            raise SceneError([f"{scene}: expected dimension = 1, 2 or 3, found {describe(self.dimension)}"])
        self.title = str(self.scene.get("title") or self.directory.name)
        self.fields = FieldsOverTime(self)

    def __repr__(self) -> str:
        return f"<results of {self.title!r} in {self.directory}>"

    @cached_property
    def _readable(self) -> tuple[Any, Repairs]:
        """The scene, without a reference or mesh that has gone since the run, and what was repaired for it."""
        return validate_with_recovery(self.scene, context_of(self.scene, self.directory))[:2]

    @property
    def bodies(self) -> dict[int, Any]:
        """The bodies whose shapes could be read, by number."""
        scene, repairs = self._readable
        return {i: body for i, body in enumerate(scene.bodies if scene else ()) if i not in repairs.misplaced}

    @property
    def _reference(self) -> Any:
        """The scene's reference, where it could be read."""
        return self._readable[0] and self._readable[0].reference

    @property
    def methods(self) -> list[Any]:
        """The classes of the settings of the scene's methods."""
        return list(known_methods(self.scene))

    def per(self, name: str) -> str:
        """What a force of the tool or boundary of a name is per, behind its unit: a thickness, a radian, nothing."""
        if self.dimension != 2:
            return ""
        methods = [self.scene.get("method"), *self.scene.get("methods", [])]
        if not any(isinstance(one, dict) and one.get("geometry") == "axisymmetric" for one in methods):
            return "/m"
        return "" if any(tool.get("name") == name for tool in self.scene.get("tools", [])) else "/rad"

    @cached_property
    def columns(self) -> dict[str, np.ndarray]:
        """The history: name -> values, one a row. Raises SceneError when there is none, and for no such column."""
        try:
            found = read_history(self.directory / "history.csv")
        except OutputError as error:
            raise SceneError([f"{self.directory}: expected a run's history, found: {error}"]) from None
        if old := [name for name in found if name in RENAMED]:
            expected = f"a history of parsolid 0.2 or later, found one of an earlier version ({', '.join(old)})"
            raise SceneError([f"{self.directory}: expected {expected}"])
        return _Columns({name: np.array(values) for name, values in found.items()})

    @cached_property
    def history(self) -> Any:
        """The history as a pandas.DataFrame with the time [s] as its index. Raises ImportError without pandas."""
        try:
            import pandas
        except ImportError as error:
            raise ImportError("history: pandas is not installed: pip install 'parsolid[notebook]'") from error
        return pandas.DataFrame(self.columns).set_index("time", drop=False).rename_axis(index="t")

    @cached_property
    def summary(self) -> dict[str, Any]:
        """summary.json. Raises OutputError when there is none: the run has not ended; or when it is damaged."""
        return read_summary(self.directory / "summary.json")

    @cached_property
    def errors(self) -> dict[str, np.ndarray]:
        """Error bars: column -> half width (n,) at the rows of the history; empty for a run without --error-bars.

        What is known of each (order, parts, verdict) is in summary["error_bars"].
        """
        try:
            found = read_history(self.directory / "history_error.csv")
        except OutputError:
            return {}
        rows = len(self.columns["time"])
        return {
            name.removesuffix("_error"): np.array(values)
            for name, values in found.items()
            if name.endswith("_error") and len(values) == rows
        }

    @cached_property
    def reference(self) -> tuple[np.ndarray, dict[str, np.ndarray]] | None:
        """Times [s] and history column -> values of the scene's reference series, None without one."""
        stated = self._reference
        if stated is None or stated.series is None:
            return None
        data = json.loads(Path(stated.series).read_text(encoding="utf-8"))
        series = {column: np.asarray(data["series"][name], float) for column, name in (stated.columns or {}).items()}
        return np.asarray(data["t"], float), series

    @property
    def reference_name(self) -> str:
        """What the reference series is: its file's own word for it, or the file's name."""
        stated = self._reference
        assert stated is not None and stated.series is not None
        method = json.loads(Path(stated.series).read_text(encoding="utf-8")).get("method")
        return str(method) if method else f"reference, {Path(stated.series).stem}"

    @cached_property
    def _published(self) -> tuple[list[tuple[Path, Layout]], np.ndarray]:
        """File and layout of each block, and the times that all of them have [s]."""
        try:
            found = [(file, *published(file)) for file in collected(self.fields_path).values()]
        except OutputError as error:
            raise SceneError([f"{self.directory}: expected a run's fields, found: {error}"]) from None
        times = min((times for _, _, times in found), key=len)
        if len(times) == 0:
            raise SceneError([f"{self.fields_path}: expected fields at one time at least, found none"])
        return [(file, layout) for file, layout, _ in found], times

    @property
    def blocks(self) -> list[tuple[Path, Layout]]:
        """File and `output.vtkhdf.Layout` of each system's fields. Raises SceneError when there are none."""
        blocks: list[tuple[Path, Layout]] = self._published[0]
        return blocks

    @property
    def times(self) -> np.ndarray:
        """Times at which fields were written [s]."""
        return self._published[1]

    @property
    def particles(self) -> int:
        """Number of particles."""
        return sum(layout.particles for _, layout in self._published[0])

    @cached_property
    def field_names(self) -> list[str]:
        """What may be shown: every field, and the components of vectors and tensors."""
        names = []
        layouts = [layout for _, layout in self._published[0]]
        shapes = {name: kind[0] for each in layouts for name, kind in {**each.varying, **each.constant}.items()}
        for name, shape in shapes.items():
            parts = {(): [], (3,): list(_COMPONENTS)[: self.dimension], (9,): _TENSOR, (3, 3): _TENSOR}.get(
                tuple(shape)
            )
            if parts is not None:
                names += ([] if len(parts) == 9 else [name]) + [f"{name}_{part}" for part in parts]
        return names

    def check_field(self, name: str) -> None:
        """Raise SceneError unless there is such a field or component."""
        if name not in self.field_names:
            known = ", ".join(self.field_names)
            raise SceneError(
                [f"--field: expected one of {known}; found {describe(name)}{suggestion(name, self.field_names)}"]
            )

    def check_history(self) -> None:
        """Raise SceneError unless there is a history of one row at least."""
        if len(self.columns["time"]) == 0:
            raise SceneError([f"{self.directory / 'history.csv'}: expected one row at least, found none"])

    def steps_at(self, times: list[float], asked: str = "--times") -> list[int]:
        """The stored steps nearest to times [s]. Raises SceneError for times outside of those stored.

        asked: what they were asked by.
        """
        stored = self.times
        for time in times:
            margin = 0.5 * np.diff(stored).max() if len(stored) > 1 else 1e-9 * max(stored[0], 1e-300)
            if not stored[0] - margin <= time <= stored[-1] + margin:
                raise SceneError([f"{asked}: expected times from {stored[0]:g} to {stored[-1]:g} s, found {time:g}"])
        # a time asked for twice is drawn once
        return list(dict.fromkeys(int(np.argmin(np.abs(stored - time))) for time in times))

    def frames(self, steps: list[int], field: str, exaggeration: float = 1.0) -> Iterator[Frame]:
        """The frames of steps, one after the other; vectors are shown by their magnitude.

        exaggeration: factor on the displacements of the positions. Raises SceneError when that needs a field that is
        not there.
        """
        if exaggeration != 1.0 and any("displacement" not in layout.varying for _, layout in self.blocks):
            raise SceneError([f"--exaggerate: expected the field displacement in {self.fields_path}, found none"])
        name, component = self._split(field)
        for step in steps:
            position = self.rows("position", step)
            if exaggeration != 1.0:
                position = position + (exaggeration - 1.0) * self.rows("displacement", step)
            values = self.rows(name, step).reshape(self.particles, -1).astype(float)
            shown = values[:, component or 0]
            if component is None and values.shape[1] > 1:
                shown = np.linalg.norm(values, axis=1)
            yield Frame(float(self.times[step]), position, shown)

    def rows(self, name: str, step: int = 0) -> np.ndarray:
        """A field or "position" of all particles at a step, by identifier; of a scene of several methods the particles
        of one system after those of another, with NaN where a system has no such field.
        """
        pieces = [_rows_of_block(path, layout, name, step) for path, layout in self.blocks]
        shape = next(piece.shape[1:] for piece in pieces if piece is not None)
        counts = [layout.particles for _, layout in self.blocks]
        filled = [np.full((n, *shape), np.nan) if piece is None else piece for n, piece in zip(counts, pieces)]
        return filled[0] if len(filled) == 1 else np.concatenate(filled)

    @cached_property
    def reference_position(self) -> np.ndarray:
        """Positions (n, 3) [m] in the reference. Raises SceneError when the fields do not tell them."""
        moved = [layout for _, layout in self.blocks if "displacement" in layout.varying]
        if len(moved) < len(self.blocks) and self.times[0] != 0.0:
            expected = "fields of time 0, or the field displacement, for planes of the reference (X)"
            raise SceneError([f"{self.fields_path}: expected {expected}, found none (x cuts what is shown)"])
        return self.rows("position") - (np.nan_to_num(self.rows("displacement")) if moved else 0.0)

    def plot(self, *columns: str, axes: Any = None) -> Any:
        """Draw columns of the history over time (the energies unless named); the matplotlib axes.

        Raises SceneError for a name that is no column.
        """
        history = self.columns
        names = columns or tuple(name for name in HISTORY_COLUMNS if name in history and name not in DISSIPATIONS)
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

    def _split(self, field: str) -> tuple[str, int | None]:
        if any(field in kinds for _, layout in self._published[0] for kinds in (layout.varying, layout.constant)):
            return field, None
        name, _, part = field.rpartition("_")
        return name, _COMPONENTS[part] if part in _COMPONENTS else _TENSOR.index(part)


def _rows_of_block(path: Path, layout: Layout, name: str, step: int) -> np.ndarray | None:
    """One system's rows of a field, None where it has no such field."""
    if name != "position" and name not in layout.varying and name not in layout.constant:
        return None
    whole = "VTKHDF/Points" if name == "position" else f"VTKHDF/PointData/{name}"
    with h5py.File(path, "r", locking=False) as file:
        return rows_of_step(file, path, whole, step, layout.particles, name in layout.constant)


class _Columns(dict[str, np.ndarray]):
    def __missing__(self, name: str) -> np.ndarray:
        known = f"expected a column of the history, one of {', '.join(self)}"
        raise SceneError([f"columns: {known}; found {describe(name)}{suggestion(name, self)}"])


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
            raise SceneError(
                [f"fields: expected one of {', '.join(self)}; found {describe(name)}{suggestion(name, self)}"]
            )
        values = self._results.rows(name, self._step)
        return values.reshape(-1, 3, 3) if values.shape[1:] == (9,) else values

    def __contains__(self, name: object) -> bool:
        return name in list(iter(self))
