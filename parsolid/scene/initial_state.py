"""Initial states of regions, from formulas or from the results of another run."""

from itertools import combinations
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

from pydantic import Field, PrivateAttr, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import (
    Detail,
    FaultDetail,
    Name,
    NotNegative,
    SceneModel,
    dimension_of,
    reject,
)
from parsolid.scene.formulas import InitialMatrix, InitialScalar, InitialVector
from parsolid.scene.named_regions import RegionName
from parsolid.scene.previous_results import TAKEN, PreviousField, steps_of
from parsolid.scene.shapes import ExistingFolder

# keys with formulas
FIELDS = ("velocity", "displacement", "deformation_gradient", "temperature", "stress")


class InitialState(SceneModel):
    """The state at time 0 of the particles of a region, of a body, or of all; it overrides earlier states.

    As in the table of a body, `deformation_gradient` is by default that of `displacement`. In place of formulas,
    fields of the results of another run may be taken: unchanged for particles with the same reference position,
    interpolated by moving least squares for others.
    """

    only_with: ClassVar = (("time", "results"), ("fields", "results"))
    where: RegionName | None = Field(None, description="a region or a group of a mesh (default: all particles)")
    body: Name | None = Field(None, description="the name of a body (default: all)")
    velocity: InitialVector | None = Field(None, description="a formula in X, Y, Z for each component [m/s]")
    displacement: InitialVector | None = Field(None, description="a formula for each component [m]")
    deformation_gradient: InitialMatrix | None = Field(None, description="rows of formulas")
    temperature: InitialScalar | None = Field(None, description="a formula [K]")
    stress: InitialMatrix | None = Field(
        None, description="rows of formulas [Pa], symmetric: an initial stress without strain; it turns with the body"
    )
    results: ExistingFolder | None = Field(None, description="a folder of results of another run")
    time: NotNegative | None = Field(None, description="the time of these results [s] (default: the last one)")
    fields: Annotated[list[Literal[TAKEN]], Field(min_length=1)] | None = Field(  # type: ignore[valid-type]
        None,
        description="fields taken from them (default: displacement and velocity); 'state' is the complete state of the "
        "method, written if output.fields has 'state'",
    )
    _of_results: dict[str, PreviousField] = PrivateAttr(default_factory=dict)

    @model_validator(mode="after")
    def _states_a_value(self, info: ValidationInfo) -> "InitialState":
        if not self.stated and self.results is None:
            reject(((), f"at least one of {', '.join(FIELDS)}, results", Phrase("none")))
        if self.results is None:
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
            expected = "a stress without displacement, or the displacement or state without stress"
            reject((("fields", (self.fields or []).index("stress")), expected, "stress"))
        if self.takes_state:
            expected = "'state' alone, which is the complete state of the method"
            reject(*((("fields", k), expected, name) for k, name in enumerate(fields) if name != "state"))
        both = sorted(set(self.stated) & (set(self._carried) if self.takes_state else set(self._of_results)))
        reject(*(((name,), "a formula or results, not both", Phrase("both")) for name in both))
        return self

    @property
    def _names(self) -> list[str]:
        """Fields that are read here; the other fields of a state are read when the method's fields are known."""
        return ["displacement", "velocity"] if self.takes_state else list(self.fields or ("displacement", "velocity"))

    @property
    def _carried(self) -> list[str]:
        """Stated keys and fields of results that a complete state contains."""
        return [name for name in (*self.stated, *self._of_results) if name != "stress"]

    def overridden_by(self, others: list["InitialState"]) -> int | None:
        """The index of an earlier state that takes the complete state of results and so overrides this one, or None."""
        if self.takes_state or not self._carried:
            return None
        for i, other in enumerate(others):
            if other.takes_state and (None in (other.body, self.body) or other.body == self.body):
                return i
        return None

    @property
    def takes_state(self) -> bool:
        """Whether the complete state of results is taken."""
        return "state" in (self.fields or ())

    @property
    def stated(self) -> list[str]:
        """The keys with formulas that are given."""
        return [key for key in FIELDS if getattr(self, key) is not None]

    @property
    def of_results(self) -> list[PreviousField]:
        """The fields taken from results."""
        return list(self._of_results.values())

    def of(self, name: str) -> Any:
        """The formula or the field of results of a name; None if neither is given."""
        return self._of_results.get(name, getattr(self, name, None))


def initial_details(scene: Any) -> list[FaultDetail]:
    """Faults of initial states: overridden states, fields that no method has."""
    details: list[FaultDetail] = [*_stress_details(scene)]
    methods = [plan.settings for plan in scene.systems]
    known = {name for one in methods for name in one.field_kinds(scene.dimension)}
    for i, one in enumerate(scene.initial):
        if (first := one.overridden_by(scene.initial[:i])) is not None:
            key = next((name for name in one.stated if name != "stress"), "fields" if one.fields else "results")
            expected = f"a place before initial.{first}, whose complete state overrides this one"
            details.append((("initial", i, key), expected, Phrase("it after that")))
        for name in ("temperature", "plastic_strain"):
            if one.of(name) is not None and name not in known:
                key = "fields" if one.results and name not in one.stated else name
                details.append((("initial", i, key), "a field that bodies of this scene have", name))
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
    """Faults of initial stresses: methods that refuse them, tensors that are not symmetric."""
    details: list[Detail] = []
    refused = {plan.settings.kind: plan.settings.initial_stress_refused for plan in scene.systems}
    for i, one in enumerate(scene.initial):
        if one.of("stress") is None:
            continue
        for kind, reason in refused.items():
            if reason is not None and one.stress is None:
                expected = f"a field that {kind} takes from results ({reason}; 'state' includes the stress)"
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
