"""Pairs of particles on lattices, chosen and weighed by their `lattice_stencils`, beside pairs within a kernel's
support."""

from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from parsolid.pairs.lattice_stencils import WIDEST
from parsolid.pairs.weights import image_point, point

# how far a neighbour may stand beside its lattice place, in steps
_ASTRAY = 1e-3


class Lattices(NamedTuple):
    """Of owned particles: number (n,) int64 of the lattice, -1 on none; spacing (n, d) [m]; weight (n, d, 7) and
    undamped (n, d, 2) of their `Stencils`. graded: whether any stand elsewhere than on the even steps by which pairs
    are told."""

    number: np.ndarray
    spacing: np.ndarray
    weight: np.ndarray
    undamped: np.ndarray
    graded: bool = False


@compiled
def lattice_weight(lattices, positions, a, b, reflection, shift):
    """(axis, weight) of owned particle a and particle b, or b's image R X_b + T; weight 0.0 where they are no pair."""
    Xa, Xb = point(positions, a), image_point(positions, b, reflection, shift)
    axis, steps = -1, 0
    for i in range(positions.shape[1]):
        distance = (Xb[i] - Xa[i]) / lattices.spacing[a, i]
        offset = round(distance)
        if abs(distance - offset) > _ASTRAY or abs(offset) > WIDEST or (offset != 0 and axis >= 0):
            return 0, 0.0
        if offset != 0:
            axis, steps = i, offset
    return max(axis, 0), lattices.weight[a, max(axis, 0), WIDEST + steps] if axis >= 0 else 0.0


@compiled
def lattice_place(lattices, positions, a, b):
    """(axis, steps along it) from owned particle a to particle b on its lattice; axis -1 where they are on no line."""
    Xa, Xb = point(positions, a), point(positions, b)
    axis, steps = -1, 0
    for i in range(positions.shape[1]):
        offset = round((Xb[i] - Xa[i]) / lattices.spacing[a, i])
        if offset != 0:
            if axis >= 0:
                return -1, 0
            axis, steps = i, offset
    return axis, steps


@compiled
def keep_lattice_pairs(lattices, number, start, neighbour, code, positions, reflections, shifts):
    """Of pairs within the support those whose particles are on one lattice with a weight, or both on none.

    number (n,): of owned particles and ghosts. Returns (start, neighbour, code).
    """
    kept = np.empty(neighbour.shape[0], np.bool_)
    count = np.zeros(start.shape[0], np.int64)
    for a in range(start.shape[0] - 1):
        count[a + 1] = count[a]
        for k in range(start[a], start[a + 1]):
            b, R, T = neighbour[k], reflections[code[k]], shifts[code[k]]
            kept[k] = number[a] == number[b]
            if kept[k] and number[a] >= 0:
                kept[k] = lattice_weight(lattices, positions, a, b, R, T)[1] != 0.0
            count[a + 1] += kept[k]
    return count, neighbour[kept], code[kept]


@compiled
def fill_lattice_weights(lattices, pairs, places, positions):
    """Put g_ab [m^2] of pairs on lattices into the weights' first columns, over what is there."""
    for a in range(pairs.start.shape[0] - 1):
        if lattices.number[a] < 0:
            continue
        for k in range(pairs.start[a], pairs.start[a + 1]):
            R, T = places.reflections[places.code[k]], places.shifts[places.code[k]]
            axis, weight = lattice_weight(lattices, positions, a, pairs.neighbour[k], R, T)
            for i in range(positions.shape[1]):
                pairs.weight[k, i] = weight if i == axis else 0.0


@compiled
def keep_near_jumps(lattices, pairs, places, positions):
    """Set k_ab of pairs on lattices to 0 but of nearest neighbours that are not `undamped`.

    The jump of a pair over two spacings, reconstructed, is no positive form: with it waves of short length grow.
    """
    d = positions.shape[1]
    for a in range(pairs.start.shape[0] - 1):
        if lattices.number[a] < 0:
            continue
        Xa = point(positions, a)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            R, T = places.reflections[places.code[k]], places.shifts[places.code[k]]
            Xb = image_point(positions, pairs.neighbour[k], R, T)
            for i in range(d):
                steps = (Xb[i] - Xa[i]) / lattices.spacing[a, i]
                none = (steps < -0.5 and lattices.undamped[a, i, 0]) or (steps > 0.5 and lattices.undamped[a, i, 1])
                if abs(steps) > 1.5 or none:
                    pairs.weight[k, d] = 0.0
