"""Pressure on whatever bounds a body in a region, curved or not."""

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from parsolid.scene.bodies import Name
from parsolid.scene.boundaries.condition import Condition, boundary_kind
from parsolid.scene.formulas import FormulaVector, Scalar
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.scene.regions import InBall, InBox, Region
from parsolid.scene.shapes import Box, Sphere

if TYPE_CHECKING:
    from parsolid.boundary.declarations import Declarations


@boundary_kind
class SurfacePressure(Condition, Timed):
    """Pressure [Pa], per reference area, on all of a body's surface within a box or a ball.

    The region must hold what lies within two horizons of that surface, and no other free surface.
    """

    exactly_one: ClassVar = (("box", "ball"),)
    plane: ClassVar[None] = None  # type: ignore[misc]
    kind: Literal["surface_pressure"]
    box: Box | None = None
    ball: Sphere | None = None
    body: Name | None = None
    pressure: Scalar = Field(description="a formula in X, Y, Z, t [Pa]")

    @property
    def region(self) -> Region:
        """The box or the ball."""
        if self.box is not None:
            return InBox(self.box.lower, self.box.upper)
        assert self.ball is not None
        return InBall(self.ball.centre, self.ball.radius)

    @property
    def course(self) -> LoadHistory:
        """The pressure in time."""
        return LoadHistory(FormulaVector((self.pressure,)), self)

    def declare(self, to: "Declarations") -> None:
        """A pressure on a surface."""
        to.surface_pressure(self, self.course)
