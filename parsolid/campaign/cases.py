"""The tables of a study file, and the single runs of a study with their overrides, ranks and folders."""

import hashlib
import itertools
import json
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from parsolid.campaign.comparison import Comparison
from parsolid.campaign.measures import MEASURES, measures_of
from parsolid.campaign.records import FINAL_STATUSES, Record
from parsolid.campaign.subprocess_runs import SubprocessRun
from parsolid.campaign.variants import digest_of
from parsolid.exact import SOLUTIONS
from parsolid.materials.declaration import Phrase
from parsolid.particles.fillings import filling_of
from parsolid.scene import Scene, SceneError, load_scene
from parsolid.scene.base_model import Positive, SceneModel, faults_of_errors, reject
from parsolid.scene.raw_tables import read_tables, toml_value
from parsolid.scene.shapes import ExistingFile
from parsolid.scene.validation_errors import suggestion
from parsolid.simulation.history import history_columns
from parsolid.sources import source_digest

Expected = Literal["stable", "failure", "refused"]
Override = Annotated[str, Field(pattern=r"^\s*[^=\s]+\s*=", description="key.path=value, as --set takes it")]
Ranks = Annotated[int, Field(ge=1)]


class Demands(SceneModel):
    """What a run must show; a setting overrides its series.

    expect      "stable": the run finishes with finite numbers; "failure": exit status 3, one message, finite numbers in
                its files; "refused": exit status 2 before anything is computed
    shows       the expectation in words, for the table
    bounds      largest allowed value of a measure or an error, by name
    other_code  errors and processor_seconds of another code, by name
    """

    expect: Expected | None = None
    shows: str | None = None
    bounds: dict[str, float] = {}
    other_code: dict[str, Positive] = {}


class Setting(Demands):
    """One value on an axis: its label and what it changes."""

    label: Annotated[str, Field(min_length=1, description="a name for the table")]
    set: list[Override] = []
    spacing: Positive | None = Field(None, description="the particle spacing [m], for observed orders and the picture")
    ranks: Ranks | None = None


class Axis(SceneModel):
    """An axis of variation: `settings`, or a `key` of the scene with its `values`, or numbers of `ranks`."""

    exactly_one: ClassVar = (("settings", "key", "ranks"),)
    name: str | None = Field(None, description="the heading of its column (default: the key, or ranks)")
    settings: Annotated[list[Setting], Field(min_length=1)] | None = None
    key: str | None = None
    values: Annotated[list[Any], Field(min_length=1)] | None = None
    ranks: Annotated[list[Ranks], Field(min_length=1)] | None = None

    @model_validator(mode="after")
    def _consistent(self) -> "Axis":
        if (self.key is None) != (self.values is None):
            reject(((), "key with values", Phrase("one of them")))
        labels = [place.label for place in self.places]
        repeated = [(i, label) for i, label in enumerate(labels) if label in labels[:i]]
        key = "settings" if self.settings is not None else "values" if self.values is not None else "ranks"
        reject(*(((key, i), "something that is not there yet", label) for i, label in repeated))
        return self

    @property
    def title(self) -> str:
        """The heading of the axis."""
        return self.name or self.key or ("ranks" if self.ranks is not None else "setting")

    @property
    def places(self) -> list[Setting]:
        """The settings along the axis, in the order given."""
        if self.settings is not None:
            return self.settings
        if self.ranks is not None:
            return [Setting(label=str(ranks), ranks=ranks) for ranks in self.ranks]
        return [Setting(label=str(value), set=[f"{self.key}={toml_value(value)}"]) for value in self.values or ()]


class Series(Demands):
    """One scene varied along axes: all combinations of their settings, or the axes together (`combine = "zip"`).

    orders: least observed order between consecutive spacings, by the name of the error.
    """

    name: Annotated[str, Field(min_length=1, description="a name, for the tables and --only")]
    scene: ExistingFile = Field(description="the scene's file, relative to the study")
    set: list[Override] = []
    ranks: Ranks | None = None
    timeout: Positive | None = None
    axes: list[Axis] = []
    combine: Literal["product", "zip"] = "product"
    orders: dict[str, float] = {}

    @model_validator(mode="after")
    def _equal_lengths(self) -> "Series":
        lengths = [len(axis.places) for axis in self.axes]
        if self.combine == "zip" and len(set(lengths)) > 1:
            reject((("axes",), "axes of equal length with combine = 'zip'", lengths))
        return self


