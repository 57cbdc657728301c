"""Weights, gradients and slopes of every basis against their definition, from which sums and continuity follow."""

import numpy as np
import pytest
from grid_reference import BASES, slope, weight

from parsolid.methods.mpm.points import find_base_nodes
from parsolid.methods.mpm.shape_functions import (
    make_basis,
    nodes_across,
    put_moments,
    shape_functions,
)


def base_cell(name):
    """xi at the start of the base cell."""
    return make_basis(name, np.zeros((1, 4))).offset


def evaluate(name, xi, half):
    """(w, dw, i - xi, u), each (K, 3), at three places xi with half widths of the domain; by plain Python."""
    halves = np.full((1, 4), 0.5)
    halves[0, :3] = half
    basis, columns = make_basis(name, halves), []
    for axis in range(3):
        table = np.zeros((nodes_across(basis), 4))
        table[:, 0], table[:, 1] = shape_functions(basis, 0, axis, xi[axis])
        table[:, 2] = np.arange(len(table)) - xi[axis]
        put_moments(basis, table)
        columns.append(table)
    return np.stack(columns, axis=2).transpose(1, 0, 2)


def samples(name):
    """Places in the base cell and half widths: random ones, the ends of the cell, domains whose ends lie on nodes,
    stretched ones.
    """
    random = np.random.default_rng(1)
    start, widest = base_cell(name), 0.5
    for _ in range(20):
        yield start + random.uniform(0.0, 1.0, 3), random.uniform(0.05, widest, 3)
    yield start + np.array([0.0, 0.5, np.nextafter(1.0, 0.0)]), np.array([0.25, 0.5, 0.25])
    yield start + np.array([0.25, 0.75, 0.5]), np.array([0.25, 0.25, 0.5])
    yield start + np.array([0.0, 0.5, 0.9]), np.array([1e-3, widest, widest])


@pytest.mark.parametrize("name", BASES)
def test_weights_are_those_of_their_definition(name):
    for xi, half in samples(name):
        w, derivative, distance, u = evaluate(name, xi, half)
        s = xi - np.arange(len(w))[:, None]
        np.testing.assert_allclose(w, weight(name, s, half), atol=2e-13)
        np.testing.assert_array_equal(distance, -s)
        # on a node the hat function has two derivatives
        smooth = np.ones(3, bool) if name != "linear" else np.abs(s).min(axis=0) > 0.0
        np.testing.assert_allclose(derivative[:, smooth], slope(name, s, half)[:, smooth], atol=1e-12)
        # slopes of a constant and of a linear field
        np.testing.assert_allclose(u.sum(axis=0), 0.0, atol=2e-12)
        np.testing.assert_allclose((u * distance).sum(axis=0), 1.0, atol=1e-13)


@pytest.mark.parametrize("name", BASES)
def test_base_nodes(name):
    basis = make_basis(name, np.zeros((4, 4)))
    origin, spacing = np.array([-0.5, 2.0, 0.0, 0.0]), 0.25
    where = np.random.default_rng(2).uniform(-3.0, 3.0, (50, 8))
    base = np.zeros((50, 3), np.int32)
    find_base_nodes(50, where, origin, spacing, basis.offset, base)
    xi = (where[:, :3] - origin[:3]) / spacing - base
    assert (xi >= base_cell(name)).all() and (xi < base_cell(name) + 1.0).all()
