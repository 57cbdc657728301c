"""Deformation, stress and wave speeds of single particles, on tiles of 96.

A tile holds the tensors of TILE particles in flat arrays: component c of particle p stands at c * TILE + p, general
tensors with nine components, symmetric ones with six (`parsolid.tensors`). Flat tiles stay in the first-level cache,
and LLVM sees that their components do not overlap, without which it does not vectorise these loops. In plane strain
the components out of the plane are those of F33 = 1; `plane` excludes that direction from wave speeds.

Whatever sums over neighbours (pair lists, box sweeps) loads a tile, calls `update_tile` (leapfrog) or `stage_tile`
(SSP-RK3), and stores what it needs. A tile that is only partly filled must hold sound values in the rest, as
`make_tile` gives them.
"""

from typing import NamedTuple

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel
from parsolid.materials.hyperelastic.functions import pressure_waves, shear_waves, stress
from parsolid.materials.viscoelastic.maxwell import (
    branch_dissipation,
    branch_stress,
    branch_waves,
    relaxation_loss,
    relaxed,
)
from parsolid.tensors import (
    cofactor,
    combine,
    combine_symmetric,
    congruence,
    contract,
    cross,
    gram,
    inverse_symmetric,
    largest_eigenvalue,
    largest_eigenvalue_bound,
    plus,
    plus_symmetric,
)

# what an update reads and writes of so many stays in a first-level cache of 48 kB
TILE = 96


class Branches(NamedTuple):
    """The Maxwell branches of a law over one step.

    moduli [Pa], times [s]: (branches,). weights (branches, 3): `maxwell.relaxation_weights` over the step. losses
    (branches, 3): leapfrog's `maxwell.loss_weights` times tau [s]; for SSP-RK3 column 0 is the `dissipation_factor` of
    the stage. to_stage (branches, 3): relaxation weights from the start of the step to the stage (SSP-RK3).
    """

    moduli: np.ndarray
    times: np.ndarray
    weights: np.ndarray
    losses: np.ndarray
    to_stage: np.ndarray


@inlined
def load(t, p):
    """General tensor of particle p of a tile."""
    return (t[p], t[TILE + p], t[2 * TILE + p], t[3 * TILE + p], t[4 * TILE + p],
            t[5 * TILE + p], t[6 * TILE + p], t[7 * TILE + p], t[8 * TILE + p])  # fmt: skip


@inlined
def store(t, p, A):
    """Put a general tensor into a tile."""
    t[p], t[TILE + p], t[2 * TILE + p], t[3 * TILE + p], t[4 * TILE + p] = A[0], A[1], A[2], A[3], A[4]
    t[5 * TILE + p], t[6 * TILE + p], t[7 * TILE + p], t[8 * TILE + p] = A[5], A[6], A[7], A[8]


@inlined
def load_symmetric(t, p):
    """Symmetric tensor of particle p of a tile."""
    return (t[p], t[TILE + p], t[2 * TILE + p], t[3 * TILE + p], t[4 * TILE + p], t[5 * TILE + p])


@inlined
def store_symmetric(t, p, S):
    """Put a symmetric tensor into a tile."""
    t[p], t[TILE + p], t[2 * TILE + p] = S[0], S[1], S[2]
    t[3 * TILE + p], t[4 * TILE + p], t[5 * TILE + p] = S[3], S[4], S[5]


def make_tile(components: int) -> np.ndarray:
    """A tile of tensors that are 1 (nine or six components), or of numbers that are 1."""
    diagonal = {9: (0, 4, 8), 6: (0, 1, 2)}.get(components, range(components))
    tile = aligned_zeros((components, TILE))
    tile[list(diagonal)] = 1.0
    return tile.ravel()


@inlined
def in_directions(third, Q):
    """A wave tensor whose eigenvalues are those of directions in the plane for third = 0, of all for third = 1."""
    # a factor, as numba warns of conditions in inlined functions
    return (Q[0], Q[1], third * Q[2] + (1.0 - third) * 0.5 * (Q[0] + Q[1]), Q[3], Q[4], Q[5])


