"""What a run left in its folder, as far as pictures need it."""

import json
import tomllib
from contextlib import ExitStack
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import h5py
import numpy as np

from parsolid.output.errors import OutputError, words
from parsolid.output.field_sums import rows_of_step
from parsolid.output.fields import DEFAULT_NAME
from parsolid.output.history import read_history
from parsolid.output.vtkhdf import Layout, collected, published
from parsolid.scene import SceneError
from parsolid.scene.methods import context_of
from parsolid.scene.sound_part import LeftOut, sound_part
from parsolid.scene.validation_errors import suggestion, told

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


class Results:
    """A run's folder: its scene, history and fields. Raises SceneError when the folder holds no run."""

    def __init__(self, directory: Path | str) -> None:
        self.directory = Path(directory)
        self.fields_path = self.directory / DEFAULT_NAME
        scene = self.directory / "scene.toml"
        try:
            self._tables = tomllib.loads(scene.read_text(encoding="utf-8"))
        except OSError as error:
            raise SceneError(
                [f"{self.directory}: expected the folder of a run, found no scene.toml ({words(error)})"]
            ) from None
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise SceneError([f"{scene}: expected TOML, found a fault: {error}"]) from None
        self.dimension = self._tables.get("dimension")
        if self.dimension not in (1, 2, 3):
            raise SceneError([f"{scene}: expected dimension = 1, 2 or 3, found {told(self.dimension)}"])
        self.title = str(self._tables.get("title") or self.directory.name)

    @cached_property
    def _sound(self) -> tuple[Any, LeftOut]:
        """The sound part of the scene: a reference or mesh that has gone since the run is left out."""
        return sound_part(self._tables, context_of(self._tables, self.directory))[:2]

    @property
    def bodies(self) -> dict[int, Any]:
        """The bodies whose shapes could be read, by number."""
        scene, left_out = self._sound
        return {i: body for i, body in enumerate(scene.bodies if scene else ()) if i not in left_out.vague}

    @property
    def _reference(self) -> Any:
        """The scene's reference, where it could be read."""
        return self._sound[0] and self._sound[0].reference

    @property
    def method(self) -> Any:
        """The class of the settings of the scene's method, or what several know together."""
        return context_of(self._tables, self.directory)["method"]

    def per(self, name: str) -> str:
        """What a force of the tool or boundary of a name is per, behind its unit: a thickness, a radian, nothing."""
        if self.dimension != 2:
            return ""
        methods = [self._tables.get("method"), *self._tables.get("methods", [])]
        if not any(isinstance(one, dict) and one.get("geometry") == "axisymmetric" for one in methods):
            return "/m"
        return "" if any(tool.get("name") == name for tool in self._tables.get("tools", [])) else "/rad"

    @cached_property
    def history(self) -> dict[str, np.ndarray]:
        """Column -> values. Raises SceneError when there is none."""
        try:
            return {name: np.array(values) for name, values in read_history(self.directory / "history.csv").items()}
        except OutputError as error:
            raise SceneError([f"{self.directory}: expected a run's history, found: {error}"]) from None

    @cached_property
    def bars(self) -> dict[str, np.ndarray]:
        """Column -> its error bar (n,) at the rows of the history; empty for a run without them."""
        try:
            found = read_history(self.directory / "history_error.csv")
        except OutputError:
            return {}
        rows = len(self.history["time"])
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
    def tables(self) -> dict[str, Any]:
        """The scene as the run resolved it."""
        return self._tables

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
            parts = {(): [], (3,): list(_COMPONENTS), (9,): _TENSOR, (3, 3): _TENSOR}.get(tuple(shape))
            if parts is not None:
                names += ([] if len(parts) == 9 else [name]) + [f"{name}_{part}" for part in parts]
        return names

    def check_field(self, name: str) -> None:
        """Raise SceneError unless there is such a field or component."""
        if name not in self.field_names:
            known = ", ".join(self.field_names)
            raise SceneError(
                [f"--field: expected one of {known}; found {told(name)}{suggestion(name, self.field_names)}"]
            )

    def check_history(self) -> None:
        """Raise SceneError unless there is a history of one row at least."""
        if len(self.history["time"]) == 0:
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

    def frames(self, steps: list[int], field: str, exaggeration: float = 1.0) -> Any:
        """The frames of steps, one after the other; vectors are shown by their magnitude.

        exaggeration: factor on the displacements of the positions. Raises SceneError when that needs a field that is
        not there.
        """
        blocks = self._published[0]
        if exaggeration != 1.0 and any("displacement" not in layout.varying for _, layout in blocks):
            raise SceneError([f"--exaggerate: expected the field displacement in {self.fields_path}, found none"])
        name, component = self._split(field)
        with ExitStack() as kept:
            files = [kept.enter_context(h5py.File(file, "r", locking=False)) for file, _ in blocks]
            for step in steps:
                values, positions = [], []
                for file, (path, layout) in zip(files, blocks):
                    values.append(_of_block(file, path, layout, name, component, step))
                    positions.append(rows_of_step(file, path, "VTKHDF/Points", step, layout.particles))
                    if exaggeration != 1.0:
                        moved = rows_of_step(file, path, "VTKHDF/PointData/displacement", step, layout.particles)
                        positions[-1] += (exaggeration - 1.0) * moved
                yield Frame(float(self.times[step]), np.concatenate(positions), np.concatenate(values))

    def constant(self, name: str) -> np.ndarray:
        """A field that does not change: body or volume."""
        pieces = []
        for path, layout in self._published[0]:
            with h5py.File(path, "r", locking=False) as file:
                pieces.append(rows_of_step(file, path, f"VTKHDF/PointData/{name}", 0, layout.particles, True))
        return np.concatenate(pieces)

    @cached_property
    def reference_position(self) -> np.ndarray:
        """Positions (n, 3) [m] in the reference. Raises SceneError when the fields do not tell them."""
        pieces = []
        for path, layout in self._published[0]:
            with h5py.File(path, "r", locking=False) as file:
                first = rows_of_step(file, path, "VTKHDF/Points", 0, layout.particles)
                if "displacement" in layout.varying:
                    first = first - rows_of_step(file, path, "VTKHDF/PointData/displacement", 0, layout.particles)
                elif self.times[0] != 0.0:
                    expected = "fields of time 0, or the field displacement, for planes of the reference (X)"
                    raise SceneError([f"{self.fields_path}: expected {expected}, found none (x cuts what is shown)"])
                pieces.append(first)
        return np.concatenate(pieces)

    def _split(self, field: str) -> tuple[str, int | None]:
        if any(field in kinds for _, layout in self._published[0] for kinds in (layout.varying, layout.constant)):
            return field, None
        name, _, part = field.rpartition("_")
        return name, _COMPONENTS[part] if part in _COMPONENTS else _TENSOR.index(part)


def _of_block(file: Any, path: Path, layout: Layout, name: str, component: int | None, step: int) -> np.ndarray:
    """A field's magnitude or one of its components at a step's rows of a block; not numbers where it has none."""
    n = layout.particles
    if name not in layout.varying and name not in layout.constant:
        return np.full(n, np.nan)
    rows = rows_of_step(file, path, f"VTKHDF/PointData/{name}", step, n, name in layout.constant)
    values = rows.reshape(n, -1).astype(float)
    if component is None and values.shape[1] > 1:
        return np.linalg.norm(values, axis=1)
    result: np.ndarray = values[:, component or 0]
    return result
