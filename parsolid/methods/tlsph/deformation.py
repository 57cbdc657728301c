"""Particle kernels of the total-Lagrangian pair methods: kinematics, stress, dissipation and wave speeds of a law.

Four particles at a time (`numerics.lanes.Lanes`); a range first..last-1 of particles shares one law.
"""

import math
from typing import NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.materials.hyperelastic.law import (
    first_piola_kirchhoff_stress,
    isotropic_shear_modulus,
    pressure_wave_tensor,
    shear_wave_tensor,
)
from parsolid.materials.viscoelastic.maxwell_lanes import branch_dissipation, relaxed
from parsolid.methods.tlsph.moved import gradient_in_reference, waves_in_reference
from parsolid.methods.tlsph.stage_kernels import note_stage, strain_loss
from parsolid.methods.tlsph.strain import load_strain
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.lanes import WIDTH, all_positive, lane, load
from parsolid.numerics.layout import (
    load_branch,
    load_correction,
    load_deformation,
    load_gradient,
    store_branch,
    store_deformation,
    store_matrix,
    store_tensor,
)
from parsolid.numerics.tensors import (
    SYMMETRIC_PLANE,
    SymmetricPlane,
    add,
    contract,
    contract_symmetric,
    cross,
    formula,
    gram,
    inverse_symmetric,
    lane_of_symmetric,
    largest_eigenvalue,
    matmul,
    matmul_transposed,
    scale,
    trace_symmetric,
)
from parsolid.pairs.terms import RiemannDissipation, record_columns


class Relaxation(NamedTuple):
    """Weights (branches, 3) of A_0, C_0^{-1}, C_1^{-1}: `to_stage` from the start of the step to the stage, `to_end`
    over the step; `dissipation` (branches,): factors on the stage's weight in the integral of the dissipation."""

    to_stage: np.ndarray
    to_end: np.ndarray
    dissipation: np.ndarray


@none_without("branches")
def _start_inverse(branches, F0):
    """C^{-1} at the start of the step, needed by branches alone."""
    return inverse_symmetric(gram(F0))


@none_without("branches")
def _branches_at_stage(branches, space, law, update, relaxation, i, F, J, old_inverse):
    """sum mu_alpha A_alpha and the internal dissipation rate [W/m^3]; A is relaxed from the start of the step."""
    C = gram(F)
    # of the F that is in the stored energy: A that relaxed to H^T H/J^2 would gain energy where these differ
    inverse = inverse_symmetric(C)
    total, rate = scale(0.0, C), 0.0 * J
    for alpha in range(len(law.branch_moduli)):
        A = load_branch(space, branches, alpha, i)
        if not update.first:
            w = relaxation.to_stage
            weights = (w[alpha, 0], w[alpha, 1], w[alpha, 2])
            A = relaxed(weights, A, old_inverse, inverse)
        total = add(total, scale(law.branch_moduli[alpha], A))
        lost = branch_dissipation(law.branch_moduli[alpha], law.relaxation_times[alpha], C, inverse, A)
        rate = rate + relaxation.dissipation[alpha] * lost
    return total, rate


@none_without("evolved")
def branch_sum_of(evolved):
    """The first of what branches that have evolved give."""
    return evolved[0]


@register_jitable
def dissipation_of(evolved, tributary, count):
    """Internal dissipation of the first `count` of four particles, the second of what branches give times volumes."""
    if evolved is None:
        return 0.0
    share, result = evolved[1] * tributary, 0.0
    for k in range(count):
        result += lane(share, k)
    return result


@none_without("branches")
def _relax_branches(branches, space, law, relaxation, i, old_inverse, F, count):
    """Relax A over the whole step; sum mu_alpha A_alpha at its end."""
    inverse = inverse_symmetric(gram(F))
    total = scale(0.0, inverse)
    for alpha in range(len(law.branch_moduli)):
        w = relaxation.to_end
        weights = (w[alpha, 0], w[alpha, 1], w[alpha, 2])
        A = relaxed(weights, load_branch(space, branches, alpha, i), old_inverse, inverse)
        store_branch(space, branches, alpha, i, A, count)
        total = add(total, scale(law.branch_moduli[alpha], A))
    return total


@none_without("branches")
def current_branches(space, law, branches, i, F):
    """sum mu_alpha A_alpha of the stored A."""
    total = scale(0.0, gram(F))
    for alpha in range(len(law.branch_moduli)):
        total = add(total, scale(law.branch_moduli[alpha], load_branch(space, branches, alpha, i)))
    return total


@none_without("stages")
def _stress_after(stages, law, F, H, J, branch_sum):
    """P at the end of the step."""
    return first_piola_kirchhoff_stress(law, F, H, J, branch_sum)


@register_jitable
def _shear_lane(isotropic, density):
    """Half the shear impedance 1/2 rho c_s where it does not depend on direction, else nothing."""
    if isotropic is None:
        return 0.0
    return 0.5 * math.sqrt(density * isotropic)


@register_jitable
def _store_shear(shear, space, law, body, i, column, F, branch_sum):
    if shear is not None:
        waves = scale(0.5 * law.density, shear_wave_tensor(law, F, branch_sum))
        store_tensor(space, body.record, i, column, waves_in_reference(body.moved, space, i, waves), 0.0)


@generic
def store_waves(terms, space, law, body, i, F, pressure, branch_sum, G):
    """Half velocity gradient and halves of the squared impedance tensors, where the pairs dissipate by them.

    pressure: the pressure wave tensor [Pa].
    """


