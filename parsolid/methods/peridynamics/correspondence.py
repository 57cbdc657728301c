"""Particle kernels of correspondence peridynamics: what a particle tells its neighbours, from gradients of the fields.

Four particles at a time (`numerics.lanes.Lanes`); a range first..last-1 shares one law. With the
sums of the gradient pass,
    G = [sum_b w V_a V_b (f_b - f_a) (x) xi] K_a^{-1} / V_a,   S = P K_a^{-1},   M = S - C1 G  (see `pairs.passes`).
"""

from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.viscoelastic.prony_lanes import small_strain, stress
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, broadcast, load
from parsolid.numerics.layout import Plane, load_correction, load_gradient, load_six, store_matrix
from parsolid.numerics.tensors import SymmetricPlane, Tensor, lane_of_symmetric
from parsolid.pairs.terms import AlongBonds, ShearScaled, record_columns


class BondedBody(NamedTuple):
    """Arrays of a rank's particles, columns over particles, see `numerics.layout`.

    inverse_shape: K^{-1}, (9 or 4, capacity); stiffness: C1 of `ShearScaled`, as 11, 22, 33, 12, 13, 23 or 11, 22, 12,
    else one row of c for `AlongBonds`, else None; volume: (1, capacity), the volume in the pair sums.
    """

    inverse_shape: np.ndarray
    stiffness: np.ndarray | None
    volume: np.ndarray


@generic
def load_symmetric(space, array, i):
    """A symmetric tensor of particles i..i+3, without a 33 in the plane."""


@load_symmetric.of(Plane)
def _plane_symmetric(space, array, i):
    return SymmetricPlane(load(array, 0, i), load(array, 1, i), broadcast(0.0), load(array, 2, i))


@load_symmetric.otherwise
def _space_symmetric(space, array, i):
    return load_six(array, 0, i)


@generic(on="stabiliser")
def store_record(space, stabiliser, body, record, i, S: Tensor, G: Tensor):
    """What neighbours read of particles i..i+3: M, and c G of `AlongBonds`; C1 and c stand there since the start."""


@store_record.of(ShearScaled)
def _store_shear_scaled(space, stabiliser, body, record, i, S, G):
    C = load_symmetric(space, body.stiffness, i)
    store_matrix(space, record, i, record_columns(space, stabiliser).stress, S - C @ G)


@store_record.of(AlongBonds)
def _store_along_bonds(space, stabiliser, body, record, i, S, G):
    columns = record_columns(space, stabiliser)
    store_matrix(space, record, i, columns.stress, S)
    store_matrix(space, record, i, columns.gradient, load(body.stiffness, 0, i) * G)


@store_record.of(None)
def _store_stress(space, stabiliser, body, record, i, S, G):
    store_matrix(space, record, i, record_columns(space, stabiliser).stress, S)


@register_jitable
def gradient_of(space, body, sums, i):
    """G of particles i..i+3, a general tensor, from the sums of a gradient pass."""
    L = load_correction(space, body.inverse_shape, i)
    return 1.0 / load(body.volume, 0, i) * (load_gradient(space, sums, i) @ L.T)


@compiled(fastmath={"contract"}, error_model="numpy")
def relaxing_records(space, first, last, law, stabiliser, body, gradient, record):
    """Records of a small-strain law whose moduli all relax alike: its stress follows from the gradient of f alone."""
    for i in range(first, last, WIDTH):
        G = gradient_of(space, body, gradient, i)
        S = stress(law, None, small_strain(G)) @ load_correction(space, body.inverse_shape, i)
        store_record(space, stabiliser, body, record, i, S, G)


@compiled(fastmath={"contract"}, error_model="numpy")
def stabiliser_records(space, first, last, stabiliser, body, gradient, record):
    """Records of the stabiliser alone."""
    for i in range(first, last, WIDTH):
        G = gradient_of(space, body, gradient, i)
        store_record(space, stabiliser, body, record, i, 0.0 * G, G)


@compiled(error_model="numpy")
def stresses(space, first, last, law, body, gradient, result):
    """Stress (n, 3, 3) [Pa] of particles first..last-1 from the sums of the last gradient pass."""
    for i in range(first, last, WIDTH):
        G = gradient_of(space, body, gradient, i)
        sigma = stress(law, None, small_strain(G))
        for k in range(min(WIDTH, last - i)):
            s = lane_of_symmetric(sigma, k)
            result[i + k, 0, 0], result[i + k, 1, 1], result[i + k, 2, 2] = s[0], s[1], s[2]
            result[i + k, 0, 1] = result[i + k, 1, 0] = s[3]
            result[i + k, 0, 2] = result[i + k, 2, 0] = s[4]
            result[i + k, 1, 2] = result[i + k, 2, 1] = s[5]
