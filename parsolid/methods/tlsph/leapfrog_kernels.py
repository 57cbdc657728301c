"""Kernels of one force evaluation a step: strain, branches, stress and waves of a new state, and the step it allows."""

import math
from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.law import first_piola_kirchhoff_stress, pressure_wave_tensor, shear_wave_tensor
from parsolid.materials.viscoelastic.maxwell_lanes import relaxation_loss, relaxed
from parsolid.methods.tlsph.deformation import (
    branch_sum_of,
    current_branches,
    largest_bound,
    propagating,
)
from parsolid.methods.tlsph.moved import gradient_in_reference, waves_in_reference
from parsolid.methods.tlsph.strain import load_strain
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.layout import (
    load_branch,
    load_correction,
    load_gradient,
    store_branch,
    store_deformation_gradient,
    store_matrix,
)
from parsolid.numerics.tensors import (
    add,
    cofactor,
    determinant,
    gram,
    inverse_symmetric,
    matmul,
    matmul_transposed,
    scale,
    trace_symmetric,
)
from parsolid.numerics.wide_space import (
    all_sound,
    at_once,
    clear_rows,
    everywhere,
    greatest_lane,
    load_row,
    only_first,
    sum_of_lanes,
)
from parsolid.pairs.mean_impedance import store_with_impedances
from parsolid.pairs.terms import MeanRiemann, record_columns


class ExactRelaxation(NamedTuple):
    """Of each branch: weights (branches, 3) of A_0, C_0^{-1}, C_1^{-1} over the step, and weights (branches, 3) [s] of
    the dissipation's rates at its start, mixed and at its end."""

    weights: np.ndarray
    rates: np.ndarray


class WaveWeights(NamedTuple):
    """What the speeds of pressure and shear waves count in the speed that bounds the step."""

    pressure: float
    shear: float


class WaveForms(NamedTuple):
    """Such counts, of which those with the greatest sum bound the step."""

    first: WaveWeights
    second: WaveWeights
    third: WaveWeights


@generic(on="weights")
def _signal(weights, fast, slow):
    """The speed [sqrt(Pa)] that bounds the step, by the speeds of pressure and shear waves."""


@_signal.of(WaveWeights)
@register_jitable
def _weighted(weights, fast, slow):
    return weights.pressure * fast + weights.shear * slow


@_signal.of(WaveForms)
def _greatest_form(weights, fast, slow):
    greater = max(_weighted(weights.first, fast, slow), _weighted(weights.second, fast, slow))
    return max(greater, _weighted(weights.third, fast, slow))


@none_without("branches", inlined=True)
def _relax(branches, space, law, relaxation, i, F0, F, count):
    """Relax A over the step; sum mu_alpha A_alpha at its end, and the energy [J/m^3] that this takes."""
    C0, C = gram(F0), gram(F)
    old_inverse, inverse = inverse_symmetric(C0), inverse_symmetric(C)
    total, lost = scale(0.0, C), 0.0 * F[0]
    for alpha in range(len(law.branch_moduli)):
        w, rates = relaxation.weights, relaxation.rates
        modulus, time = law.branch_moduli[alpha], law.relaxation_times[alpha]
        before = load_branch(space, branches, alpha, i)
        A = relaxed((w[alpha, 0], w[alpha, 1], w[alpha, 2]), before, old_inverse, inverse)
        store_branch(space, branches, alpha, i, A, count)
        total = add(total, scale(modulus, A))
        r = (rates[alpha, 0], rates[alpha, 1], rates[alpha, 2])
        lost = lost + relaxation_loss(modulus, time, r, C0, old_inverse, before, C, inverse, A)
    return total, lost


@generic
def _store_record(terms, space, law, body, i, stress, G, pressure, shear):
    """What the pairs need of particles i..i+3: P L, and where they dissipate grad v and impedances."""


@_store_record.of(None)
def _store_stress(terms, space, law, body, i, stress, G, pressure, shear):
    store_matrix(space, body.record, i, record_columns(space, terms).stress, stress)


