"""Histories of particles that are tensors, and what a law with such a history implements.

The rows of a state (rows, capacity) are symmetric tensors of particles (11, 22, 33, 12, 13, 23; in the plane 11, 22,
33, 12): number 0 is what the law remembers of the deformation (the strain; C^{-1} of a Maxwell solid), then come the
branches' e_j, or A_j.
"""

import math

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import load, store_first
from parsolid.numerics.layout import Plane, load_six
from parsolid.numerics.tensors import SymmetricPlane, Tensor, contract, formula, trace

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
def wave_modulus(space, law, undeformed, weights, state, i, G: Tensor):
    """Bound of rho c_max^2 [Pa] of particles i..i+3 after a step, in which `undeformed` [Pa] is the same at rest; 0.0
    of small strain, whose waves do not change.
    """


@generic(on="law")
def squared_volume_ratio(space, law, state, i, J):
    """(J_old/J)^2 of particles i..i+3 with the state before the step; 1.0 of small strain."""


@formula
def _mean(s):
    """The mean eigenvalue; of a plane tensor that of those in the plane."""
    return 0.5 * (s[0] + s[1]) if len(s) == 4 else trace(s) * (1.0 / 3.0)


@formula
def _square(s):
    """The square of the most by which an eigenvalue can exceed the mean, kept above rounding below 0."""
    if len(s) == 4:
        half = 0.5 * (s[0] - s[1])
        return half * half + s[3] * s[3]
    whole, sum_of_values = contract(s, s), trace(s)
    return (2.0 / 3.0) * (whole - sum_of_values * sum_of_values * (1.0 / 3.0)) + 1e-14 * whole


@register_jitable
def largest_principal_value(s):
    """Bound of the largest eigenvalue of a symmetric tensor, sharp in the plane, whose 33 does not count."""
    return _mean(s) + math.sqrt(_square(s))


@generic(on="law")
def settle_state(space, law, weights, state, i, count, G: Tensor):
    """Take the state of the first `count` of particles i..i+3 through a step; stored energy and loss [J/m^3]."""


@generic(on="law")
def scalar_energy(space, law, state, i, k, G: Tensor):
    """Stored energy [J/m^3] of particle i + k that needs a logarithm, which lanes lack; 0.0 of Prony solids."""
