"""Conditions on the nodes of a grid: rigid walls and thermal boundaries."""

from typing import ClassVar, Literal

from pydantic import Field

from parsolid.scene.base_model import Plane, Point, SceneModel
from parsolid.scene.bodies import Name
from parsolid.scene.formulas import Scalar


class GridCondition(SceneModel):
    """A condition on nodes of a grid, wherever particles are."""

    on_particles: ClassVar[bool] = False


class Wall(GridCondition):
    """A rigid plane that moves with a constant velocity, and on one side of which all bodies are.

    contact      "frictionless": the wall's normal velocity; "sticking": its whole velocity
    separation   whether a body may leave the wall again
    """

    body: ClassVar[None] = None
    kind: Literal["wall"]
    plane: Plane = Field(description="a plane such as 'Y = 0': where the wall is at time 0")
    side: Literal["above", "below"] = Field(
        description="'above' or 'below': where along the plane's axis the bodies are"
    )
    velocity: Point | None = Field(None, description="the velocity of the wall [m/s], at rest unless given")
    contact: Literal["frictionless", "sticking"] = "frictionless"
    separation: bool = True


class PrescribedTemperature(GridCondition):
    """Temperature [K] on a plane."""

    kind: Literal["temperature"]
    plane: Plane = Field(description="a plane such as 'Y = 0'")
    body: Name | None = None
    temperature: Scalar = Field(description="a formula in X, Y, Z, t [K]")


class HeatFlux(GridCondition):
    """Heat [W/m^2] that flows into a body through a plane that bounds it; planes without any condition are insulated."""

    kind: Literal["heat_flux"]
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = None
    heat_flux: Scalar = Field(description="a formula in X, Y, Z, t [W/m^2]")
