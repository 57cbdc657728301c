"""Paths of the deformation gradient F(t), as a file states them and as the driver follows them; time in s.

A path may jump, or have a kink, at its breaks. There, `side` chooses the value just before (-1) or just after (+1).
"""

import csv
from functools import cached_property
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, PlainSerializer, PlainValidator, field_validator, model_validator
from scipy.interpolate import CubicSpline

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import NotNegative, Positive, SceneModel, reject
from parsolid.scene.formulas import FORMULA, Formula, formula_in
from parsolid.scene.probes import component_names
from parsolid.scene.shapes import ExistingFile
from parsolid.scene.validation_errors import suggestion

COMPONENTS = component_names("deformation_gradient", 3)
FREE = "free"


def _in_time(value: Any) -> Formula:
    return formula_in(value, ("t",))


def _in_time_or_free(value: Any) -> Formula | str:
    return FREE if value == FREE else _in_time(value)


_SOURCE = PlainSerializer(lambda formula: formula if isinstance(formula, str) else formula.source)
TimeFormula = Annotated[Any, PlainValidator(_in_time), _SOURCE, FORMULA]
TimeFormulaOrFree = Annotated[Any, PlainValidator(_in_time_or_free), _SOURCE, FORMULA]


class Path(SceneModel):
    """Base of paths: their breaks, and the diagonal components that are free, so that their stress vanishes."""

    breaks: list[NotNegative] = Field([], description="times at which the path may jump or have a kink [s]")

    @property
    def kinks(self) -> list[float]:
        """Times [s] between which the path is smooth."""
        return self.breaks

    @property
    def free(self) -> np.ndarray:
        """(3,) bool: which diagonal components of F are found from P_ii = 0."""
        return np.zeros(3, bool)

    @property
    def last_time(self) -> float:
        """Time [s] to which the path is given."""
        return np.inf

    def gradients(self, times: np.ndarray, sides: np.ndarray) -> np.ndarray:
        """F (n, 3, 3) at times (n,) [s], just before (side -1), at (0) or just after (+1) them.

        Free components are 1.
        """
        return self._at(np.where(sides == 0, times, np.nextafter(times, np.where(sides < 0, -np.inf, np.inf))))

    def _at(self, times: np.ndarray) -> np.ndarray:
        raise NotImplementedError


def _values(formula: Formula, times: np.ndarray) -> np.ndarray:
    evaluate: Any = formula.evaluate
    return evaluate(np.zeros((len(times), 3)), times)


def _diagonal(*components: np.ndarray) -> np.ndarray:
    return np.stack(components, axis=-1)[:, :, None] * np.eye(3)


class Uniaxial(Path):
    """F = diag(stretch, 1, 1), with lateral stretches that are fixed, or free so that the lateral stress vanishes."""

    kind: Literal["uniaxial"]
    stretch: TimeFormula = Field(description="a formula in t")
    lateral: Literal["free", "fixed"] = "free"

    @property
    def free(self) -> np.ndarray:
        return np.array([False, True, True]) if self.lateral == FREE else np.zeros(3, bool)

    def _at(self, times: Any) -> Any:
        one = np.ones(len(times))
        return _diagonal(_values(self.stretch, times), one, one)


class SimpleShear(Path):
    """F = I + shear e_x (x) e_y."""

    kind: Literal["simple-shear"]
    shear: TimeFormula = Field(description="a formula in t")

    def _at(self, times: Any) -> Any:
        result = np.tile(np.eye(3), (len(times), 1, 1))
        result[:, 0, 1] = _values(self.shear, times)
        return result


class CyclicShear(Path):
    """F = I + amplitude sin(2 pi t / period) e_x (x) e_y."""

    kind: Literal["cyclic-shear"]
    amplitude: float = Field(description="the greatest shear")
    period: Positive = Field(description="the period [s]")

    def _at(self, times: Any) -> Any:
        result = np.tile(np.eye(3), (len(times), 1, 1))
        result[:, 0, 1] = self.amplitude * np.sin(2.0 * np.pi * times / self.period)
        return result


class Isochoric(Path):
    """F = diag(s, s^-1/2, s^-1/2) of a stretch s, or planar diag(s, 1/s, 1)."""

    kind: Literal["isochoric"]
    stretch: TimeFormula = Field(description="a formula in t")
    planar: bool = False

    def _at(self, times: Any) -> Any:
        stretch = _values(self.stretch, times)
        if self.planar:
            return _diagonal(stretch, 1.0 / stretch, np.ones(len(times)))
        return _diagonal(stretch, stretch**-0.5, stretch**-0.5)


class Volumetric(Path):
    """F = J^(1/3) I of a Jacobian J."""

    kind: Literal["volumetric"]
    jacobian: TimeFormula = Field(description="a formula in t")

    def _at(self, times: Any) -> Any:
        return _diagonal(*3 * (np.cbrt(_values(self.jacobian, times)),))


class Formulas(Path):
    """F component by component, rows of formulas in t; "free" on the diagonal finds a component from P_ii = 0."""

    kind: Literal["formulas"]
    deformation_gradient: Annotated[
        list[Annotated[list[TimeFormulaOrFree], Field(min_length=3, max_length=3)]], Field(min_length=3, max_length=3)
    ] = Field(description="three rows of three formulas in t")

    @property
    def free(self) -> np.ndarray:
        return np.array([self.deformation_gradient[i][i] == FREE for i in range(3)])

    @field_validator("deformation_gradient")
    @classmethod
    def _free_on_diagonal(cls, rows: list[Any]) -> list[Any]:
        reject(
            *(
                ((i, j), "a formula in t (only the diagonal can be free)", FREE)
                for i in range(3)
                for j in range(3)
                if i != j and rows[i][j] == FREE
            )
        )
        return rows

    def _at(self, times: Any) -> Any:
        components = [
            [np.ones(len(times)) if f == FREE else _values(f, times) for f in row] for row in self.deformation_gradient
        ]
        return np.moveaxis(np.array(components), 2, 0)