@store_waves.of(None)
def _store_nothing(terms, space, law, body, i, F, pressure, branch_sum, G):
    return None


@store_waves.of(RiemannDissipation)
def _store_riemann_waves(terms, space, law, body, i, F, pressure, branch_sum, G):
    at = record_columns(space, terms)
    store_matrix(space, body.record, i, at.gradient, scale(0.5, gradient_in_reference(body.moved, space, i, G)))
    waves = waves_in_reference(body.moved, space, i, scale(0.5 * law.density, pressure))
    shear = _shear_lane(isotropic_shear_modulus(law), law.density)
    store_tensor(space, body.record, i, at.pressure_wave, waves, shear)
    _store_shear(terms.shear, space, law, body, i, at.shear_wave, F, branch_sum)


@formula
def propagating(waves):
    """A wave tensor whose largest eigenvalue is that of directions in the plane, where there is one."""
    if len(waves) == SYMMETRIC_PLANE:
        return SymmetricPlane(waves[0], waves[1], 0.5 * (waves[0] + waves[1]), waves[3])
    return waves


@register_jitable
def largest_bound(q):
    """A bound on the largest eigenvalue of a symmetric tensor, m + sqrt(2/3) |dev| with the mean eigenvalue m: cheap on
    four particles at once."""
    mean = trace_symmetric(q) * (1.0 / 3.0)
    deviator = contract_symmetric(q, q) - 3.0 * mean * mean
    # what rounding leaves of no deviator may be negative
    return mean + math.sqrt(max(deviator * (2.0 / 3.0), 1e-30 * mean * mean))


@register_jitable
def _largest_speed(largest, rho_c2, first, last):
    """The greatest rho c_max^2 [Pa]: lambda_max of the wave tensor, found exactly only where its bound says so."""
    q = propagating(rho_c2)
    bound = largest_bound(q)
    for k in range(last - first):
        if not lane(bound, k) <= largest:
            largest = max(largest, largest_eigenvalue(lane_of_symmetric(q, k)))
    return largest


@compiled(fastmath={"contract"}, error_model="numpy")
def advance_deformation(space, first, last, law, terms, update, relaxation, body):
    """One stage of F, H, J (eqs (72b)-(72d)) with the stress and waves of the state it starts from put into the
    records.

    update: `runge_kutta.Update`, in one sweep with the stress because a sweep of its own takes 2 to 19 % of a step.
    Returns (sound, internal dissipation rate [W], greatest rho c_max^2 [Pa] of the state at the end of the last stage,
    energy [J] that the stages have taken from what is stored, see `stage_losses`); sound is False when a Jacobian is
    not positive, or not a number.
    """
    sound, largest, dissipation, lost = True, 0.0, 0.0, 0.0
    for i in range(first, last, WIDTH):
        count = min(WIDTH, last - i)
        F, H, J = load_deformation(space, body.deformation, i)
        F0, H0, J0 = F, H, J
        if update.first:
            store_deformation(space, body.start, i, F, H, J, count)
        else:
            F0, H0, J0 = load_deformation(space, body.start, i)
        L = load_correction(space, body.correction, i)
        # (70): C_ab = 2 L_a g_ab, and L is symmetric only where spacings are equal
        G = scale(1.0 / load(body.volume, 0, i), matmul_transposed(load_gradient(space, body.sums, i), L))
        old_inverse = _start_inverse(body.branches, F0)
        evolved = _branches_at_stage(body.branches, space, law, update, relaxation, i, F, J, old_inverse)
        branch_sum = branch_sum_of(evolved)
        dissipation += dissipation_of(evolved, load(body.tributary, 0, i), count)
        P = first_piola_kirchhoff_stress(law, F, H, J, branch_sum)
        store_matrix(space, body.record, i, record_columns(space, terms).stress, matmul(P, L))
        store_waves(terms, space, law, body, i, F, pressure_wave_tensor(law, F, H, J, branch_sum), branch_sum, G)
        note_stage(body.stages, space, update, i, G, P, count)
        F3 = F
        dJ = contract(H, G)
        H = add(scale(update.keep, H0), scale(update.take, add(H, scale(update.step, cross(F, G)))))
        F = add(scale(update.keep, F0), scale(update.take, add(F, scale(update.step, G))))
        J = update.keep * J0 + update.take * (J + update.step * dJ)
        store_deformation(space, body.deformation, i, F, H, J, count)
        if not all_positive(J):
            sound = False
        if update.last:
            branch_sum = _relax_branches(body.branches, space, law, relaxation, i, old_inverse, F, count)
            largest = _largest_speed(largest, pressure_wave_tensor(law, F, H, J, branch_sum), i, i + count)
            after = _stress_after(body.stages, law, F, H, J, branch_sum)
            lost += strain_loss(
                body.stages, space, i, update.step, (F0, F3), (G, P, after), load(body.tributary, 0, i), count
            )
    return sound, dissipation, largest, lost


@compiled(fastmath={"contract"}, error_model="numpy")
def largest_wave_modulus(space, first, last, law, body):
    """Greatest rho c_max^2 [Pa] of the current state, c_max over all directions (sharper than (79))."""
    largest = 0.0
    for i in range(first, last, WIDTH):
        F, H, J = load_strain(space, body, i)
        branch_sum = current_branches(space, law, body.branches, i, F)
        largest = _largest_speed(largest, pressure_wave_tensor(law, F, H, J, branch_sum), i, min(i + WIDTH, last))
    return largest
