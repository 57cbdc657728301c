"""Motion prescribed over a region: velocity, displacement, a layer of fictitious particles."""

from typing import ClassVar, Literal

from pydantic import Field

from parsolid.scene.base_model import Name, Plane, Point
from parsolid.scene.boundaries.condition import Condition, Reporting, boundary_kind
from parsolid.scene.formulas import Formula, FormulaVector, VectorOrFree
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.scene.named_regions import RegionName
from parsolid.scene.regions import Beside, InBall, InBox, Named, NearestTo, OnPlane, Region
from parsolid.scene.shapes import Box, Sphere


class RegionCondition(Condition):
    """A condition on a region: one with a name, a plane, a box, a ball, or the particle nearest to a point."""

    exactly_one: ClassVar = (("where", "plane", "box", "ball", "point"),)
    where: RegionName | None = Field(None, description="a region with a name, or a group of a mesh")
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0'; particles on it are meant")
    box: Box | None = None
    ball: Sphere | None = None
    point: Point | None = Field(None, description="the particle nearest to this point [m] is meant")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")

    @property
    def region(self) -> Region:
        """The one that is given."""
        if self.where is not None:
            return Named(self.where)
        if self.plane is not None:
            return OnPlane(self.plane)
        if self.box is not None:
            return InBox(self.box.lower, self.box.upper)
        if self.ball is not None:
            return InBall(self.ball.centre, self.ball.radius)
        assert self.point is not None
        return NearestTo(self.point)


class MotionCondition(Condition):
    """A condition that prescribes motion; quantity: "velocity" [m/s] or "displacement" [m], whose values in time are
    `prescribed`. Components that are None in its formulas are free."""

    quantity: ClassVar[Literal["velocity", "displacement"]] = "displacement"


@boundary_kind
class PrescribedVelocity(RegionCondition, Reporting, MotionCondition):
    """Velocity [m/s] prescribed over a region; components that are "free" follow the equation of motion."""

    quantity: ClassVar[Literal["velocity", "displacement"]] = "velocity"
    kind: Literal["velocity"]
    velocity: VectorOrFree = Field(description="a formula in X, Y, Z, t or 'free' for each component [m/s]")


@boundary_kind
class PrescribedDisplacement(RegionCondition, Timed, Reporting, MotionCondition):
    """Displacement [m] prescribed over a region; components that are "free" follow the equation of motion."""

    kind: Literal["displacement"]
    displacement: VectorOrFree = Field(description="a formula in X, Y, Z, t or 'free' for each component [m]")


@boundary_kind
class FictitiousLayer(Timed, Reporting, MotionCondition):
    """A layer of fictitious particles, the part of a body on one side of a plane, with prescribed displacement.

    As wide as the horizon it holds the rest of the body at the plane (Galadima et al., section 8), with an error of
    first order.
    """

    kind: Literal["layer"]
    plane: Plane = Field(description="a plane such as 'Y = 0' through the body")
    side: Literal["above", "below"] = Field(description="'above' or 'below': where along the plane's axis the layer is")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")
    displacement: VectorOrFree | None = Field(
        None, description="a formula or 'free' for each component [m], zero unless given"
    )

    @property
    def region(self) -> Region:
        """One side of the plane."""
        return Beside(self.plane, self.side)

    @property
    def prescribed(self) -> LoadHistory:
        """The displacement in time."""
        return LoadHistory(self.displacement or FormulaVector([Formula(0.0)] * 3), self)
