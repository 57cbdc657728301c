"""Particle kernel of the material point method: kinematics, equation of state, radial return, energy and heat of a
step.

Four particles at a time (`numerics.lanes.Lanes`); a range first..last-1 of particles shares one law. Every lane's
result depends on that lane alone, so that it is the same whatever particles are its neighbours.
"""

import math
from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.failure.failing import (
    Elasticity,
    borne,
    counted,
    failing,
    flowing,
    formless,
    found_before,
    moving,
    resisted,
    settled,
    sounding,
    summed,
)
from parsolid.materials.failure.failure import Loading
from parsolid.materials.plastic import radial_return, rate_form  # noqa: F401  (their overloads)
from parsolid.materials.plastic.plasticity import (
    cold_pressure,
    deviator_update,
    grueneisen_coefficient,
    melting_temperature,
    room_to_compress,
    shear_modulus,
)
from parsolid.materials.plastic.specific_heat import specific_heat, temperature_rise
from parsolid.materials.plastic.wave_speed import wave_speed
from parsolid.methods.mpm.layout import load_rate, store_stress
from parsolid.numerics.dispatch import generic
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import WIDTH, aligned_zeros, all_positive, broadcast, from_floats, load, store_first, total
from parsolid.numerics.layout import four_rows
from parsolid.numerics.polar import congruence, rotation, rotation_near, symmetric_part
from parsolid.numerics.tensor_rows import (
    largest_lane,
    load_general,
    load_symmetric,
    one_gradient,
    speed_of,
    store_general,
    store_symmetric,
)
from parsolid.numerics.tensors import I, cofactor, contract, determinant, trace


class MaterialState(NamedTuple):
    """What the particles of elastic-plastic laws carry from step to step, rows of (rows, capacity) arrays.

    deformation: F, 9 rows in space (11, 12, 13, 21...), 5 in plane strain and axisymmetry (11, 12, 21, 22, 33);
    deviator: unrotated s [Pa], 6 rows (11, 22, 33, 12, 13, 23) or 4 (11, 22, 33, 12); one row each: plastic_strain
    (equivalent), energy E [J/m^3] per reference volume, temperature [K]. Of laws that fail, else None: damage, that of
    each criterion (a row each), the factor of the strength and the mass that was deleted [kg].
    """

    deformation: np.ndarray
    deviator: np.ndarray
    plastic_strain: np.ndarray
    energy: np.ndarray
    temperature: np.ndarray
    damage: np.ndarray | None = None
    criterion_damage: np.ndarray | None = None
    strength_factor: np.ndarray | None = None
    deleted_mass: np.ndarray | None = None


class BulkViscosity(NamedTuple):
    """q = rho h |tr d| (quadratic h |tr d| + linear c) in compression; spacing h [m]."""

    linear: float
    quadratic: float
    spacing: float


class CentredViscosity(NamedTuple):
    """As `BulkViscosity`; heat is the work of the forces: half by the pressure of the step before, half by the new
    one.
    """

    linear: float
    quadratic: float
    spacing: float


DEFORMATION_ROWS = {2: 5, 3: 9}
DEVIATOR_ROWS = {2: 4, 3: 6}


def new_state(dimension: int, capacity: int, criteria: int = 0) -> MaterialState:
    """The virgin state of `capacity` particles (a multiple of the lane width), at the temperature 0.

    criteria: number of the law's criteria of failure.
    """
    deformation = aligned_zeros((DEFORMATION_ROWS[dimension], capacity))
    deformation[{2: (0, 3, 4), 3: (0, 4, 8)}[dimension], :] = 1.0
    deviator = aligned_zeros((DEVIATOR_ROWS[dimension], capacity))
    damage = [aligned_zeros((rows, capacity)) for rows in (1, criteria)] if criteria else []
    return MaterialState(deformation, deviator, *(aligned_zeros((1, capacity)) for _ in range(3)), *damage)


