"""Tractions on planes that bound a body."""

from typing import Literal

from pydantic import Field

from parsolid.scene.boundaries.condition import boundary_kind
from parsolid.scene.boundaries.surface import OnSurface
from parsolid.scene.formulas import Vector
from parsolid.scene.load_histories import Timed


@boundary_kind
class Traction(OnSurface, Timed):
    """Traction [Pa] per reference area on a plane that bounds the body, or on its surface in a region with a name."""

    kind: Literal["traction"]
    traction: Vector = Field(description="a formula in X, Y, Z, t for each component [Pa]")
