"""Total-Lagrangian SPH as a scene states it."""

from typing import ClassVar, Literal

from pydantic import Field

from parsolid.pairs.smoothing import kernel_names
from parsolid.scene.base_model import NotNegative, Positive
from parsolid.scene.method_settings import MethodSettings


class TotalLagrangianSPH(MethodSettings):
    """Upwind total-Lagrangian smoothed particle hydrodynamics (Lee et al.)."""

    system: ClassVar = "parsolid.methods.tlsph.system:TotalLagrangianSPH"
    materials: ClassVar = ("hyperelastic",)
    boundaries: ClassVar = ("fixed", "roller", "antisymmetric", "velocity", "traction")
    kind: Literal["tlsph"]
    kernel: Literal[kernel_names()] = "wendland-c2"  # type: ignore[valid-type]
    smoothing: float = Field(0.85, gt=0, le=30, description="smoothing length over particle spacing, h/dx, at most 30")
    cfl: Positive = Field(0.7, description="time step over (particle spacing / largest wave speed)")
    dissipation: NotNegative = Field(1.0, description="factor on the Riemann dissipation, 0 = none")
    reconstruction: bool = Field(True, description="linear reconstruction of the velocity jump")
    pair_correction: Literal["none", "closure"] = Field(
        "none",
        description='"closure" for irregular particles: weights under which a constant stress has no force inside',
    )
