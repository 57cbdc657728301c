"""Elastic-plastic solids of the material point method, as a scene states them: a law in parts, each told apart by its `kind`."""

import sys
from functools import cache, cached_property
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import NotNegative, Positive, SceneModel, by_kind, reject
from parsolid.scene.validation_errors import NOTHING, Phrase, suggestion

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_LIBRARY = Path(__file__).parents[1] / "materials" / "plastic" / "library.toml"


class MieGrueneisen(SceneModel):
    """P = P_H (1 - gamma (1 - J)/2) + gamma E about the Hugoniot U_s = C0 + S u_p, with the full Grueneisen coefficient."""

    kind: Literal["mie-grueneisen"]
    sound_speed: Positive = Field(description="C0 [m/s]")
    slope: float = Field(ge=1, description="S")
    gamma: NotNegative = Field(description="the full Grueneisen coefficient, 2.02 for copper")


class LinearVolume(SceneModel):
    """P = -K ln J."""

    kind: Literal["linear"]
    bulk_modulus: Positive = Field(description="K [Pa]")


class ConstantShearModulus(SceneModel):
    """A shear modulus that does not change."""

    kind: Literal["constant"]
    modulus: Positive = Field(description="mu [Pa]")


class SteinbergShearModulus(SceneModel):
    """mu = mu0 [1 + A P J^(1/3) - B (T - 300)] (Steinberg, Cochran & Guinan 1980)."""

    kind: Literal["steinberg-cochran-guinan"]
    modulus: Positive = Field(description="mu0 [Pa] at 300 K")
    pressure_coefficient: NotNegative = Field(description="A [1/Pa]")
    temperature_coefficient: NotNegative = Field(description="B [1/K]")


class NadalLePoac(SceneModel):
    """Shear modulus of Nadal & Le Poac 2003, which falls to zero at melting."""

    kind: Literal["nadal-le-poac"]
    modulus: Positive = Field(description="mu0 [Pa]")
    pressure_coefficient: NotNegative = Field(description="d(mu)/dP / mu0 [1/Pa]")
    width: Positive = Field(description="zeta, of the fall to zero")
    lindemann: Positive = Field(description="C")
    atomic_mass: Positive = Field(description="in atomic mass units")


class Varshni(SceneModel):
    """mu = mu0 - D/(exp(T0/T) - 1) (Varshni 1970)."""

    kind: Literal["varshni"]
    modulus: Positive = Field(description="mu0 [Pa] at 0 K")
    drop: NotNegative = Field(description="D [Pa]")
    temperature: Positive = Field(description="T0 [K]")


class LinearSoftening(SceneModel):
    """mu = G0 (1 - alpha T/T_m) (Preston, Tonks & Wallace 2003)."""

    kind: Literal["linear-softening"]
    modulus: Positive = Field(description="G0 [Pa] at 0 K")
    softening: float = Field(ge=0, lt=1, description="alpha")


class LinearHardening(SceneModel):
    """sigma_y = yield_stress + hardening ep; perfect plasticity without hardening."""

    kind: Literal["linear-hardening"]
    yield_stress: Positive = Field(description="the yield stress [Pa]")
    hardening: NotNegative = Field(0.0, description="the slope over the equivalent plastic strain [Pa]")


class JohnsonCook(SceneModel):
    """sigma_y = (A + B ep^n) (1 + C ln(rate/reference_rate)) (1 - T*^m), the logarithm not below 0, T* in [0, 1]."""

    kind: Literal["johnson-cook"]
    yield_stress: Positive = Field(description="A [Pa]")
    hardening: NotNegative = Field(description="B [Pa]")
    exponent: Positive = Field(description="n")
    rate_sensitivity: NotNegative = Field(description="C")
    thermal_exponent: Positive = Field(description="m")
    reference_rate: Positive = Field(1.0, description="[1/s]")
    reference_temperature: Positive = Field(description="where T* = 0 [K]")


class ZerilliArmstrong(SceneModel):
    """sigma_y = sigma_a + B0 sqrt(ep) exp(-a0 T + a1 T ln rate), for face-centred cubic metals."""

    kind: Literal["zerilli-armstrong"]
    athermal_stress: Positive = Field(description="sigma_a, grain size included [Pa]")
    hardening: NotNegative = Field(description="B0 [Pa]")
    softening: NotNegative = Field(description="a0 [1/K]")
    rate_sensitivity: NotNegative = Field(description="a1 [1/K]")