@inlined
def mean_impedance(density, Q):
    """Root of the mean over directions of rho^2 c^2 [kg/(m^2 s)], rho c^2 = N . Q N."""
    return (density * (Q[0] + Q[1] + Q[2]) * (1.0 / 3.0)) ** 0.5


@kernel
def relax_branch(modulus, time, weights, rates, step, F, G, A, branch_sum, lost):
    """Relax A of a branch of a tile over a step [s] in which F grows by step G; add its share to branch_sum (mu A) and
    what it dissipates [J/m^3] to lost. weights, rates: its rows of `Branches`."""
    for p in range(TILE):
        F_old = load(F, p)
        C_old, C = gram(F_old), gram(combine(1.0, F_old, step, load(G, p)))
        C_old_inverse, C_inverse, A_old = inverse_symmetric(C_old), inverse_symmetric(C), load_symmetric(A, p)
        A_new = relaxed(weights, A_old, C_old_inverse, C_inverse)
        store_symmetric(A, p, A_new)
        store_symmetric(branch_sum, p, combine_symmetric(1.0, load_symmetric(branch_sum, p), modulus, A_new))
        lost[p] += relaxation_loss(modulus, time, rates, C_old, C_old_inverse, A_old, C, C_inverse, A_new)


@kernel
def clear_sums(branch_sum, lost):
    """Set what `relax_branch` adds to, to 0."""
    for p in range(branch_sum.size):
        branch_sum[p] = 0.0
    for p in range(lost.size):
        lost[p] = 0.0


@kernel
def relax_tile(branches, step, F, G, A, branch_sum, lost):
    """`relax_branch` of all branches; the sum of their moduli [Pa]."""
    moduli, times, weights, losses = branches.moduli, branches.times, branches.weights, branches.losses
    total = 0.0
    clear_sums(branch_sum, lost)
    for k in range(moduli.size):
        of_branch = (weights[k, 0], weights[k, 1], weights[k, 2]), (losses[k, 0], losses[k, 1], losses[k, 2])
        A_k = A[6 * TILE * k : 6 * TILE * (k + 1)]
        relax_branch(moduli[k], times[k], of_branch[0], of_branch[1], step, F, G, A_k, branch_sum, lost)
        total += moduli[k]
    return total


@kernel
def deform_tile(law, step, total, third, signals, F, G, branch_sum, push, J, P, impedance, signal):
    """F after a step, and what follows from it, see `update_tile`. total, branch_sum: of the branches, branch_sum None
    without; third: 0 in plane strain, else 1."""
    p1, s1, p2, s2, p3, s3 = signals
    for p in range(TILE):
        F_new = combine(1.0, load(F, p), step, load(G, p))
        H = cofactor(F_new)
        J_new = F_new[0] * H[0] + F_new[1] * H[1] + F_new[2] * H[2]
        P_new = stress(law, F_new, H, J_new)
        fast, slow = pressure_waves(law, F_new, H, J_new), shear_waves(law, F_new)
        if branch_sum is not None:
            S = load_symmetric(branch_sum, p)
            P_new = plus(P_new, branch_stress(total, S, F_new, H, J_new))
            fast, slow = plus_symmetric(fast, branch_waves(total, S, H, J_new)), plus_symmetric(slow, S)
        store(F, p, F_new)
        store(P, p, P_new)
        J[p] = J_new
        fast, slow = in_directions(third, fast), in_directions(third, slow)
        c_p, c_s = largest_eigenvalue_bound(fast) ** 0.5, largest_eigenvalue_bound(slow) ** 0.5
        signal[p] = max(p1 * c_p + s1 * c_s, p2 * c_p + s2 * c_s, p3 * c_p + s3 * c_s)
        if push is not None:
            # rho_r^2 c_r^2 of the moved reference: F_r Q F_r^T / J_r^2
            fast, slow = congruence(load(push, p), fast), congruence(load(push, p), slow)
            fast, slow = in_directions(third, fast), in_directions(third, slow)
        impedance[p], impedance[TILE + p] = (
            0.5 * mean_impedance(law.density, fast),
            0.5 * mean_impedance(law.density, slow),
        )


