"""Numbers of runs beside published ones: what a study states of them, how they are read from histories, and verdicts.

A row is one number of one method: what is published with its scatter, what is computed with the bar of its resolutions,
and whether the two agree. Rows are what the report of a study, of verification and of validation are made of.
"""

import math
from collections.abc import Iterable, Mapping
from dataclasses import asdict, dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, model_validator

from parsolid.campaign.estimate import Series, spacing_bar
from parsolid.campaign.orders import order_in_spacing
from parsolid.scene.base_model import NotNegative, Positive, SceneModel, reject
from parsolid.scene.formulas import number_of
from parsolid.simulation.loop import FINISHED

# of the published value, within which a computed one agrees where the source gives no scatter
SHARE = 0.05
INSIDE, NEAR, OUTSIDE = "inside the bars", "within the tolerance", "outside"
UNRESOLVED, MISSING = "not resolved", "no value"
AS_STATED, NOT_AS_STATED, SHOWN = "as stated", "not as stated", "shown"
# verdicts of what agrees
AGREES = (INSIDE, NEAR, AS_STATED)

Take = Literal[
    "last",
    "first",
    "maximum",
    "minimum",
    "mean",
    "range",
    "frequency",
    "slope",
    "time_of_maximum",
    "time_of_minimum",
    "crossing",
    "at",
]


class Reading(SceneModel):
    """One number of a column of the history: its last value unless said otherwise.

    range: greatest less least; frequency: of crossings of the middle between both [1/s]; slope: least squares over
    `against`, the time unless given; crossing: the first time [s] at which it goes through `level`; at: at a `time`,
    linear between rows
    """

    column: str = Field(description="a column of history.csv")
    take: Take = Field("last", description="what is read of it")
    begin: NotNegative | None = Field(None, description="from when on [s], the start unless given")
    end: NotNegative | None = Field(None, description="until when [s], the end unless given")
    level: float | None = Field(None, description="of a crossing")
    time: NotNegative | None = Field(None, description="of a value at a time [s]")
    against: str | None = Field(None, description="of a slope: the column that it is over")

    @model_validator(mode="after")
    def _used(self) -> "Reading":
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
        """The columns of the history that it needs."""
        return [self.column] if self.against is None else [self.column, self.against]

    def value(self, history: Mapping[str, np.ndarray]) -> float:
        """The number that a history (column -> (n,)) gives. Raises ValueError where it gives none."""
        for name in self.columns:
            if name not in history:
                raise ValueError(f"no column {name}")
        times = history["time"]
        chosen = (times >= (-math.inf if self.begin is None else self.begin)) & (
            times <= (math.inf if self.end is None else self.end)
        )
        over = history[self.against] if self.against is not None else times
        # there is no tip of a crack before there is a crack
        chosen &= np.isfinite(history[self.column]) & np.isfinite(over)
        if not chosen.any():
            raise ValueError(f"no row of {self.column} in the span of time")
        place = self.level if self.time is None else self.time
        return float(_READ[self.take](times[chosen], history[self.column][chosen], over[chosen], place))


