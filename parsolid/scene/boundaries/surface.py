"""Pressure that follows a surface, springs and dashpots on it."""

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field, model_validator

from parsolid.scene.base_model import NotNegative, Plane, reject
from parsolid.scene.bodies import Name
from parsolid.scene.boundaries.condition import Condition, Reporting, boundary_kind
from parsolid.scene.formulas import FormulaVector, Scalar
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.scene.named_regions import RegionName
from parsolid.scene.validation_errors import NOTHING

if TYPE_CHECKING:
    from parsolid.boundary.declarations import Declarations


class OnSurface(Condition, Reporting):
    """A condition on a body's surface: on a plane that bounds it, or in a region with a name."""

    exactly_one: ClassVar = (("plane", "where"),)
    needs_bounding_plane: ClassVar[bool] = True
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0' that bounds the body")
    where: RegionName | None = None
    body: Name | None = None


@boundary_kind
class Pressure(OnSurface, Timed):
    """Pressure [Pa] on the deformed surface, against its present normal: -p da = -p cof(F) dA."""

    kind: Literal["pressure"]
    pressure: Scalar = Field(description="a formula in X, Y, Z, t [Pa]")

    def declare(self, to: "Declarations") -> None:
        """A force on the present area."""
        to.pressure(self, LoadHistory(FormulaVector((self.pressure,)), self))


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

    def declare(self, to: "Declarations") -> None:
        """Springs and dashpots."""
        to.springs(self, self.stiffness, self.damping, self.along == "normal")
