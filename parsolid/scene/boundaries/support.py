"""Supports: planes of symmetry, rest and antisymmetry."""

from typing import TYPE_CHECKING, ClassVar, Literal

from pydantic import Field

from parsolid.scene.base_model import Plane
from parsolid.scene.bodies import Name
from parsolid.scene.boundaries.condition import Condition, boundary_kind

if TYPE_CHECKING:
    from parsolid.boundary.declarations import Declarations


@boundary_kind
class Support(Condition):
    """A support on a plane that bounds the body.

    fixed          no velocity
    roller         no velocity along the normal, no shear traction: a plane of symmetry
    antisymmetric  no velocity in the plane, no normal traction: the image moves with v' = -R v, R the reflection

    With `mirror` the particles have images beyond the plane; without it the particles on the plane are clamped only,
    which leaves first-order errors beside the plane.
    """

    needs_bounding_plane: ClassVar[bool] = True
    kind: Literal["fixed", "roller", "antisymmetric"]
    plane: Plane = Field(description="a plane such as 'Y = 0' that bounds the body")
    body: Name | None = None
    mirror: bool = True

    def declare(self, to: "Declarations") -> None:
        """A mirror plane, or a clamp."""
        to.support(self, self.kind, self.mirror)
