"""Supports: planes of symmetry, rest and antisymmetry."""

from typing import Any, Literal

import numpy as np
from pydantic import Field, model_validator

from parsolid.scene.base_model import reject
from parsolid.scene.boundaries.condition import boundary_kind
from parsolid.scene.boundaries.surface import OnSurface
from parsolid.scene.formulas import VectorOrFree


@boundary_kind
class Support(OnSurface):
    """A support on a plane that bounds the body, or in a region with a name.

    fixed          no velocity
    roller         no velocity along the normal, no shear traction: a plane of symmetry
    antisymmetric  no velocity in the plane, no normal traction: the image moves with v' = -R v, R the reflection

    With `mirror` the particles have images beyond the plane; without it the particles on the plane are clamped only,
    which leaves first-order errors beside the plane. In a region with a name no particle has images: "fixed" holds all
    particles there, "roller" and "antisymmetric" those of the body's surface there, along and across its normal.

    A plane with a `velocity` moves: the components that the kind holds are those of the plane. Images lie at the
    present place of the plane and move with v' = Q v + 2 w, which is exact for a linear velocity.
    """

    kind: Literal["fixed", "roller", "antisymmetric"]
    mirror: bool = Field(
        True, description="particles have images beyond the plane; without them those on the plane are clamped only"
    )

    velocity: VectorOrFree | None = Field(
        None,
        description="of the plane [m/s], formulas in t, 'free' where the kind holds nothing; at rest unless given",
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

    def holds(self, dimension: int) -> np.ndarray:
        """Which components (d,) of the velocity the plane has."""
        assert self.plane is not None
        normal = np.arange(dimension) == self.plane.axis
        return np.array({"roller": normal, "fixed": normal | True, "antisymmetric": ~normal}[self.kind])

    @model_validator(mode="after")
    def _refuse_velocity(self) -> "Support":
        if self.velocity is None:
            return self
        if self.plane is None or not self.mirror:
            reject((("velocity",), "no such key without images beyond a plane", self.velocity.sources))
            return self
        for i, (one, held) in enumerate(zip(self.velocity, self.holds(len(self.velocity)))):
            if held != (one is not None):
                expected = "a formula in t" if held else "'free', as this kind holds nothing there"
                reject((("velocity", i), expected, "free" if one is None else one.source))
            elif one is not None and set(one.names) - {"t"}:
                reject((("velocity", i), "a formula in t alone", one.source))
        return self
