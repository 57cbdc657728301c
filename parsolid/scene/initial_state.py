"""Initial states of a scene beside those of its bodies' tables: of a region, or from the results of another run."""

from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import Detail, FaultDetail, Name, NotNegative, SceneModel, dimension_of, reject
from parsolid.scene.formulas import InitialMatrix, InitialScalar, InitialVector
from parsolid.scene.named_regions import RegionName
from parsolid.scene.previous_results import TAKEN, PreviousField, steps_of
from parsolid.scene.shapes import ExistingFolder

# keys with formulas
FIELDS = ("velocity", "displacement", "deformation_gradient", "temperature", "stress")


class InitialState(SceneModel):
    """The state at time 0 of the particles of a region, of a body, or of all; it holds in place of what stands before.

    Of `displacement` and `deformation_gradient` the same holds as in a body's table: the second is one plus the
    gradient of the first. In place of formulas there may be the results of another run: its fields at a time, as they
    are where particles have the same reference place, interpolated by moving least squares elsewhere.
    """

    where: RegionName | None = Field(None, description="a region or a group of a mesh, all particles unless given")
    body: Name | None = Field(None, description="the name of a body, all of them unless given")
    velocity: InitialVector | None = Field(None, description="a formula in X, Y, Z for each component [m/s]")
    displacement: InitialVector | None = Field(None, description="a formula for each component [m]")
    deformation_gradient: InitialMatrix | None = Field(None, description="rows of formulas")
    temperature: InitialScalar | None = Field(None, description="a formula [K]")
    stress: InitialMatrix | None = Field(
        None, description="rows of formulas [Pa], symmetric: what no deformation has made; it turns with the matter"
    )
    results: ExistingFolder | None = Field(None, description="a folder of results of another run")
    time: NotNegative | None = Field(None, description="the time of these results [s], the last unless given")
    fields: Annotated[list[Literal[TAKEN]], Field(min_length=1)] | None = Field(  # type: ignore[valid-type]
        None,
        description="what is taken of them, displacement and velocity unless given; 'state' is all that the method "
        "carries on, written where output.fields has 'state'",
    )
    _of_results: dict[str, PreviousField] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _states_a_value(self, info: ValidationInfo) -> "InitialState":
        if not self.stated and self.results is None:
            reject(((), f"at least one of {', '.join(FIELDS)}, results", Phrase("none")))
        if self.results is None:
            alone = [(key, getattr(self, key)) for key in ("time", "fields") if getattr(self, key) is not None]
            reject(*(((key,), "no such key without results", value) for key, value in alone))
            return self
        try:
            steps = steps_of(Path(self.results), self.time)
        except (OSError, KeyError, ValueError) as error:
            key, found = ("results", self.results) if self.time is None else ("time", self.time)
            reject(((key,), str(error), found))
        fields = self.fields or []
        for name in self._names:
            lacking = [one for one in ("displacement", name) if any(one not in step.names for step in steps)]
            if lacking:
                place = ("fields", fields.index(name) if name in fields else 0) if fields else ("results",)
                reject((place, f"results with the field {lacking[0]!r} ({', '.join(steps[0].names)})", self.results))
            self._of_results[name] = PreviousField(steps, name, dimension_of(info) or 3)
        if "stress" in self._of_results and "displacement" in self._of_results:
            expected = "a stress without the displacement that made it, or the displacement or state alone"
            reject((("fields", (self.fields or []).index("stress")), expected, "stress"))
        if self.takes_state:
            others = [(k, name) for k, name in enumerate(fields) if name != "state"]
            reject(
                *(
                    (("fields", k), "'state' alone, which has all that the method carries on", name)
                    for k, name in others
                )
            )
        both = sorted(set(self.stated) & (set(self._carried) if self.takes_state else set(self._of_results)))
        reject(*(((name,), "a formula or results, not both", Phrase("both")) for name in both))
        return self

    @property
    def _names(self) -> list[str]:
        """Fields that are read of results; what a state has besides is read when the method's fields are there."""
        return ["displacement", "velocity"] if self.takes_state else list(self.fields or ("displacement", "velocity"))

    @property
    def _carried(self) -> list[str]:
        """Stated keys and fields of results that a state has in it."""
        return [name for name in (*self.stated, *self._of_results) if name != "stress"]

    def overridden_by(self, others: list["InitialState"]) -> int | None:
        """Which of the states before this one takes that of results, which holds in its place; None if none does."""
        if self.takes_state or not self._carried:
            return None
        apart = [None not in (one.body, self.body) and one.body != self.body for one in others]
        return next((i for i, one in enumerate(others) if one.takes_state and not apart[i]), None)

    @property
    def takes_state(self) -> bool:
        """Whether all that the method carries on is taken of the results."""
        return "state" in (self.fields or ())

    @property
    def stated(self) -> list[str]:
        """The keys with formulas that are given."""
        return [key for key in FIELDS if getattr(self, key) is not None]

    @property
    def of_results(self) -> list[PreviousField]:
        """The fields that are taken of results."""
        return list(self._of_results.values())

    def of(self, name: str) -> Any:
        """The formula or the field of results for a name, None where neither is given."""
        return self._of_results.get(name, getattr(self, name, None))


