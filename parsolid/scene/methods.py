"""Methods as a scene states them; a new method is one class more, told apart by its `kind`."""

from typing import Literal

from pydantic import Field, model_validator

from parsolid.scene.section import NotNegative, Positive, Section, by_kind, reject


class TotalLagrangianSPH(Section):
    """Upwind total-Lagrangian smoothed particle hydrodynamics (Lee et al.)."""

    kind: Literal["tlsph"]
    kernel: Literal["wendland-c2", "cubic-spline", "quintic-spline"] = "wendland-c2"
    smoothing: Positive = Field(0.85, description="smoothing length over particle spacing, h/dx")
    cfl: Positive = Field(0.7, description="time step over (particle spacing / largest wave speed)")
    dissipation: NotNegative = Field(1.0, description="factor on the Riemann dissipation, 0 = none")
    reconstruction: bool = Field(True, description="linear reconstruction of the velocity jump")
    pair_correction: Literal["none", "closure"] = Field(
        "none", description='"closure" for irregular particles: weights under which a constant stress has no force inside'
    )
    maximum_step: Positive | None = Field(None, description="the largest time step [s]")
    minimum_step: Positive | None = Field(None, description="the time step [s] below which the run stops")

    @model_validator(mode="after")
    def _ordered(self) -> "TotalLagrangianSPH":
        if self.maximum_step is not None and self.minimum_step is not None and self.minimum_step > self.maximum_step:
            reject((("minimum_step",), f"at most maximum_step = {self.maximum_step:g}", self.minimum_step))
        return self


Method = by_kind(TotalLagrangianSPH)