class ThermalActivation(SceneModel):
    """Rate term of Steinberg & Lund 1989."""

    frequency: Positive = Field(description="C1 [1/s]")
    kink_energy: Positive = Field(description="U_k [J]")
    peierls_stress: Positive = Field(description="Y_P [Pa]")
    drag: NotNegative = Field(description="C2 [Pa s]")


class SteinbergCochranGuinan(SceneModel):
    """sigma_y = (Y_T + min(sigma_0 [1 + beta (ep + ep_i)]^n, Y_max)) mu/mu0; Y_T is that of `activation`, 0 without."""

    kind: Literal["steinberg-cochran-guinan-lund"]
    yield_stress: Positive = Field(description="sigma_0 [Pa]")
    greatest_yield_stress: Positive = Field(description="Y_max [Pa]")
    shear_modulus: Positive = Field(description="mu0 [Pa]")
    hardening: NotNegative = Field(description="beta")
    exponent: Positive = Field(description="n")
    initial_strain: NotNegative = Field(0.0, description="ep_i")
    activation: ThermalActivation | None = None

    @model_validator(mode="after")
    def _ordered(self) -> "SteinbergCochranGuinan":
        if self.greatest_yield_stress < self.yield_stress:
            reject(
                (
                    ("greatest_yield_stress",),
                    f"at least yield_stress = {self.yield_stress:g}",
                    self.greatest_yield_stress,
                )
            )
        return self


class PrestonTonksWallace(SceneModel):
    """sigma_y = 2 tau(ep, rate, T/T_m) mu of Preston, Tonks & Wallace 2003."""

    kind: Literal["preston-tonks-wallace"]
    hardening: Positive = Field(description="theta")
    hardening_exponent: Positive = Field(description="p")
    saturation_cold: Positive = Field(description="s_0")
    saturation_hot: Positive = Field(description="s_inf")
    activation: Positive = Field(description="kappa")
    rate_scale: Positive = Field(description="gamma")
    yield_cold: Positive = Field(description="y_0")
    yield_hot: Positive = Field(description="y_inf")
    medium_yield: Positive = Field(description="y_1")
    medium_exponent: Positive = Field(description="y_2")
    overdriven_exponent: Positive = Field(description="beta")
    atomic_mass: Positive = Field(description="in atomic mass units")


class MechanicalThreshold(SceneModel):
    """sigma_y = sigma_a + S(rate, T) sigma_e(ep) mu/mu0 of Follansbee & Kocks 1988."""

    kind: Literal["mechanical-threshold"]
    athermal_stress: NotNegative = Field(description="sigma_a [Pa]")
    shear_modulus: Positive = Field(description="mu0 [Pa]")
    boltzmann_over_burgers: Positive = Field(description="k/b^3 [Pa/K]")
    activation: Positive = Field(description="g0")
    activation_rate: Positive = Field(description="edot0 [1/s]")
    p: Positive
    q: Positive
    hardening: Positive = Field(description="a0 [Pa]")
    hardening_log_rate: float = Field(0.0, description="a1 [Pa]")
    hardening_root_rate: float = Field(0.0, description="a2 [Pa]")
    hardening_temperature: float = Field(0.0, description="a3 [Pa/K]")
    alpha: Positive
    saturation_stress: Positive = Field(description="sigma_es0 [Pa]")
    saturation_activation: Positive = Field(description="g0s")
    saturation_rate: Positive = Field(description="edot_s [1/s]")


class ConstantMelting(SceneModel):
    """A melting temperature that does not change."""

    kind: Literal["constant"]
    temperature: Positive = Field(description="[K]")


class SteinbergMelting(SceneModel):
    """T_m = T_m0 exp(2 a (1 - J)) J^(-2 (gamma - a - 1/3)) (Steinberg, Cochran & Guinan 1980)."""

    kind: Literal["steinberg-cochran-guinan"]
    temperature: Positive = Field(description="T_m0 [K]")
    gamma: Positive = Field(description="the Grueneisen coefficient")
    volume_coefficient: NotNegative = Field(description="a")


EquationOfState = by_kind(MieGrueneisen, LinearVolume)
ShearModulus = by_kind(ConstantShearModulus, SteinbergShearModulus, NadalLePoac, Varshni, LinearSoftening)
FlowStress = by_kind(
    LinearHardening, JohnsonCook, ZerilliArmstrong, SteinbergCochranGuinan, PrestonTonksWallace, MechanicalThreshold
)
Melting = by_kind(ConstantMelting, SteinbergMelting)


