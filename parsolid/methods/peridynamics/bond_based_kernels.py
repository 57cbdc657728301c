"""Forces and energies of the bond-based law (prototype microelastic brittle) over a scalar-weighted pair list.

The two ends of a bond of stretch s = (|y| - |xi|) / |xi| pull each other with  weight c s y/|y|  [N]; the bond stores
weight c s^2 |xi| / 2  [J], where weight = w(|xi|) V_a V_b and c is the micromodulus, the mean of the two ends'.
Source: Silling and Askari, 2005, eqs (8) to (10).
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.methods.peridynamics.bonds import field_jump, reference_bond
from parsolid.numerics.dispatch import generic
from parsolid.pairs.lists import images_of, mutual


@register_jitable
def _length(vector):
    return math.sqrt(vector[0] * vector[0] + vector[1] * vector[1] + vector[2] * vector[2])


@generic
def pull(linear, x, u):
    """Force of a bond xi = x that changes by u, over weight c: s y/|y|, or with `linear` to first order in u."""


@pull.of(None)
def _pull_stretched(linear, x, u):
    y, reference = (x[0] + u[0], x[1] + u[1], x[2] + u[2]), _length(x)
    length = _length(y)
    factor = (length - reference) / (reference * length)
    return factor * y[0], factor * y[1], factor * y[2]


@pull.otherwise
def _pull_to_first_order(linear, x, u):
    reference = _length(x)
    factor = (x[0] * u[0] + x[1] * u[1] + x[2] * u[2]) / (reference * reference * reference)
    return factor * x[0], factor * x[1], factor * x[2]


@compiled(fastmath={"contract"}, error_model="numpy")
def add_bond_forces(space, pairs, linear, column, micromodulus, kinematics, force):
    """Add the force [N] of a list's bonds under the field in columns `column`... of kinematics to the particles that
    receive.

    micromodulus (n,); force (n, 4 or more) [N]; linear: see `pull`.
    """
    images = images_of(pairs)
    for a in range(len(pairs.start) - 1):
        f0, f1, f2 = 0.0, 0.0, 0.0
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            x = reference_bond(space, images, k, kinematics, a, b)
            p = pull(linear, x, field_jump(space, images, k, kinematics, column, a, b))
            factor = 0.5 * pairs.weight[k] * (micromodulus[a] + micromodulus[b])
            f0, f1, f2 = f0 + factor * p[0], f1 + factor * p[1], f2 + factor * p[2]
            if mutual(pairs):
                force[b, 0] -= factor * p[0]
                force[b, 1] -= factor * p[1]
                force[b, 2] -= factor * p[2]
        force[a, 0] += f0
        force[a, 1] += f1
        force[a, 2] += f2


@compiled(fastmath={"contract"}, error_model="numpy")
def bond_energy(space, pairs, column, micromodulus, share, kinematics):
    """Energy [J] of a list's bonds, half for each end that receives it, times that particle's share (owned,)."""
    total, images = 0.0, images_of(pairs)
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            x = reference_bond(space, images, k, kinematics, a, b)
            u = field_jump(space, images, k, kinematics, column, a, b)
            reference, parts = _length(x), share[a]
            if mutual(pairs):
                parts += share[b]
            stretch = (_length((x[0] + u[0], x[1] + u[1], x[2] + u[2])) - reference) / reference
            total += (
                0.125 * parts * pairs.weight[k] * (micromodulus[a] + micromodulus[b]) * stretch * stretch * reference
            )
    return total
