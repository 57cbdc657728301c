"""Strain-gradient thermo-visco-plasticity with micro-inertia (Rahaman, Pathak, Roy & Reddy), docs/ulsph.md.

    rho l_m^2 (v^p)' = div xi + tau - pi,  v^p >= 0            tau = |S|
    t_pi pi' + pi = S_g R_1 R_2 v^p/d^p                        S_g = S_0 sqrt(f^2 + l_2 eta^p), f = 1 + H_0/S_0 gamma^n
    xi_en' = S_0 l_1^2 grad v^p,  t_xi xi_dis' + xi_dis = S_g R_1 R_2 l_3^2 grad v^p/d^p
    t_q q' + q = -kappa grad T                                 R_1 = (d^p/d_0)^m_1, R_2 = 1 - T*^m_2
    d^p = sqrt(v^p^2 + l_3^2 |grad v^p|^2 + d_reg^2)

The norm is the paper's, |S| = sqrt(S:S) without 3/2. Functions take the law of `in_numbers`, in which a length, a time
or a conductivity that is left out is 0. Densities of energy are per present volume unless said otherwise.
"""

from typing import Annotated, Any, ClassVar, NamedTuple

from parsolid.elementary import exp, log, power
from parsolid.kernels import inlined
from parsolid.materials.declaration import Density, Parameter, Phrase, law
from parsolid.materials.law_functions import law_function
from parsolid.tensors import combine_symmetric, contract_symmetric, times_symmetric


class MicroInertia(NamedTuple):
    """Parameters in SI units; None of those after `initial_micro_stress`: left out.

    shear_modulus mu, bulk_modulus K [Pa]; specific_heat C_v [J/(kg K)]; reference_temperature T_r,
    melting_temperature T_m [K]; yield_stress S_0, hardening H_0 [Pa], exponent n, rate_exponent m_1, thermal_exponent
    m_2, reference_rate d_0, regularisation d_reg [1/s], initial_micro_stress pi(0) [Pa]; energetic_length l_1,
    hardening_length l_2, dissipative_length l_3, inertia_length l_m [m] (the paper tables l_m^2);
    stress_relaxation_time t_pi, flux_relaxation_time t_xi, heat_relaxation_time t_q [s]; conductivity kappa [W/(m K)].
    """

    density: float
    shear_modulus: float
    bulk_modulus: float
    specific_heat: float
    reference_temperature: float
    melting_temperature: float
    yield_stress: float
    hardening: float
    exponent: float
    rate_exponent: float
    thermal_exponent: float
    reference_rate: float
    regularisation: float
    initial_micro_stress: float
    energetic_length: float | None
    hardening_length: float | None
    dissipative_length: float | None
    inertia_length: float | None
    stress_relaxation_time: float | None
    flux_relaxation_time: float | None
    heat_relaxation_time: float | None
    conductivity: float | None

    def heat(self, temperature: Any) -> Any:
        """int_0^T C_v dT [J/kg] at temperatures [K]."""
        return self.specific_heat * temperature

    def temperature_rise(self, temperature: Any, heat: Any) -> Any:
        """[K] by heat [J/m^3] of the undeformed volume."""
        return heat / (self.density * self.specific_heat)


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

    of_strain: ClassVar = False
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


class MicroIncrements(NamedTuple):
    """What a step is the same of for all particles: step [s], theta, d_0^-m_1, and what relaxes, 1 - exp(-dt/t), of
    micro-stress, micro-flux and heat flux (1 without a time).
    """

    step: float
    theta: float
    rate_factor: float
    relax_stress: float | None
    relax_flux: float | None
    relax_heat: float | None


def in_numbers(law):
    """A law with 0 in place of what it leaves out (None), as functions take it."""
    return type(law)(*(0.0 if value is None else value for value in law))


@law_function
def flow_strength(law, gamma, curl, temperature):
    """S_g R_2 [Pa] of gamma, eta^p = curl [1/m] and the temperature [K]; 0 from melting on."""


@flow_strength.of(MicroInertia)
def _flow_strength(law, gamma, curl, temperature):
    hardened = 1.0 + law.hardening / law.yield_stress * power(gamma, law.exponent) + 0.0 * gamma
    warm = (temperature - law.reference_temperature) / (law.melting_temperature - law.reference_temperature)
    softened = 1.0 - power(min(max(warm, 0.0), 1.0), law.thermal_exponent) + 0.0 * warm
    return law.yield_stress * (hardened * hardened + law.hardening_length * curl) ** 0.5 * softened


@inlined
def least_rate_square(law, gradient_square):
    """d^p^2 - v^p^2 = l_3^2 |grad v^p|^2 + d_reg^2 [1/s^2]."""
    return law.dissipative_length * law.dissipative_length * gradient_square + law.regularisation * law.regularisation


@inlined
def resistance(law, rate, gradient_square, gamma, curl, temperature):
    """S_g R_1 R_2/d^p [Pa s]."""
    square = rate * rate + least_rate_square(law, gradient_square)
    factor = exp(0.5 * (law.rate_exponent - 1.0) * log(square) - law.rate_exponent * log(law.reference_rate))
    return flow_strength(law, gamma, curl, temperature) * factor + 0.0 * square


@inlined
def curl_rate(gradient, direction):
    """d(eta^p)/dt = sqrt(|g|^2 - |N g|^2) [1/(m s)] of g = grad v^p (three components) and N = S/|S|, symmetric.

    It is the norm of the curl of the plastic distortion rate v^p N for a uniform N.
    """
    N, g = direction, gradient
    x = N[0] * g[0] + N[3] * g[1] + N[4] * g[2]
    y = N[3] * g[0] + N[1] * g[1] + N[5] * g[2]
    z = N[4] * g[0] + N[5] * g[1] + N[2] * g[2]
    return max(g[0] * g[0] + g[1] * g[1] + g[2] * g[2] - (x * x + y * y + z * z), 0.0) ** 0.5


