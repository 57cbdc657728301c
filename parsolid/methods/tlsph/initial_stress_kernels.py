"""Particle kernel of a stress at time 0 that no deformation has made."""

from decomposition.compiled import compiled
from parsolid.methods.tlsph.strain import load_strain
from parsolid.numerics.lanes import WIDTH
from parsolid.numerics.layout import load_correction, store_matrix
from parsolid.numerics.tensors import matmul


@compiled(error_model="numpy")
def corrected_stress(space, owned, body, initial, result):
    """F S0 L of the present F, the part of the records that the pairs read [Pa]."""
    for i in range(0, owned, WIDTH):
        F, _, _ = load_strain(space, body, i)
        # rows of a general tensor, as those of a correction are
        S = matmul(F, load_correction(space, initial, i))
        store_matrix(space, result, i, 0, matmul(S, load_correction(space, body.correction, i)))
