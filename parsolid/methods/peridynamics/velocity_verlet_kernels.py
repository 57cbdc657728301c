"""Kernels of `velocity_verlet`: velocities and displacements of a rank's particles."""

from decomposition.compiled import compiled
from parsolid.numerics.optional import free_of, load_of


@compiled
def kick(dimension, time, velocity, force, mass, share, loads, clamp):
    """v += time (F/m + load) = dv; on this side of mirror planes the work of the loads and time/2 sum F . dv [J].

    The latter is what leapfrog, with this work, adds to kinetic and stored energy by the end of a step and takes by the
    next, exactly where F is linear; without loads dt^2/8 sum m |a|^2, with time = dt/2 (Hairer, Lubich and Wanner,
    Geometric Numerical Integration, 2006, section I.5).
    velocity, force [N] (n, 4); mass (n,) [kg], of whole particles; loads (n, 4) [m/s^2] or None; clamp (n, 4): 0 where
    held, or None.
    """
    work, swing = 0.0, 0.0
    for a in range(len(mass)):
        for i in range(dimension):
            v, load, free = velocity[a, i], load_of(loads, a, i), free_of(clamp, a, i)
            new = (v + time * (force[a, i] / mass[a] + load)) * free
            work += 0.5 * time * share[a] * mass[a] * load * (v + new)
            # what is held is not kicked, whatever it is moved by
            swing += 0.5 * time * share[a] * force[a, i] * free * (new - v)
            velocity[a, i] = new
    return work, swing


@compiled
def drift(dimension, step, velocity, reference, displacement, position):
    """u += step v; x = X + u of the owned particles; the sum of all components of v, a number if all of them are."""
    total = 0.0
    for a in range(len(position)):
        for i in range(dimension):
            total += velocity[a, i]
            displacement[a, i] += step * velocity[a, i]
            position[a, i] = reference[a, i] + displacement[a, i]
    return total


@compiled
def kinetic_energy(dimension, velocity, mass, share):
    """Sum of 1/2 m v^2 [J]."""
    energy = 0.0
    for a in range(len(mass)):
        square = 0.0
        for i in range(dimension):
            square += velocity[a, i] * velocity[a, i]
        energy += 0.5 * mass[a] * share[a] * square
    return energy
