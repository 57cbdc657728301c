"""Fields of another run's results as initial fields: unchanged for the same particles, else interpolated."""

import json
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

# fields that an initial state may take
TAKEN = ("velocity", "displacement", "deformation_gradient", "temperature", "plastic_strain", "stress", "state")
# prefix of the fields of a method's state in a file, which are in double precision
STATE = "state_"
_TENSORS = ("deformation_gradient", "stress")
# distances in spacings: below the first particles are the same, beyond the second there is no value
_SAME, _FAR = 1e-4, 2.0
# number of neighbours of an interpolation by dimension, and rows read at a time
_NEIGHBOURS, _ROWS = {1: 4, 2: 12, 3: 32}, 1_000_000
# relative tolerance on times
_ROUND_OFF = 1e-9
# file with positions and velocities of rigid tools at the times of a state
TOOLS = "tools.json"


def tools_at(folder: Path, time: float | None) -> dict[str, Any]:
    """States of the tools of a run by name at a time [s] of its fields (default: the last); empty without tools or
    states."""
    try:
        found = json.loads((folder / TOOLS).read_text(encoding="utf-8"))
        times, tools = np.array(found["times"]), found["tools"]
    except (OSError, ValueError, KeyError):
        return {}
    if not len(times):
        return {}
    nearest = -1 if time is None else int(np.argmin(np.abs(times - time)))
    off = 0.0 if time is None else abs(times[nearest] - time)
    return dict(tools[nearest]) if off <= _ROUND_OFF * times[-1] else {}


@dataclass(frozen=True)
class StepOfResults:
    """One step of a file of fields: rows from `first` on (of constant fields from 0 on); names: field -> number of
    components."""

    path: Path
    first: int
    count: int
    time: float
    names: dict[str, int]


def methods_of(folder: Path) -> list[str]:
    """Kinds of the methods of the run in a folder; empty if they cannot be read."""
    try:
        tables = tomllib.loads((folder / "scene.toml").read_text(encoding="utf-8"))
        stated = tables.get("methods") or [tables["method"]]
        return [one["kind"] for one in (stated.values() if isinstance(stated, dict) else stated)]
    except (OSError, ValueError, KeyError, TypeError):
        return []


def steps_of(folder: Path, time: float | None) -> list[StepOfResults]:
    """The step of every file of fields in a folder at a time [s] (default: the last).

    Raises ValueError with the known times if there is none.
    """
    import h5py

    found: dict[Path, tuple[int, np.ndarray, dict[str, int]]] = {}
    for path in sorted(folder.glob("fields*.vtkhdf")):
        with h5py.File(path, "r") as file:
            if "series" not in file:
                continue
            steps = file["VTKHDF/Steps"]
            names = {name: int(np.prod(data.shape[1:])) for name, data in file["VTKHDF/PointData"].items()}
            times = steps["Values"][: steps.attrs["NSteps"]]
            found[path] = int(file["VTKHDF/NumberOfPoints"][0]), times, names
    all_times = sorted({float(one) for _, times, _ in found.values() for one in times})
    if not all_times:
        raise ValueError("a folder with fields of a run")
    wanted = all_times[-1] if time is None else time
    result = []
    for path, (count, times, names) in found.items():
        here = np.flatnonzero(np.abs(times - wanted) <= _ROUND_OFF * max(abs(wanted), all_times[-1]))
        if len(here):
            result.append(StepOfResults(path, int(here[0]) * count, count, float(times[here[0]]), names))
    if not result:
        raise ValueError(f"a time of its fields ({', '.join(f'{one:.6g}' for one in all_times)})")
    return result


