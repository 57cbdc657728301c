"""Melting temperatures."""

from typing import Annotated, NamedTuple

from parsolid.elementary import exp, log
from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import melting_temperature


@law("melting", "constant")
class ConstantMelting(NamedTuple):
    """temperature [K] at every pressure."""

    temperature: Annotated[float, Parameter("K", above=0.0)]


@law("melting", "steinberg-cochran-guinan")
class SteinbergMelting(NamedTuple):
    """T_m = T_m0 exp(2 a (1 - 1/eta)) eta^(2 (gamma0 - a - 1/3)), eta = 1/J (Steinberg, Cochran & Guinan 1980).

    temperature T_m0 [K], gamma0 and its volume coefficient a.
    """

    temperature: Annotated[float, Parameter("K", "T_m0", above=0.0)]
    gamma: Annotated[float, Parameter("1", "the Grueneisen coefficient", above=0.0)]
    volume_coefficient: Annotated[float, Parameter("1", "a", at_least=0.0)]


@melting_temperature.of(ConstantMelting)
def _constant(model, J):
    return model.temperature


@melting_temperature.of(SteinbergMelting)
def _steinberg(model, J):
    exponent = 2.0 * (model.gamma - model.volume_coefficient - 1.0 / 3.0)
    # eta^b = exp(-b ln J)
    return model.temperature * exp(2.0 * model.volume_coefficient * (1.0 - J) - exponent * log(J))
