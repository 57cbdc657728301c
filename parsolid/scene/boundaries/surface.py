"""Pressure that follows a surface, springs and dashpots on it."""

from typing import Any, ClassVar, Literal

from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import Name, NotNegative, Plane, method_of, reject
from parsolid.scene.boundaries.condition import Condition, Reporting, boundary_kind
from parsolid.scene.formulas import Scalar
from parsolid.scene.load_histories import Timed
from parsolid.scene.named_regions import RegionName
from parsolid.scene.regions import InBall, InBox, Region
from parsolid.scene.shapes import Box, Sphere
from parsolid.scene.validation_errors import NOTHING


class OnSurface(Condition, Reporting):
    """A condition on a body's surface: on a plane that bounds it, or in a region with a name."""

    exactly_one: ClassVar[tuple[tuple[str, ...], ...]] = (("plane", "where"),)
    needs_bounding_plane: ClassVar[bool] = True
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0' that bounds the body")
    where: RegionName | None = Field(None, description="a region with a name, or a group of a mesh")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")


@boundary_kind
class Pressure(OnSurface, Timed):
    """Pressure [Pa] on a body's surface: on a plane that bounds it, in a region with a name, in a box or a ball.

    On a plane and in a region it is on the deformed surface, against its present normal: -p da = -p cof(F) dA. In
    peridynamics it is per reference area, on all of the surface within the region, box or ball, which must hold what
    lies within two horizons of that surface, and no other free surface.
    """

    exactly_one: ClassVar = (("plane", "where", "box", "ball"),)
    kind: Literal["pressure"]
    box: Box | None = None
    ball: Sphere | None = None
    pressure: Scalar = Field(description="a formula in X, Y, Z, t [Pa]")

    @model_validator(mode="after")
    def _known_place(self, info: ValidationInfo) -> "Pressure":
        method: Any = method_of(info)
        known, (places,) = getattr(method, "pressed", ()), self.exactly_one
        wrong = [key for key in places if getattr(self, key) is not None and key not in known]
        if method is not None and wrong:
            reject(((wrong[0],), f"one of {', '.join(known)} with this method", Phrase(wrong[0])))
        return self

    @property
    def region(self) -> Region:
        """The plane, region, box or ball."""
        if self.box is not None:
            return InBox(self.box.lower, self.box.upper)
        if self.ball is not None:
            return InBall(self.ball.centre, self.ball.radius)
        return super().region


@boundary_kind
class Spring(OnSurface):
    """Springs and dashpots from the surface to rest: a traction -k u - c v per reference area.

    along: "normal" for the part along the reference normal alone
    """

    kind: Literal["spring"]
    stiffness: NotNegative = Field(0.0, description="stiffness per reference area [Pa/m]")
    damping: NotNegative = Field(0.0, description="damping per reference area [Pa s/m]")
    along: Literal["all", "normal"] = Field("all", description="all directions, or the normal alone")

    @model_validator(mode="after")
    def _some(self) -> "Spring":
        if not self.stiffness and not self.damping:
            reject((("stiffness",), "a stiffness or a damping above 0", NOTHING))
        return self
