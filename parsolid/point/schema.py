"""The file of a material point: its keys, their checks, and how it is read."""

import os
from pathlib import Path
from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationError, field_validator, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.point.paths import AnyPath
from parsolid.scene.base_model import Positive, SceneModel, faults_of_errors, reject
from parsolid.scene.materials import Material, ValueFault
from parsolid.scene.raw_tables import apply_override, read_tables
from parsolid.scene.validation_errors import SceneError

MOST_STEPS = 1_000_000
# kinds of materials with a temperature
_HEATED = ("elastic-plastic", "micro-inertia")


def _has_temperature(material: Any) -> bool:
    """Whether a material, or a law of a file by its role, has a temperature."""
    role = getattr(getattr(material, "declared", None), "role", None)
    return material.kind in _HEATED or role in _HEATED


Direction = Annotated[list[float], Field(min_length=3, max_length=3)]


class PointOutput(SceneModel):
    """The folder of the results, and the material directions of the wave speeds."""

    directory: str = Field("results", description="the folder of the results, relative to the working folder")
    directions: list[Direction] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
    pictures: bool = True

    @field_validator("directions")
    @classmethod
    def _not_zero(cls, directions: list[Any]) -> list[Any]:
        reject(
            *(((i,), "a direction of some length", N) for i, N in enumerate(directions) if not np.linalg.norm(N) > 0.0)
        )
        return directions


class MaterialPoint(SceneModel):
    """A material, the path of its deformation gradient from the undeformed state at time 0, and how finely it is
    followed.
    """

    exactly_one: ClassVar = (("steps", "time_step"),)
    title: str = ""
    end_time: Positive = Field(description="the time to follow the path to [s]")
    steps: Annotated[int, Field(ge=1, le=MOST_STEPS)] | None = Field(None, description="the number of equal steps")
    time_step: Positive | None = Field(None, description="the longest step [s]")
    material: Material = Field(description="a table with the key kind")
    path: AnyPath = Field(description="a table with the key kind")
    temperature: Positive | None = Field(None, description="of a solid with plastic flow at time 0 [K]")
    thermal_reference: Literal["stress-free", "at-constant-volume"] | None = Field(
        None, description="as a body of a scene came to its temperature: stress-free unless given"
    )
    heat: Literal["adiabatic", "isothermal"] | None = Field(None, description="adiabatic unless given")
    output: PointOutput = PointOutput()

    @model_validator(mode="after")
    def _within_bounds(self) -> "MaterialPoint":
        details: list[Any] = []
        if self.end_time > self.path.last_time:
            details.append(
                (("end_time",), f"at most the last time of the path, {self.path.last_time:g}", self.end_time)
            )
        if self.time_step is not None and self.end_time / self.time_step > MOST_STEPS:
            details.append(
                (("time_step",), f"at least end_time/{MOST_STEPS} = {self.end_time / MOST_STEPS:g}", self.time_step)
            )
        if self.material.kind == "bond-based":
            details.append((("material", "kind"), "a law of stresses (bonds have none)", self.material.kind))
        try:
            if hasattr(self.material, "law_at"):
                self.material.law_at((0.0, 0.0, 0.0))
        except ValueFault as fault:
            details.append((("material", *fault.place), fault.expected, Phrase(fault.found)))
        if not _has_temperature(self.material):
            stated = [key for key in ("temperature", "heat") if getattr(self, key) is not None]
            details += [
                ((key,), f"no such key but with the material {' or '.join(map(repr, _HEATED))}", getattr(self, key))
                for key in stated
            ]
        if self.thermal_reference is not None and (self.temperature is None or self.material.kind != "elastic-plastic"):
            details.append(
                (
                    ("thermal_reference",),
                    "no such key but for an elastic-plastic solid with a temperature",
                    self.thermal_reference,
                )
            )
        late = [(i, time) for i, time in enumerate(self.path.breaks) if time > self.end_time]
        details += [(("path", "breaks", i), f"a time up to end_time = {self.end_time:g}", time) for i, time in late]
        reject(*details)
        return self

    @property
    def longest_step(self) -> float:
        """The longest step [s]."""
        return self.end_time / self.steps if self.steps is not None else self.time_step or self.end_time

    @property
    def conditions(self) -> dict[str, Any]:
        """Keywords of the law's class in `driver.POINT_LAWS`."""
        if not _has_temperature(self.material):
            return {}
        result = {"temperature": self.temperature, "isothermal": self.heat == "isothermal"}
        if self.thermal_reference is not None:
            result["constant_volume"] = self.thermal_reference == "at-constant-volume"
        return result

    def resolved(self) -> dict[str, Any]:
        """The file with its defaults, as plain tables that validate to the same."""
        return self.model_dump(exclude_none=True)


def load_point(
    path: str | os.PathLike[str], overrides: list[str] | tuple[str, ...] = (), trust_code: bool = False
) -> MaterialPoint:
    """Read a material point; `overrides` are "key.path=value" with TOML values, applied before validation.

    Files named in it are relative to its folder; trust_code: laws in them are run. Raises SceneError with every fault.
    """
    path = Path(path)
    data = read_tables(path, "material point")
    faults = [text for text in (apply_override(data, override) for override in overrides) if text]
    if isinstance(output := data.setdefault("output", {}), dict):
        output.setdefault("directory", os.path.join("results", path.stem))
    try:
        context = {"dimension": 3, "folder": str(path.resolve().parent), "trust_code": trust_code}
        point = MaterialPoint.model_validate(data, context=context)
    except ValidationError as error:
        raise SceneError(dict.fromkeys([*faults, *faults_of_errors(error)])) from None
    if faults:
        raise SceneError(faults)
    # a path without free components must not be seen to leave J > 0
    if not point.path.free.any():
        edges = [0.0, *(time for time in point.path.kinks if 0.0 < time < point.end_time), point.end_time]
        times = np.unique(np.concatenate([np.linspace(0.0, point.end_time, 1001), edges]))
        for side in (-1, 1):
            inside = times[1:] if side < 0 else times[:-1]
            with np.errstate(all="ignore"):
                J = np.linalg.det(point.path.gradients(inside, np.full(len(inside), side)))
            bad = np.flatnonzero(~(J > 0.0))
            if len(bad):
                found = Phrase(f"J = {J[bad[0]]:g} at t = {inside[bad[0]]:g}")
                raise SceneError([f"path: expected a deformation gradient with J > 0, found {found}"])
    return point
