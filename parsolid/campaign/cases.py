"""What a study may say, and its single runs: overrides, ranks, and a folder named by a digest."""

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
from parsolid.campaign.runner import MEASURES, Launched, Record
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
    """What a run must show; what a setting says goes before what its series says.

    expect      "stable": the run ends and no number is anything but finite; "failure": it ends with exit status 3, one
                message and no number in its files that is not finite; "refused": exit status 2 before anything is
                computed
    shows       the same in words, for the table
    bounds      largest allowed value of a measure or an error, by name
    other_code  what another code reached: errors, processor_seconds
    """

    expect: Expected | None = None
    shows: str | None = None
    bounds: dict[str, float] = {}
    other_code: dict[str, Positive] = {}


class Setting(Demands):
    """One place on an axis: what it is called and what it changes."""

    label: Annotated[str, Field(min_length=1, description="a name for the table")]
    set: list[Override] = []
    spacing: Positive | None = Field(None, description="the particle spacing [m], for observed orders and the picture")
    ranks: Ranks | None = None


class Axis(SceneModel):
    """Something that varies: `settings`, or a `key` of the scene with its `values`, or numbers of `ranks`."""

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
        """The places along the axis, in the order given."""
        if self.settings is not None:
            return self.settings
        if self.ranks is not None:
            return [Setting(label=str(ranks), ranks=ranks) for ranks in self.ranks]
        return [Setting(label=str(value), set=[f"{self.key}={toml_value(value)}"]) for value in self.values or ()]


class Series(Demands):
    """One scene, varied along its axes: every combination of their places, or all axes in step (`combine = "zip"`).

    orders: least observed order of an error between consecutive spacings, by the error's name.
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
    def _in_step(self) -> "Series":
        lengths = [len(axis.places) for axis in self.axes]
        if self.combine == "zip" and len(set(lengths)) > 1:
            reject((("axes",), "axes of equal length with combine = 'zip'", lengths))
        return self


class Study(SceneModel):
    """A set of series and how to report on them; made by `load_study`.

    report      "accuracy": errors with observed orders, and pictures; "stability": how each run ended, energy drift,
    steps
    timeout     wall time [s] after which a run is ended
    allowed     errors may be so many times those of the other code
    errors      names of the errors to show, in this order (default: all)
    group       the section of a report of several studies, and the picture, that its comparisons are in
    remark      what else a reader of that report is to know
    compared    published numbers and how runs compute them
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
    def _told_apart(cls, series: list[Series]) -> list[Series]:
        names = [one.name for one in series]
        reject(*(((i, "name"), "a name that no other series has", n) for i, n in enumerate(names) if n in names[:i]))
        return series

    @model_validator(mode="after")
    def _known_series(self) -> "Study":
        known = [one.name for one in self.series]
        wrong = [(i, j, name) for i, one in enumerate(self.compared) for j, name in enumerate(one.series or ())]
        reject(
            *(
                (("compared", i, "series", j), f"one of {', '.join(known)}{suggestion(name, known)}", name)
                for i, j, name in wrong
                if name not in known
            )
        )
        return self


def load_study(path: str | Path) -> Study:
    """Read a study; scenes are relative to its folder. Raises SceneError with every fault."""
    path = Path(path)
    data = read_tables(path, "study")
    try:
        return Study.model_validate(data, context={"folder": str(path.resolve().parent), "dimension": None})
    except ValidationError as error:
        raise SceneError(dict.fromkeys(faults_of_errors(error))) from None


@dataclass
class Case:
    """One run of a study. `labels`: axis title -> label; `scene` is None where the scene is refused, as expected."""

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
        """What the run is called: series and labels."""
        return ", ".join([self.series.name, *self.labels.values()])

    @property
    def line(self) -> tuple[str, ...]:
        """What the runs of one line of a picture share: the series and all labels but the resolution's."""
        others = (label for axis, label in self.labels.items() if axis != self.resolution_axis)
        return (self.series.name, *others)

    @property
    def folder_name(self) -> str:
        """The folder of the run: words for the eye, the digest for the rest."""
        words = re.sub(r"[^a-z0-9.]+", "-", self.title.lower()).strip("-")
        return f"{words[:60].strip('-')}-{self.digest}"

    @property
    def launched(self) -> Launched:
        """The run as a program of its own."""
        return Launched(self.title, self.arguments, self.ranks, self.timeout)

    def arguments(self, folder: Path) -> list[str]:
        """The arguments of `parsolid` that make the run."""
        overrides = [word for override in self.overrides for word in ("--set", override)]
        scene = min(self.series.scene, os.path.relpath(self.series.scene), key=len)
        return ["run", scene, "-o", str(folder), *overrides, *(["--trust-code"] if self.trust_code else [])]

    def value(self, name: str) -> float | None:
        """A measure or an error of the run."""
        errors = self.measures.get("errors") or {}
        return errors[name] if name in errors else self.measures.get(name)

    @property
    def other_code_ratios(self) -> dict[str, float]:
        """What the run has over what the other code reached, by name; without what the run has not."""
        values = {name: self.value(name) for name in self.other_code}
        return {name: value / self.other_code[name] for name, value in values.items() if value is not None}


