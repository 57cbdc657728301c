"""Methods as a scene states them; a new method is one class more, told apart by its `kind`."""

from typing import Any, ClassVar, Literal

from pydantic import Field

from parsolid.scene.base_model import ByKind, NotNegative, Positive, by_kind
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.mpm import MaterialPoint
from parsolid.scene.peridynamics import Peridynamics


class TotalLagrangianSPH(MethodSettings):
    """Upwind total-Lagrangian smoothed particle hydrodynamics (Lee et al.)."""

    materials: ClassVar = ("hyperelastic",)
    boundaries: ClassVar = ("fixed", "roller", "antisymmetric", "velocity", "traction")
    kind: Literal["tlsph"]
    kernel: Literal["wendland-c2", "cubic-spline", "quintic-spline"] = "wendland-c2"
    smoothing: Positive = Field(0.85, description="smoothing length over particle spacing, h/dx")
    cfl: Positive = Field(0.7, description="time step over (particle spacing / largest wave speed)")
    dissipation: NotNegative = Field(1.0, description="factor on the Riemann dissipation, 0 = none")
    reconstruction: bool = Field(True, description="linear reconstruction of the velocity jump")
    pair_correction: Literal["none", "closure"] = Field(
        "none",
        description='"closure" for irregular particles: weights under which a constant stress has no force inside',
    )


_SETTINGS = (TotalLagrangianSPH, Peridynamics, MaterialPoint)
Method = by_kind(*_SETTINGS)


def settings_class(table: object) -> type[MethodSettings] | None:
    """The class of a raw table's settings; None when it names no method."""
    kinds: Any = ByKind(_SETTINGS)
    chosen: type[MethodSettings] | None = kinds.choose(table)
    return chosen
