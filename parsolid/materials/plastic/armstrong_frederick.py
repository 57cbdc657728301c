"""Kinematic hardening of Armstrong & Frederick (CEGB report RD/B/N 731, 1966; Mater. High Temp. 24 (2007) 1)."""

from typing import Annotated, NamedTuple

from parsolid.materials.declaration import Parameter, law
from parsolid.materials.plastic.functions import back_stress_energy, back_stress_step


@law("kinematic-hardening", "armstrong-frederick")
class ArmstrongFrederick(NamedTuple):
    """d beta = 2/3 modulus dp - recovery beta d ep: beta saturates at the von Mises stress modulus/recovery, and grows
    linearly (Prager, Ziegler) without recovery."""

    modulus: Annotated[float, Parameter("Pa", "C, of the back stress over the plastic strain", above=0.0)]
    recovery: Annotated[
        float,
        Parameter(
            "1", "gamma, rate of saturation of the back stress over the plastic strain", at_least=0.0, default=0.0
        ),
    ]


@back_stress_step.of(ArmstrongFrederick)
def _implicit_step(hardening, increment):
    return 1.0 / (1.0 + hardening.recovery * increment), hardening.modulus


@back_stress_energy.of(ArmstrongFrederick)
def _free_energy(hardening, square):
    # its derivative by the strain 3 beta/(2 C) that it belongs to is beta
    return 0.75 / hardening.modulus * square
