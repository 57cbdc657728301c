"""Mullins softening of any hyperelastic law (Ogden & Roxburgh, Proc. R. Soc. A 455 (1999) 2861).

Of the law, U(J) is the part of the volume and W the rest. P = eta dW/dF + U' H,

    eta = 1 - erf(d/s)/r,   d = max(Wm - W, 0),   s = m + beta Wm,   Wm the largest W so far

Below Wm it unloads and loads again on one curve. Of the work on the way to Wm, (s/r) E(Wm/s) is dissipated, E(u) = u
erf(u) + [exp(-u^2) - 1]/sqrt(pi), and W - (s/r) [E(Wm/s) - E(d/s)] is stored. beta is Abaqus's.
"""

import math
from typing import Any, NamedTuple

from parsolid.elementary import erf, exp
from parsolid.kernels import inlined
from parsolid.materials.declaration import StateVariable
from parsolid.materials.hyperelastic.at_particles import (
    Member,
    after_step,
    at_particle,
    keep_state,
    members,
    value_count,
)
from parsolid.materials.hyperelastic.functions import (
    dissipated_energy,
    elastic_moduli,
    energy,
    isotropic_shear_modulus,
    pressure_waves,
    shear_waves,
    stress,
    volume_part,
)
from parsolid.tensors import combine, combine_symmetric, gram

_ROOT_OF_PI = math.sqrt(math.pi)
LARGEST_ENERGY = StateVariable("J/m^3", "the largest energy of shape so far")


class Softened(NamedTuple):
    """A law that softens. solid: without branches and state variables; ratio: r > 1; scale: m > 0 [J/m^3]; beta >= 0;
    largest_energy: Wm [J/m^3]."""

    density: float
    solid: Any
    ratio: float
    scale: float
    beta: float
    largest_energy: float
    branch_moduli: tuple[float, ...] | None
    relaxation_times: tuple[float, ...] | None


@inlined
def _integral(u):
    """The integral of erf from 0 to u."""
    return u * erf(u) + (exp(-u * u) - 1.0) / _ROOT_OF_PI


@inlined
def _energy_of_shape(law, F, H, J):
    return energy(law.solid, F, H, J) - volume_part(law.solid, J)[0]


@inlined
def _stress_of_shape(law, F, H, J):
    return combine(1.0, stress(law.solid, F, H, J), -volume_part(law.solid, J)[1], H)


@inlined
def _below(law, W):
    """d/s and s."""
    s = law.scale + law.beta * law.largest_energy
    return max(law.largest_energy - W, 0.0) / s, s


@energy.of(Softened)
def _energy(law, F, H, J):
    W = _energy_of_shape(law, F, H, J)
    u, s = _below(law, W)
    return volume_part(law.solid, J)[0] + W - s / law.ratio * (_integral(law.largest_energy / s) - _integral(u))


@stress.of(Softened)
def _stress(law, F, H, J):
    u, _ = _below(law, _energy_of_shape(law, F, H, J))
    eta = 1.0 - erf(u) / law.ratio
    return combine(eta, _stress_of_shape(law, F, H, J), volume_part(law.solid, J)[1], H)


@pressure_waves.of(Softened)
def _waves(law, F, H, J):
    # those that unload from the largest energy count, too: eta falls with W
    u, s = _below(law, _energy_of_shape(law, F, H, J))
    eta, slope = 1.0 - erf(u) / law.ratio, 2.0 / (_ROOT_OF_PI * law.ratio * s) * exp(-u * u)
    of_volume = max(volume_part(law.solid, J)[2], 0.0)
    waves = combine_symmetric(eta, pressure_waves(law.solid, F, H, J), (1.0 - eta) * of_volume, gram(H))
    return combine_symmetric(1.0, waves, slope, gram(_stress_of_shape(law, F, H, J)))


@shear_waves.of(Softened)
def _shear_waves(law, F):
    return shear_waves(law.solid, F)


@isotropic_shear_modulus.of(Softened)
def _isotropic(law):
    return isotropic_shear_modulus(law.solid) if law.branch_moduli is None else None


@elastic_moduli.of(Softened)
def _moduli(law):
    return elastic_moduli(law.solid)


@dissipated_energy.of(Softened)
def _dissipated(law):
    s = law.scale + law.beta * law.largest_energy
    return s / law.ratio * _integral(law.largest_energy / s)


@members.of(Softened)
def _members(law):
    return (*members(law.solid), Member("largest_energy", LARGEST_ENERGY))


@value_count.of(Softened)
def _value_count(law):
    return value_count(law.solid) + 1


@at_particle.of(Softened)
def _at_particle(law, values, stride, p):
    solid, largest = at_particle(law.solid, values, stride, p), values[value_count(law.solid) * stride + p]
    return Softened(
        law.density, solid, law.ratio, law.scale, law.beta, largest, law.branch_moduli, law.relaxation_times
    )


@after_step.of(Softened)
def _after_step(law, F, H, J):
    largest = max(law.largest_energy, _energy_of_shape(law, F, H, J))
    return Softened(
        law.density, law.solid, law.ratio, law.scale, law.beta, largest, law.branch_moduli, law.relaxation_times
    )


@keep_state.of(Softened)
def _keep_state(law, values, stride, p):
    values[value_count(law.solid) * stride + p] = law.largest_energy
