"""What a study may say: scenes, axes along which they vary, and what the runs must show."""

from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, ValidationError, field_validator, model_validator

from parsolid.campaign.comparison import Comparison
from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import Positive, SceneModel, faults_of_errors, reject
from parsolid.scene.raw_tables import read_tables, toml_value
from parsolid.scene.shapes import ExistingFile
from parsolid.scene.validation_errors import SceneError, suggestion

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
