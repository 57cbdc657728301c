"""Tables of a scene for output, the reference to compare with, error bars and targets."""

import json
import sys
from collections.abc import Container, Iterable
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, field_validator, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import Detail, NotNegative, OnRestart, Positive, SceneModel, Times, reject
from parsolid.scene.named_regions import RegionName
from parsolid.scene.probes import ShownField
from parsolid.scene.shapes import ExistingFile


class ErrorBars(SceneModel):
    """Error bars for every column of the history, from coarse runs of the scene before the run itself."""

    ratios: Annotated[list[Positive], Field(min_length=1, max_length=4)] | None = Field(
        None,
        description="spacings of the coarse runs over that of the scene, rising and above 1 (default: by dimension)",
    )

    @field_validator("ratios")
    @classmethod
    def _rising(cls, ratios: list[float] | None) -> list[float] | None:
        before = [1.15, *(ratios or ())]
        reject(*(((i,), f"at least {1.0 * a:g}", b) for i, (a, b) in enumerate(zip(before, ratios or ())) if b < a))
        return ratios


class RunTargets(SceneModel):
    """Requested errors: the scene is run from coarse to fine until its error bars are small enough."""

    target: Annotated[list[str], Field(min_length=1)] = Field(
        description='column of the history and bar, "tip.twist=2%" of its largest value, or "tip.twist=0.01"'
    )
    core_seconds: Positive | None = Field(None, description="limit of the core-seconds of all runs together")


# columns of the stored energy: internal energy if the energy of a law includes heat
STRAIN_ENERGY, INTERNAL_ENERGY = "strain_energy", "internal_energy"
DISSIPATIONS = ("material_dissipation", "numerical_dissipation")
_WITH_HEAT = ("elastic-plastic",)
STORED_ENERGY = (STRAIN_ENERGY, INTERNAL_ENERGY)
ENERGIES = ("kinetic", *STORED_ENERGY, *DISSIPATIONS, "external_work")
HISTORY_COLUMNS = (*ENERGIES, "energy_error")


def holds_heat(material: Any) -> bool:
    """Whether the stored energy of a material includes heat and plastic work."""
    return getattr(material, "kind", None) in _WITH_HEAT


def stored_column(materials: Iterable[Any]) -> str:
    """The column of the stored energy in the history of bodies of these materials."""
    return INTERNAL_ENERGY if any(map(holds_heat, materials)) else STRAIN_ENERGY


def stored_energy(columns: Container[str]) -> str:
    """The column of the stored energy among the columns of a history."""
    return INTERNAL_ENERGY if INTERNAL_ENERGY in columns else STRAIN_ENERGY


class Output(SceneModel):
    """Folder and frequency of results; times and intervals in s of the simulated time, but for `checkpoint_wall`."""

    at_most_one: ClassVar = (
        ("history_interval", "history_steps"),
        ("fields_interval", "fields_times"),
        ("checkpoint_interval", "checkpoint_steps"),
    )
    on_restart: ClassVar = {"where": OnRestart.FIXED}
    directory: str = Field(
        default="results", min_length=1, description="the folder of the results, relative to the working folder"
    )
    history_interval: Positive | None = Field(None, description="time between rows of history.csv [s]")
    history_steps: Annotated[int, Field(ge=1)] | None = Field(
        default=None, description="steps between rows of history.csv (default: 1, or the interval)"
    )
    fields_interval: Positive | None = Field(default=None, description="time between fields [s] (default: end_time/20)")
    fields_times: Times | None = Field(None, description="times at which fields are written [s]")
    fields: list[ShownField] | None = Field(
        default=None, description="the fields to write (default: displacement, velocity and some of stress)"
    )
    where: RegionName | None = Field(None, description="write only fields of the particles of this region")
    checkpoint_interval: Positive | None = Field(None, description="simulated time between checkpoints [s]")
    checkpoint_steps: Annotated[int, Field(ge=1)] | None = Field(None, description="steps between checkpoints")
    checkpoint_wall: Positive = Field(default=600.0, description="wall time between checkpoints [s]")
    compression: Annotated[int, Field(ge=0, le=9)] = Field(
        default=0, description="deflate level of the fields after the run, 0 for none"
    )
    pictures: bool | None = Field(None, description="draw the standard pictures (default: of runs of 20 s or more)")


_HYPERELASTIC, _PLASTIC, _PRONY = ("mooney-rivlin", "neo-hookean"), ("elastic-plastic",), ("prony", "linear-elastic")
_MICRO = ("micro-inertia",)
# exact solution -> alternative sets of parameters, and kinds of material
SOLUTIONS_KNOWN = {
    "viscoelastic-plate": ((("amplitude",),), _HYPERELASTIC),
    "axis-aligned": ((("amplitude",),), ("neo-hookean",)),
    "generalised-vortex": ((("amplitude",),), ("neo-hookean",)),
    "cosine-mode": ((("start", "amplitude"),), _PLASTIC),
    "heated-slab": ((("start", "face_rise"), ("start", "heat_flux")), _PLASTIC),
    "plastic-layer": ((("start", "rate"),), _PLASTIC),
    "steady-shock": ((("start", "particle_speed"),), _PLASTIC),
    "uniaxial-creep": (((),), _PRONY),
    "bar-vibration": ((("stretch",),), _PRONY),
    "delayed-heat-mode": ((("start", "amplitude", "mode"),), _MICRO),
    "delayed-heat-pulse": ((("start", "amplitude", "centre", "width"),), _MICRO),
    "elastic-impact": ((("speed",),), _MICRO),
    "micro-wave": ((("rate", "amplitude", "mode"),), _MICRO),
    "free-micro-wave": ((("rate", "amplitude", "mode"),), _MICRO),
    "micro-layer": ((("height", "rate"),), _MICRO),
}

