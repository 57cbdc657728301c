"""The functions of an elastic-plastic law over arrays, of any shapes that go together; SI units."""

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.plastic import functions as of

_MELTING, _SHEAR, _FLOW, _BULK, _ROOM = range(5)


def flow_stress(law, plastic_strain, rate, temperature, J=1.0, pressure=0.0) -> np.ndarray:
    """`functions.flow_stress` [Pa] with the shear modulus and the melting temperature of the law."""
    return _evaluated(law, _FLOW, J, pressure, temperature, plastic_strain, rate)


def shear_modulus(law, J, pressure, temperature) -> np.ndarray:
    """`functions.shear_modulus` [Pa]."""
    return _evaluated(law, _SHEAR, J, pressure, temperature)


def melting_temperature(law, J) -> np.ndarray:
    """`functions.melting_temperature` [K]."""
    return _evaluated(law, _MELTING, J)


def pressure(law, J, energy, volume=0.0) -> np.ndarray:
    """P [Pa] of the Jacobian, the internal energy E [J/m^3] per reference volume, and the plastic logarithmic strain of
    volume of laws that have one."""
    elastic = np.asarray(J, float) * np.exp(-np.asarray(volume))
    J, energy = np.broadcast_arrays(elastic, np.asarray(energy, float))
    result = np.empty(J.shape)
    _pressures(law.equation_of_state, J.ravel(), energy.ravel(), result.reshape(-1))
    return result


def isentropic_bulk_modulus(law, J, pressure) -> np.ndarray:
    """`functions.isentropic_bulk_modulus` [Pa]."""
    return _evaluated(law, _BULK, J, pressure)


def pressure_wave_modulus(law) -> float:
    """K + 4 mu/3 [Pa] of the undeformed solid at its reference temperature."""
    mu = shear_modulus(law, 1.0, 0.0, law.reference_temperature)
    return float(isentropic_bulk_modulus(law, 1.0, 0.0) + 4.0 / 3.0 * mu)


def room_to_compress(law, J) -> np.ndarray:
    """`functions.room_to_compress`."""
    return _evaluated(law, _ROOM, J)


def _evaluated(law, row: int, J, pressure=0.0, temperature=None, plastic_strain=0.0, rate=1.0) -> np.ndarray:
    temperature = law.reference_temperature if temperature is None else temperature
    states = np.broadcast_arrays(*(np.asarray(x, float) for x in (J, pressure, temperature, plastic_strain, rate)))
    result = np.empty((5, states[0].size))
    _evaluate(law, *(np.ravel(state).copy() for state in states), result)
    return result[row].reshape(states[0].shape)


@kernel
def _evaluate(law, J, pressure, temperature, plastic_strain, rate, result):
    eos = law.equation_of_state
    for i in range(len(J)):
        melting = of.melting_temperature(law.melting, J[i])
        mu = of.shear_modulus(law.shear_modulus, J[i], pressure[i], temperature[i], melting)
        slow = max(rate[i], of.SLOWEST_RATE)
        result[_MELTING, i], result[_SHEAR, i] = melting, mu
        result[_FLOW, i] = of.flow_stress(law.flow_stress, plastic_strain[i], slow, temperature[i], mu, melting)
        result[_BULK, i] = of.isentropic_bulk_modulus(eos, J[i], pressure[i])
        result[_ROOM, i] = of.room_to_compress(eos, J[i])


@kernel
def _pressures(eos, J, energy, result):
    for i in range(len(J)):
        result[i] = of.cold_pressure(eos, J[i]) + of.grueneisen_coefficient(eos) * energy[i]