class Study(SceneModel):
    """A set of series and how to report on them; made by `load_study`.

    report      "accuracy": errors with observed orders, and pictures; "stability": exit, energy drift and steps
    timeout     wall time [s] after which a run is ended
    allowed     largest allowed ratio of an error to that of the other code
    errors      names of the errors to show, in this order (default: all)
    group       section and picture of the verification report that the study belongs to
    remark      remark for the verification report
    compared    published values and how runs compute them
    """

    title: str
    group: Annotated[str, Field(min_length=1)] = "verification"
    remark: str | None = None
    report: Literal["accuracy", "stability"] = "accuracy"
    ranks: Ranks = 1
    timeout: Positive = 3600.0
    allowed: Positive = 1.0
    errors: list[str] | None = None
    series: Annotated[list[Series], Field(min_length=1)] = Field(description="at least one series")
    compared: list[Comparison] = []

    @field_validator("series")
    @classmethod
    def _unique_names(cls, series: list[Series]) -> list[Series]:
        names = [one.name for one in series]
        reject(*(((i, "name"), "a name that no other series has", n) for i, n in enumerate(names) if n in names[:i]))
        return series

    @model_validator(mode="after")
    def _known_series(self) -> "Study":
        known, details = [series.name for series in self.series], list[Any]()
        for i, comparison in enumerate(self.compared):
            for j, name in enumerate(comparison.series or ()):
                if name not in known:
                    expected = f"one of {', '.join(known)}{suggestion(name, known)}"
                    details.append((("compared", i, "series", j), expected, name))
        reject(*details)
        return self


def load_study(path: str | Path) -> Study:
    """Read a study file; paths of scenes are relative to its folder. Raises SceneError with all faults."""
    path = Path(path)
    data = read_tables(path, "study")
    try:
        return Study.model_validate(data, context={"folder": str(path.resolve().parent), "dimension": None})
    except ValidationError as error:
        raise SceneError(dict.fromkeys(faults_of_errors(error))) from None


@dataclass
class Case:
    """One run of a study.

    labels: title of an axis -> label of the setting; resolution_axis: title of the axis with spacings; scene: None if
    refused; work: particles times an estimate of the steps; measures, faults, orders: filled in from the record
    """

    series: Series
    labels: dict[str, str]
    overrides: list[str]
    ranks: int
    timeout: float
    spacing: float | None
    resolution_axis: str | None
    expect: str | None
    shows: str | None
    bounds: dict[str, float]
    other_code: dict[str, float]
    trust_code: bool = False
    scene: Scene | None = None
    digest: str = ""
    particles: int = 0
    work: float = 0.0
    record: Record | None = None
    measures: dict[str, Any] = field(default_factory=dict)
    faults: list[str] = field(default_factory=list)
    orders: dict[str, float] = field(default_factory=dict)

    @property
    def title(self) -> str:
        """The series and labels of the run."""
        return ", ".join([self.series.name, *self.labels.values()])

    @property
    def line(self) -> tuple[str, ...]:
        """The series and all labels but that of the resolution: runs with one line form one curve of a picture."""
        return (self.series.name, *(label for axis, label in self.labels.items() if axis != self.resolution_axis))

    @property
    def folder_name(self) -> str:
        """The folder of the run: its title and its digest."""
        words = re.sub(r"[^a-z0-9.]+", "-", self.title.lower()).strip("-")
        return f"{words[:60].strip('-')}-{self.digest}"

    @property
    def subprocess_run(self) -> SubprocessRun:
        """The run of `parsolid` in a subprocess."""
        return SubprocessRun(self.title, self.arguments, self.ranks, self.timeout)

    def arguments(self, folder: Path) -> list[str]:
        """The arguments of `parsolid` that make the run."""
        overrides = [word for override in self.overrides for word in ("--set", override)]
        scene = min(self.series.scene, os.path.relpath(self.series.scene), key=len)
        return ["run", scene, "-o", str(folder), *overrides, *(["--trust-code"] if self.trust_code else [])]

    def set_record(self, record: Record | None) -> None:
        """Set the record of the run and the measures of a record with a final status."""
        self.record = record
        self.measures = measures_of(record) if record is not None and record.status in FINAL_STATUSES else {}

    def value(self, name: str) -> float | None:
        """An error or a measure of the run by name; None if the run has none of this name."""
        errors = self.measures.get("errors") or {}
        return errors[name] if name in errors else self.measures.get(name)

    @property
    def other_code_ratios(self) -> dict[str, float]:
        """Errors and costs of the run over those of the other code, by name; without those that the run lacks."""
        values = {name: self.value(name) for name in self.other_code}
        return {name: value / self.other_code[name] for name, value in values.items() if value is not None}


def cases_of(study: Study, trust_code: bool = False) -> list[Case]:
    """All runs of a study in its order, with their scenes; trust_code: scenes may import modules with laws.

    Raises SceneError with the faults of all scenes.
    """
    cases, faults = [], []
    for series in study.series:
        axes = [axis.places for axis in series.axes]
        for settings in zip(*axes) if series.combine == "zip" and axes else itertools.product(*axes):
            case = _case(study, series, settings)
            case.trust_code = trust_code
            faults += _read_scene(case)
            cases.append(case)
    for line in dict.fromkeys(case.line for case in cases if case.resolution_axis is not None):
        faults += _share_defaults([case for case in cases if case.line == line and case.scene is not None])
    faults += _unknown_names(study, cases)
    first = {case.digest: case.title for case in reversed(cases) if case.digest}
    faults += [
        f"{case.title}: expected a run that differs from the others, found the scene and ranks of {first[case.digest]}"
        for case in cases
        if case.digest and first[case.digest] != case.title
    ]
    if faults:
        raise SceneError(dict.fromkeys(faults))
    return cases


