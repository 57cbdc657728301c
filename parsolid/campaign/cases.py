"""From a study to its single runs: overrides, ranks, and a folder named by a digest."""

import hashlib
import itertools
import json
import os
import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from parsolid.campaign.measures import MEASURES
from parsolid.campaign.runner import Launched, Record
from parsolid.campaign.study_file import Series, Setting, Study
from parsolid.campaign.variants import digest_of
from parsolid.exact import SOLUTIONS
from parsolid.particles.fillings import filling_of
from parsolid.scene import Scene, SceneError, load_scene
from parsolid.scene.raw_tables import toml_value
from parsolid.scene.validation_errors import suggestion
from parsolid.simulation.history import history_columns
from parsolid.sources import source_digest


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
            known = errors | (set(MEASURES) if key != "orders" else set())
            faults += [
                f"{case.series.name}: {key}: expected one of {', '.join(sorted(known))}"
                f"{suggestion(name, known)}, found {name!r}"
                for name in names
                if name not in known and case.scene is not None
            ]
    faults += _unknown_columns(study, cases)
    return faults + [
        f"errors: expected one of {', '.join(sorted(every))}{suggestion(name, every)}, found {name!r}"
        for name in study.errors or ()
        if name not in every
    ]


def _unknown_columns(study: Study, cases: list[Case]) -> list[str]:
    """Columns that comparisons read and a run's history will not have."""
    faults = []
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
    return faults


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
