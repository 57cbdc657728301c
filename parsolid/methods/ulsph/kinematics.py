"""Kernels that move particles: half kicks, drifts, and the energies of motion."""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.optional import free_of, load_of


@register_jitable
def second_vector(dimension):
    """First column of the second vector of `kinematics` and of `force_sums`: of the places, of the viscous forces."""
    return 2 if dimension == 2 else 4


@compiled(fastmath={"contract"}, error_model="numpy")
def kick(owned, dimension, step, kinematics, forces, mass, loads, clamp):
    """v += F/m step and the loads' [m/s^2], but for held components.

    Returns the work of the loads and that of the artificial viscosity [J], exact for this change of the velocity, and
    leapfrog's oscillation, step/2 sum F . dv [J] of the other forces.
    """
    work, viscous, swing, first = 0.0, 0.0, 0.0, second_vector(dimension)
    for a in range(owned):
        inverse = 1.0 / mass[0, a]
        for i in range(dimension):
            old, load = kinematics[a, i], load_of(loads, a, i)
            new = free_of(clamp, a, i) * (old + step * (forces[a, i] * inverse + load))
            work += mass[0, a] * load * (old + new)
            viscous += forces[a, first + i] * (old + new)
            swing += (forces[a, i] - forces[a, first + i]) * (new - old)
            kinematics[a, i] = new
    return 0.5 * step * work, 0.5 * step * viscous, 0.5 * step * swing


@compiled(fastmath={"contract"}, error_model="numpy")
def drift(first, last, dimension, step, kinematics):
    """x += v step, the same arithmetic for particles and for their ghosts on other ranks."""
    place = second_vector(dimension)
    for a in range(first, last):
        for i in range(dimension):
            kinematics[a, place + i] += step * kinematics[a, i]


@compiled(error_model="numpy")
def kinetic_energy(owned, dimension, kinematics, mass):
    """Sum of 1/2 m v^2 [J]."""
    energy = 0.0
    for a in range(owned):
        square = 0.0
        for i in range(dimension):
            square += kinematics[a, i] * kinematics[a, i]
        energy += mass[0, a] * square
    return 0.5 * energy


@compiled(error_model="numpy")
def least_transit(owned, dimension, kinematics, speed, smoothing_length):
    """The least h / (c + |v|) [s]; speed (rows,) [m/s]."""
    least = math.inf
    for a in range(owned):
        square = 0.0
        for i in range(dimension):
            square += kinematics[a, i] * kinematics[a, i]
        transit = smoothing_length[0, a] / (speed[a] + math.sqrt(square))
        # also where it is not a number
        if not transit >= least:
            least = transit
    return least
