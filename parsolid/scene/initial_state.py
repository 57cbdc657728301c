"""Initial states of a scene beside those of its bodies' tables: of a region, or from the results of another run."""

from typing import Any

from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import SceneModel, reject
from parsolid.scene.bodies import Name
from parsolid.scene.formulas import InitialMatrix, InitialScalar, InitialVector
from parsolid.scene.method_settings import Detail
from parsolid.scene.named_regions import RegionName

# keys with formulas
FIELDS = ("velocity", "displacement", "deformation_gradient", "temperature")


class InitialState(SceneModel):
    """The state at time 0 of the particles of a region, of a body, or of all; it holds in place of what stands before.

    Of `displacement` and `deformation_gradient` the same holds as in a body's table: the second is one plus the
    gradient of the first.
    """

    where: RegionName | None = None
    body: Name | None = None
    velocity: InitialVector | None = Field(None, description="a formula in X, Y, Z for each component [m/s]")
    displacement: InitialVector | None = Field(None, description="a formula for each component [m]")
    deformation_gradient: InitialMatrix | None = Field(None, description="rows of formulas")
    temperature: InitialScalar | None = Field(None, description="a formula [K]")

    @model_validator(mode="after")
    def _something(self, info: ValidationInfo) -> "InitialState":
        if not self.stated:
            reject(((), f"at least one of {', '.join(FIELDS)}", Phrase("none")))
        return self

    @property
    def stated(self) -> list[str]:
        """The keys with formulas that are given."""
        return [key for key in FIELDS if getattr(self, key) is not None]


def initial_details(scene: Any) -> list[Detail]:
    """Faults of initial states: bodies that are not there, temperatures that no body has."""
    details: list[Detail] = []
    names = [body.name for body in scene.bodies if body.name is not None]
    for i, one in enumerate(scene.initial):
        if one.body is not None and one.body not in names:
            details.append((("initial", i, "body"), f"the name of a body ({', '.join(names) or 'none'})", one.body))
        warm = any("temperature" in plan.settings.field_kinds(scene.dimension) for plan in scene.systems)
        if one.temperature is not None and not warm:
            details.append((("initial", i, "temperature"), "no such key with this method", one.temperature.source))
    return details