@_store_record.of(MeanRiemann)
def _store_all(terms, space, law, body, i, stress, G, pressure, shear):
    fast, slow = _half_impedance(space, law, body, i, pressure), _half_impedance(space, law, body, i, shear)
    store_with_impedances(space, terms, body.record, i, stress, fast, slow)
    half = scale(0.5, gradient_in_reference(body.moved, space, i, G))
    store_matrix(space, body.record, i, record_columns(space, terms).gradient, half)


@register_jitable
def _half_impedance(space, law, body, i, waves):
    """Half the root of the mean over directions of rho^2 c^2."""
    mean = trace_symmetric(propagating(waves_in_reference(body.moved, space, i, waves))) * (1.0 / 3.0)
    return 0.5 * math.sqrt(everywhere(space, law.density * mean))


@register_jitable
def _signals(space, weights, pressure, shear):
    """The weighted sum of wave speeds [sqrt(Pa)] of particles side by side, by bounds that are exact where two
    eigenvalues are equal: the exact ones take as long as the stress."""
    fast, slow = math.sqrt(largest_bound(propagating(pressure))), math.sqrt(largest_bound(propagating(shear)))
    return everywhere(space, _signal(weights, fast, slow))


@register_jitable
def _lost(space, evolved, tributary):
    """Internal dissipation [J] of particles side by side."""
    if evolved is None:
        return everywhere(space, 0.0)
    return evolved[1] * tributary


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_strain(space, first, last, law, terms, weights, step, relaxation, body):
    """F after a step [s] by its velocity gradient in the middle, H = cof F and J = det F, A relaxed exactly, and stress
    and waves of the new state in the records; the pair sums, which it reads, are zero afterwards.

    Returns (sound, internal dissipation [J], greatest weighted sum of wave speeds times sqrt(rho) [sqrt(Pa)]); sound
    is False when a Jacobian is not positive, or not a number.
    """
    sound, greatest, dissipation = True, everywhere(space, 0.0), everywhere(space, 0.0)
    width = at_once(space)
    for i in range(first, last, width):
        count = min(width, last - i)
        F0, _, _ = load_strain(space, body, i)
        L = load_correction(space, body.correction, i)
        # (70): C_ab = 2 L_a g_ab, and L is symmetric only where spacings are equal
        G = scale(1.0 / load_row(space, body.volume, 0, i), matmul_transposed(load_gradient(space, body.sums, i), L))
        # while they are in the cache
        clear_rows(space, body.sums, i, count)
        F = add(F0, scale(step, G))
        H, J = cofactor(F), determinant(F)
        store_deformation_gradient(space, body.deformation, i, F, J, count)
        if not all_sound(space, J):
            sound = False
        evolved = _relax(body.branches, space, law, relaxation, i, F0, F, count)
        branch_sum, lost = branch_sum_of(evolved), _lost(space, evolved, load_row(space, body.tributary, 0, i))
        dissipation = dissipation + only_first(lost, count, width)
        P = first_piola_kirchhoff_stress(law, F, H, J, branch_sum)
        pressure, shear = pressure_wave_tensor(law, F, H, J, branch_sum), shear_wave_tensor(law, F, branch_sum)
        _store_record(terms, space, law, body, i, matmul(P, L), G, pressure, shear)
        # max gives its second argument where either is not a number
        greatest = max(greatest, only_first(_signals(space, weights, pressure, shear), count, width))
    return sound, sum_of_lanes(space, dissipation), greatest_lane(space, greatest)


@compiled(fastmath={"contract"}, error_model="numpy")
def greatest_signal(space, first, last, law, weights, body):
    """Greatest weighted sum of wave speeds times sqrt(rho) [sqrt(Pa)] of the current state, over all directions."""
    greatest = everywhere(space, 0.0)
    width = at_once(space)
    for i in range(first, last, width):
        F, H, J = load_strain(space, body, i)
        branch_sum = current_branches(space, law, body.branches, i, F)
        pressure, shear = pressure_wave_tensor(law, F, H, J, branch_sum), shear_wave_tensor(law, F, branch_sum)
        greatest = max(greatest, only_first(_signals(space, weights, pressure, shear), min(width, last - i), width))
    return greatest_lane(space, greatest)