@kernel
def update_tile(
    law, step, plane, signals, branches, F, G, A, branch_sum, push, J, P, impedance, signal, lost
):  # fmt: skip
    """Leapfrog: the state of a tile after a step [s] with its velocity gradient G [1/s] in the middle of the step.

    law: without branches, see `materials.hyperelastic.functions`. signals: six numbers (p1, s1, p2, s2, p3, s3).
    branches: `Branches`; A (branches * 6 TILE) and the scratch branch_sum (6 TILE) are None for laws without. push
    (9 TILE): F_r/J_r of an updated reference, or None.

    Advances F and A. Fills J, P [Pa], impedance (2 TILE): half rho c of pressure and of shear waves [kg/(m^2 s)], the
    root of its mean square over directions; signal: the greatest of the sums p_i sqrt(rho) c_p + s_i sqrt(rho) c_s
    [sqrt(Pa)] over all directions; lost: energy that branches dissipate [J/m^3].
    """
    total = 0.0
    if A is not None:
        total = relax_tile(branches, step, F, G, A, branch_sum, lost)
    third = 0.0 if plane else 1.0
    # a function of its own: LLVM makes twice as fast a loop of it
    deform_tile(law, step, total, third, signals, F, G, branch_sum, push, J, P, impedance, signal)


@kernel
def branches_at_stage(k, branches, F, F_start, A, branch_sum, rate):
    """Add mu A of branch k at a stage, relaxed from the start of the step, to branch_sum, and its weighted dissipation
    rate [W/m^3] to rate."""
    modulus, time, factor, w = branches.moduli[k], branches.times[k], branches.losses[k, 0], branches.to_stage[k]
    weights = (w[0], w[1], w[2])
    for p in range(TILE):
        C = gram(load(F, p))
        # of the F that is in the stored energy: A that relaxed to H^T H/J^2 would gain energy where these differ
        C_inverse, C_start_inverse = inverse_symmetric(C), inverse_symmetric(gram(load(F_start, p)))
        A_stage = relaxed(weights, load_symmetric(A, p), C_start_inverse, C_inverse)
        store_symmetric(branch_sum, p, combine_symmetric(1.0, load_symmetric(branch_sum, p), modulus, A_stage))
        rate[p] += factor * branch_dissipation(modulus, time, C, C_inverse, A_stage)


@kernel
def stage_tile(
    law, keep, take, step, branches, F, H, J, F_start, H_start, J_start, G, A, branch_sum, push, P, fast, slow, rate
):  # fmt: skip
    """SSP-RK3: one stage y <- keep y_start + take (y + step dy/dt) of F, H and J of a tile, eqs (72b) to (72d).

    Fills P [Pa] and, of the state before the stage, halves of rho^2 times the wave tensors of pressure (fast, 6 TILE)
    and shear (slow); rate: dissipation [W/m^3] of the branches, times its factor in the integral over the step.
    """
    total = 0.0
    if A is not None:
        for p in range(6 * TILE):
            branch_sum[p] = 0.0
        for p in range(TILE):
            rate[p] = 0.0
        for k in range(branches.moduli.size):
            branches_at_stage(k, branches, F, F_start, A[6 * TILE * k : 6 * TILE * (k + 1)], branch_sum, rate)
            total += branches.moduli[k]
    for p in range(TILE):
        F_old, H_old, J_old, grad_v = load(F, p), load(H, p), J[p], load(G, p)
        P_old = stress(law, F_old, H_old, J_old)
        Q_p, Q_s = pressure_waves(law, F_old, H_old, J_old), shear_waves(law, F_old)
        if A is not None:
            S = load_symmetric(branch_sum, p)
            P_old = plus(P_old, branch_stress(total, S, F_old, H_old, J_old))
            Q_p, Q_s = plus_symmetric(Q_p, branch_waves(total, S, H_old, J_old)), plus_symmetric(Q_s, S)
        if push is not None:
            Q_p, Q_s = congruence(load(push, p), Q_p), congruence(load(push, p), Q_s)
        store(P, p, P_old)
        half = 0.5 * law.density
        store_symmetric(
            fast, p, (half * Q_p[0], half * Q_p[1], half * Q_p[2], half * Q_p[3], half * Q_p[4], half * Q_p[5])
        )
        store_symmetric(
            slow, p, (half * Q_s[0], half * Q_s[1], half * Q_s[2], half * Q_s[3], half * Q_s[4], half * Q_s[5])
        )
        dH, dJ = cross(F_old, grad_v), contract(H_old, grad_v)
        store(H, p, combine(keep, load(H_start, p), take, combine(1.0, H_old, step, dH)))
        store(F, p, combine(keep, load(F_start, p), take, combine(1.0, F_old, step, grad_v)))
        J[p] = keep * J_start[p] + take * (J_old + step * dJ)


