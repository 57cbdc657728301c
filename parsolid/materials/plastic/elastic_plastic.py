"""Hypoelastic-plastic solid with an equation of state; its parts are chosen by type.

sigma = s - (P + q) 1. The deviator is carried unrotated (Green-Naghdi rate), flow is isochoric and associated (d^p along s),
P follows from the full internal energy, and the temperature enters flow stress, shear modulus and melting alone.
"""

from typing import Any, NamedTuple

from parsolid.materials.plastic.equation_of_state import LinearElastic, MieGrueneisen
from parsolid.materials.plastic.johnson_cook import JohnsonCook
from parsolid.materials.plastic.linear_hardening import LinearHardening
from parsolid.materials.plastic.mechanical_threshold import MechanicalThreshold
from parsolid.materials.plastic.melting import ConstantMelting, SteinbergMelting
from parsolid.materials.plastic.preston_tonks_wallace import PrestonTonksWallace
from parsolid.materials.plastic.rate_form import RateForm
from parsolid.materials.plastic.shear_modulus import (
    ConstantShearModulus,
    LinearSoftening,
    NadalLePoac,
    SteinbergShearModulus,
    Varshni,
)
from parsolid.materials.plastic.steinberg_cochran_guinan import SteinbergCochranGuinan, ThermalActivation
from parsolid.materials.plastic.zerilli_armstrong import ZerilliArmstrong


class ElasticPlastic(NamedTuple):
    """Parameters in SI units; the parts are NamedTuples of `materials`.

    density [kg/m^3], specific_heat C_v [J/(kg K)], reference_temperature [K] of the state without stress and energy,
    taylor_quinney: share of the plastic work that heats; conductivity [W/(m K)] or None; equation_of_state, shear_modulus,
    flow_stress, melting (None: never).
    """

    density: float
    specific_heat: float
    reference_temperature: float
    taylor_quinney: float
    conductivity: float | None
    equation_of_state: Any
    shear_modulus: Any
    flow_stress: Any
    melting: Any

    def internal_energy(self, temperature: float) -> float:
        """E [J/m^3] of the undeformed body at a temperature [K]."""
        return self.density * self.specific_heat * (temperature - self.reference_temperature)


_PARTS = {
    "equation_of_state": {"mie-grueneisen": MieGrueneisen, "linear": LinearElastic},
    "shear_modulus": {
        "constant": ConstantShearModulus,
        "steinberg-cochran-guinan": SteinbergShearModulus,
        "nadal-le-poac": NadalLePoac,
        "varshni": Varshni,
        "linear-softening": LinearSoftening,
    },
    "flow_stress": {
        "linear-hardening": LinearHardening,
        "johnson-cook": JohnsonCook,
        "zerilli-armstrong": ZerilliArmstrong,
        "steinberg-cochran-guinan-lund": SteinbergCochranGuinan,
        "preston-tonks-wallace": PrestonTonksWallace,
        "mechanical-threshold": MechanicalThreshold,
    },
    "melting": {"constant": ConstantMelting, "steinberg-cochran-guinan": SteinbergMelting},
}
_ATOMIC_MASS_UNIT = 1.66053906660e-27


def of_material(material) -> ElasticPlastic:
    """The law of a material of kind "elastic-plastic" as a scene states it."""
    stated = material.parts
    parts = {key: _part(kinds, stated[key], stated["density"]) for key, kinds in _PARTS.items()}
    if material.integration == "rate-form":
        parts["flow_stress"] = RateForm(parts["flow_stress"])
    numbers = ("density", "specific_heat", "reference_temperature", "taylor_quinney")
    conductivity = stated["conductivity"]
    numbers = {key: float(stated[key]) for key in numbers}
    return ElasticPlastic(conductivity=None if conductivity is None else float(conductivity), **numbers, **parts)


def _part(kinds: dict, stated, density: float):
    """The NamedTuple of one part; the material's density where it wants one."""
    if stated is None:
        return None
    kind, values = kinds[stated.kind], {"density": float(density)}
    for key in kind._fields:
        if key == "activation" and kind is SteinbergCochranGuinan:
            values[key] = None if stated.activation is None else ThermalActivation(**stated.activation.model_dump())
        elif key != "density":
            values[key] = float(getattr(stated, key))
    if "atomic_mass" in values:
        values["atomic_mass"] *= _ATOMIC_MASS_UNIT
    return kind(**{key: values[key] for key in kind._fields})
