"""Kernels between particles and the nodes of a grid, see `node_grid.Functions`."""

import numpy as np

from decomposition.compiled import compiled


@compiled(error_model="numpy")
def _fill_shape(at, p, values):
    """Fill the functions (2^d,) of a cell's nodes at a particle."""
    values[0], count = 1.0, 1
    for axis in range(len(at.strides) - 1, -1, -1):
        for k in range(count):
            upper = at.within[p, axis] * values[k]
            values[count + k] = upper
            values[k] -= upper
        count *= 2


@compiled(error_model="numpy")
def _give(at, lower, mine, result):
    """Add what was summed in a cell (2^d d,) to its nodes, and forget it."""
    d = len(at.strides)
    for k in range(1 << d):
        for i in range(d):
            result[lower + at.corners[k], i] += mine[k * d + i]
            mine[k * d + i] = 0.0


@compiled(fastmath={"contract"}, error_model="numpy")
def to_nodes(at, values, result):
    """Add values (n, d) of particles times the functions there to result (nodes, d)."""
    d = len(at.strides)
    # neighbours in memory are so in space
    shape, mine, last = np.empty(1 << d), np.zeros(d << d), -1
    for p in range(len(at.lower)):
        if at.lower[p] != last:
            if last >= 0:
                _give(at, last, mine, result)
            last = at.lower[p]
        _fill_shape(at, p, shape)
        for k in range(1 << d):
            for i in range(d):
                mine[k * d + i] += shape[k] * values[p, i]
    if last >= 0:
        _give(at, last, mine, result)


@compiled(fastmath={"contract"}, error_model="numpy")
def from_nodes(at, nodes, free, result):
    """Add what functions with values (nodes, d) at nodes are at particles to result (n, d), where free (n, d)."""
    d = len(at.strides)
    shape, mine, last = np.empty(1 << d), np.empty(d << d), -1
    for p in range(len(at.lower)):
        if at.lower[p] != last:
            last = at.lower[p]
            for k in range(1 << d):
                for i in range(d):
                    mine[k * d + i] = nodes[last + at.corners[k], i]
        _fill_shape(at, p, shape)
        for i in range(d):
            total = 0.0
            for k in range(1 << d):
                total += shape[k] * mine[k * d + i]
            if free[p, i]:
                result[p, i] += total


@compiled
def add_moments(at, weights, result):
    """Add weights (n, kinds) of particles times products of powers 0 to 2 of their places within cells to result
    (nodes, kinds, 3^d), at the lower node of each cell; the first axis is the fastest.
    """
    powers = np.empty(result.shape[2])
    for p in range(len(at.lower)):
        powers[0], count = 1.0, 1
        for axis in range(at.within.shape[1]):
            for k in range(2 * count):
                powers[count + k] = at.within[p, axis] * powers[k]
            count *= 3
        for kind in range(weights.shape[1]):
            if weights[p, kind] != 0.0:
                for k in range(count):
                    result[at.lower[p], kind, k] += weights[p, kind] * powers[k]
