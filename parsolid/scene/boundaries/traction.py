"""Tractions on planes that bound a body."""

from typing import ClassVar, Literal

from pydantic import Field

from parsolid.scene.base_model import Name, Plane
from parsolid.scene.boundaries.condition import Condition, Reporting, boundary_kind
from parsolid.scene.formulas import Vector
from parsolid.scene.load_histories import LoadHistory, Timed
from parsolid.scene.named_regions import RegionName


@boundary_kind
class Traction(Condition, Timed, Reporting):
    """Traction [Pa] per reference area on a plane that bounds the body, or on its surface in a region with a name."""

    exactly_one: ClassVar = (("plane", "where"),)
    needs_bounding_plane: ClassVar[bool] = True
    kind: Literal["traction"]
    plane: Plane | None = Field(None, description="a plane such as 'Y = 0' that bounds the body")
    where: RegionName | None = Field(None, description="a region with a name, or a group of a mesh")
    body: Name | None = Field(None, description="only this body is meant; all of them unless given")
    traction: Vector = Field(description="a formula in X, Y, Z, t for each component [Pa]")

    @property
    def prescribed(self) -> LoadHistory:
        """The traction in time."""
        return LoadHistory(self.traction, self)