def _case(study: Study, series: Series, settings: tuple[Setting, ...]) -> Case:
    def first(name: str) -> Any:
        """The value of the first setting that has one, else that of the series."""
        values = [getattr(table, name) for table in (*settings, series)]
        return next((value for value in values if value is not None), None)

    resolution = next((i for i, setting in enumerate(settings) if setting.spacing is not None), None)
    case = Case(
        series=series,
        labels={axis.title: setting.label for axis, setting in zip(series.axes, settings)},
        overrides=[*series.set, *(override for setting in settings for override in setting.set)],
        ranks=first("ranks") or study.ranks,
        timeout=series.timeout or study.timeout,
        spacing=None if resolution is None else settings[resolution].spacing,
        resolution_axis=None if resolution is None else series.axes[resolution].title,
        expect=first("expect"),
        shows=first("shows"),
        bounds=dict(series.bounds),
        other_code=dict(series.other_code),
    )
    for setting in settings:
        case.bounds |= setting.bounds
        case.other_code |= setting.other_code
    return case


def _read_scene(case: Case) -> list[str]:
    """Read the scene of a case, and set digest, particles and work; its faults, unless it is expected to be refused."""
    try:
        case.scene = load_scene(case.series.scene, case.overrides, case.trust_code)
    except SceneError as error:
        if case.expect != "refused":
            return [f"{case.title}: {fault}" for fault in error.faults]
    if case.scene is None:
        scene_text = Path(case.series.scene).read_text(encoding="utf-8")
        text = json.dumps([scene_text, case.overrides, case.ranks, source_digest()])
        case.digest = hashlib.sha256(text.encode()).hexdigest()[:12]
    else:
        case.digest = digest_of(case.scene, case.ranks)
        dimension = case.scene.dimension
        case.particles = sum(filling_of(body, dimension).count for body in case.scene.bodies)
        # the number of steps grows as end_time / spacing
        case.work = float(case.particles) ** (1.0 + 1.0 / dimension) * case.scene.end_time
    return []


def _share_defaults(line: list[Case]) -> list[str]:
    """Give all runs of a line the defaults of the finest one, since defaults may depend on the resolution.

    Returns the faults of the scenes with them.
    """
    faults: list[str] = []
    finest: Any = max(line, key=lambda case: case.particles).scene if line else None
    for case in line:
        scene: Any = case.scene
        overrides: list[str] = []
        for own, fine in zip(scene.systems, finest.systems):
            own_defaults = own.settings.defaults_for(scene, own.bodies)
            fine_defaults = fine.settings.defaults_for(finest, fine.bodies)
            keys = own_defaults | fine_defaults if own_defaults != fine_defaults else {}
            if keys.keys() & (own.settings.model_fields_set | fine.settings.model_fields_set):
                # a scene states one of the keys itself
                continue
            table = ".".join(map(str, own.place))
            for key in keys:
                value = getattr(fine.settings, key)
                if value is not None:
                    overrides.append(f"{table}.{key}={toml_value(value)}")
        if overrides:
            case.overrides += overrides
            faults += _read_scene(case)
    return faults


def _unknown_names(study: Study, cases: list[Case]) -> list[str]:
    """Faults of names of errors, measures and columns in a study that no run has."""
    faults, all_errors = [], set()
    for case in cases:
        if case.scene is None:
            continue
        errors = error_names(case.scene)
        all_errors |= errors
        for key, names in (("bounds", case.bounds), ("other_code", case.other_code), ("orders", case.series.orders)):
            known = errors if key == "orders" else errors | set(MEASURES)
            faults += [
                f"{case.series.name}: {key}: expected one of {', '.join(sorted(known))}"
                f"{suggestion(name, known)}, found {name!r}"
                for name in names
                if name not in known
            ]
    for i, comparison in enumerate(study.compared):
        for case in cases:
            if case.scene is None or (comparison.series is not None and case.series.name not in comparison.series):
                continue
            columns = history_columns(case.scene)
            faults += [
                f"compared.{i}.readings: expected a column of {case.series.name}{suggestion(name, columns)}, "
                f"found {name!r}"
                for name in comparison.columns
                if name not in columns
            ]
    return faults + [
        f"errors: expected one of {', '.join(sorted(all_errors))}{suggestion(name, all_errors)}, found {name!r}"
        for name in study.errors or ()
        if name not in all_errors
    ]


def error_names(scene: Any) -> set[str]:
    """Names of the errors that the summary.json of a scene's run holds."""
    reference = scene.reference
    if reference is None:
        return set()
    if reference.exact is None:
        return set(reference.columns or reference.final)
    solution: Any = SOLUTIONS[reference.exact]
    solution = solution.of_scene(scene)
    if reference.history:
        return set(solution.history_names())
    if reference.each_step:
        return {f"largest_{name}" for name in solution.scales}
    names = solution.error_names(scene.dimension)
    return {f"{name}@{time:.6g}" for name in names for time in reference.times if time <= scene.end_time}
