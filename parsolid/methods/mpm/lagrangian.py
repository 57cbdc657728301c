"""The total-Lagrangian material point method between grid and stress update, and the mean dilatation of cells.

Weights are those of the reference positions (`where` in scatter and gather), so that a gather gives the material
velocity gradient dv/dX. Stress updates work with the spatial one and the Cauchy stress:

    l = (dv/dX) F^-1        V0 P = V sigma F^-T

Against locking, the dilatation rate theta of the particles of a cell is replaced by their mean, and the pressure in the
internal force by the mean that belongs to it, with the constant weights V0, so that the power of the stresses stays
what it is:

    theta_p <- sum_q V0_q theta_q / sum_q V0_q        (V p)_p <- V0_p sum_q (V p)_q / sum_q V0_q
"""

import math

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.methods.mpm.layout import load_rate
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, broadcast, load
from parsolid.numerics.layout import Plane, Space, four_rows, load_nine, store_rows
from parsolid.numerics.tensors import (
    GeneralSpace,
    SymmetricSpace,
    cofactor,
    determinant,
    gram,
    lane_of_symmetric,
    largest_eigenvalue,
)


@compiled(fastmath={"contract"}, error_model="numpy")
def to_spatial_gradient(first, last, space, deformation, rate):
    """Velocity gradients by current place from those by reference place, rate (capacity, 12), with F before the step.

    deformation: F11 F12 F21 F22 F33 (5, capacity) in two dimensions, the 9 rows of F in three. Up to three rows beyond
    `last` are overwritten.
    """
    for i in range(first, last, WIDTH):
        by_reference = load_rate(Space(), rate, i)
        _store_rows(rate, i, by_reference @ _transposed_inverse(space, deformation, i).T)


@compiled(fastmath={"contract"}, error_model="numpy")
def to_first_piola_kirchhoff(first, last, space, deformation, stress, nominal):
    """V0 P (capacity, 12) from V sigma (capacity, 8), with F after the step; arguments as in `to_spatial_gradient`."""
    for i in range(first, last, WIDTH):
        normal, shear = four_rows(stress, i, 0), four_rows(stress, i, 4)
        sigma = SymmetricSpace(normal[0], normal[1], normal[2], shear[2], shear[1], shear[0])
        _store_rows(nominal, i, sigma @ _transposed_inverse(space, deformation, i))


@register_jitable
def _store_rows(array, i, tensor):
    """A general tensor of particles i..i+3 as rows padded to 4."""
    zero = broadcast(0.0)
    store_rows(array, i, 0, tensor[0], tensor[1], tensor[2], zero)
    store_rows(array, i, 4, tensor[3], tensor[4], tensor[5], zero)
    store_rows(array, i, 8, tensor[6], tensor[7], tensor[8], zero)


@generic
def _transposed_inverse(space, deformation, i):
    """F^-T of particles i..i+3, all nine components."""


@_transposed_inverse.of(Space)
def _inverse_in_space(space, deformation, i):
    F = load_nine(deformation, 0, i)
    return (1.0 / determinant(F)) * cofactor(F)


@_transposed_inverse.otherwise
def _inverse_in_plane(space, deformation, i):
    zero = broadcast(0.0)
    a, b, c, d = load(deformation, 0, i), load(deformation, 1, i), load(deformation, 2, i), load(deformation, 3, i)
    inverse, last = 1.0 / (a * d - b * c), 1.0 / load(deformation, 4, i)
    return GeneralSpace(d * inverse, -c * inverse, zero, -b * inverse, a * inverse, zero, zero, zero, last)


@compiled(error_model="numpy")
def smallest_stretches(first, last, space, deformation, stress):
    """Smallest principal stretch of particles first..last-1, and smallest stretch over speed [s/m], the last column of
    stress.

    For particles of a sound state, with finite F and J > 0.
    """
    least, slowest = 1.0, np.inf
    for i in range(first, last, WIDTH):
        # the eigenvalues of F^-T F^-1 are the inverse squares of the stretches
        squares = gram(_transposed_inverse(space, deformation, i).T)
        for k in range(min(WIDTH, last - i)):
            stretch = 1.0 / math.sqrt(largest_eigenvalue(lane_of_symmetric(squares, k)))
            least, slowest = min(least, stretch), min(slowest, stretch / stress[i + k, 7])
    return least, slowest


@generic
def _directions(space):
    """The directions over which a dilatation is spread: in plane strain l33 stays 0."""


@_directions.of(Plane)
def _two_directions(space):
    return 2


@_directions.otherwise
def _three_directions(space):
    return 3


@register_jitable(error_model="numpy")
def _total_dilatation(members, motion, rate):
    """sum_q V0_q theta_q and sum_q V0_q."""
    volume, total = 0.0, 0.0
    for p in members:
        volume += motion[p, 7]
        total += motion[p, 7] * (rate[p, 0] + rate[p, 5] + rate[p, 10])
    return total, volume


@register_jitable(error_model="numpy")
def _total_pressure(members, motion, stress, directions):
    """-sum_q (V p)_q and sum_q V0_q."""
    volume, total = 0.0, 0.0
    for p in members:
        volume += motion[p, 7]
        for d in range(directions):
            total += stress[p, d] / directions
    return total, volume


@compiled(error_model="numpy")
def average_dilatation(first, last, space, grid, motion, rate):
    """Give the particles of each of the cells first..last-1 their mean dilatation rate; grid, motion: see `grid`."""
    directions = _directions(space)
    for c in range(first, last):
        members = grid.order[grid.start[c] : grid.start[c + 1]]
        total, volume = _total_dilatation(members, motion, rate)
        for p in members:
            change = (total / volume - rate[p, 0] - rate[p, 5] - rate[p, 10]) / directions
            for d in range(directions):
                rate[p, 5 * d] += change


@compiled(error_model="numpy")
def average_pressure(first, last, space, grid, motion, stress):
    """Give the particles of cells first..last-1 the mean pressure adjoint to `average_dilatation`; stress: rows of
    CauchyStress.
    """
    directions = _directions(space)
    for c in range(first, last):
        members = grid.order[grid.start[c] : grid.start[c + 1]]
        total, volume = _total_pressure(members, motion, stress, directions)
        for p in members:
            change = motion[p, 7] * total / volume
            for d in range(directions):
                change -= stress[p, d] / directions
            for d in range(directions):
                stress[p, d] += change