@dataclass
class PreviousField:
    """A field of results at a time, evaluated at reference positions like a formula; width: number of components of a
    field of a method's state, None for other fields."""

    steps: list[StepOfResults]
    name: str
    dimension: int
    width: int | None = None
    _box: tuple[np.ndarray, np.ndarray] | None = None
    _known: dict[str, np.ndarray] = field(default_factory=dict)
    _tree: Any = None

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of the value of a particle."""
        d = self.dimension
        if self.width is not None:
            return (self.width,)
        scalars: dict[str, tuple[int, ...]] = {"temperature": (), "plastic_strain": ()}
        return scalars.get(self.name, (d, d) if self.name in _TENSORS else (d,))

    def __len__(self) -> int:
        return int(np.prod(self.shape))

    def of_particles(self, points: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Rows (n, ...) of the file for the particles nearest to points (n, d) [m], and (n,) whether each is at its
        point."""
        if not len(points):
            return np.zeros((0, len(self))), np.ones(0, bool)
        self._read(points)
        values, spacing = self._known["values"], self._known["spacing"]
        distance, nearest = self._tree.query(points)
        found = nearest < len(values)
        nearest = np.where(found, nearest, 0) if len(values) else np.zeros(0, np.int64)
        return values[nearest], found & (distance <= _SAME * spacing[nearest])

    def evaluate(self, points: np.ndarray) -> np.ndarray:
        """Values (n, ...) at reference positions (n, d) [m]; nan far from all particles."""
        return self.components(points).reshape(len(points), *self.shape)

    def components(self, points: np.ndarray) -> np.ndarray:
        """Values (n, components) at reference positions (n, d) [m]; nan far from all particles."""
        d = self.dimension
        if not len(points):
            return np.zeros((0, len(self)))
        self._read(points)
        values, X, spacing = self._known["values"], self._known["X"], self._known["spacing"]
        result = np.full((len(points), len(self)), np.nan)
        count = min(_NEIGHBOURS[d] + 1, len(X))
        if count:
            distance, near = self._tree.query(points, k=range(1, count + 1))
            same = distance[:, 0] <= _SAME * spacing[near[:, 0]]
            result[same] = values[near[same, 0]]
            between = np.flatnonzero(~same & (distance[:, 0] <= _FAR * spacing[near[:, 0]]))
            # moving least squares of linear functions over neighbours of one body; weights vanish at the farthest one
            distance, near = distance[between], near[between]
            X, values, body = (self._known[name] for name in ("X", "values", "body"))
            weight = (1.0 - np.minimum(distance / distance[:, -1:], 1.0) ** 2) ** 2 + 1e-12
            weight *= body[near] == body[near[:, :1]]
            arms = (X[near] - points[between][:, None]) / distance[:, -1:, None]
            base = np.concatenate([np.ones((*near.shape, 1)), arms], axis=2)
            moment = np.einsum("nk,nki,nkj->nij", weight, base, base) + 1e-9 * np.eye(base.shape[2])
            right = np.einsum("nk,nki,nkc->nic", weight, base, values[near])
            result[between] = np.asarray(np.linalg.solve(moment, right)[:, 0])
        # positions have more digits in the file than displacements
        return result - points if self.name == "displacement" else result

    def _read(self, points: np.ndarray) -> None:
        """Read the particles near points, unless they have been read."""
        from scipy.spatial import cKDTree

        lower, upper = points.min(axis=0), points.max(axis=0)
        if self._box is not None and (lower >= self._box[0]).all() and (upper <= self._box[1]).all():
            return
        pieces = [piece for step in self.steps for piece in self._pieces(step, lower, upper)]
        self._known = {name: np.concatenate([piece[name] for piece in pieces]) for name in pieces[0]}
        self._tree = cKDTree(self._known["X"])
        wide = 0.01 * (self._known["spacing"].max(initial=0.0))
        self._box = lower - wide, upper + wide

    def _pieces(self, step: StepOfResults, lower: np.ndarray, upper: np.ndarray) -> list[dict[str, np.ndarray]]:
        import h5py

        d, result = self.dimension, []
        with h5py.File(step.path, "r") as file:
            data, places = file["VTKHDF/PointData"], file["VTKHDF/Points"]
            for low in range(0, step.count, _ROWS):
                high = min(low + _ROWS, step.count)
                here = slice(step.first + low, step.first + high)
                x, spacing = places[here, :d], data["volume"][low:high].astype(float) ** (1.0 / d)
                X = x - data["displacement"][here, :d]
                margin = 4.0 * spacing[:, None]
                inside = ((lower - margin <= X) & (upper + margin >= X)).all(axis=1)
                values = x if self.name == "displacement" else self._columns(data[self.name][here])
                kept = {"X": X, "values": values, "spacing": spacing, "body": data["body"][low:high]}
                result.append({name: rows[inside] for name, rows in kept.items()})
        return result

    def _columns(self, rows: np.ndarray) -> np.ndarray:
        """The components of rows of a file, in which vectors and tensors of 2-D are padded to 3-D."""
        d, count = self.dimension, len(self)
        whole = rows.reshape(len(rows), int(np.prod(rows.shape[1:])))
        if self.width is None:
            whole = whole.astype(float)
            if self.name in _TENSORS:
                whole = whole.reshape(-1, 3, 3)[:, :d, :d].reshape(-1, d * d)
        elif count == 4 and whole.shape[1] == 9:
            whole = whole[:, [0, 1, 3, 4]]
        return whole[:, :count]
