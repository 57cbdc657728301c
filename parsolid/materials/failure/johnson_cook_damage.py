"""Strain to fracture of Johnson & Cook (Eng. Fract. Mech. 21 (1985) 31, eqs (2)-(4))."""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.kernels import inlined
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.failure.functions import damage_after
from parsolid.tensors import contract_symmetric

# of the mises stress [Pa] below which the triaxiality is that of this stress
_LEAST_STRESS = 1.0


@law("failure", "johnson-cook")
class JohnsonCookDamage(NamedTuple):
    """D grows by d ep / ef, ef = (D1 + D2 exp(D3 s)) (1 + D4 ln edot*) (1 + D5 T*), s = mean stress / von Mises stress.

    s is positive in tension, so that D3 < 0 makes tension brittle, as the paper lists it. edot* = rate/reference_rate
    >= 1 and T* in [0, 1], as in the flow stress. No less than least_strain: with D1 < 0 (Armco iron) or a low factor
    the formula passes zero.
    """

    needs_melting = True  # type: ignore[misc]
    d1: Annotated[float, Parameter("1", "D1")]
    d2: Annotated[float, Parameter("1", "D2", at_least=0.0)]
    d3: Annotated[float, Parameter("1", "D3, of mean over von Mises stress: negative where tension embrittles")]
    d4: Annotated[float, Parameter("1", "D4")]
    d5: Annotated[float, Parameter("1", "D5")]
    reference_rate: Annotated[float, Parameter("1/s", above=0.0, default=1.0)]
    reference_temperature: Annotated[float, Parameter("K", "where T* = 0", above=0.0)]
    least_strain: Annotated[float, Parameter("1", "bound of the strain to fracture", above=0.0, default=1e-3)]


@inlined
def strain_to_fracture(criterion, triaxiality, rate, temperature, melting_temperature):
    """ef at a ratio of mean stress (tension positive) over von Mises stress, an equivalent plastic strain rate [1/s]
    and a temperature [K].
    """
    stressed = criterion.d1 + criterion.d2 * exp(min(criterion.d3 * triaxiality, 100.0))
    fast = 1.0 + criterion.d4 * log(max(rate / criterion.reference_rate, 1.0))
    warm = (temperature - criterion.reference_temperature) / (melting_temperature - criterion.reference_temperature)
    hot = 1.0 + criterion.d5 * min(max(warm, 0.0), 1.0)
    # two negative factors are no strength
    return max(max(stressed, 0.0) * max(fast, 0.0) * max(hot, 0.0), criterion.least_strain)


@damage_after.of(JohnsonCookDamage)
def _accumulated(criterion, damage, strength, loading):
    mises = (1.5 * contract_symmetric(loading.deviator, loading.deviator)) ** 0.5
    triaxiality = -loading.pressure / max(mises, _LEAST_STRESS)
    limit = strain_to_fracture(criterion, triaxiality, loading.rate, loading.temperature, loading.melting_temperature)
    return damage + (loading.increment / (strength * limit) if loading.increment > 0.0 else 0.0)
