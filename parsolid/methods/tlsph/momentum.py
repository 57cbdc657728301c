"""Kernels of the momentum equation (72a) and the energy sums."""

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.law import equilibrium_energy
from parsolid.materials.viscoelastic.maxwell_lanes import branch_energy
from parsolid.methods.tlsph.stage_kernels import clamped, motion_loss
from parsolid.methods.tlsph.strain import load_strain
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, broadcast, from_floats, lane, load, store, swizzle, total, without_fourth
from parsolid.numerics.layout import Plane, load_branch
from parsolid.numerics.tensors import gram, lane_of_general, lane_of_stored_symmetric

_swap = swizzle(2, 3, 0, 1)


@generic
def split_motion(space, kinematics, a):
    """v and x of a particle, lanes beyond the dimension zero."""


@split_motion.of(Plane)
def _split_in_plane(space, kinematics, a):
    motion, two = load(kinematics, a, 0), from_floats(1.0, 1.0, 0.0, 0.0)
    return motion * two, _swap(motion) * two


@split_motion.otherwise
def _split_in_space(space, kinematics, a):
    return load(kinematics, a, 0), load(kinematics, a, 4)


@generic
def join_motion(space, kinematics, a, v, x):
    """Store v and x of a particle."""


@join_motion.of(Plane)
def _join_in_plane(space, kinematics, a, v, x):
    store(kinematics, a, 0, v + _swap(x))


@join_motion.otherwise
def _join_in_space(space, kinematics, a, v, x):
    store(kinematics, a, 0, v)
    store(kinematics, a, 4, x)


@generic
def _within(space, value):
    """Lanes beyond the dimension set to zero."""


@_within.of(Plane)
def _within_plane(space, value):
    return value * from_floats(1.0, 1.0, 0.0, 0.0)


@_within.otherwise
def _within_space(space, value):
    return without_fourth(value)


@register_jitable
def _loaded(loads, a, acceleration):
    if loads is None:
        return acceleration
    return acceleration + load(loads, a, 0)


@register_jitable
def _load_power(loads, a, mass, v):
    if loads is None:
        return 0.0
    return mass * total(load(loads, a, 0) * v)


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_motion(space, owned, update, kinematics, start, force, sums, mass, share, loads, clamp, free, rates):
    """One stage of v and x; sets the pair forces and pair sums to zero for the next.

    mass (n,): rho V [kg]; share (n,): tributary over pair volume; loads (n, 4): acceleration of body forces and
    tractions [m/s^2] or None; clamp (n, 4): 0 for held components, else 1, or None; free as in `kick`; rates (n, 4):
    accelerations of the first stage, or None.
    Returns (numerical dissipation rate, power of the loads) [W] and what the stages take of kinetic energy [J].
    """
    dissipation, power, lost = 0.0, 0.0, 0.0
    zero = broadcast(0.0)
    for a in range(owned):
        v, x = split_motion(space, kinematics, a)
        v0, x0 = v, x
        if update.first:
            store(start, a, 0, v)
            store(start, a, 4, x)
        else:
            v0, x0 = load(start, a, 0), load(start, a, 4)
        D = load(force, a, 4)
        dissipation -= share[a] * total(_within(space, D) * v)
        power += _load_power(loads, a, mass[a] * share[a], v)
        rate = _within(space, load(force, a, 0) + D) * (1.0 / mass[a])
        rate = _loaded(loads, a, rate)
        lost += motion_loss(rates, update, a, mass[a] * share[a], free, rate, v - v0)
        new_v = update.keep * v0 + update.take * (v + update.step * rate)
        new_x = update.keep * x0 + update.take * (x + update.step * v)
        join_motion(space, kinematics, a, clamped(clamp, a, new_v), new_x)
        store(force, a, 0, zero)
        store(force, a, 4, zero)
        for column in range(0, sums.shape[1], WIDTH):
            store(sums, a, column, zero)
    return dissipation, power, lost


@register_jitable
def _swing(swings, mass, rate):
    # by its argument, for numba to leave out what a scene lacks
    if swings is None:
        return 0.0
    return mass * total(rate * rate)


@compiled(fastmath={"contract"}, error_model="numpy")
def kick(space, owned, opening, step, kinematics, force, mass, share, loads, free, swings):
    """v after half a step [s]; the opening half of a step also moves x by its v and sets the pair forces to zero.

    free (n, 4): 0 for components that forces do not change, else 1, or None; otherwise as in `advance_motion`.
    Returns numerical dissipation and work of the loads, both with the velocity in the middle of the step, and, where
    `swings` is not None, leapfrog's oscillation, the kinetic energy of the change of v [J].
    """
    work, swing, half = 0.0, 0.0, 0.5 * step
    dissipation = zero = broadcast(0.0)
    for a in range(owned):
        v, x = split_motion(space, kinematics, a)
        D = _within(space, load(force, a, 4))
        rate = _loaded(loads, a, (_within(space, load(force, a, 0)) + D) * (1.0 / mass[a]))
        rate = clamped(free, a, rate)
        new = v + half * rate
        swing += _swing(swings, mass[a] * share[a], rate)
        middle = new if opening else v
        dissipation = dissipation - share[a] * (D * middle)
        work += _load_power(loads, a, mass[a] * share[a], middle)
        if opening:
            join_motion(space, kinematics, a, new, x + step * new)
            store(force, a, 0, zero)
            store(force, a, 4, zero)
        else:
            join_motion(space, kinematics, a, new, x)
    return half * total(dissipation), half * work, 0.5 * half * half * swing


@register_jitable
def _load_force(loads, a, i, mass):
    if loads is None:
        return 0.0
    return mass * loads[a, i]


@compiled
def prescribed_power(particles, components, kinematics, force, mass, share, loads):
    """Power [W] that holds prescribed components against pair forces and loads; arguments as in `advance_motion`."""
    power = 0.0
    for k in range(particles.shape[0]):
        a, i = particles[k], components[k]
        resisted = force[a, i] + force[a, 4 + i] + _load_force(loads, a, i, mass[a])
        power -= share[a] * resisted * kinematics[a, i]
    return power


@compiled
def prescribe(particles, components, values, kinematics):
    """Set prescribed velocity components [m/s]."""
    for k in range(particles.shape[0]):
        kinematics[particles[k], components[k]] = values[k]


@compiled
def kinetic_energy(owned, dimension, kinematics, mass, share):
    """Sum of 1/2 m v^2 [J] over owned particles with their tributary mass."""
    energy = 0.0
    for a in range(owned):
        square = 0.0
        for i in range(dimension):
            square += kinematics[a, i] * kinematics[a, i]
        energy += 0.5 * mass[a] * share[a] * square
    return energy


@register_jitable
def _branch_energies(space, law, branches, i, k, F, J):
    if branches is None:
        return 0.0
    C, energy = gram(F), 0.0
    for alpha in range(len(law.branch_moduli)):
        A = lane_of_stored_symmetric(load_branch(space, branches, alpha, i), k)
        energy += branch_energy(law.branch_moduli[alpha], C, J, A)
    return energy


@compiled(error_model="numpy")
def stored_energy(space, first, last, law, body):
    """Sum of W V [J] with tributary volumes (eqs (19), (20))."""
    energy = 0.0
    for i in range(first, last, WIDTH):
        F4, H4, J4 = load_strain(space, body, i)
        for k in range(min(WIDTH, last - i)):
            F, H, J = lane_of_general(F4, k), lane_of_general(H4, k), lane(J4, k)
            W = equilibrium_energy(law, F, H, J) + _branch_energies(space, law, body.branches, i, k, F, J)
            energy += W * body.tributary[0, i + k]
    return energy
