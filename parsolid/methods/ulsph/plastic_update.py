"""Particle kernels of elastic-plastic laws with an equation of state: the state between the passes, heat after them.

Four particles at a time; a range first..last-1 shares one law. The deviator is a Cauchy stress in Jaumann's rate, its
trial is what `deviator_update` returns to the flow stress; energy and temperature are those of the material point
method, but that viscous heat comes from the sums of the second pass.
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.failure.failing import (
    Elasticity,
    borne,
    counted,
    failing,
    flowing,
    found_before,
    moving,
    settled,
    sounding,
    summed,
)
from parsolid.materials.failure.failure import Loading
from parsolid.materials.plastic import radial_return, rate_form  # noqa: F401  (their overloads)
from parsolid.materials.plastic.jaumann_rate_lanes import elastic_increment, jaumann_turn
from parsolid.materials.plastic.plasticity import (
    cold_pressure,
    deviator_update,
    grueneisen_coefficient,
    melting_temperature,
    room_to_compress,
    shear_modulus,
)
from parsolid.materials.plastic.wave_speed import wave_speed
from parsolid.methods.ulsph.layout import (
    bounded_inverse,
    carried_on,
    load_correction,
    load_moment,
    store_correction,
    store_stress_record,
    store_vector,
)
from parsolid.methods.ulsph.sums import divergences, gradients, store_fluxes
from parsolid.methods.ulsph.viscous_heat import centred_heat
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import WIDTH, all_positive, broadcast, from_floats, lane, load, store_first, total
from parsolid.numerics.layout import Plane, load_gradient
from parsolid.numerics.polar import congruence
from parsolid.numerics.tensor_rows import load_symmetric, store_symmetric
from parsolid.numerics.tensors import I, contract, trace


@register_jitable
def _strained(space, step, mean_step, correction, body, i, count, present):
    """B of the forces, growth of the density over half the step, S turned with the spin and the strain increment
    dev D dt."""
    weight = 1.0 / (load(body.mass, 0, i) * load(body.density, 0, i))
    B = bounded_inverse(space, correction, weight * load_moment(space, body.rate_sums, i))
    rate = moving(present, weight * (load_gradient(space, body.rate_sums, i) @ B))
    # the moment is that of the middle of the step, and so is its density then
    growth = math.exp(-0.5 * step * trace(rate))
    B = growth * B
    later = carried_on(correction, space, body.correction, i, B, 0.5 * step, mean_step)
    store_correction(space, body.correction, i, B, count)
    turn = jaumann_turn(rate, step)
    rotated = congruence(turn, load_symmetric(space, body.deviator, i))
    return later, growth, rotated, elastic_increment(turn, rate, step, 0.5)


@generic(on="loss")
def _supplied(loss, factor):
    """Heat that conduction brings: -factor div q, 0 where nothing is conducted."""


@_supplied.of(None)
def _nothing_supplied(loss, factor):
    return 0.0


@_supplied.otherwise
def _conducted(loss, factor):
    return -factor * loss


@generic
def _store_speed(space, kinematics, i, speed, count):
    """c beside the velocity in space; the plane has it in the record."""


@_store_speed.of(Plane)
def _speed_in_record(space, kinematics, i, speed, count):
    return None


@_store_speed.otherwise
def _speed_in_kinematics(space, kinematics, i, speed, count):
    for k in range(count):
        kinematics[i + k, 3] = lane(speed, k)


@register_jitable
def _flowed(law, step, rotated, strain, ep, temperature, pressure, J, new_J):
    """Deviator, increment of the plastic strain and plastic work per volume of a step; melting temperature and what
    `Elasticity` holds.
    """
    melting = melting_temperature(law.melting, J)
    mu = shear_modulus(law.shear_modulus, J, pressure, temperature, melting)
    capacity = law.density * law.specific_heat
    share = law.taylor_quinney * new_J / capacity
    s, increment, work = deviator_update(law.flow_stress, rotated, strain, ep, step, temperature, share, mu, melting)
    return s, increment, work, melting, Elasticity(new_J, mu, capacity)


@register_jitable
def _store_state(space, body, i, values, count):
    """S, rho, ep, E and T of the first `count` of particles i..i+3."""
    store_symmetric(space, body.deviator, i, values[0], count)
    store_first(body.density, 0, i, values[1], count)
    store_first(body.plastic_strain, 0, i, values[2], count)
    store_first(body.energy, 0, i, values[3], count)
    store_first(body.temperature, 0, i, values[4], count)


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_state(space, first, last, law, step, mean_step, carried, heating, correction, body):
    """Advance density, stress, plastic strain, E and T of particles by a step [s] from the sums of the first pass.

    Fills B, the records and the speeds of sound. Viscous heat is that of the last forces, which act for the halves of
    the step before and of this one, together mean_step [s]. Returns (sound, plastic work, viscous heat, what failure
    released [J]); sound is False where a particle is compressed beyond its equation of state or is not a number.
    """
    sound, plastic, viscous, freed = True, broadcast(0.0), broadcast(0.0), broadcast(0.0)
    eos, gamma = law.equation_of_state, grueneisen_coefficient(law.equation_of_state)
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        whole, present = found_before(law.failure, body, i)
        B, growth, rotated, strain = _strained(space, step, mean_step, correction, body, i, count, present)
        volume, old = load(body.mass, 0, i) / law.density, load(body.density, 0, i)
        middle, density = old * growth, old * growth * growth
        ep, energy, temperature = load(body.plastic_strain, 0, i), load(body.energy, 0, i), load(body.temperature, 0, i)
        J, half_J, new_J = law.density / old, law.density / middle, law.density / density
        change, pressure = new_J - J, borne(whole, cold_pressure(eos, J) + gamma * energy)
        flow = _flowed(law, step, rotated, strain, ep, temperature, pressure, J, new_J)
        s, increment, plastic_work = flowing(whole, flow[0], flow[1], new_J * flow[2])
        friction = (1.0 / volume) * centred_heat(heating, space, body, i, step, mean_step)
        conducted = _supplied(divergences(space, carried, body, i, 1.0 / (volume * half_J))[1], step * half_J)
        # closed form of E+ = E + W - (P + P+)/2 (J+ - J) with P+ = A(J+) + gamma E+; T dS and -gamma T tr d likewise
        cold, part = cold_pressure(eos, new_J), 0.5 * gamma * change
        worked = energy + 0.5 * half_J * contract(rotated + s, strain) + friction + conducted
        rise = (law.taylor_quinney * plastic_work + friction + conducted) / flow[4][2]
        closed = worked - 0.5 * (pressure + cold) * change, temperature * (1.0 - part) + rise
        opened = worked - 0.5 * pressure * change, temperature + rise
        energy, temperature, pressure = settled(whole, closed, opened, cold, gamma, part)
        loading = Loading(s, pressure, ep + increment, increment, increment / max(step, 1e-300), temperature, flow[3])
        s, pressure, energy, temperature, released, whole = failing(
            whole, law, body, i, count, loading, flow[4], energy, change, strain
        )
        _store_state(space, body, i, (s, density, ep + increment, energy, temperature), count)
        speed = wave_speed(law, sounding(whole, new_J), pressure, flow[4][1])
        _store_speed(space, body.kinematics, i, speed, count)
        P = (1.0 / (density * density)) * ((s - pressure * I) @ B)
        store_stress_record(space, body.record, i, P, density, broadcast(0.0), temperature, speed)
        valid = counted(present, float(count) - from_floats(0.5, 1.5, 2.5, 3.5))
        plastic = plastic + choose(valid, volume * plastic_work, 0.0)
        viscous = viscous + choose(valid, volume * friction, 0.0)
        freed = summed(whole, freed, valid, volume * released)
        # the second of both where one is not a number
        if not all_positive(choose(valid, min(room_to_compress(eos, new_J), speed), 1.0)):
            sound = False
    return sound, total(plastic), total(viscous), total(freed)


@none_without("gradient")
def _fourier(gradient, conductivity):
    """q = -kappa grad T."""
    if len(gradient) == 2:
        return -conductivity * gradient[0], -conductivity * gradient[1]
    return -conductivity * gradient[0], -conductivity * gradient[1], -conductivity * gradient[2]


@none_without("conductivity")
def _flux(conductivity, gradient):
    """q of a law that conducts."""
    return _fourier(gradient, conductivity)


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_heat_flux(space, first, last, law, carried, body):
    """The heat flux from the gradients that the second pass has summed, and what it tells the neighbours."""
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        mass, density = load(body.mass, 0, i), load(body.density, 0, i)
        B = load_correction(space, body.correction, i)
        q = _flux(law.conductivity, gradients(space, carried, body, i, B, 1.0 / (mass * density))[1])
        store_vector(body.heat_flux, i, q, count)
        store_fluxes(space, carried, body.flux, i, B, 1.0 / (density * density), None, None, q)