class ElasticPlastic(SceneModel):
    """Elastic-plastic solid with an equation of state and heat (Banerjee).

    With `library`, what is not given is that of the material library; without, everything but conductivity and melting is
    needed. youngs_modulus and poissons_ratio are short for a linear equation of state and a constant shear modulus.
    """

    kind: Literal["elastic-plastic"]
    library: str | None = Field(None, description="a name of parsolid/materials/plastic/library.toml")
    density: Positive | None = Field(None, description="the density [kg/m^3]")
    specific_heat: Positive | None = Field(None, description="C_v [J/(kg K)]")
    reference_temperature: Positive | None = Field(None, description="of no stress and energy [K], 300 unless given")
    taylor_quinney: float | None = Field(
        None, ge=0, le=1, description="share of the plastic work that heats, 0.9 unless given"
    )
    conductivity: Positive | None = Field(None, description="of heat [W/(m K)]")
    youngs_modulus: Positive | None = Field(None, description="Young's modulus [Pa]")
    poissons_ratio: float | None = Field(None, gt=-1, lt=0.5, description="Poisson's ratio")
    equation_of_state: EquationOfState | None = None
    shear_modulus: ShearModulus | None = None
    flow_stress: FlowStress | None = None
    melting: Melting | None = None
    integration: Literal["radial-return", "rate-form"] = Field(
        "radial-return", description="the rate form is the paper's"
    )

    @model_validator(mode="after")
    def _complete(self, info: ValidationInfo) -> "ElasticPlastic":
        if self.library is not None and self.library not in library():
            expected = f"one of {', '.join(map(repr, library()))}{suggestion(self.library, library())}"
            reject((("library",), expected, self.library))
        details = []
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            details.append(((), "both youngs_modulus and poissons_ratio, or neither", Phrase("one of them")))
        if self.youngs_modulus is not None:
            for key in ("equation_of_state", "shear_modulus"):
                if getattr(self, key) is not None:
                    details.append(((key,), "no such key with youngs_modulus", Phrase("it")))
        reject(*details)
        needed = ("density", "specific_heat", "equation_of_state", "shear_modulus", "flow_stress")
        missing = [key for key in needed if self.parts[key] is None]
        details = [((key,), "a value (or a library that has it)", NOTHING) for key in missing]
        for key, kinds in _NEED_MELTING.items():
            part = self.parts[key]
            if self.parts["melting"] is None and part is not None and part.kind in kinds:
                details.append((("melting",), f"a table, needed by the {key.replace('_', ' ')} {part.kind!r}", NOTHING))
        reject(*details)
        return self

    @cached_property
    def parts(self) -> dict[str, Any]:
        """Every parameter and part, with the library's and the defaults where the scene gives none."""
        known = None if self.library is None else library()[self.library]
        result = {"conductivity": None, "melting": None, "reference_temperature": 300.0, "taylor_quinney": 0.9}
        for key in (*_SHARED, "equation_of_state", "shear_modulus", "flow_stress", "melting"):
            stated = getattr(self, key)
            if stated is None and known is not None:
                stated = known.parts[key]
            if stated is not None or key not in result:
                result[key] = stated
        if self.youngs_modulus is not None:
            E, nu = self.youngs_modulus, self.poissons_ratio
            result["equation_of_state"] = LinearVolume(kind="linear", bulk_modulus=E / (3.0 * (1.0 - 2.0 * nu)))
            result["shear_modulus"] = ConstantShearModulus(kind="constant", modulus=E / (2.0 * (1.0 + nu)))
        return result


_SHARED = ("density", "specific_heat", "reference_temperature", "taylor_quinney", "conductivity")
_NEED_MELTING = {
    "flow_stress": ("johnson-cook", "preston-tonks-wallace"),
    "shear_modulus": ("nadal-le-poac", "linear-softening"),
}


@cache
def library() -> dict[str, ElasticPlastic]:
    """The material library: name -> material, without names of other materials."""
    with open(_LIBRARY, "rb") as file:
        tables = tomllib.load(file)
    return {
        name: ElasticPlastic.model_validate(
            {"kind": "elastic-plastic"} | {k: v for k, v in table.items() if k != "source"}
        )
        for name, table in tables.items()
    }
