"""Updated-Lagrangian SPH as a scene states it."""

from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator

from parsolid.methods.failure_fields import DAMAGE
from parsolid.methods.plastic_fields import (
    FLOW_FIELDS,
    fields_of_no_body,
    flow_fields_of_no_body,
    temperatures_without_heat,
)
from parsolid.methods.ulsph.state import MICRO_STATE, STATE
from parsolid.pairs.smoothing import kernel_names, smoothing_kernel
from parsolid.scene.base_model import Detail, NotNegative, Positive, SceneModel, mismatch
from parsolid.scene.method_settings import MethodSettings, named_observables
from parsolid.scene.plasticity import QUANTITIES, faults_of_names

# names that only one kind of material has
_KIND_OF = {
    "micro_rate": "micro-inertia",
    "micro_stress": "micro-inertia",
    "micro_kinetic": "micro-inertia",
    "internal_energy": "elastic-plastic",
}
# keys of elastic-plastic solids that the material point method alone takes
# particles across a slender body from which its bending stiffness is right within 15 %
_BENDING_LAYERS = 8
_OF_THE_GRID = ("conductivity_tensor",)


class Viscosity(SceneModel):
    """Artificial viscosity in approach (Monaghan); its work is a column of the history, and heats where the scene says
    so."""

    linear: NotNegative = Field(1.0, description="factor alpha_1 of the speed of sound")
    quadratic: NotNegative = Field(1.0, description="factor alpha_2 of the velocity jump")
    softening: Positive = Field(0.01, description="share of h^2 added to the squared distance")