def _frequency(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    middle = 0.5 * (values.max() + values.min())
    below = values < middle
    periods = []
    for upwards in (True, False):
        here = np.nonzero((below[:-1] != below[1:]) & (below[:-1] == upwards))[0]
        if len(here) > 1:
            first, last = (_through(times, values, int(i), middle) for i in (here[0], here[-1]))
            periods.append((last - first) / (len(here) - 1))
    if not periods:
        raise ValueError("no whole period")
    return float(1.0 / np.mean(periods))


def _through(times: np.ndarray, values: np.ndarray, i: int, level: float) -> float:
    """When values go through a level between the rows i and i + 1."""
    return float(times[i] + (level - values[i]) / (values[i + 1] - values[i]) * (times[i + 1] - times[i]))


def _crossing(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    assert level is not None
    below = values < level
    here = np.nonzero(below[:-1] != below[1:])[0]
    if not len(here):
        raise ValueError(f"nothing goes through {level:g}")
    return _through(times, values, int(here[0]), level)


def _slope(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    if np.ptp(over) <= 0.0:
        raise ValueError("a slope over one place")
    return float(np.polyfit(over - over.mean(), values, 1)[0])


def _peak(times: np.ndarray, values: np.ndarray) -> float:
    """When values are greatest: of the parabola through the greatest and the rows beside it."""
    i = int(np.argmax(values))
    if i in (0, len(values) - 1):
        return float(times[i])
    rows = slice(i - 1, i + 2)
    a, b, _ = np.polyfit(times[rows] - times[i], values[rows] - values[i], 2)
    return float(times[i] - 0.5 * b / a) if a < 0.0 else float(times[i])


def _mean(times: np.ndarray, values: np.ndarray, over: np.ndarray, level: float | None) -> float:
    span = times[-1] - times[0]
    return float(np.trapezoid(values, times) / span) if span > 0.0 else float(values.mean())


# take -> number of times, values, `against` (n,) each and a level or a time
_READ: dict[str, Any] = {
    "last": lambda t, v, x, level: v[-1],
    "first": lambda t, v, x, level: v[0],
    "maximum": lambda t, v, x, level: v.max(),
    "minimum": lambda t, v, x, level: v.min(),
    "mean": _mean,
    "range": lambda t, v, x, level: v.max() - v.min(),
    "frequency": _frequency,
    "slope": _slope,
    "time_of_maximum": lambda t, v, x, level: _peak(t, v),
    "time_of_minimum": lambda t, v, x, level: _peak(t, -v),
    "crossing": _crossing,
    "at": lambda t, v, x, time: np.interp(time, t, v),
}


class Comparison(SceneModel):
    """A published number, and how runs of a study compute it.

    value        that is published, exact or of another code; scatter: how far it may be off, by the source
    tolerance    share of the value (of 1 where it is 0) within which a run agrees where there is no scatter
    series       names of the series that compute it, all unless given
    formula      of the readings' names; the one reading unless given
    order        known order of the spacing for the bar; that of the method unless given
    cause        why runs do not agree, where that is known: they are then told but not counted as faults
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
    def _sound(self) -> "Comparison":
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
        """The columns of the history that it needs."""
        return list(dict.fromkeys(name for one in self.readings.values() for name in one.columns))

    @property
    def allowed(self) -> float:
        """How far a run may be off where the source gives no scatter, in the unit of the value."""
        return (self.tolerance or SHARE) * (abs(self.value) or 1.0)

    @property
    def widest(self) -> float:
        """The widest bar of a run that can show a disagreement, in the unit of the value."""
        return max(self.scatter or 0.0, self.allowed)

    def computed(self, history: Mapping[str, np.ndarray]) -> float:
        """The number of a run. Raises ValueError where its history does not give it."""
        found = {name: one.value(history) for name, one in self.readings.items()}
        value = number_of(self.formula, found) if self.formula is not None else next(iter(found.values()))
        if not math.isfinite(value):
            raise ValueError("it is not finite")
        return value

    def verdict(self, computed: float, bar: float | None) -> str:
        """Whether a computed number agrees with the published one, where its bar is narrow enough to tell."""
        miss, bar = abs(computed - self.value), bar or 0.0
        near = self.scatter is None and miss <= self.allowed
        inside = miss <= (self.scatter or 0.0) + bar
        if not (inside or near):
            return OUTSIDE
        if bar > self.widest:
            return UNRESOLVED
        return INSIDE if inside else NEAR


@dataclass
class Resolution:
    """One resolution of a row: value and processor seconds."""

    label: str
    spacing: float | None
    particles: int
    steps: int
    core_seconds: float
    processor_seconds: float
    value: float | None

    @classmethod
    def of(cls, case: Any, value: float | None) -> "Resolution":
        """Of a case that has been run."""
        label, record = case.labels.get(case.resolution_axis, ""), case.record
        costs = record.core_seconds, record.seconds
        return cls(label, case.spacing, record.particles, record.steps, *costs, value)


@dataclass
class Row:
    """One line of a report; numbers are None where there is none.

    error: of the computed number over the published one, or a relative error against an exact solution; tolerance: of
    it; remark: the stated cause of a difference; reason: why there is no number, or why it tells nothing; line: the
    runs' name in pictures; levels: from coarse to fine, of a row without a published number those of its error
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
        """Whether it agrees; None where nothing is asked of it."""
        return None if self.verdict == SHOWN else self.verdict in AGREES

    @property
    def faulty(self) -> bool:
        """Whether it disagrees and nobody has said why, or has no number; what is not resolved does not disagree."""
        return self.verdict == MISSING or (self.agrees is False and self.verdict != UNRESOLVED and not self.remark)

    def errors(self) -> list[tuple[float, float]]:
        """Processor seconds and |error| of its levels that have both."""
        scale, away = abs(self.reference or 0.0) or 1.0, self.reference or 0.0
        return [
            (one.processor_seconds, abs(one.value - away) / scale)
            for one in self.levels
            if one.value is not None and one.processor_seconds > 0.0 and one.value != away
        ]

    @classmethod
    def of(cls, stated: Mapping[str, Any]) -> "Row":
        """From what `as_stated` gave. Raises TypeError, KeyError for something else."""
        return cls(**{**stated, "levels": [Resolution(**one) for one in stated["levels"]]})

    def as_stated(self) -> dict[str, Any]:
        """Plain tables and numbers."""
        return asdict(self)


def rows_of_comparison(title: str, stated: Comparison, lines: Iterable[list[Any]]) -> list[Row]:
    """A row of each line of cases that have been run, coarse to fine, of those that compute a comparison."""
    return [
        _row(title, stated, line) for line in lines if stated.series is None or line[0].series.name in stated.series
    ]


def _row(title: str, stated: Comparison, line: list[Any]) -> Row:
    row = Row(title, ", ".join(line[-1].line), stated.quantity, stated.unit, stated.value, stated.scatter)
    row.source, row.remark, row.line = stated.source, stated.cause or "", row.method
    row.tolerance = stated.allowed if stated.scatter is None else None
    reasons = list[str]()
    for case in line:
        value, record = None, case.record
        if record.status == FINISHED:
            try:
                value = stated.computed(record.history)
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
    row.bar, row.order = _bar(stated, line[-1].scene, row.levels)
    row.error = (row.computed - stated.value) / (abs(stated.value) or 1.0)
    row.verdict = stated.verdict(row.computed, row.bar)
    if row.verdict == UNRESOLVED:
        values = ", ".join("none" if one.value is None else f"{one.value:.4g}" for one in row.levels)
        row.reason = f"the bar, {row.bar:.2g}, is wider than {stated.widest:.2g}; from coarse to fine: {values}"
    return row


def _bar(stated: Comparison, scene: Any, levels: list[Resolution]) -> tuple[float | None, float | None]:
    """The bar of the finest number by the three finest, and the order observed; None with one of them alone."""
    known = [(one.spacing, one.value) for one in reversed(levels) if one.spacing and one.value is not None][:3]
    if len(known) < 2:
        return None, None
    spacings, values = (np.array(column, float) for column in zip(*known))
    order = stated.order or min(order_in_spacing(name, scene) for name in stated.columns)
    found = spacing_bar(Series(np.zeros(1), values[:, None], spacings / spacings[0]), order, 1.0)
    return float(found.error[0]), found.order
