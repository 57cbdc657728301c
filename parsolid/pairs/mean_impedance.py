"""Riemann dissipation with one impedance of each wave a particle, the root of the mean of rho^2 c^2 over directions.

A pair takes the mean of both particles', so that it needs no wave tensors and no roots:
    D_a = sum_b k_ab [Z_s u + (Z_p - Z_s)(u . n) n],   k_ab = S/2 |C_skew|,
with u and n as in `pairs.passes`. Errors are those of the impedance along C_skew to three digits
(docs/integrators.md).
"""

import math

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import broadcast, fused
from parsolid.numerics.layout import Plane, store_matrix, store_rows
from parsolid.numerics.wide_space import WideSpace, everywhere, store_columns_wide
from parsolid.pairs.pair_terms import own_motion, own_side, pair_forces, reconstructed, stress_force
from parsolid.pairs.primitives import dot, jump_factor, motion, steps, within
from parsolid.pairs.terms import MeanRiemann, record_columns


@compiled
def whole_jump_factors(pairs, dimension):
    """Multiply the k_ab of `weights.jump_factors`, which are for |g_ab| times an impedance, by |g_ab|."""
    weight = pairs.weight
    for k in range(weight.shape[0]):
        square = 0.0
        for i in range(dimension):
            square += weight[k, i] * weight[k, i]
        weight[k, dimension] *= math.sqrt(square)


# --- records -----------------------------------------------------------------------------------------------------


@generic
def store_with_impedances(space, terms, record, i, stress, pressure, shear):
    """P L and half the impedances of pressure and shear waves of particles i..i+3; in space they stand in its pads."""


@store_with_impedances.of(Plane)
def _store_plane(space, terms, record, i, stress, pressure, shear):
    at, zero = record_columns(space, terms), broadcast(0.0)
    store_matrix(space, record, i, at.stress, stress)
    store_rows(record, i, at.pressure, pressure, shear, zero, zero)


@store_with_impedances.of(WideSpace)
def _store_wide(space, terms, record, i, stress, pressure, shear):
    column, zero = record_columns(space, terms).stress, everywhere(space, 0.0)
    store_columns_wide(record, i, column, stress[0], stress[3], stress[6], pressure)
    store_columns_wide(record, i, column + 4, stress[1], stress[4], stress[7], shear)
    store_columns_wide(record, i, column + 8, stress[2], stress[5], stress[8], zero)


@store_with_impedances.otherwise
def _store_space(space, terms, record, i, stress, pressure, shear):
    column, zero = record_columns(space, terms).stress, broadcast(0.0)
    store_rows(record, i, column, stress[0], stress[3], stress[6], pressure)
    store_rows(record, i, column + 4, stress[1], stress[4], stress[7], shear)
    store_rows(record, i, column + 8, stress[2], stress[5], stress[8], zero)


# --- pairs -------------------------------------------------------------------------------------------------------


@own_side.of(MeanRiemann)
def _own_impedances(space, terms, kinematics, record, a):
    at = record_columns(space, terms)
    return (*own_motion(space, terms, kinematics, record, a), record[a, at.pressure], record[a, at.shear])


@pair_forces.of(MeanRiemann)
def _stress_and_mean_impedances(space, terms, own, images, k, weight, kinematics, record, b, g):
    t = stress_force(space, own[0], weight, images, k, record, b, g)
    return t, _jump_force(space, terms, own, images, k, kinematics, record, b, g)


@register_jitable
def _jump_force(space, terms, own, images, k, kinematics, record, b, g):
    """D_ab."""
    at = record_columns(space, terms)
    jump, x, X = steps(space, motion(space, images, k, kinematics, b), own[2])
    jump = reconstructed(terms.reconstruction, space, jump, own[3], images, k, record, b, at.gradient, X)
    pressure, shear = own[4] + record[b, at.pressure], own[5] + record[b, at.shear]
    x = within(space, x)
    normal = (pressure - shear) * dot(space, jump, x) / dot(space, x, x)
    return jump_factor(space, g) * fused(broadcast(shear), jump, broadcast(normal) * x)