def cases_of(study: Study, trust_code: bool = False) -> list[Case]:
    """All runs of a study in its order, their scenes read, with the laws they name where these are trusted.

    Raises SceneError with the faults of all scenes.
    """
    cases, faults = [], []
    for series in study.series:
        axes = [axis.places for axis in series.axes]
        for places in zip(*axes) if series.combine == "zip" and axes else itertools.product(*axes):
            case = _case(study, series, places)
            case.trust_code = trust_code
            faults += _complete(case)
            cases.append(case)
    for line in dict.fromkeys(case.line for case in cases if case.resolution_axis is not None):
        faults += _alike([case for case in cases if case.line == line and case.scene is not None])
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


def _case(study: Study, series: Series, places: tuple[Setting, ...]) -> Case:
    def chosen(name: str) -> Any:
        return next((value for place in (*places, series) if (value := getattr(place, name)) is not None), None)

    resolution = next((i for i, place in enumerate(places) if place.spacing is not None), None)
    ranks = next((place.ranks for place in places if place.ranks is not None), None)
    return Case(
        series=series,
        labels={axis.title: place.label for axis, place in zip(series.axes, places)},
        overrides=[*series.set, *(override for place in places for override in place.set)],
        ranks=ranks or series.ranks or study.ranks,
        timeout=series.timeout or study.timeout,
        spacing=None if resolution is None else places[resolution].spacing,
        resolution_axis=None if resolution is None else series.axes[resolution].title,
        expect=chosen("expect"),
        shows=chosen("shows"),
        bounds=series.bounds | {name: bound for place in places for name, bound in place.bounds.items()},
        other_code=series.other_code | {name: value for place in places for name, value in place.other_code.items()},
    )


def _complete(case: Case) -> list[str]:
    """Read a case's scene; the faults of one that is not expected to have any."""
    try:
        case.scene = load_scene(case.series.scene, case.overrides, case.trust_code)
    except SceneError as error:
        if case.expect != "refused":
            return [f"{case.title}: {fault}" for fault in error.faults]
    if case.scene is None:
        # what is refused has no scene but its text
        stated = Path(case.series.scene).read_text(encoding="utf-8")
        text = json.dumps([stated, case.overrides, case.ranks, source_digest()])
        case.digest = hashlib.sha256(text.encode()).hexdigest()[:12]
    else:
        case.digest = digest_of(case.scene, case.ranks)
        dimension = case.scene.dimension
        case.particles = sum(filling_of(body, dimension).count for body in case.scene.bodies)
        # steps become as many more as particles come closer, and as the simulated time is longer
        case.work = float(case.particles) ** (1.0 + 1.0 / dimension) * case.scene.end_time
    return []


def _alike(line: list[Case]) -> list[str]:
    """Have runs that differ in resolution alone leave out the same: usual values may depend on how fine a scene is, and
    those of the finest are for all. The faults of scenes with them."""
    faults: list[str] = []
    finest: Any = max(line, key=lambda case: case.particles).scene if line else None
    for case in line:
        scene: Any = case.scene
        stated: list[str] = []
        for own, fine in zip(scene.systems, finest.systems):
            one, other = own.settings.defaults_for(scene, own.bodies), fine.settings.defaults_for(finest, fine.bodies)
            values = {key: getattr(fine.settings, key) for key in one | other} if one != other else {}
            if values.keys() & (own.settings.model_fields_set | fine.settings.model_fields_set):
                # one of them has its own
                continue
            place = ".".join(map(str, own.place))
            stated += [f"{place}.{key}={toml_value(value)}" for key, value in values.items() if value is not None]
        case.overrides += stated
        faults += _complete(case) if stated else []
    return faults


def _unknown_names(study: Study, cases: list[Case]) -> list[str]:
    """Names in bounds, other codes, orders and errors that no run will have."""
    faults, every = [], set()
    for case in cases:
        errors = error_names(case.scene)
        every |= errors
        for key, names in (("bounds", case.bounds), ("other_code", case.other_code), ("orders", case.series.orders)):
            wanted = errors | (set(MEASURES) if key != "orders" else set())
            faults += [
                f"{case.series.name}: {key}: expected one of {', '.join(sorted(wanted))}"
                f"{suggestion(name, wanted)}, found {name!r}"
                for name in names
                if name not in wanted and case.scene is not None
            ]
    # columns that comparisons read and a run's history will not have
    for i, one in enumerate(study.compared):
        for case in cases:
            if case.scene is None or (one.series is not None and case.series.name not in one.series):
                continue
            known = history_columns(case.scene)
            faults += [
                f"compared.{i}.readings: expected a column of {case.series.name}{suggestion(name, known)}, "
                f"found {name!r}"
                for name in one.columns
                if name not in known
            ]
    return faults + [
        f"errors: expected one of {', '.join(sorted(every))}{suggestion(name, every)}, found {name!r}"
        for name in study.errors or ()
        if name not in every
    ]


def error_names(scene: Any) -> set[str]:
    """Names of the errors that summary.json will hold; scene: None where it cannot be read."""
    reference = scene.reference if scene is not None else None
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
