"""The functions of an elastic-plastic law over arrays; all of one shape (n,), SI units."""

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.plastic import lanes_laws, plasticity  # noqa: F401


def flow_stress(law, plastic_strain, rate, temperature, J=1.0, pressure=0.0) -> np.ndarray:
    """`plasticity.flow_stress` [Pa] with the shear modulus and the melting temperature of the law."""
    model = getattr(law.flow_stress, "flow_stress", law.flow_stress)
    return _over(_flow_stresses, model, law, plastic_strain, rate, temperature, J, pressure)


def shear_modulus(law, J, pressure, temperature) -> np.ndarray:
    """`plasticity.shear_modulus` [Pa]."""
    return _over(_shear_moduli, law, J, pressure, temperature)


def melting_temperature(law, J) -> np.ndarray:
    """`plasticity.melting_temperature` [K]."""
    return _over(_melting_temperatures, law, J)


def pressure(law, J, energy) -> np.ndarray:
    """P [Pa] of the Jacobian and the internal energy E [J/m^3] per reference volume."""
    return _over(_pressures, law, J, energy)


def isentropic_bulk_modulus(law, J, pressure) -> np.ndarray:
    """`plasticity.isentropic_bulk_modulus` [Pa]."""
    return _over(_bulk_moduli, law, J, pressure)


def room_to_compress(law, J) -> np.ndarray:
    """`plasticity.room_to_compress`."""
    return _over(_rooms, law, J)


def _over(kernel, *arguments):
    fixed = [argument for argument in arguments if isinstance(argument, tuple)]
    arrays = np.broadcast_arrays(
        *(np.asarray(argument, float) for argument in arguments if not isinstance(argument, tuple))
    )
    result = np.empty(arrays[0].shape)
    kernel(*fixed, *(np.ravel(array).copy() for array in arrays), result.reshape(-1))
    return result


@compiled(error_model="numpy")
def _flow_stresses(model, law, plastic_strain, rate, temperature, J, pressure, result):
    for i in range(len(result)):
        melting = plasticity.melting_temperature(law.melting, J[i])
        mu = plasticity.shear_modulus(law.shear_modulus, J[i], pressure[i], temperature[i], melting)
        slow = max(rate[i], plasticity.SLOWEST_RATE)
        result[i] = plasticity.flow_stress(model, plastic_strain[i], slow, temperature[i], mu, melting)


@compiled(error_model="numpy")
def _shear_moduli(law, J, pressure, temperature, result):
    for i in range(len(result)):
        melting = plasticity.melting_temperature(law.melting, J[i])
        result[i] = plasticity.shear_modulus(law.shear_modulus, J[i], pressure[i], temperature[i], melting)


@compiled(error_model="numpy")
def _melting_temperatures(law, J, result):
    for i in range(len(result)):
        result[i] = plasticity.melting_temperature(law.melting, J[i])


@compiled(error_model="numpy")
def _pressures(law, J, energy, result):
    eos = law.equation_of_state
    for i in range(len(result)):
        result[i] = plasticity.cold_pressure(eos, J[i]) + plasticity.grueneisen_coefficient(eos) * energy[i]


@compiled(error_model="numpy")
def _bulk_moduli(law, J, pressure, result):
    for i in range(len(result)):
        result[i] = plasticity.isentropic_bulk_modulus(law.equation_of_state, J[i], pressure[i])


@compiled(error_model="numpy")
def _rooms(law, J, result):
    for i in range(len(result)):
        result[i] = plasticity.room_to_compress(law.equation_of_state, J[i])