@kernel
def relax_over_step(branches, F, F_start, A):
    """SSP-RK3: relax A of a tile over the whole step, in which F_start has become F."""
    for k in range(branches.moduli.size):
        w, a = branches.weights[k], A[6 * TILE * k : 6 * TILE * (k + 1)]
        weights = (w[0], w[1], w[2])
        for p in range(TILE):
            start, end = inverse_symmetric(gram(load(F_start, p))), inverse_symmetric(gram(load(F, p)))
            store_symmetric(a, p, relaxed(weights, load_symmetric(a, p), start, end))


@kernel
def sum_branches(branches, A, branch_sum):
    """sum mu A of a tile; sum mu [Pa]."""
    total = 0.0
    for p in range(6 * TILE):
        branch_sum[p] = 0.0
    for k in range(branches.moduli.size):
        total += branches.moduli[k]
        for p in range(6 * TILE):
            branch_sum[p] += branches.moduli[k] * A[6 * TILE * k + p]
    return total


@kernel
def stress_tile(law, branches, F, H, J, A, branch_sum, P):
    """P [Pa] of the state of a tile."""
    total = 0.0
    if A is not None:
        total = sum_branches(branches, A, branch_sum)
    for p in range(TILE):
        P_now = stress(law, load(F, p), load(H, p), J[p])
        if A is not None:
            P_now = plus(P_now, branch_stress(total, load_symmetric(branch_sum, p), load(F, p), load(H, p), J[p]))
        store(P, p, P_now)


@kernel
def waves_tile(law, plane, branches, F, H, J, A, branch_sum, fast, slow, bound):
    """Wave tensors [Pa] of pressure (fast) and shear (slow) of the state of a tile, and a bound (2 TILE) on the largest
    eigenvalue of each over the directions of propagation."""
    total = 0.0
    if A is not None:
        total = sum_branches(branches, A, branch_sum)
    third = 0.0 if plane else 1.0
    for p in range(TILE):
        F_now, H_now, J_now = load(F, p), load(H, p), J[p]
        Q_p, Q_s = pressure_waves(law, F_now, H_now, J_now), shear_waves(law, F_now)
        if A is not None:
            S = load_symmetric(branch_sum, p)
            Q_p, Q_s = plus_symmetric(Q_p, branch_waves(total, S, H_now, J_now)), plus_symmetric(Q_s, S)
        Q_p, Q_s = in_directions(third, Q_p), in_directions(third, Q_s)
        store_symmetric(fast, p, Q_p)
        store_symmetric(slow, p, Q_s)
        bound[p], bound[TILE + p] = largest_eigenvalue_bound(Q_p), largest_eigenvalue_bound(Q_s)


@kernel
def largest_modulus(largest, fast, bound, count):
    """Greatest rho c_p^2 [Pa] of the first particles of a tile and of what was found before: the eigenvalue is
    computed only where its bound may exceed that."""
    for p in range(count):
        # also where the bound is not a number
        if not bound[p] <= largest:
            largest = max(largest, largest_eigenvalue(load_symmetric(fast, p)))
    return largest
