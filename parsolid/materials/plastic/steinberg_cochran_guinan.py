"""Flow stress of Steinberg, Cochran & Guinan (J. Appl. Phys. 51 (1980) 1498), with the rate term of Steinberg, Lund."""

from typing import Annotated, Any, NamedTuple

from parsolid.elementary import exp, power
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.law_functions import law_function
from parsolid.materials.plastic.functions import flow_stress

_BOLTZMANN = 1.380649e-23


class ThermalActivation(NamedTuple):
    """Rate term Y_T of Steinberg & Lund (J. Appl. Phys. 65 (1989) 1528), at most the Peierls stress:

    rate = 1/(exp(2 U_k (1 - Y_T/Y_P)^2/(k T))/C1 + C2/Y_T).

    frequency C1 [1/s], kink_energy U_k [J], peierls_stress Y_P [Pa], drag C2 [Pa s].
    """

    frequency: Annotated[float, Parameter("1/s", "C1", above=0.0)]
    kink_energy: Annotated[float, Parameter("J", "U_k", above=0.0)]
    peierls_stress: Annotated[float, Parameter("Pa", "Y_P", above=0.0)]
    drag: Annotated[float, Parameter("Pa s", "C2", at_least=0.0)]


@law("flow-stress", "steinberg-cochran-guinan-lund")
class SteinbergCochranGuinan(NamedTuple):
    """sigma_y = (Y_T(rate, T) + min(sigma_0 [1 + beta (ep + ep_i)]^n, Y_max)) mu/mu0.

    yield_stress sigma_0, greatest_yield_stress Y_max, shear_modulus mu0 [Pa], hardening beta, exponent n,
    initial_strain ep_i; activation: a ThermalActivation, or None for the rate-independent model of 1980 (rates above
    1e5/s).
    """

    yield_stress: Annotated[float, Parameter("Pa", "sigma_0", above=0.0)]
    greatest_yield_stress: Annotated[float, Parameter("Pa", "Y_max", above=0.0)]
    shear_modulus: Annotated[float, Parameter("Pa", "mu0", above=0.0)]
    hardening: Annotated[float, Parameter("1", "beta", at_least=0.0)]
    exponent: Annotated[float, Parameter("1", "n", above=0.0)]
    initial_strain: Annotated[float, Parameter("1", "ep_i", at_least=0.0, default=0.0)]
    activation: Annotated[ThermalActivation | None, Parameter(default=None)]

    def faults(self) -> list[tuple[tuple[Any, ...], str, object]]:
        """Yield stresses that are not in order."""
        if self.greatest_yield_stress >= self.yield_stress:
            return []
        bound = f"at least yield_stress = {self.yield_stress:g}"
        return [(("greatest_yield_stress",), bound, self.greatest_yield_stress)]


@law_function
def thermal_stress(activation, rate, temperature):
    """Y_T [Pa] of the thermal activation, 0 without (None)."""


@thermal_stress.of(None)
def _none(activation, rate, temperature):
    return 0.0


@thermal_stress.of(ThermalActivation)
def _bisected(activation, rate, temperature):
    # the rate rises with Y_T: bisection of y = Y_T/Y_P in [0, 1], to 1e-13 of Y_P
    low, high, barrier = 0.0, 1.0, 2.0 * activation.kink_energy / (_BOLTZMANN * temperature)
    for _ in range(44):
        y = 0.5 * (low + high)
        waiting = exp(barrier * (1.0 - y) * (1.0 - y)) / activation.frequency
        slow = rate * (waiting + activation.drag / (y * activation.peierls_stress)) - 1.0
        low, high = (y, high) if slow > 0.0 else (low, y)
    return activation.peierls_stress * low


@flow_stress.of(SteinbergCochranGuinan)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    hardened = power(1.0 + model.hardening * (plastic_strain + model.initial_strain), model.exponent)
    athermal = min(model.yield_stress * hardened, model.greatest_yield_stress)
    solid = (athermal + thermal_stress(model.activation, rate, temperature)) * shear_modulus / model.shear_modulus
    return solid if temperature < melting_temperature else 0.0
