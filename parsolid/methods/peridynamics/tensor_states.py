"""Histories of particles that are tensors, and what a law with such a history implements.

The rows of a state (rows, capacity) are symmetric tensors of particles (11, 22, 33, 12, 13, 23; in the plane 11, 22,
33, 12): number 0 is what the law remembers of the deformation (the strain; C^{-1} of a Maxwell solid), then come the
branches' e_j, or A_j.
"""

from numba.extending import register_jitable

from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import load, store_first
from parsolid.numerics.layout import Plane, load_six
from parsolid.numerics.tensors import SymmetricPlane, Tensor

TENSOR_ROWS = {2: 4, 3: 6}


@generic
def load_state(space, state, number, i):
    """A symmetric tensor of particles i..i+3."""


@load_state.of(Plane)
def _plane_state(space, state, number, i):
    row = 4 * number
    return SymmetricPlane(
        load(state, row, i), load(state, row + 1, i), load(state, row + 2, i), load(state, row + 3, i)
    )


@load_state.otherwise
def _space_state(space, state, number, i):
    return load_six(state, 6 * number, i)


@register_jitable
def store_state(state, number, i, tensor, count):
    """A symmetric tensor of the first `count` of particles i..i+3."""
    for c in range(len(tensor)):
        store_first(state, number * len(tensor) + c, i, tensor[c] + 0.0, count)


# --- what a law implements; weights: see `tensor_history.step_weights`; G: displacement gradient after a step ------


@generic(on="law")
def nominal_stress(space, law, weights, state, i, G: Tensor):
    """First Piola-Kirchhoff stress [Pa] of particles i..i+3 after a step; the state stays as it is."""


@generic(on="law")
def settle_state(space, law, weights, state, i, count, G: Tensor):
    """Take the state of the first `count` of particles i..i+3 through a step; stored energy and loss [J/m^3]."""


@generic(on="law")
def scalar_energy(space, law, state, i, k, G: Tensor):
    """Stored energy [J/m^3] of particle i + k that needs a logarithm, which lanes lack; 0.0 of Prony solids."""
