"""Comparisons of computed with published values: the tables of a study, readings of histories, verdicts.

A row holds one quantity of one method: the published value with its scatter, the computed value with the error bar of
its resolutions, and a verdict. The reports of studies, verification and validation consist of rows.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from parsolid.campaign.estimate import Series, spacing_bar
from parsolid.campaign.orders import order_in_spacing
from parsolid.scene.base_model import NotNegative, Positive, SceneModel, reject
from parsolid.scene.formulas import number_of
from parsolid.simulation.loop import FINISHED

# default tolerance, as a share of the published value, where the source gives no scatter
SHARE = 0.05
INSIDE, NEAR, OUTSIDE = "inside the bars", "within the tolerance", "outside"
UNRESOLVED, MISSING = "not resolved", "no value"
AS_STATED, NOT_AS_STATED, SHOWN = "as stated", "not as stated", "shown"
# verdicts of rows that agree
AGREES = (INSIDE, NEAR, AS_STATED)


def _frequency(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    middle = 0.5 * (values.max() + values.min())
    below = values < middle
    periods = []
    for upwards in (True, False):
        here = np.nonzero((below[:-1] != below[1:]) & (below[:-1] == upwards))[0]
        if len(here) > 1:
            first, last = (_crossing_time(times, values, int(i), middle) for i in (here[0], here[-1]))
            periods.append((last - first) / (len(here) - 1))
    if not periods:
        raise ValueError("no whole period")
    return float(1.0 / np.mean(periods))


def _crossing_time(times: np.ndarray, values: np.ndarray, i: int, level: float) -> float:
    """Time at which values reach a level between the rows i and i + 1, by linear interpolation."""
    return float(times[i] + (level - values[i]) / (values[i + 1] - values[i]) * (times[i + 1] - times[i]))


def _crossing(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    assert level is not None
    below = values < level
    here = np.nonzero(below[:-1] != below[1:])[0]
    if not len(here):
        raise ValueError(f"nothing goes through {level:g}")
    return _crossing_time(times, values, int(here[0]), level)


def _slope(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    if np.ptp(over) <= 0.0:
        raise ValueError("no slope: all abscissae are equal")
    return float(np.polyfit(over - over.mean(), values, 1)[0])


def _time_of_maximum(times: np.ndarray, values: np.ndarray) -> float:
    """Time of the maximum of the parabola through the largest value and its two neighbours."""
    i = int(np.argmax(values))
    if i in (0, len(values) - 1):
        return float(times[i])
    rows = slice(i - 1, i + 2)
    a, b, _ = np.polyfit(times[rows] - times[i], values[rows] - values[i], 2)
    return float(times[i] - 0.5 * b / a) if a < 0.0 else float(times[i])


def _mean(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    span = times[-1] - times[0]
    return float(np.trapezoid(values, times) / span) if span > 0.0 else float(values.mean())


# take -> function of times, values, abscissae (n,) each, and the level or time of the reading
_READERS: dict[str, Any] = {
    "last": lambda t, v, x, level: v[-1],
    "first": lambda t, v, x, level: v[0],
    "maximum": lambda t, v, x, level: v.max(),
    "minimum": lambda t, v, x, level: v.min(),
    "mean": _mean,
    "range": lambda t, v, x, level: v.max() - v.min(),
    "frequency": _frequency,
    "slope": _slope,
    "time_of_maximum": lambda t, v, x, level: _time_of_maximum(t, v),
    "time_of_minimum": lambda t, v, x, level: _time_of_maximum(t, -v),
    "crossing": _crossing,
    "at": lambda t, v, x, time: np.interp(time, t, v),
}

Take: Any = Literal[tuple(_READERS)]


class Reading(SceneModel):
    """A number read from a column of the history; `take` says how.

    range: maximum minus minimum; frequency [1/s]: from crossings of the middle between both; slope: least squares over
    the column `against` (default: time); crossing: first time [s] at which the column reaches `level`; at: value at
    `time`, linear between rows; time_of_maximum, time_of_minimum [s]: of the parabola through three rows
    """

    column: str = Field(description="a column of history.csv")
    take: Take = Field("last", description="what is read of it")
    begin: NotNegative | None = Field(None, description="from when on [s], the start unless given")
    end: NotNegative | None = Field(None, description="until when [s], the end unless given")
    level: float | None = Field(None, description="of a crossing")
    time: NotNegative | None = Field(None, description="of a value at a time [s]")
    against: str | None = Field(None, description="of a slope: the column that it is over")

    @model_validator(mode="after")
    def _keys_match_take(self) -> "Reading":
        details: list[Any] = []
        for key, take in (("level", "crossing"), ("time", "at")):
            if (getattr(self, key) is None) == (self.take == take):
                expected = f"a number with take = {take!r}" if self.take == take else f"no such key but with {take!r}"
                details.append(((key,), expected, getattr(self, key)))
        if self.against is not None and self.take != "slope":
            details.append((("against",), "no such key but with take = 'slope'", self.against))
        if self.begin is not None and self.end is not None and not self.end > self.begin:
            details.append((("end",), f"a time after begin = {self.begin:g}", self.end))
        reject(*details)
        return self

    @property
    def columns(self) -> list[str]:
        """Columns of the history that are read."""
        return [self.column] if self.against is None else [self.column, self.against]

    def value(self, history: Mapping[str, np.ndarray]) -> float:
        """The number in a history (column -> values (n,)). Raises ValueError if the history does not give one."""
        for name in self.columns:
            if name not in history:
                raise ValueError(f"no column {name}")
        times, values = history["time"], history[self.column]
        over = history[self.against] if self.against is not None else times
        # the column of a crack tip is nan before there is a crack
        rows = np.isfinite(values) & np.isfinite(over)
        if self.begin is not None:
            rows &= times >= self.begin
        if self.end is not None:
            rows &= times <= self.end
        if not rows.any():
            raise ValueError(f"no row of {self.column} in the span of time")
        argument = self.level if self.time is None else self.time
        return float(_READERS[self.take](times[rows], values[rows], over[rows], argument))


class Comparison(SceneModel):
    """A published value, and how the runs of a study compute it.

    value        published, exact or of another code; scatter: its uncertainty as the source gives it
    tolerance    relative difference (absolute if the value is 0) within which a run agrees if there is no scatter
    series       names of the series that compute it (default: all)
    formula      of the names of the readings (default: the single reading)
    order        known order in the spacing, for the error bar (default: that of the method)
    cause        known cause of a disagreement: it is then reported, but does not count as a fault
    """

    quantity: Annotated[str, Field(min_length=1, description="what is compared, in words")]
    unit: str = Field("", description="of the value")
    value: float = Field(description="what is published")
    scatter: NotNegative | None = Field(None, description="half of the range of the published value, in its unit")
    tolerance: Positive | None = Field(None, description="share of the value that runs may be off, 0.05 unless given")
    source: Annotated[str, Field(min_length=1, description="author, year, table or figure")]
    readings: Annotated[dict[str, Reading], Field(min_length=1)] = Field(description="numbers of the history by name")
    formula: str | None = Field(None, description="of the names of readings")
    series: list[str] | None = Field(None, description="names of series")
    order: Positive | None = Field(None, description="of the spacing, for the bar")
    cause: str | None = Field(None, description="why runs do not agree")

    @model_validator(mode="after")
    def _consistent(self) -> "Comparison":
        details: list[Any] = []
        if self.formula is None and len(self.readings) > 1:
            details.append((("formula",), f"a formula of {', '.join(self.readings)}", None))
        if self.scatter is not None and self.tolerance is not None:
            details.append((("tolerance",), "no such key beside scatter", self.tolerance))
        if self.value == 0.0 and self.scatter is None and self.tolerance is None:
            details.append((("value",), "scatter or tolerance where it is 0", self.value))
        if self.formula is not None:
            try:
                number_of(self.formula, dict.fromkeys(self.readings, 1.0))
            except ValueError as error:
                details.append((("formula",), f"a formula of {', '.join(self.readings)}: {error}", self.formula))
        reject(*details)
        return self

    @property
    def columns(self) -> list[str]:
        """Columns of the history that are read."""
        return list(dict.fromkeys(name for reading in self.readings.values() for name in reading.columns))

    @property
    def allowed(self) -> float:
        """The tolerance in the unit of the value, used where the source gives no scatter."""
        return (self.tolerance or SHARE) * (abs(self.value) or 1.0)

    @property
    def widest(self) -> float:
        """The widest error bar with which a run counts as resolved, in the unit of the value."""
        return max(self.scatter or 0.0, self.allowed)

    def computed(self, history: Mapping[str, np.ndarray]) -> float:
        """The computed value of a run. Raises ValueError if its history does not give one."""
        readings = {name: reading.value(history) for name, reading in self.readings.items()}
        value = number_of(self.formula, readings) if self.formula is not None else next(iter(readings.values()))
        if not math.isfinite(value):
            raise ValueError("it is not finite")
        return value

    def verdict(self, computed: float, bar: float | None) -> str:
        """The verdict on a computed value with an error bar; UNRESOLVED if the bar is too wide to show a difference."""
        difference, bar = abs(computed - self.value), bar or 0.0
        near = self.scatter is None and difference <= self.allowed
        inside = difference <= (self.scatter or 0.0) + bar
        if not (inside or near):
            return OUTSIDE
        if bar > self.widest:
            return UNRESOLVED
        return INSIDE if inside else NEAR


@dataclass
class Resolution:
    """One resolution of a row: the value and its costs."""

    label: str
    spacing: float | None
    particles: int
    steps: int
    core_seconds: float
    processor_seconds: float
    value: float | None

    @classmethod
    def of(cls, case: Any, value: float | None) -> "Resolution":
        """From a case that has been run."""
        label, record = case.labels.get(case.resolution_axis, ""), case.record
        costs = record.core_seconds, record.seconds
        return cls(label, case.spacing, record.particles, record.steps, *costs, value)


@dataclass
class Row:
    """One line of a report; a number that does not exist is None.

    reference, scatter: published; computed, bar: of the finest run; error: relative difference of both, or the error
    against an exact solution; tolerance: allowed error; order: observed; remark: the stated cause of a disagreement;
    reason: why there is no value or no verdict; line: the name in pictures; levels: all resolutions, coarse to fine
    """

    case: str
    method: str
    quantity: str
    unit: str = ""
    reference: float | None = None
    scatter: float | None = None
    source: str = ""
    computed: float | None = None
    bar: float | None = None
    error: float | None = None
    tolerance: float | None = None
    order: float | None = None
    core_seconds: float | None = None
    verdict: str = SHOWN
    remark: str = ""
    reason: str = ""
    line: str = ""
    levels: list[Resolution] = field(default_factory=list)

    @property
    def agrees(self) -> bool | None:
        """Whether the row agrees; None if it has no verdict."""
        return None if self.verdict == SHOWN else self.verdict in AGREES

    @property
    def faulty(self) -> bool:
        """Whether the row has no value, or is resolved and disagrees without a stated cause."""
        return self.verdict == MISSING or (self.agrees is False and self.verdict != UNRESOLVED and not self.remark)

    def errors(self) -> list[tuple[float, float]]:
        """Processor seconds and relative |error| of each level that has both and an error that is not 0."""
        reference = self.reference or 0.0
        scale = abs(reference) or 1.0
        return [
            (level.processor_seconds, abs(level.value - reference) / scale)
            for level in self.levels
            if level.value is not None and level.processor_seconds > 0.0 and level.value != reference
        ]

    @classmethod
    def of(cls, table: Mapping[str, Any]) -> "Row":
        """From a table as `dataclasses.asdict` gives it. Raises TypeError or KeyError for another table."""
        row = cls(**table)
        row.levels = [Resolution(**level) for level in table["levels"]]
        return row


def rows_of_comparison(title: str, comparison: Comparison, lines: Iterable[list[Any]]) -> list[Row]:
    """A row for each line of cases, sorted from coarse to fine, of the series that compute a comparison."""
    series = comparison.series
    return [_row(title, comparison, line) for line in lines if series is None or line[0].series.name in series]


def _row(title: str, comparison: Comparison, line: list[Any]) -> Row:
    method = ", ".join(line[-1].line)
    row = Row(title, method, comparison.quantity, comparison.unit, comparison.value, comparison.scatter)
    row.source, row.remark, row.line = comparison.source, comparison.cause or "", method
    row.tolerance = comparison.allowed if comparison.scatter is None else None
    reasons = list[str]()
    for case in line:
        value, record = None, case.record
        if record.status == FINISHED:
            try:
                value = comparison.computed(record.history)
            except ValueError as error:
                reasons.append(f"{case.title}: {error}")
        else:
            reasons.append(f"{case.title}: {record.status}: {(record.message or '').partition(chr(10))[0]}")
        row.levels.append(Resolution.of(case, value))
    row.core_seconds = row.levels[-1].core_seconds
    row.computed = row.levels[-1].value
    if row.computed is None:
        row.verdict, row.reason = MISSING, "; ".join(reasons)
        return row
    row.bar, row.order = _bar(comparison, line[-1].scene, row.levels)
    row.error = (row.computed - comparison.value) / (abs(comparison.value) or 1.0)
    row.verdict = comparison.verdict(row.computed, row.bar)
    if row.verdict == UNRESOLVED:
        values = ", ".join("none" if level.value is None else f"{level.value:.4g}" for level in row.levels)
        row.reason = f"the bar, {row.bar:.2g}, is wider than {comparison.widest:.2g}; from coarse to fine: {values}"
    return row


def _bar(comparison: Comparison, scene: Any, levels: list[Resolution]) -> tuple[float | None, float | None]:
    """Error bar of the finest value from the three finest ones, and the observed order; None with fewer than two."""
    finest = [level for level in reversed(levels) if level.spacing and level.value is not None][:3]
    if len(finest) < 2:
        return None, None
    spacings = np.array([level.spacing for level in finest], float)
    values = np.array([level.value for level in finest], float)
    order = comparison.order or min(order_in_spacing(name, scene) for name in comparison.columns)
    bar = spacing_bar(Series(np.zeros(1), values[:, None], spacings / spacings[0]), order, 1.0)
    return float(bar.error[0]), bar.order
