"""Particle kernels of the micro-inertia law: the state between the two passes, and fluxes after them.

Four particles at a time; a range first..last-1 shares one law. The order is that of a leapfrog (docs/microinertia.md):
stresses, micro-velocity and temperature see fluxes of the step's start, fluxes see their gradients at its end.
"""

import math

from numba.extending import register_jitable

from decomposition.compiled import compiled
from parsolid.materials.plastic.micro_inertia import (
    advance_fluxes,
    advance_heat_flux,
    advance_micro,
    curl_rate,
    micro_energies,
    pressure,
    volumetric_energy,
)
from parsolid.methods.mpm.layout import load_symmetric, store_symmetric
from parsolid.methods.ulsph.layout import (
    load_correction,
    load_moment,
    load_number,
    load_vector,
    spin_rotation,
    store_correction,
    store_number,
    store_stress_record,
    store_vector,
    trusted_inverse,
)
from parsolid.methods.ulsph.sums import divergences, gradients, store_fluxes
from parsolid.numerics.dispatch import none_without
from parsolid.numerics.elementary import choose
from parsolid.numerics.lanes import WIDTH, all_positive, broadcast, from_floats, load, store_first, total
from parsolid.numerics.layout import load_gradient
from parsolid.numerics.polar import congruence, symmetric_part
from parsolid.numerics.tensors import I, contract, trace


@none_without("gradient")
def square_of(gradient):
    """|g|^2."""
    result = gradient[0] * gradient[0]
    for k in range(1, len(gradient)):
        result = result + gradient[k] * gradient[k]
    return result


@none_without("flux")
def _power(flux, gradient):
    """xi . g."""
    result = flux[0] * gradient[0]
    for k in range(1, len(gradient)):
        result = result + flux[k] * gradient[k]
    return result


@register_jitable
def _or_zero(value):
    """What a scene lacks is nothing."""
    return 0.0 if value is None else value


@none_without("curl")
def _curl_after(curl, gradient, direction, step):
    return curl + step * curl_rate(gradient, direction)


@none_without("free", returns="solved")
def _where_free(free, solved, trial, keep_stress, stress):
    """What the local solve found, but where the micro-velocity is held at 0."""
    rate, mean, tau, new_stress, heat, lost = solved
    held = trial + 0.0 * tau
    return (
        choose(free, rate, 0.0),
        choose(free, mean, 0.0),
        choose(free, tau, held),
        choose(free, new_stress, keep_stress * stress),
        choose(free, heat, 0.0),
        choose(free, lost, 0.0),
    )


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_state(space, first, last, law, increments, carried, body):
    """Advance density, stress, micro-velocity, pi, gamma and T of particles by a step from the sums of the first pass.

    Fills B and the records. Returns (sound, plastic heat [J], energy [J] that time integration lost).
    """
    sound, plastic, lost = True, broadcast(0.0), broadcast(0.0)
    step, mu = increments.step, law.shear_modulus
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        mass, density = load(body.mass, 0, i), load(body.density, 0, i)
        inverse = 1.0 / (mass * density)
        B = trusted_inverse(space, inverse * load_moment(space, body.rate_sums, i))
        store_correction(space, body.correction, i, B, count)
        L = inverse * (load_gradient(space, body.rate_sums, i) @ B)
        D, expansion = symmetric_part(L), trace(L)
        old = load_symmetric(space, body.deviator, i)
        trial = congruence(spin_rotation(L, step), old)
        trial = trial + (2.0 * mu * step) * (D + (expansion * (-1.0 / 3.0)) * I)
        tau, trial_tau = math.sqrt(contract(old, old)), math.sqrt(contract(trial, trial))
        direction = (1.0 / max(trial_tau, 1e-300)) * trial
        force, heat_loss = divergences(space, carried, body, i, density / mass)
        gradient = load_vector(body.micro_gradient, i, space)
        rate, stress = load(body.micro_rate, 0, i), load(body.micro_stress, 0, i)
        gamma, temperature = load(body.plastic_strain, 0, i), load(body.temperature, 0, i)
        curl = load_number(body.micro_curl, i)
        solved = advance_micro(
            law, increments, tau, trial_tau, rate, stress, gamma, curl, temperature, force, square_of(gradient)
        )
        solved = _where_free(
            load_number(body.micro_free, i), solved, trial_tau, _or_zero(increments.keep_stress), stress
        )
        new_rate, mean_rate, new_tau, new_stress, heat, loss = solved
        density = density * math.exp(-step * expansion)
        diffused = _or_zero(_power(load_vector(body.dissipative_flux, i, space), gradient))
        heat = heat + (0.5 * step) * diffused
        temperature = temperature + (heat - step * _or_zero(heat_loss)) / (density * law.specific_heat)
        deviator = new_tau * direction
        store_symmetric(space, body.deviator, i, deviator, count)
        store_first(body.density, 0, i, density, count)
        store_first(body.micro_rate, 0, i, new_rate, count)
        store_first(body.micro_stress, 0, i, new_stress, count)
        store_first(body.plastic_strain, 0, i, gamma + step * mean_rate, count)
        store_first(body.temperature, 0, i, temperature, count)
        store_number(body.micro_curl, i, _curl_after(curl, gradient, direction, step), count)
        p = pressure(law, density * (1.0 / law.density))
        P = (1.0 / (density * density)) * ((deviator - p * I) @ B)
        store_stress_record(space, body.record, i, P, density, new_rate, temperature, speed_of_sound(law))
        valid, volume = float(count) - from_floats(0.5, 1.5, 2.5, 3.5), mass / density
        plastic = plastic + choose(valid, volume * heat, 0.0)
        lost = lost + choose(valid, volume * loss, 0.0)
        if not all_positive(choose(valid, choose(new_tau + new_rate + temperature + 1.0, density, -1.0), 1.0)):
            sound = False
    return sound, total(plastic), total(lost)


@register_jitable
def speed_of_sound(law):
    """c_L [m/s] of the undeformed solid."""
    return math.sqrt((law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus) / law.density)


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_gradients(space, first, last, law, increments, carried, body):
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
        store_first(body.temperature, 0, i, temperature + heat / (density * law.specific_heat), count)
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
        moving, bent = micro_energies(
            law, density, load(body.micro_rate, 0, i), square_of(load_vector(body.energetic_flux, i, space))
        )
        elastic = contract(S, S) * (0.25 / law.shear_modulus) + density * volumetric_energy(law, density / law.density)
        valid = float(count) - from_floats(0.5, 1.5, 2.5, 3.5)
        kinetic = kinetic + choose(valid, volume * _or_zero(moving), 0.0)
        stored = stored + choose(valid, volume * (elastic + _or_zero(bent)), 0.0)
    return total(kinetic), total(stored)
