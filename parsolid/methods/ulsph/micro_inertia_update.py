"""Particle kernels of the micro-inertia law: the state between the two passes, and fluxes after them.

Four particles at a time; a range first..last-1 shares one law. The order is that of a leapfrog (docs/microinertia.md):
stresses, micro-velocity and temperature see fluxes of the step's start, fluxes see their gradients at its end.
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.plastic.jaumann_rate_lanes import elastic_increment, jaumann_turn, returned_deviator
from parsolid.materials.plastic.micro_inertia_lanes import (
    advance_fluxes,
    advance_heat_flux,
    advance_micro,
    curl_rate,
    deviatoric_energy,
    gradient_energy,
    micro_kinetic_energy,
    micro_time_step,
    pressure,
    volumetric_energy,
)
from parsolid.methods.ulsph.layout import (
    bounded_inverse,
    load_correction,
    load_moment,
    load_number,
    load_vector,
    store_correction,
    store_number,
    store_stress_record,
    store_vector,
)
from parsolid.methods.ulsph.sums import divergences, gradients, store_fluxes
from parsolid.methods.ulsph.viscous_heat import viscous_heat
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import WIDTH, all_positive, broadcast, from_floats, load, store_first, total
from parsolid.numerics.layout import load_gradient
from parsolid.numerics.polar import congruence
from parsolid.numerics.tensor_rows import largest_lane, load_symmetric, store_symmetric
from parsolid.numerics.tensors import I, contract, trace


@none_without("gradient")
def square_of(gradient):
    """|g|^2."""
    return _power(gradient, gradient)


@none_without("flux")
def _power(flux, gradient):
    """xi . g."""
    result = flux[0] * gradient[0]
    for k in range(1, len(gradient)):
        result = result + flux[k] * gradient[k]
    return result


@generic
def _or_zero(value):
    """What a scene lacks is nothing."""


@_or_zero.of(None)
def _zero(value):
    return 0.0


@_or_zero.otherwise
def _itself(value):
    return value


@none_without("curl")
def _curl_after(curl, gradient, direction, step):
    return curl + step * curl_rate(gradient, direction)


@generic
def _kept(relaxed, stress):
    """pi after a step without flow."""


@_kept.of(None)
def _none_kept(relaxed, stress):
    return 0.0 * stress


@_kept.otherwise
def _some_kept(relaxed, stress):
    return (1.0 - relaxed) * stress


@none_without("free", returns="solved")
def _where_free(free, solved, trial, kept_stress):
    """What the local solve found, but where the micro-velocity is held at 0."""
    rate, mean, tau, new_stress, heat, lost = solved
    held = trial + 0.0 * tau
    return (
        choose(free, rate, 0.0),
        choose(free, mean, 0.0),
        choose(free, tau, held),
        choose(free, new_stress, kept_stress),
        choose(free, heat, 0.0),
        choose(free, lost, 0.0),
    )


@register_jitable
def _elastic_step(space, shear_modulus, step, correction, body, i, count):
    """B, mean and new density, and of S: its norm at the start, turned with the spin, and the elastic trial."""
    mass, density = load(body.mass, 0, i), load(body.density, 0, i)
    inverse = 1.0 / (mass * density)
    B = bounded_inverse(space, correction, inverse * load_moment(space, body.rate_sums, i))
    L = inverse * (load_gradient(space, body.rate_sums, i) @ B)
    growth = math.exp(-0.5 * step * trace(L))
    # the moment is that of the middle of the step, and so is its density then
    B = growth * B
    store_correction(space, body.correction, i, B, count)
    old, turn = load_symmetric(space, body.deviator, i), jaumann_turn(L, step)
    rotated = congruence(turn, old)
    trial = rotated + elastic_increment(turn, L, step, shear_modulus)
    return B, density * growth, density * growth * growth, math.sqrt(contract(old, old)), rotated, trial


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_state(space, first, last, law, increments, carried, correction, body):
    """Advance density, stress, micro-velocity, pi, gamma and T of particles by a step from the sums of the first pass.

    Fills B and the records. Returns (sound, plastic heat [J], energy [J] that time integration lost).
    """
    sound, plastic, lost, step = True, broadcast(0.0), broadcast(0.0), increments.step
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        elastic = _elastic_step(space, law.shear_modulus, step, correction, body, i, count)
        B, middle, density, tau, rotated, trial = elastic
        trial_tau, mass = math.sqrt(contract(trial, trial)), load(body.mass, 0, i)
        force, heat_loss = divergences(space, carried, body, i, middle / mass)
        gradient = load_vector(body.micro_gradient, i, space)
        rate, stress = load(body.micro_rate, 0, i), load(body.micro_stress, 0, i)
        gamma, temperature = load(body.plastic_strain, 0, i), load(body.temperature, 0, i)
        curl, square = load_number(body.micro_curl, i), square_of(gradient)
        solved = advance_micro(
            law, increments, middle, tau, trial_tau, rate, stress, gamma, curl, temperature, force, square
        )
        free, kept_stress = load_number(body.micro_free, i), _kept(increments.relax_stress, stress)
        new_rate, mean_rate, new_tau, new_stress, heat, loss = _where_free(free, solved, trial_tau, kept_stress)
        heat = heat + (0.5 * step) * _or_zero(_power(load_vector(body.dissipative_flux, i, space), gradient))
        temperature = temperature + (heat - step * _or_zero(heat_loss)) / (middle * law.specific_heat)
        deviator = returned_deviator(rotated, trial, tau, new_tau, (law.shear_modulus * step) * mean_rate)
        store_symmetric(space, body.deviator, i, deviator, count)
        for row, value in (
            (body.density, density),
            (body.micro_rate, new_rate),
            (body.micro_stress, new_stress),
            (body.plastic_strain, gamma + step * mean_rate),
            (body.temperature, temperature),
        ):
            store_first(row, 0, i, value, count)
        direction = (1.0 / max(trial_tau, 1e-300)) * trial
        store_number(body.micro_curl, i, _curl_after(curl, gradient, direction, step), count)
        p = pressure(law, density / law.density)
        P = (1.0 / (density * density)) * ((deviator - p * I) @ B)
        store_stress_record(space, body.record, i, P, density, new_rate, temperature, None)
        valid, volume = float(count) - from_floats(0.5, 1.5, 2.5, 3.5), mass / middle
        plastic, lost = plastic + choose(valid, volume * heat, 0.0), lost + choose(valid, volume * loss, 0.0)
        if not all_positive(choose(valid, choose(new_tau + new_rate + temperature + 1.0, density, -1.0), 1.0)):
            sound = False
    return sound, total(plastic), total(lost)


@register_jitable
def speed_of_sound(law):
    """c_L [m/s] of the undeformed solid."""
    return math.sqrt((law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus) / law.density)


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_gradients(space, first, last, law, increments, carried, heating, body):
    """Fluxes after a step from the gradients that the second pass has summed, and what they tell the neighbours.

    Returns the dissipation of the micro-flux [J] in the second half of the step.
    """
    plastic, step = broadcast(0.0), increments.step
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        mass, density = load(body.mass, 0, i), load(body.density, 0, i)
        B = load_correction(space, body.correction, i)
        gradient, warming = gradients(space, carried, body, i, B, 1.0 / (mass * density))
        temperature, rate = load(body.temperature, 0, i), load(body.micro_rate, 0, i)
        energetic = load_vector(body.energetic_flux, i, space)
        dissipative = load_vector(body.dissipative_flux, i, space)
        heat = (0.5 * step) * _or_zero(_power(dissipative, gradient))
        valid = float(count) - from_floats(0.5, 1.5, 2.5, 3.5)
        plastic = plastic + choose(valid, mass / density * heat, 0.0)
        warmth = heat + viscous_heat(heating, space, body, i, step * density / mass)
        temperature = temperature + warmth / (density * law.specific_heat)
        store_first(body.temperature, 0, i, temperature, count)
        energetic, dissipative = advance_fluxes(
            law,
            increments,
            energetic,
            dissipative,
            gradient,
            rate,
            load(body.plastic_strain, 0, i),
            load_number(body.micro_curl, i),
            temperature,
        )
        heat_flux = advance_heat_flux(law, increments, load_vector(body.heat_flux, i, space), warming)
        store_vector(body.energetic_flux, i, energetic, count)
        store_vector(body.dissipative_flux, i, dissipative, count)
        store_vector(body.heat_flux, i, heat_flux, count)
        store_vector(body.micro_gradient, i, gradient, count)
        store_fluxes(space, carried, body.flux, i, B, 1.0 / (density * density), energetic, dissipative, heat_flux)
    return total(plastic)


@compiled(error_model="numpy")
def energies(space, first, last, law, body):
    """Kinetic energy of the micro-velocity and stored energy [J] of particles first..last-1."""
    kinetic, stored = broadcast(0.0), broadcast(0.0)
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        density, S = load(body.density, 0, i), load_symmetric(space, body.deviator, i)
        volume = load(body.mass, 0, i) / density
        rate, flux = load(body.micro_rate, 0, i), load_vector(body.energetic_flux, i, space)
        elastic = deviatoric_energy(law, math.sqrt(contract(S, S)))
        elastic = elastic + density * volumetric_energy(law, density / law.density) + gradient_energy(law, flux)
        valid = float(count) - from_floats(0.5, 1.5, 2.5, 3.5)
        kinetic = kinetic + choose(valid, volume * micro_kinetic_energy(law, density, rate), 0.0)
        stored = stored + choose(valid, volume * elastic, 0.0)
    return total(kinetic), total(stored)


@compiled(error_model="numpy")
def least_micro_step(first, last, law, space, body):
    """Least stable step [s] of micro-rate and micro-flux of particles first..last-1."""
    least = broadcast(math.inf)
    for i in range(first, last, WIDTH):
        valid = float(min(WIDTH, last - i)) - from_floats(0.5, 1.5, 2.5, 3.5)
        step = micro_time_step(
            law,
            load(body.smoothing_length, 0, i),
            load(body.density, 0, i),
            load(body.micro_rate, 0, i),
            square_of(load_vector(body.micro_gradient, i, space)),
            load(body.plastic_strain, 0, i),
            load_number(body.micro_curl, i),
            load(body.temperature, 0, i),
        )
        least = choose(valid, min(step, least), least)
    return -largest_lane(-least)


@compiled(error_model="numpy")
def pressures(first, last, law, density, result):
    """p [Pa] of particles first..last-1 into result (n,)."""
    for i in range(first, last):
        result[i - first] = pressure(law, density[0, i] / law.density)
