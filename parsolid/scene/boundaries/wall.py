"""Rigid walls that bodies run into."""

from typing import ClassVar, Literal

from pydantic import Field

from parsolid.scene.base_model import Plane, Point
from parsolid.scene.boundaries.condition import Condition, Reporting, boundary_kind


@boundary_kind
class Wall(Condition, Reporting):
    """A rigid plane that moves with a constant velocity, and on one side of which all bodies are."""

    on_particles: ClassVar[bool] = False
    body: ClassVar[None] = None  # type: ignore[misc]
    kind: Literal["wall"]
    plane: Plane = Field(description="a plane such as 'Y = 0': where the wall is at time 0")
    side: Literal["above", "below"] = Field(
        description="'above' or 'below': where along the plane's axis the bodies are"
    )
    velocity: Point | None = Field(None, description="the velocity of the wall [m/s], at rest unless given")
    contact: Literal["frictionless", "sticking"] = Field(
        "frictionless", description='"frictionless": the wall\'s normal velocity; "sticking": its whole velocity'
    )
