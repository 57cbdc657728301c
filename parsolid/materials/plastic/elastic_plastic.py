"""Hypoelastic-plastic solid with an equation of state; its parts are chosen by type.

sigma = s - (P + q) 1. The deviator is carried unrotated (Green-Naghdi rate), flow is isochoric and associated (d^p
along s), P follows from the full internal energy, and the temperature enters flow stress, shear modulus and melting
alone.
"""

from typing import Any, NamedTuple

from parsolid.materials.plastic.rate_form import RateForm

# parts, each told apart by its kind or found in a file of its own
PARTS = ("equation_of_state", "shear_modulus", "flow_stress", "melting")


class ElasticPlastic(NamedTuple):
    """Parameters in SI units; the parts are NamedTuples of `materials`.

    density [kg/m^3], specific_heat C_v [J/(kg K)], reference_temperature [K] of the state without stress and energy,
    taylor_quinney: share of the plastic work that heats; conductivity [W/(m K)] or None; equation_of_state,
    shear_modulus, flow_stress, melting (None: never).
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

    def internal_energy(self, temperature: Any, without_energy: Any = None) -> Any:
        """E [J/m^3] of the undeformed body at temperatures [K]; 0 at others, the reference unless given."""
        cold = self.reference_temperature if without_energy is None else without_energy
        return self.density * self.specific_heat * (temperature - cold)


def of_material(material) -> ElasticPlastic:
    """The law of a material of kind "elastic-plastic" as a scene states it."""
    stated = material.parts
    density = float(stated["density"])
    parts = {key: None if stated[key] is None else stated[key].part_of(density=density) for key in PARTS}
    if material.integration == "rate-form":
        parts["flow_stress"] = RateForm(parts["flow_stress"])
    numbers = ("density", "specific_heat", "reference_temperature", "taylor_quinney")
    conductivity = stated["conductivity"]
    numbers = {key: float(stated[key]) for key in numbers}
    return ElasticPlastic(conductivity=None if conductivity is None else float(conductivity), **numbers, **parts)
