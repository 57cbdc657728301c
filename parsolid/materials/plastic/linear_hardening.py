"""Rate-independent von Mises plasticity with linear hardening; perfect plasticity with H = 0."""

from typing import NamedTuple

from numba.extending import overload

from parsolid.materials.plastic.plasticity import flow_stress, plastic_increment
from parsolid.numerics.dispatch import is_instance
from parsolid.numerics.elementary import choose


class LinearHardening(NamedTuple):
    """sigma_y = yield_stress + hardening ep, both in Pa."""

    yield_stress: float
    hardening: float


@overload(flow_stress)
def _flow(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
    if not is_instance(model, LinearHardening):
        return None

    def stress(model, plastic_strain, rate, temperature, shear_modulus, melting_temperature):
        solid = model.yield_stress + model.hardening * plastic_strain
        return choose(melting_temperature - temperature, solid, 0.0)

    return stress


@overload(plastic_increment)
def _closed_form(flow, trial, expected, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature):
    if not is_instance(flow, LinearHardening):
        return None

    def increment(
        flow, trial, expected, plastic_strain, step, temperature, heating, shear_modulus, melting_temperature
    ):
        yielding = flow_stress(flow, plastic_strain, step, temperature, shear_modulus, melting_temperature)
        slope = choose(melting_temperature - temperature, flow.hardening, 0.0)
        return max((trial - yielding) / (3.0 * shear_modulus + slope), 0.0)

    return increment