@inlined
def returned_deviator(turned, trial, tau, tau1, elastic_flow):
    """S [Pa] in Jaumann's rate, S' = 2 mu (dev D - v^p N) + W S - S W with N = S/|S|, at the end of a step whose |S|
    went from tau to tau1.

    turned: S of its start, turned; trial: with 2 mu times the strain; elastic_flow: mu v^p dt [Pa]. With the flow along
    the mean of both ends S is along trial - a turned, a = mu v^p dt/|S|; along trial alone, as a radial return, the
    direction is of first order.
    """
    mean = 0.5 * (tau + tau1)
    # with more flow than stress all is along the last strain
    ratio = elastic_flow / (max(elastic_flow, mean) + 1e-300)
    along = combine_symmetric(1.0, trial, -ratio, turned)
    norm = contract_symmetric(along, along) ** 0.5
    return times_symmetric(tau1 / (norm + 1e-300) if norm > 0.0 else 0.0 * norm, along)


@inlined
def energetic_flux(law, step, flux, gradient):
    """xi_en [Pa m] after a step [s] with grad v^p [1/(m s)] at its end; three components."""
    a = step * law.yield_stress * law.energetic_length * law.energetic_length
    return (flux[0] + a * gradient[0], flux[1] + a * gradient[1], flux[2] + a * gradient[2])


@inlined
def dissipative_flux(law, share, flux, gradient, resistance):
    """xi_dis [Pa m] after a step in which `share` of it relaxes, with grad v^p at its end ((3.20), (3.21) with 1/d^p,
    in rates that are not objective, as the paper's)."""
    a, b = 1.0 - share, share * law.dissipative_length * law.dissipative_length * resistance
    return (a * flux[0] + b * gradient[0], a * flux[1] + b * gradient[1], a * flux[2] + b * gradient[2])


@inlined
def heat_flux(law, share, flux, temperature_gradient):
    """q [W/m^2] after a step in which `share` of it relaxes, with grad T [K/m] at its end: Cattaneo's, and Fourier's
    where all of it does."""
    a, b, g = 1.0 - share, -share * law.conductivity, temperature_gradient
    return (a * flux[0] + b * g[0], a * flux[1] + b * g[1], a * flux[2] + b * g[2])


@inlined
def pressure(law, density_ratio):
    """p = K (rho/rho_0 - 1) [Pa], positive in compression (3.13)."""
    return law.bulk_modulus * (density_ratio - 1.0)


@inlined
def volumetric_energy(law, density_ratio):
    """K/rho_0 (ln r + 1/r - 1) [J/kg], r = rho/rho_0: what p does in changing the density."""
    return law.bulk_modulus / law.density * (log(density_ratio) + 1.0 / density_ratio - 1.0)


@inlined
def deviatoric_energy(law, tau):
    """|S|^2/(4 mu) [J/m^3]."""
    return tau * tau / (4.0 * law.shear_modulus)


@inlined
def gradient_energy(law, flux_square):
    """|xi_en|^2/(2 S_0 l_1^2) [J/m^3]; 0 where xi_en is."""
    stiffness = 2.0 * law.yield_stress * law.energetic_length * law.energetic_length
    return flux_square / max(stiffness, 1e-300)


@inlined
def micro_kinetic_energy(law, density, rate):
    """rho l_m^2 v^p^2/2 [J/m^3]."""
    return 0.5 * law.inertia_length * law.inertia_length * density * rate * rate


@inlined
def micro_time_step(law, length, density, resistance):
    """Stable step [s] of micro-rate and micro-flux at a state with a `resistance`, for particles whose operators see
    wave numbers up to 2/length; very long without energetic and dissipative length.

    Energetic wave: (l_1/l_m) sqrt(S_0/rho); dissipative wave: (l_3/l_m) sqrt(S_g R_1 R_2/(rho d^p t_xi)), or its
    diffusion where t_xi is shorter than the step. The micro-oscillator and t_pi are implicit and set no limit.
    """
    inertia = max(law.inertia_length * law.inertia_length * density, 1e-300)
    energetic = law.energetic_length / length * (law.yield_stress / inertia) ** 0.5
    diffusivity = law.dissipative_length * law.dissipative_length * resistance / inertia
    dissipative = delayed_rate(diffusivity, law.flux_relaxation_time, length)
    return 1.0 / (energetic * energetic + dissipative * dissipative + 1e-60) ** 0.5


@inlined
def heat_time_step(law, length):
    """Stable step [s] of temperature and heat flux for wave numbers up to 2/length: Cattaneo's wave or diffusion,
    whichever is longer; very long without conductivity."""
    rate = delayed_rate(law.conductivity / (law.density * law.specific_heat), law.heat_relaxation_time, length)
    return 1.0 / max(rate, 1e-30)


@inlined
def delayed_rate(diffusivity, time, length):
    """One over the stable step [1/s] of a flux that relaxes towards -diffusivity grad: that of diffusion, or of its
    wave if that is longer.

    With the exact relaxation a mode k is stable while dt D k^2 tanh(dt/(2 t)) <= 2; here k = 2/length.
    """
    return min(2.0 * diffusivity / (length * length), (diffusivity / max(time, 1e-200)) ** 0.5 / length)
