"""Forces and energies of the bond-based law (prototype microelastic brittle) over a scalar-weighted pair list.

The two ends of a bond of stretch s = (|y| - |xi|) / |xi| pull each other with  weight c s y/|y|  [N]; the bond stores
weight c s^2 |xi| / 2  [J], where weight = w(|xi|) V_a V_b and c is the micromodulus, the mean of the two ends'.
Source: Silling and Askari, 2005, eqs (8) to (10).
"""

import math

from numba import njit
from numba.extending import register_jitable

from parsolid.kernels.bonds import displacement_column, field_jump, reference_bond


@register_jitable
def _stretched(space, images, k, kinematics, a, b):
    """y, |y|, |xi| of a bond."""
    x = reference_bond(space, images, k, kinematics, a, b)
    u = field_jump(space, images, k, kinematics, displacement_column(space), a, b)
    y = (x[0] + u[0], x[1] + u[1], x[2] + u[2])
    length = math.sqrt(y[0] * y[0] + y[1] * y[1] + y[2] * y[2])
    return y, length, math.sqrt(x[0] * x[0] + x[1] * x[1] + x[2] * x[2])


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def add_bond_forces(space, first, last, pairs, images, both, micromodulus, kinematics, force):
    """Add the force [N] of the bonds of particles first..last-1 to a, and with `both` to b; micromodulus (n,), force (n, 8)."""
    for a in range(first, last):
        f0, f1, f2 = 0.0, 0.0, 0.0
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            y, length, reference = _stretched(space, images, k, kinematics, a, b)
            c = 0.5 * (micromodulus[a] + micromodulus[b])
            pull = pairs.weight[k] * c * (length - reference) / (reference * length)
            f0, f1, f2 = f0 + pull * y[0], f1 + pull * y[1], f2 + pull * y[2]
            if both is not None:
                force[b, 0] -= pull * y[0]
                force[b, 1] -= pull * y[1]
                force[b, 2] -= pull * y[2]
        force[a, 0] += f0
        force[a, 1] += f1
        force[a, 2] += f2


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def bond_energy(space, pairs, images, both, micromodulus, kinematics):
    """Energy [J] of a rank's share of a list's bonds: the whole of those of two owned particles, half of the others."""
    total = 0.0
    for a in range(len(pairs.start) - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            total += _energy(space, pairs, images, k, micromodulus, kinematics, a)
    return total if both is not None else 0.5 * total


@njit(cache=True, fastmath={"contract"}, error_model="numpy")
def listed_bond_energy(space, found, pairs, images, both, micromodulus, kinematics):
    """As `bond_energy`, of the bonds listed in rows (particle, pair) of found."""
    total = 0.0
    for row in range(len(found)):
        total += _energy(space, pairs, images, found[row, 1], micromodulus, kinematics, found[row, 0])
    return total if both is not None else 0.5 * total


@register_jitable
def _energy(space, pairs, images, k, micromodulus, kinematics, a):
    b = pairs.neighbour[k]
    _, length, reference = _stretched(space, images, k, kinematics, a, b)
    c = 0.5 * (micromodulus[a] + micromodulus[b])
    return 0.5 * pairs.weight[k] * c * (length - reference) ** 2 / reference
