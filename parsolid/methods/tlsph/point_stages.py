"""SSP-RK3: deformation and stress of single particles in a stage, on tiles (`point_update`)."""

from parsolid.kernels import kernel
from parsolid.materials.viscoelastic.maxwell import branch_dissipation, relaxed
from parsolid.methods.tlsph.point_update import (
    TILE,
    law_in,
    load,
    load_symmetric,
    store,
    store_symmetric,
    stress_with_branches,
    waves_with_branches,
)
from parsolid.methods.tlsph.tile_fields import copy, copy_in, copy_out
from parsolid.tensors import (
    cofactor,
    combine,
    combine_symmetric,
    congruence,
    contract,
    cross,
    gram,
    inverse_symmetric,
)


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
    law, keep, take, step, branches, F, H, J, F_start, H_start, J_start, G, A, branch_sum, push, P, fast, slow, rate,
    values,
):  # fmt: skip
    """SSP-RK3: one stage y <- keep y_start + take (y + step dy/dt) of F, H and J of a tile, eqs (72b) to (72d).

    Fills P [Pa] and, of the state before the stage, halves of rho^2 times the wave tensors of pressure (fast, 6 TILE)
    and shear (slow); rate: dissipation [W/m^3] of the branches, times its factor in the integral over the step.
    values: `ParticleValues` of a law without state variables, or None.
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
        here = law_in(law, values, p)
        P_old = stress_with_branches(here, total, branch_sum, p, F_old, H_old, J_old)
        Q_p, Q_s = waves_with_branches(here, total, branch_sum, p, F_old, H_old, J_old)
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
def load_start(F, H, J, tensor, gradient, cofactors, jacobian, i, n):
    """F, H and J at the start of the step of n particles from row i on, as `load_deformation` takes them."""
    copy_in(F, tensor, gradient, i, n)
    copy(J[:n], jacobian[i : i + n])
    if cofactors is not None:
        copy_in(H, tensor, cofactors, i, n)
    else:
        for p in range(TILE):
            store(H, p, cofactor(load(F, p)))
            H[8 * TILE + p] = J[p]


@kernel
def store_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n):
    """F, H and J of n particles into rows from i on, as `load_deformation` takes them."""
    copy_out(gradient, i, n, F, tensor)
    if cofactors is not None:
        copy_out(cofactors, i, n, H, tensor)
    copy(jacobian[i : i + n], J[:n])
