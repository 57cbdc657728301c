"""Particle kernel of a stress at time 0 that no deformation has made."""

from decomposition.compiled import compiled
from parsolid.methods.tlsph.strain import load_strain
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, broadcast, load
from parsolid.numerics.layout import Plane, load_correction, store_matrix
from parsolid.numerics.tensors import GeneralPlane, GeneralSpace, matmul


@generic
def _load_tensor(space, rows, i):
    """A tensor of particles i..i+3 from d*d rows."""


@_load_tensor.of(Plane)
def _load_plane_tensor(space, rows, i):
    return GeneralPlane(load(rows, 0, i), load(rows, 1, i), load(rows, 2, i), load(rows, 3, i), broadcast(0.0))


@_load_tensor.otherwise
def _load_space_tensor(space, rows, i):
    x, y, z = load(rows, 0, i), load(rows, 1, i), load(rows, 2, i)
    u, v, w = load(rows, 3, i), load(rows, 4, i), load(rows, 5, i)
    return GeneralSpace(x, y, z, u, v, w, load(rows, 6, i), load(rows, 7, i), load(rows, 8, i))


@compiled(error_model="numpy")
def corrected_stress(space, owned, body, initial, result):
    """F S0 L of the present F, the part of the records that the pairs read [Pa]."""
    for i in range(0, owned, WIDTH):
        F, _, _ = load_strain(space, body, i)
        S = matmul(F, _load_tensor(space, initial, i))
        store_matrix(space, result, i, 0, matmul(S, load_correction(space, body.correction, i)))
