"""What a scene states of the law "micro-inertia"."""

from typing import Annotated, Any, ClassVar

from parsolid.materials.declaration import Density, Parameter, Phrase, law
from parsolid.materials.plastic.micro_inertia import MicroInertia

_OPTIONAL = (
    *("energetic_length", "hardening_length", "dissipative_length", "inertia_length"),
    *("stress_relaxation_time", "flux_relaxation_time", "heat_relaxation_time", "conductivity"),
)
# what has no effect, or cannot be solved particle by particle, without another
_NEEDS = {
    "flux_relaxation_time": "dissipative_length",
    "heat_relaxation_time": "conductivity",
    "initial_micro_stress": "stress_relaxation_time",
    "energetic_length": "inertia_length",
    "dissipative_length": "inertia_length",
}


def _left_out(unit: str, description: str) -> Parameter:
    return Parameter(unit, f"{description}, 0: left out", at_least=0.0, default=0.0)


@law("micro-inertia", "micro-inertia")
class StatedMicroInertia:
    """Strain-gradient thermo-visco-plasticity with micro-inertia (Rahaman et al.), in the norm |S| = sqrt(S:S).

    Every length, every time and the conductivity is left out unless given, or where it is 0; without all of them it is
    classical thermo-visco-plasticity.
    """

    exactly_one: ClassVar = (("youngs_modulus", "shear_modulus"), ("poissons_ratio", "bulk_modulus"))
    density: Density
    youngs_modulus: Annotated[float | None, Parameter("Pa", "E", above=0.0, default=None)]
    poissons_ratio: Annotated[float | None, Parameter("1", "Poisson's ratio", above=-1.0, below=0.5, default=None)]
    shear_modulus: Annotated[float | None, Parameter("Pa", "mu", above=0.0, default=None)]
    bulk_modulus: Annotated[float | None, Parameter("Pa", "K", above=0.0, default=None)]
    specific_heat: Annotated[float, Parameter("J/(kg K)", "C_v", above=0.0)]
    reference_temperature: Annotated[float, Parameter("K", "T_r, of T* = 0", above=0.0)]
    melting_temperature: Annotated[float, Parameter("K", "T_m, of T* = 1", above=0.0)]
    yield_stress: Annotated[float, Parameter("Pa", "S_0, of |S|", above=0.0)]
    hardening: Annotated[float, Parameter("Pa", "H_0", at_least=0.0)]
    exponent: Annotated[float, Parameter("1", "n", above=0.0)]
    rate_exponent: Annotated[float, Parameter("1", "m_1, at most 1", at_least=0.0)]
    thermal_exponent: Annotated[float, Parameter("1", "m_2", above=0.0)]
    reference_rate: Annotated[float, Parameter("1/s", "d_0", above=0.0)]
    regularisation: Annotated[float, Parameter("1/s", "d_reg, of d^p at rest", at_least=1e-100, default=1e-2)]
    initial_micro_stress: Annotated[float, Parameter("Pa", "pi(0)", at_least=0.0, default=0.0)]
    energetic_length: Annotated[float, _left_out("m", "l_1")]
    hardening_length: Annotated[float, _left_out("m", "l_2")]
    dissipative_length: Annotated[float, _left_out("m", "l_3")]
    inertia_length: Annotated[float, _left_out("m", "l_m, the root of the paper's l_m^2")]
    stress_relaxation_time: Annotated[float, _left_out("s", "t_pi")]
    flux_relaxation_time: Annotated[float, _left_out("s", "t_xi")]
    heat_relaxation_time: Annotated[float, _left_out("s", "t_q")]
    conductivity: Annotated[float, _left_out("W/(m K)", "kappa")]

    def faults(self) -> list[tuple[tuple[Any, ...], str, object]]:
        """What is no such solid, or has no effect."""
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            return [
                ((), "youngs_modulus with poissons_ratio, or shear_modulus with bulk_modulus", Phrase("one of each"))
            ]
        details: list[tuple[tuple[Any, ...], str, object]] = []
        if self.melting_temperature <= self.reference_temperature:
            expected = f"more than reference_temperature = {self.reference_temperature:g}"
            details.append((("melting_temperature",), expected, self.melting_temperature))
        if self.rate_exponent > 1.0:
            details.append((("rate_exponent",), "at most 1", self.rate_exponent))
        for key, needed in _NEEDS.items():
            if getattr(self, key) and not getattr(self, needed):
                details.append(((key,), f"no such key (or 0) without {needed}", getattr(self, key)))
        return details

    def micro_inertia_law(self) -> MicroInertia:
        """The law in SI units, with None for what is left out."""
        values: dict[str, Any] = {name: getattr(self, name) for name in MicroInertia._fields}
        if self.youngs_modulus is not None:
            E, nu = float(self.youngs_modulus), float(self.poissons_ratio)  # type: ignore[arg-type]
            values |= {"shear_modulus": E / (2.0 * (1.0 + nu)), "bulk_modulus": E / (3.0 * (1.0 - 2.0 * nu))}
        values |= {name: values[name] or None for name in _OPTIONAL}
        numbers: dict[str, Any] = {key: value if value is None else float(value) for key, value in values.items()}
        return MicroInertia(**numbers)