@generic
def _viscous_pressure(viscosity, density, rate, sound_speed):
    """q [Pa] at the rate of volume change tr d [1/s] and the current density [kg/m^3]."""


@_viscous_pressure.of(BulkViscosity, CentredViscosity)
def _bulk_viscosity(viscosity, density, rate, sound_speed):
    jump = max(-rate, 0.0) * viscosity.spacing
    return density * jump * (viscosity.quadratic * jump + viscosity.linear * sound_speed)


@_viscous_pressure.of(None)
def _inviscid(viscosity, density, rate, sound_speed):
    return 0.0


@generic
def _heating(viscosity, q, pressure, stress, i, volume):
    """The viscous pressure [Pa] whose work is the heat of a step, that of stress and of the present volume [m^3] before
    it known.
    """


@_heating.of(CentredViscosity)
def _mean_of_both(viscosity, q, pressure, stress, i, volume):
    rows = four_rows(stress, i, 0)
    return 0.5 * (q - pressure - (rows[0] + rows[1] + rows[2]) * (1.0 / 3.0) / volume)


@_heating.otherwise
def _of_the_end(viscosity, q, pressure, stress, i, volume):
    return q


@register_jitable
def _kinematics(step, rate, F):
    """F+ = (1 + dt l) F with the velocity gradient l, R at its end, and the stretching D at half the step in unrotated
    axes.
    """
    new_F = F + step * (rate @ F)
    R = rotation(new_F)
    # the rate at half the step, l (1 + dt l/2)^-1: of a rotation it has no symmetric part, however large the step
    M = I + (0.5 * step) * rate
    half_rate = symmetric_part((1.0 / determinant(M)) * (rate @ cofactor(M).T))
    half_R = rotation_near(R, F + new_F)
    return new_F, R, congruence(half_R.T, half_rate)


@register_jitable
def _load_state(space, state, i):
    """F, s, ep, E and T of particles i..i+3."""
    F, s = load_general(space, state.deformation, i), load_symmetric(space, state.deviator, i)
    return F, s, load(state.plastic_strain, 0, i), load(state.energy, 0, i), load(state.temperature, 0, i)


@register_jitable
def _store_state(space, state, i, values, count):
    """The same of the first `count` of particles i..i+3."""
    store_general(space, state.deformation, i, values[0], count)
    store_symmetric(space, state.deviator, i, values[1], count)
    store_first(state.plastic_strain, 0, i, values[2], count)
    store_first(state.energy, 0, i, values[3], count)
    store_first(state.temperature, 0, i, values[4], count)