class UpdatedLagrangianSPH(MethodSettings):
    """Updated-Lagrangian SPH with rebuilt neighbours (Rahaman et al., mended)."""

    system: ClassVar = "parsolid.methods.ulsph.system:UpdatedLagrangianSPH"
    in_cells: ClassVar = True
    materials: ClassVar = ("micro-inertia", "elastic-plastic", "hyperelastic")
    reactions: ClassVar = ("fixed", "roller", "velocity", "rotation", "wall", "traction", "spring")
    boundaries: ClassVar = (*reactions, "antisymmetric", "micro-hard", "temperature")
    planes_move: ClassVar = True
    strained: ClassVar = False
    state_variables: ClassVar = (
        *("velocity", "density", "deviator", "temperature", "energy", "plastic_strain", "damage", "criterion_damage"),
        *("micro_rate", "micro_stress", "micro_curl", "micro_gradient"),
        *("energetic_flux", "dissipative_flux", "heat_flux", "back_stress", "volume_flow"),
        *("deformation_gradient", "viscous_strain_inverses"),
    )
    state_of_particles: ClassVar = ("deleted_*",)
    state_forces: ClassVar = (
        *("pair_*", "force", "viscous_force", "viscous_heat", "correction", "micro_curl", "micro_gradient"),
    )
    refused: ClassVar = {
        "displacement": "motion is prescribed as a velocity or a rotation",
        "layer": "a part of a body is held by 'fixed' in a region",
        "pressure": "a present area needs a deformation gradient; 'traction' is per reference area",
        "heat-flux": "heat comes through planes of a temperature",
    }
    declared_fields: ClassVar = (*STATE, *MICRO_STATE, DAMAGE)
    extra_fields: ClassVar = {
        **FLOW_FIELDS,
        **dict.fromkeys(("internal_energy", "sound_speed", "smoothing_length", "viscous_heat"), "scalar"),
        **dict.fromkeys(("criterion_damage", "micro_curl"), "scalar"),
        **dict.fromkeys(("force", "viscous_force", "heat_flux", "area"), "vector"),
        **dict.fromkeys(("micro_gradient", "energetic_flux", "dissipative_flux"), "vector"),
    }
    pictured_fields: ClassVar = ("plastic_strain", "von_mises_stress", "pressure")
    ledger_terms: ClassVar = {
        "viscous_dissipation": 1,
        "kinetic_offset": -1,
        "heat_supplied": 0,
        "heat_stored": -1,
        "plastic_work": 0,
        "viscous_heat": 0,
        "viscous_heat_to_come": 1,
    }
    viscous_terms: ClassVar = ("viscous_dissipation", "viscous_heat")
    extra_quantities: ClassVar = {
        "maximum_temperature": "scalar",
        "maximum_plastic_strain": "scalar",
        "maximum_von_mises_stress": "scalar",
        "mean_plastic_strain": "scalar",
        "micro_kinetic": "scalar",
        "heat": "scalar",
        "lower_bounds": "vector",
        "upper_bounds": "vector",
    } | QUANTITIES

    kind: Literal["ulsph"]
    kernel: Literal[kernel_names()] = Field(  # type: ignore[valid-type]
        "cubic-spline", description="the smoothing kernel"
    )
    smoothing: Positive = Field(1.3, description="smoothing length over particle spacing, h/dx")
    # the equation of state is integrated, not the derivative of a stored energy
    balance_warning: Positive = 0.03
    cfl: Positive = Field(0.3, description="time step over h / (wave speed + particle speed)")
    gradient_correction: bool = Field(
        True, description="gradients exact for linear fields, where a particle has enough neighbours"
    )
    viscosity: Viscosity | Literal[False] = Field(Viscosity(), description="artificial viscosity; false: none")
    viscous_heating: bool = Field(
        False, description="its heat raises the temperature of micro-inertia; that of other laws it always raises"
    )
    contact: Literal["compression", "welded"] | None = Field(
        None, description="bodies press on one another and part freely ('compression'), or stick ('welded')"
    )
    skin: Positive = Field(
        0.25, description="by how much lists reach beyond the support, as a part of it; made anew when it is used up"
    )
    rebalance: float = Field(
        1.1, gt=1, description="growth of the busiest rank's particles and ghosts beyond which all are dealt out anew"
    )

    @field_validator("viscosity", mode="wrap", json_schema_input_type=Viscosity | Literal[False])
    @classmethod
    def _table_or_false(cls, value: Any, handler: Any, info: ValidationInfo) -> Any:
        if isinstance(value, dict):
            return Viscosity.model_validate(value, context=info.context)
        if value is False or isinstance(value, Viscosity):
            return value
        raise mismatch("a table or false", value)

    def touching(self) -> str:
        """How bodies meet: they press on one another unless they are welded."""
        return super().touching() if self.contact == "welded" else "pressing on one another where they touch"

    def reach(self, spacing: np.ndarray) -> np.ndarray:
        length = self.smoothing * float(np.prod(spacing)) ** (1.0 / len(spacing))
        return np.full(len(spacing), smoothing_kernel(self.kernel).support * length)

    def contact_distance(self, spacing: np.ndarray) -> np.ndarray:
        return np.maximum(self.reach(spacing), spacing)

    def bending_fault(self, across: int, spacing: float) -> tuple[str, bool] | None:
        """Gradients beside free faces are one-sided: cantilevers and plates vibrate too slowly (docs/ulsph.md)."""
        if across >= _BENDING_LAYERS:
            return None
        slower = "their bending vibrations are 35 % too slow with 3 particles across, 22 with 4, 11 with 6, 7 with 8"
        return f"{slower}; take {_BENDING_LAYERS} or more, or 'tlsph'", False

    def contact_refused(self, scene: Any) -> str | None:
        return None

    def scene_faults(self, scene: Any) -> list[Detail]:
        """Keys without an effect, conditions and names that no body of the scene has."""
        details: list[Detail] = []
        for i, body in enumerate(scene.bodies):
            parts = getattr(body.material, "parts", {})
            here, other = ("bodies", i, "material"), [key for key in _OF_THE_GRID if parts.get(key)]
            details += [((*here, key), "no such key with this method", parts[key]) for key in other]
        if self.contact is not None and len(scene.bodies) == 1:
            details.append((("method", "contact"), "no such key with one body", self.contact))
        if self.viscous_heating and self.viscosity is False:
            details.append((("method", "viscous_heating"), "false without viscosity", True))
        kinds = {body.material.kind for body in scene.bodies}
        micro = "micro-inertia" in kinds
        if self.viscous_heating and not micro:
            expected = "no such key without micro-inertia: elastic-plastic laws always take it up, elastic ones never"
            details.append((("method", "viscous_heating"), expected, True))
        needed = {"micro-hard": micro, "temperature": micro or "elastic-plastic" in kinds}
        for i, boundary in enumerate(scene.boundaries):
            if not needed.get(boundary.kind, True):
                wanted = "micro-inertia" if boundary.kind == "micro-hard" else "a temperature"
                details.append((("boundaries", i, "kind"), f"a body with {wanted}", boundary.kind))
        of_flow = flow_fields_of_no_body(scene)
        if not needed["temperature"]:
            of_flow = fields_of_no_body(scene) + temperatures_without_heat(scene)
        wanted, one = "a field or quantity that a body of this scene has", next(iter(kinds))
        named = named_observables(scene)
        details += [(place, wanted, name) for place, name in named if _KIND_OF.get(name, one) not in kinds]
        return details + of_flow + faults_of_names(scene)
