"""Hypoelastic-plastic solid with an equation of state; its parts are chosen by type.

sigma = s - (P + q) 1. The deviator is carried unrotated (Green-Naghdi rate), flow is isochoric and associated (d^p
along s, less the back stress of kinematic hardening), P follows from the full internal energy, and the temperature
enters flow stress, shear modulus and melting alone.
"""

from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np

from parsolid.materials.declaration import Parameter, Phrase, law
from parsolid.materials.failure.failure import Failure
from parsolid.materials.plastic.heat_capacity import HeatPoints, capacity_at, entropy_of, heat_of, rise_by_heat

# parts, each told apart by its kind or found in a file of its own
PARTS = ("equation_of_state", "shear_modulus", "flow_stress", "melting", "kinematic_hardening")


class ElasticPlastic(NamedTuple):
    """Parameters in SI units; the parts are NamedTuples of `materials`.

    density [kg/m^3], specific_heat C_v [J/(kg K)] at the reference_temperature [K], that of the state without stress
    and energy, and specific_heat_slope dC_v/dT [J/(kg K^2)], or heat_points in place of both; taylor_quinney: share of
    the plastic work that heats;
    conductivity [W/(m K)] or 0, the largest if there is a conductivity_tensor (xx yy zz xy xz yz, None: isotropic);
    equation_of_state, shear_modulus, flow_stress, melting (None: never), failure (None: never), kinematic_hardening
    (None: the yield surface stays about no stress).
    """

    # laws of other roles have such parts
    branch_moduli = relaxation_times = None  # type: ignore[misc]
    density: float
    specific_heat: float
    reference_temperature: float
    taylor_quinney: float
    conductivity: float
    equation_of_state: Any
    shear_modulus: Any
    flow_stress: Any
    melting: Any
    specific_heat_slope: float = 0.0
    conductivity_tensor: tuple[float, ...] | None = None
    failure: Failure | None = None
    kinematic_hardening: Any = None
    heat_points: HeatPoints | None = None

    def internal_energy(self, temperature: Any, without_energy: Any = None) -> Any:
        """E [J/m^3] of the undeformed body at temperatures [K]; 0 at others, the reference unless given."""
        cold = self.reference_temperature if without_energy is None else without_energy
        return self.density * (self.heat(temperature) - self.heat(cold))

    def heat(self, temperature: Any) -> Any:
        """int_0^T C_v dT [J/kg] at temperatures [K]."""
        if self.heat_points is not None:
            return heat_of(self.heat_points, temperature) - heat_of(self.heat_points, 0.0)
        start = self.specific_heat - self.specific_heat_slope * self.reference_temperature
        return (start + 0.5 * self.specific_heat_slope * temperature) * temperature

    def entropy(self, temperature: Any, jacobian: Any) -> Any:
        """[J/(kg K)], 0 of the undeformed body at the reference temperature; exact if C_v does not depend on it.

        T deta = C_v (dT + gamma T dJ), which for a C_v that depends on T and a gamma is no differential.
        """
        gamma = getattr(self.equation_of_state, "gamma", 0.0)
        return self._entropy_of_heat(temperature) + gamma * self.specific_heat_at(temperature) * (jacobian - 1.0)

    def _entropy_of_heat(self, temperature: Any) -> Any:
        """int C_v/T dT [J/(kg K)] from the reference temperature to temperatures [K]."""
        if self.heat_points is None:
            slope, reference = self.specific_heat_slope, self.reference_temperature
            by_heat = (self.specific_heat - slope * reference) * np.log(temperature / reference)
            return by_heat + slope * (temperature - reference)
        return entropy_of(self.heat_points, temperature) - entropy_of(self.heat_points, self.reference_temperature)

    def specific_heat_at(self, temperature: Any) -> Any:
        """C_v [J/(kg K)] at temperatures [K]."""
        return capacity_at(self.heat_points, self, temperature)

    def temperature_rise(self, temperature: Any, heat: Any) -> Any:
        """[K] from temperatures on by heat [J/m^3] of the undeformed volume."""
        return rise_by_heat(self.heat_points, self, temperature, heat)


@law("elastic-plastic", "elastic-plastic")
class StatedElasticPlastic:
    """Elastic-plastic solid with an equation of state and heat (Banerjee).

    youngs_modulus and poissons_ratio are short for a linear equation of state and a constant shear modulus.
    """

    of_strain: ClassVar = False
    density: Annotated[float | None, Parameter("kg/m^3", "the density", above=0.0, default=None)]
    specific_heat: Annotated[float | None, Parameter("J/(kg K)", "C_v", above=0.0, default=None)]
    specific_heat_slope: Annotated[
        float | None, Parameter("J/(kg K^2)", "dC_v/dT, 0 unless given", at_least=0.0, default=None)
    ]
    reference_temperature: Annotated[
        float | None, Parameter("K", "of no stress and energy, 300 unless given", above=0.0, default=None)
    ]
    taylor_quinney: Annotated[
        float | None,
        Parameter(
            "1", "share of the plastic work that heats, 0.9 unless given", at_least=0.0, at_most=1.0, default=None
        ),
    ]
    conductivity: Annotated[float | None, Parameter("W/(m K)", "of heat", above=0.0, default=None)]
    youngs_modulus: Annotated[float | None, Parameter("Pa", "Young's modulus", above=0.0, default=None)]
    poissons_ratio: Annotated[float | None, Parameter("1", "Poisson's ratio", above=-1.0, below=0.5, default=None)]

    def faults(self) -> list[tuple[tuple[str, ...], str, object]]:
        """Constants that do not go together."""
        stated: Any = self
        details: list[tuple[tuple[str, ...], str, object]] = []
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            details.append(((), "both youngs_modulus and poissons_ratio, or neither", Phrase("one of them")))
        if self.youngs_modulus is not None:
            given = [key for key in ("equation_of_state", "shear_modulus") if getattr(stated, key) is not None]
            details += [((key,), "no such key with youngs_modulus", Phrase("it")) for key in given]
        return details


def of_material(material) -> ElasticPlastic:
    """The law of a material of kind "elastic-plastic" as a scene states it."""
    stated = material.parts
    density = float(stated["density"])
    parts: dict[str, Any] = {
        key: None if stated[key] is None else stated[key].part_of(density=density) for key in PARTS
    }
    names = ("density", "specific_heat", "specific_heat_slope", "reference_temperature", "taylor_quinney")
    numbers: dict[str, Any] = {key: float(stated[key]) for key in names}
    conductivity, tensor = stated["conductivity"], stated["conductivity_tensor"]
    if tensor is not None:
        tensor = tuple(map(float, tensor))
        conductivity = np.linalg.eigvalsh(full_tensor(tensor))[-1]
    failure = None if material.failure is None else material.failure.build(density)
    given: dict[str, Any] = {"heat_points": stated["heat_capacity"], "failure": failure}
    return ElasticPlastic(
        conductivity=float(conductivity or 0.0), conductivity_tensor=tensor, **given, **numbers, **parts
    )


def full_tensor(components: Any) -> np.ndarray:
    """(3, 3) of xx yy zz xy xz yz."""
    xx, yy, zz, xy, xz, yz = components
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