@register_jitable
def _flowed(law, step, s, strain, ep, temperature, pressure, J, new_J):
    """Deviator, increment of the plastic strain and plastic work per volume of a step; melting temperature and what
    `Elasticity` holds.
    """
    melting = melting_temperature(law.melting, J)
    mu = shear_modulus(law.shear_modulus, J, pressure, temperature, melting)
    capacity = law.density * specific_heat(law, temperature)
    heating = law.taylor_quinney * new_J / capacity
    new_s, increment, plastic_work = deviator_update(
        law.flow_stress, s, strain, ep, step, temperature, heating, mu, melting
    )
    return new_s, increment, plastic_work, melting, Elasticity(new_J, mu, capacity)


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_stress(space, first, last, law, step, viscosity, state, motion, rate, stress):
    """Advance F, s, ep, E and T of particles first..last-1 by one step [s] with the velocity gradients `rate`.

    motion (capacity, 8): x y z m | vx vy vz V0; rate (capacity, 12): rows of l, each padded to 4; stress (capacity, 8):
    V sigma is written, artificial viscosity included, xx yy zz 0 | yz xz xy c + |v| (up to three records beyond `last`
    are overwritten). viscosity is a BulkViscosity or None. Returns (sound, largest c + |v| [m/s], plastic work, viscous
    work, what failure released [J]); sound is False where J <= 0, beyond the equation of state, or not a number.
    """
    sound, fastest, plastic, viscous, freed = True, broadcast(0.0), broadcast(0.0), broadcast(0.0), broadcast(0.0)
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        F, s, ep, energy, temperature = _load_state(space, state, i)
        whole, present = found_before(law.failure, state, i)
        new_F, R, D = _kinematics(step, moving(present, load_rate(space, rate, i)), F)
        J, new_J, volume_rate = determinant(F), determinant(new_F), trace(D)
        change, half_J = new_J - J, 0.5 * (J + new_J)
        pressure = borne(whole, cold_pressure(eos, J) + gamma * energy)
        strain = step * (D + (volume_rate * (-1.0 / 3.0)) * I)
        flow = _flowed(law, step, s, strain, ep, temperature, pressure, J, new_J)
        new_s, increment, plastic_work = flowing(whole, flow[0], flow[1], new_J * flow[2])
        melting, elasticity = flow[3], flow[4]
        q = _viscous_pressure(viscosity, law.density / half_J, volume_rate, wave_speed(law, J, pressure, elasticity[1]))
        q, velocity = resisted(whole, pressure, q), four_rows(motion, i, 4)
        volume = velocity[3]
        heating = _heating(viscosity, q, pressure, stress, i, volume * J)
        # closed form of E+ = E + W - [(P + P+)/2 + q] (J+ - J), P+ = A(J+) + gamma E+; T dS and -gamma T tr d likewise
        cold, part = cold_pressure(eos, new_J), 0.5 * gamma * change
        work = 0.5 * half_J * contract(s + new_s, strain)
        rise = temperature_rise(law, elasticity[2], law.taylor_quinney * plastic_work - heating * change)
        closed = energy + work - (0.5 * (pressure + cold) + heating) * change, temperature * (1.0 - part) + rise
        opened = energy + work - (0.5 * pressure + heating) * change, temperature + rise
        energy, temperature, pressure = settled(whole, closed, opened, cold, gamma, part)
        new_ep, flow_rate = ep + increment, increment / max(step, 1e-300)
        loading = Loading(new_s, pressure, new_ep, increment, flow_rate, temperature, melting)
        new_s, pressure, energy, temperature, released, whole = failing(
            whole, law, state, i, count, loading, elasticity, energy, change, strain
        )
        _store_state(space, state, i, (formless(whole, new_F, new_J), new_s, new_ep, energy, temperature), count)
        valid = counted(present, float(count) - from_floats(0.5, 1.5, 2.5, 3.5))
        speed = wave_speed(law, sounding(whole, new_J), pressure, elasticity[1]) + speed_of(velocity)
        store_stress(space, stress, i, (volume * new_J) * (congruence(R, new_s) - (pressure + q) * I), speed)
        fastest = choose(valid, max(speed, fastest), fastest)
        plastic = plastic + choose(valid, volume * plastic_work, 0.0)
        viscous = viscous + choose(valid, -volume * heating * change, 0.0)
        freed = summed(whole, freed, valid, volume * released)
        # the second of both where one is not a number
        if not all_positive(choose(valid, min(room_to_compress(eos, new_J), speed), 1.0)):
            sound = False
    return sound, largest_lane(fastest), total(plastic), total(viscous), total(freed)


@compiled(error_model="numpy")
def note_plastic_rise(first, last, space, law, state, before, rise):
    """Add to rise (1, capacity) [K] how far plastic flow beyond the strains `before` (capacity,) warms particles
    first..last-1.

    state: `MaterialState` after the step.
    """
    deviator, plastic_strain = state.deviator, state.plastic_strain
    for p in range(first, last):
        norm = deviator[0, p] ** 2 + deviator[1, p] ** 2 + deviator[2, p] ** 2
        for k in range(3, deviator.shape[0]):
            norm += 2.0 * deviator[k, p] ** 2
        J = determinant(one_gradient(space, state.deformation, p))
        heating = law.taylor_quinney / (law.density * specific_heat(law, state.temperature[0, p]))
        rise[0, p] += heating * J * math.sqrt(1.5 * norm) * (plastic_strain[0, p] - before[p])
