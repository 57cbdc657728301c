"""Supports: planes of symmetry, rest and antisymmetry."""

from typing import Any, Literal

from pydantic import Field, model_validator

from parsolid.scene.base_model import reject
from parsolid.scene.boundaries.condition import boundary_kind
from parsolid.scene.boundaries.surface import OnSurface


@boundary_kind
class Support(OnSurface):
    """A support on a plane that bounds the body, or in a region with a name.

    fixed          no velocity
    roller         no velocity along the normal, no shear traction: a plane of symmetry
    antisymmetric  no velocity in the plane, no normal traction: the image moves with v' = -R v, R the reflection

    With `mirror` the particles have images beyond the plane; without it the particles on the plane are clamped only,
    which leaves first-order errors beside the plane. In a region with a name no particle has images: "fixed" holds all
    particles there, "roller" and "antisymmetric" those of the body's surface there, along and across its normal.
    """

    kind: Literal["fixed", "roller", "antisymmetric"]
    mirror: bool = Field(
        True, description="particles have images beyond the plane; without them those on the plane are clamped only"
    )

    @model_validator(mode="before")
    @classmethod
    def _no_images(cls, table: Any) -> Any:
        """Regions with a name have no images."""
        return {"mirror": False} | table if isinstance(table, dict) and table.get("where") is not None else table

    @model_validator(mode="after")
    def _refuse_images(self) -> "Support":
        if self.where is not None and self.mirror:
            reject((("mirror",), "false in a region with a name (images are beyond a plane)", self.mirror))
        return self
