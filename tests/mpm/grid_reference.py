"""The grid's transfers once more, in plain numpy, node by node from the formulas: what the kernels are
tested against.
"""

from typing import NamedTuple

import numpy as np
from scipy import interpolate

from parsolid.methods.mpm.points import find_base_nodes
from parsolid.methods.mpm.shape_functions import make_basis, nodes_across
from parsolid.methods.mpm.transfer import Cells

SPACING = 0.3
ORIGIN = np.array([-0.7, 0.2, 1.1, 0.0])
BASES = ("linear", "ugimp", "quadratic-spline", "cubic-spline")


def hat(s):
    return np.maximum(0.0, 1.0 - np.abs(s))


def averaged_hat(s, half):
    """Mean of the hat function over s - half .. s + half, from its second antiderivative."""
    primitive = interpolate.PPoly(np.array([[0.5, -0.5], [0.0, 1.0], [0.0, 0.5]]), [-1.0, 0.0, 1.0])
    return (primitive(np.clip(s + half, -1, 1)) - primitive(np.clip(s - half, -1, 1))) / (2.0 * half)


def spline(degree):
    return interpolate.BSpline.basis_element(np.arange(degree + 2) - 0.5 * (degree + 1), extrapolate=False)


def weight(name, s, half):
    """A node's weight at distance s = (x - x_i)/h."""
    if name == "linear":
        return hat(s)
    if name == "ugimp":
        return averaged_hat(s, half)
    return np.nan_to_num(spline(2 if name == "quadratic-spline" else 3)(s))


def slope(name, s, half):
    """dw/ds."""
    if name == "linear":
        return np.where(np.abs(s) < 1.0, -np.sign(s), 0.0)
    if name == "ugimp":
        return (hat(s + half) - hat(s - half)) / (2.0 * half)
    return np.nan_to_num(spline(2 if name == "quadratic-spline" else 3).derivative()(s))


class ParticleSet(NamedTuple):
    """Random particles listed by base cell, with everything that the kernels take."""

    dimension: int
    basis: object
    halves: np.ndarray
    motion: np.ndarray
    cells: Cells
    nodes: np.ndarray
    places: np.ndarray


def topology(basis, motion, count, dimension, spacing=SPACING, origin=ORIGIN):
    """The cells, with the particles' order by base cell, and the nodes' positions (nodes, 4)."""
    base = np.zeros((count, dimension), np.int64)
    find_base_nodes(count, motion, origin, spacing, basis.offset, base)
    order = np.lexsort(base.T[::-1])
    cells, counts = np.unique(base, axis=0, return_counts=True)
    across = nodes_across(basis)
    steps = np.stack(np.meshgrid(*[np.arange(across)] * dimension, indexing="ij"), -1).reshape(-1, dimension)
    numbers, slots = np.unique((cells[:, None] + steps).reshape(-1, dimension), axis=0, return_inverse=True)
    places = np.zeros((len(numbers), 4))
    places[:, :dimension] = origin[:dimension] + spacing * numbers
    rows = np.zeros((len(cells), 4))
    rows[:, :dimension] = cells
    start = np.concatenate([[0], np.cumsum(counts)]).astype(np.int64)
    stencil = slots.reshape(len(cells), -1).astype(np.int32)
    return Cells(tuple(range(dimension)), False, origin, spacing, rows, start, order, stencil), places


def make_cloud(name, dimension, count=60, seed=3, lower=0.5):
    """Particles in a box of about 3 cells a side, some exactly on nodes, cell faces and cell middles."""
    random = np.random.default_rng(seed)
    motion = np.zeros((count + 4, 8))
    motion[:count, :dimension] = lower + random.uniform(0.0, 0.9, (count, dimension))
    special = ORIGIN[:dimension] + SPACING * (6.0 + np.array([0.0, 0.25, 0.5, 1.0])[:, None])
    # at a node the gradient of a hat function may be either one
    motion[:4, :dimension] = special + (1e-7 if name == "linear" else 0.0)
    motion[:count, 3] = random.uniform(0.5, 2.0, count)
    motion[:count, 4 : 4 + dimension] = random.normal(size=(count, dimension))
    motion[:count, 7] = random.uniform(0.1, 0.2, count)
    halves = np.zeros((count + 4, 4)) + 0.5
    halves[:count, :dimension] = random.uniform(0.02, 0.5, (count, dimension))
    basis = make_basis(name, halves)
    cells, places = topology(basis, motion, count, dimension)
    nodes = np.zeros((len(places), 8))
    return ParticleSet(dimension, basis, halves, motion, cells, nodes, places)


def weights_of(particle_set, name):
    """All weights (particles, nodes) and their gradients (particles, nodes, 3), and positions of nodes less
    particles.
    """
    count = particle_set.cells.start[-1]
    x = particle_set.motion[:count, :3]
    apart = particle_set.places[None, :, :3] - x[:, None]
    s = -apart / particle_set.cells.spacing
    half = particle_set.halves[:count, None, :3]
    w, g = weight(name, s, half), slope(name, s, half) / particle_set.cells.spacing
    if particle_set.dimension == 2:
        w[..., 2], g[..., 2] = 1.0, 0.0
    gradient = np.stack(
        [g[..., 0] * w[..., 1] * w[..., 2], w[..., 0] * g[..., 1] * w[..., 2], w[..., 0] * w[..., 1] * g[..., 2]], -1
    )
    return w.prod(-1), gradient, apart