class Table(Path):
    """F from rows of numbers: a CSV `file` or `rows` with `columns`; components that are missing are those of I.

    Columns are "time" and deformation_gradient_xx, _xy..., in a file after a `prefix`, so that the history of a probe
    or of an earlier point can be followed. Two rows with the same time are a jump. The interpolation is linear, cubic
    (a spline between jumps) or constant (each row until the next).
    """

    exactly_one: ClassVar = (("file", "rows"),)
    kind: Literal["table"]
    file: ExistingFile | None = None
    prefix: str = Field("", description="what stands before the names of the components, as in 'corner.'")
    columns: Annotated[list[str], Field(min_length=2)] | None = None
    rows: Annotated[list[list[float]], Field(min_length=1)] | None = None
    interpolation: Literal["linear", "cubic", "constant"] = "linear"

    @model_validator(mode="after")
    def _readable(self) -> "Table":
        if (self.rows is None) != (self.columns is None):
            reject(((), "rows with columns, or a file with its own", Phrase("one of each")))
        try:
            times, _ = self._series
        except _TableFault as error:
            reject((("file" if self.file else "rows",), error.expected, error.found))
        key, late = ("file" if self.file else "rows",), np.flatnonzero(np.diff(times) < 0.0)
        if times[0] > 0.0:
            reject((key, "a table that starts at time 0", Phrase(f"time {times[0]:g}")))
        if len(late):
            reject((key, "times that do not fall", Phrase(f"{times[late[0] + 1]:g} after {times[late[0]]:g}")))
        return self

    @property
    def last_time(self) -> float:
        return np.inf if self.interpolation == "constant" else float(self._series[0][-1])

    @property
    def kinks(self) -> list[float]:
        times = self._series[0]
        if self.interpolation == "cubic":
            times = times[1:][np.diff(times) == 0.0]
        return [*self.breaks, *np.unique(times[times >= 0.0]).tolist()]

    @cached_property
    def _series(self) -> tuple[np.ndarray, np.ndarray]:
        """Times (n,) and F (n, 9)."""
        stated: Any = (self.columns, self.rows) if self.file is None else _read(self.file)
        columns, rows = stated
        known = {self.prefix + name: position for position, name in enumerate(COMPONENTS)}
        if "time" not in columns:
            raise _TableFault("a column 'time'", Phrase(", ".join(columns)[:80]))
        if not set(known) & set(columns):
            near = suggestion(columns[-1], known)
            raise _TableFault(f"a column such as {next(iter(known))!r}{near}", Phrase(", ".join(columns)[-80:]))
        ragged = next((i for i, row in enumerate(rows) if len(row) != len(columns)), None)
        if ragged is not None:
            raise _TableFault(
                f"{len(columns)} numbers in every row", Phrase(f"{len(rows[ragged])} in row {ragged + 1}")
            )
        F = np.tile(np.eye(3).ravel(), (len(rows), 1))
        for j, name in enumerate(columns):
            if name in known:
                F[:, known[name]] = _numbers(rows, j, name)
        return _numbers(rows, columns.index("time"), "time"), F

    def _at(self, times: Any) -> Any:
        knots, F = self._series
        # numbers of the rows before the times, the first one for a time before all; of a jump the later one
        before = np.maximum(np.searchsorted(knots, times, side="right") - 1, 0)
        if self.interpolation == "constant":
            return F[before].reshape(-1, 3, 3)
        if self.interpolation == "linear":
            return np.stack([np.interp(times, knots, column) for column in F.T], axis=1).reshape(-1, 3, 3)
        result = F[before]
        # a spline between each two jumps, beyond the last row, too
        starts = np.flatnonzero(np.diff(knots, prepend=-np.inf) == 0.0)
        piece = np.searchsorted(starts, before, side="right")
        for number, (first, last) in enumerate(zip([0, *starts], [*starts, len(knots)])):
            here = piece == number
            if here.any() and last - first > 1:
                result[here] = CubicSpline(knots[first:last], F[first:last])(times[here])
        return result.reshape(-1, 3, 3)


class _TableFault(Exception):
    def __init__(self, expected: str, found: object) -> None:
        super().__init__(expected)
        self.expected, self.found = expected, found


def _read(path: str) -> tuple[list[str], list[list[str]]]:
    try:
        with open(path, newline="", encoding="utf-8") as file:
            columns, *rows = [row for row in csv.reader(file) if row]
    except (OSError, UnicodeDecodeError, ValueError, csv.Error) as error:
        raise _TableFault("a CSV file with a line of names and lines of numbers", Phrase(f"{path} ({error})")) from None
    if not rows:
        raise _TableFault("at least one row of numbers", Phrase(f"none in {path}"))
    return [name.strip() for name in columns], rows


def _numbers(rows: list[Any], column: int, name: str) -> np.ndarray:
    for i, row in enumerate(rows):
        try:
            finite = np.isfinite(float(row[column]))
        except ValueError:
            finite = False
        if not finite:
            raise _TableFault(f"finite numbers in the column {name!r}", Phrase(f"{row[column]!r} in row {i + 1}"))
    return np.array([float(row[column]) for row in rows])


AnyPath = Annotated[
    Uniaxial | SimpleShear | CyclicShear | Isochoric | Volumetric | Formulas | Table, Field(discriminator="kind")
]