# exact solutions of linear solids
_SMALL_STRAIN = ("uniaxial-creep", "bar-vibration")
# exact solutions with a body force
MANUFACTURED = ("axis-aligned", "generalised-vortex")

# the type checker does not know what literals a table holds
KnownSolution: Any = Literal[tuple(SOLUTIONS_KNOWN)]


def solution_faults(exact: str, material: Any) -> list[Detail]:
    """The fault of an exact solution that does not hold for a material."""
    if material.kind not in SOLUTIONS_KNOWN[exact][1]:
        return [(("reference", "exact"), f"a solution for the material {material.kind!r}", exact)]
    if exact in _SMALL_STRAIN and getattr(material, "strain", "small") != "small":
        return [(("reference", "exact"), f"a solution for strain = '{material.strain}'", exact)]
    return []


def _series_faults(file: str, columns: dict[str, str]) -> list[Detail]:
    """Faults of a JSON file of series, and of the series to compare (column of the history -> name in the file)."""
    try:
        data = json.loads(Path(file).read_text(encoding="utf-8"))
        series, times, scale = data["series"], data["t"], data["E0"]
        known = [name for name, values in series.items() if len(values) == len(times)]
    except (ValueError, TypeError, LookupError, AttributeError, RecursionError):
        return [(("series",), "JSON with t, E0 and a table series", file)]
    unknown = [(column, name) for column, name in columns.items() if name not in known]
    if unknown:
        return [(("columns", column), f"one of {', '.join(known)}", name) for column, name in unknown]
    if not _finite(times) or len(times) < 2 or any(after <= before for before, after in pairwise(times)):
        return [(("series",), "t of at least two finite numbers that rise", file)]
    if not _finite([scale]) or scale <= 0.0:
        return [(("series",), "E0 > 0", Phrase(f"{scale!r} in {file}"))]
    details: list[Detail] = []
    for column, name in columns.items():
        if not _finite(series[name]):
            details.append((("columns", column), "a series of finite numbers", name))
        elif column not in HISTORY_COLUMNS and not any(series[name]):
            details.append((("columns", column), "a series that is not zero throughout, for a relative error", name))
    return details


def _finite(values: Any) -> bool:
    """Whether all are numbers, and finite."""
    return isinstance(values, list) and all(
        isinstance(value, int | float) and not isinstance(value, bool) and abs(value) <= sys.float_info.max
        for value in values
    )


class Reference(SceneModel):
    """Reference values of the results.

    Either a JSON file `series` with "t", "E0" and a table "series" of equally long lists, and `columns` from a column
    of the history to a name in that table; or an `exact` solution with its `parameters`, compared at `times` [s], at
    each step, or with columns of probes (some solutions); or the `final` values of columns of the history.
    """

    exactly_one: ClassVar = (("series", "exact", "final"), ("columns", "times", "each_step", "history", "final"))
    series: ExistingFile | None = Field(None, description="a JSON file with t, E0 and a table of series")
    columns: Annotated[dict[str, str], Field(min_length=1)] | None = Field(
        None, description="column of the history = name in the file's series"
    )
    exact: KnownSolution | None = Field(None, description="an exact solution")
    parameters: dict[str, float] = Field({}, description="parameters of the exact solution")
    times: Annotated[list[NotNegative], Field(min_length=1)] | None = Field(
        None, description="times at which fields are compared with the exact solution [s]"
    )
    each_step: Literal[True] | None = Field(None, description="true: the largest error over all steps")
    history: Literal[True] | None = Field(None, description="true: compare columns of the history")
    final: Annotated[dict[str, float], Field(min_length=1)] | None = Field(
        None, description="column of the history = its value at the end"
    )

    @model_validator(mode="after")
    def _paired(self) -> "Reference":
        if (self.series is None) != (self.columns is None) or (self.final is not None and self.exact is not None):
            expected = "series with columns, exact with times, each_step or history, or final alone"
            reject(((), expected, Phrase("one of each")))
        zeros = [column for column, value in (self.final or {}).items() if value == 0.0]
        reject(*((("final", column), "a number other than 0", 0.0) for column in zeros))
        if self.exact is not None:
            wanted, _ = SOLUTIONS_KNOWN[self.exact]
            if set(self.parameters) not in map(set, wanted):
                text = " or ".join(", ".join(names) for names in wanted) or "none"
                reject((("parameters",), f"the parameters {text}", Phrase(", ".join(self.parameters) or "none")))
        if self.series is not None:
            reject(*_series_faults(self.series, self.columns or {}))
        return self
