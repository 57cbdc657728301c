"""Planes at a temperature, and heat that flows through planes."""

from typing import ClassVar, Literal

import numpy as np
from pydantic import Field, model_validator

from parsolid.scene.base_model import Name, Plane, reject
from parsolid.scene.boundaries.condition import Condition, boundary_kind
from parsolid.scene.formulas import Scalar


class OnHeatedPlane(Condition):
    """A condition on the heat of bodies at a plane."""

    on_particles: ClassVar[bool] = False
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")


@boundary_kind
class PrescribedTemperature(OnHeatedPlane):
    """Temperature [K] on a plane."""

    kind: Literal["temperature"]
    temperature: Scalar = Field(description="a formula in X, Y, Z, t [K]")

    @model_validator(mode="after")
    def _absolute(self) -> "PrescribedTemperature":
        if self.temperature.is_constant and self.temperature.evaluate(np.zeros((1, 3)))[0] < 0.0:
            reject((("temperature",), "an absolute temperature", self.temperature.source))
        return self


@boundary_kind
class HeatFlux(OnHeatedPlane):
    """Heat [W/m^2] into a body through a plane that bounds it; planes without any condition are insulated."""

    kind: Literal["heat-flux"]
    heat_flux: Scalar = Field(description="a formula in X, Y, Z, t [W/m^2]")