def initial_details(scene: Any) -> list[FaultDetail]:
    """Faults of initial states: bodies that are not there, what no method can take."""
    details: list[FaultDetail] = [*_stress_details(scene)]
    names = [body.name for body in scene.bodies if body.name is not None]
    methods = [plan.settings for plan in scene.systems]
    known = {name for one in methods for name in one.field_kinds(scene.dimension)}
    for i, one in enumerate(scene.initial):
        if one.body is not None and one.body not in names:
            details.append(
                (("initial", i, "body"), f"the name of a body ({', '.join(names) or 'none'})", one.body, "unknown-name")
            )
        if (first := one.overridden_by(scene.initial[:i])) is not None:
            key = next((name for name in one.stated if name != "stress"), "fields" if one.fields else "results")
            expected = f"to stand before initial.{first}, whose state of results holds in its place"
            details.append((("initial", i, key), expected, Phrase("it behind")))
        for name in ("temperature", "plastic_strain"):
            if one.of(name) is not None and name not in known:
                key = "fields" if one.results and name not in one.stated else name
                details.append((("initial", i, key), "what bodies of this scene have", name))
        if (
            one.of_results
            and one.of("displacement")
            and not one.takes_state
            and not all(each.strained for each in methods)
        ):
            expected = "velocity, temperature, plastic_strain or state (this method takes no strain from it)"
            details.append((("initial", i, "fields"), expected, "displacement"))
    return details


def _stress_details(scene: Any) -> list[Detail]:
    """Faults of initial stresses: methods that carry none, formulas that are no symmetric tensor."""
    details: list[Detail] = []
    refused = {plan.settings.kind: plan.settings.initial_stress_refused for plan in scene.systems}
    for i, one in enumerate(scene.initial):
        if one.of("stress") is None:
            continue
        for kind, reason in refused.items():
            if reason is not None and one.stress is None:
                expected = f"what {kind} takes of results ({reason}; 'state' has all that makes a stress)"
                details.append((("initial", i, "fields"), expected, "stress"))
            elif reason is not None:
                details.append((("initial", i, "stress"), f"no such key in {kind} ({reason})", Phrase("one")))
        if one.stress is None:
            continue
        rows = [row.sources for row in one.stress]
        for j, k in combinations(range(len(rows)), 2):
            if rows[j][k] != rows[k][j]:
                expected = f"a symmetric tensor, as {rows[j][k]!r} in row {j + 1}, column {k + 1}"
                details.append((("initial", i, "stress", k, j), expected, rows[k][j]))
    return details
