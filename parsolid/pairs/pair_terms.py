"""What a pair adds to the forces of its particles, by the type of the terms (see `pairs.terms`).

`own` is what a pair needs of the first particle; a contribution is a tuple (T,), or (T, D) with D the force that
dissipates.
"""

import math

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.lanes import broadcast, fused, horizontal_sums, lane, last_two_roots, load
from parsolid.pairs.primitives import (
    dot,
    gradient_of,
    jump_factor,
    less_sum_times,
    matrix,
    motion,
    reference,
    steps,
    stiffness_of,
    stress_of,
    sum_times,
    vector,
    within,
)
from parsolid.pairs.symmetric_tensors import along, dyad, free_lane, square, symmetric_of
from parsolid.pairs.terms import KINEMATICS, AlongBonds, RiemannDissipation, ShearScaled, record_columns

_FIELD = KINEMATICS[3].field


@generic(on="terms")
def own_side(space, terms, kinematics, record, a):
    """What a pair reads of its first particle; the stress comes first, then X."""


@own_side.of(None)
def _own_stress(space, terms, kinematics, record, a):
    return matrix(space, record, a, 0), reference(space, None, a, kinematics, a)


@register_jitable
def own_motion(space, terms, kinematics, record, a):
    """Stress, X, motion and gradient of the first particle."""
    at, X = record_columns(space, terms), reference(space, None, a, kinematics, a)
    own = motion(space, None, a, kinematics, a)
    return matrix(space, record, a, at.stress), X, own, matrix(space, record, a, at.gradient)


@own_side.of(RiemannDissipation)
def _own_waves(space, terms, kinematics, record, a):
    at = record_columns(space, terms)
    return (
        *own_motion(space, terms, kinematics, record, a),
        symmetric_of(space, None, a, record, a, at.pressure_wave),
        _shear_wave(terms.shear, space, None, a, record, a, at.shear_wave),
    )


@own_side.of(ShearScaled)
def _own_stiffness(space, terms, kinematics, record, a):
    at, X = record_columns(space, terms), reference(space, None, a, kinematics, a)
    return matrix(space, record, a, at.stress), X, load(kinematics, a, _FIELD), matrix(space, record, a, at.stiffness)


@own_side.of(AlongBonds)
def _own_modulus(space, terms, kinematics, record, a):
    at, X = record_columns(space, terms), reference(space, None, a, kinematics, a)
    P, G = matrix(space, record, a, at.stress), matrix(space, record, a, at.gradient)
    return P, X, load(kinematics, a, _FIELD), G, load(record, a, at.modulus)


@generic(on="terms")
def pair_forces(space, terms, own, images, k, weight, kinematics, record, b, g):
    """What the pair k adds to the first particle; the second one has its negative."""


@pair_forces.of(None)
def _stress_alone(space, terms, own, images, k, weight, kinematics, record, b, g):
    return (stress_force(space, own[0], weight, images, k, record, b, g),)


@pair_forces.of(RiemannDissipation)
def _stress_and_riemann(space, terms, own, images, k, weight, kinematics, record, b, g):
    t = stress_force(space, own[0], weight, images, k, record, b, g)
    return t, _riemann_force(space, terms, own, images, k, kinematics, record, b, g)


@pair_forces.of(ShearScaled)
def _stress_and_shear(space, terms, own, images, k, weight, kinematics, record, b, g):
    t = stress_force(space, own[0], weight, images, k, record, b, g)
    jump = broadcast(weight[k]) * (vector(images, k, kinematics, b, _FIELD) - own[2])
    there = stiffness_of(space, images, k, record, b, record_columns(space, terms).stiffness)
    return (t + sum_times(space, own[3], there, jump),)


@pair_forces.of(AlongBonds)
def _stress_and_bond(space, terms, own, images, k, weight, kinematics, record, b, g):
    t = stress_force(space, own[0], weight, images, k, record, b, g)
    return (t + _force_along_bond(space, terms, own, images, k, kinematics, record, b, g),)


@generic(on="weight")
def stress_force(space, own, weight, images, k, record, b, g):
    """(P_a L_a + P_b L_b) g_ab; of radial lists with the image that makes the two passes adjoint at any plane."""


@stress_force.of(2)
def _stress_force_of_vectors(space, own, weight, images, k, record, b, g):
    return sum_times(space, own, stress_of(space, images, k, record, b, 0), g)


@stress_force.of(1)
def _stress_force_of_bonds(space, own, weight, images, k, record, b, g):
    return sum_times(space, own, gradient_of(space, images, k, record, b, 0), g)


@register_jitable
def _force_along_bond(space, terms, own, images, k, kinematics, record, b, g):
    """xi/(2 |xi|^3) xi . [(c_a + c_b)(f_b - f_a) - (c_a G_a + c_b G_b) xi] times the weight."""
    at = record_columns(space, terms)
    xi = reference(space, images, k, kinematics, b) - own[1]
    jump = (own[4] + load(record, b, at.modulus)) * (vector(images, k, kinematics, b, _FIELD) - own[2])
    jump = jump - sum_times(space, own[3], gradient_of(space, images, k, record, b, at.gradient), xi)
    length = dot(space, xi, xi)
    return broadcast(0.5 * dot(space, jump, xi) / (length * math.sqrt(length))) * g


# --- Riemann dissipation -----------------------------------------------------------------------------------------


@none_without("shear")
def _shear_wave(shear, space, images, k, record, b, column):
    return symmetric_of(space, images, k, record, b, column)


@none_without("reconstruction", returns="jump")
def reconstructed(reconstruction, space, jump, own, images, k, record, b, column, X):
    """The jump less what the mean of both gradients explains."""
    return less_sum_times(space, jump, own, gradient_of(space, images, k, record, b, column), X)


@register_jitable
def _shear_lanes(shear, space, own, there, squares):
    """Lanes that add up to g . Q_s g, or to g . g where shear is isotropic."""
    if shear is None:
        return square(space, squares)
    return along(space, own, there, squares)


@register_jitable
def _shear_impedance(shear, root, isotropic):
    if shear is None:
        return root * isotropic
    return root


@register_jitable
def _riemann_force(space, terms, own, images, k, kinematics, record, b, g):
    """D_ab of eqs (74), (75)."""
    _, _, here, gradient, pressure, shear = own
    at = record_columns(space, terms)
    jump, x, X = steps(space, motion(space, images, k, kinematics, b), here)
    jump = reconstructed(terms.reconstruction, space, jump, gradient, images, k, record, b, at.gradient, X)
    squares = dyad(space, g)
    there = symmetric_of(space, images, k, record, b, at.pressure_wave)
    fast = along(space, pressure, there, squares)
    other = _shear_wave(terms.shear, space, images, k, record, b, at.shear_wave)
    slow = _shear_lanes(terms.shear, space, shear, other, squares)
    sums = horizontal_sums(within(space, jump * x), within(space, x * x), fast, slow)
    c_p, root = last_two_roots(sums)
    c_s = _shear_impedance(terms.shear, root, free_lane(pressure) + free_lane(there))
    normal = (c_p - c_s) * lane(sums, 0) / lane(sums, 1)
    return jump_factor(space, g) * fused(broadcast(c_s), jump, broadcast(normal) * x)
