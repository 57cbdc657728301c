"""SSP-RK3: a stage of particles whose neighbours stand in lists, as `list_update` takes a step of leapfrog."""

from parsolid.kernels import kernel
from parsolid.materials.viscoelastic.maxwell import branch_dissipation, relaxed
from parsolid.methods.tlsph.list_update import find_gradients, store_stresses
from parsolid.methods.tlsph.point_update import (
    TILE,
    add_initial_stress,
    law_in,
    load,
    load_symmetric,
    load_values,
    store,
    store_symmetric,
    stress_with_branches,
    waves_with_branches,
)
from parsolid.methods.tlsph.tile_fields import (
    copy,
    copy_branches_in,
    copy_branches_out,
    copy_in,
    copy_out,
    energy_lost,
    largest_modulus,
    load_deformation,
    tiles_in,
    waves_tile,
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


@kernel
def store_wave_rows(d, i, n, rows, Q, isotropic):
    """Wave tensors of a tile into their rows, if there are any; isotropic: half rho c_s where it has no direction,
    beside the pressure waves."""
    if rows is None:
        return
    for p in range(n):
        row = rows[i + p]
        if d == 3:
            row[0], row[1], row[2], row[3] = Q[p], Q[TILE + p], Q[2 * TILE + p], isotropic
            row[4], row[5], row[6] = Q[3 * TILE + p], Q[4 * TILE + p], Q[5 * TILE + p]
        else:
            row[0], row[1], row[2], row[3] = Q[p], Q[TILE + p], Q[3 * TILE + p], isotropic


@kernel
def advance_stage(
    law, keep, take, step, at_start, at_end, d, branches, half, isotropic, first, last, places,
    gradient, cofactors, jacobian, gradient_start, cofactors_start, jacobian_start, field_A,
    volume, push, inverse, initial,
    pairs, motion, operator, record, fast, slow, tiles, A, branch_sum, push_tile, values,
):  # fmt: skip
    """SSP-RK3: one stage y <- keep y_start + take (y + step dy/dt) of particles first .. last - 1, with records of the
    state before it; at_start, at_end: whether it is the first or the last of the step.

    Arguments as in `stage_tile` and `list_update.advance_step`; fast, slow: rows of wave tensors, or None.

    Returns (whether all Jacobians are positive, dissipation rate of branches [W], greatest rho c_p^2 [Pa] of the state
    at the end of the step).
    """
    sound, rate, largest = True, 0.0, 0.0
    # out of their tuples once: each time costs a count of references
    tiles = tiles_in(tiles)
    tensor, symmetric, F, H, J, F0, H0, J0 = (
        places.tensor, places.symmetric, tiles.F, tiles.H, tiles.J, tiles.F_start, tiles.H_start, tiles.J_start
    )  # fmt: skip
    G, P, S, Z, lost = tiles.G, tiles.P, tiles.S, tiles.impedance, tiles.lost
    Q_p, Q_s, bound, F_before = tiles.fast, tiles.slow, tiles.bound, tiles.initial
    if d == 2:
        G[:] = 0.0
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        find_gradients(d, pairs, i, n, motion, half, operator, inverse, record, G)
        load_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        if at_start:
            store_deformation(F, H, J, tensor, gradient_start, cofactors_start, jacobian_start, i, n)
        load_start(F0, H0, J0, tensor, gradient_start, cofactors_start, jacobian_start, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        if push is not None:
            copy_in(push_tile, tensor, push, i, n)
        if initial is not None:
            for p in range(TILE):
                store(F_before, p, load(F, p))
        if values is not None:
            load_values(values, i, n)
        stage_tile(
            law, keep, take, step, branches, F, H, J, F0, H0, J0, G, A, branch_sum, push_tile, P, Q_p, Q_s, lost, values
        )  # fmt: skip
        if initial is not None:
            copy_in(S, tensor, initial, i, n)
            add_initial_stress(F_before, S, P)
        store_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        for p in range(n):
            sound = sound and J[p] > 0.0
        store_stresses(d, i, n, P, Z, operator, record)
        store_wave_rows(d, i, n, fast, Q_p, isotropic)
        store_wave_rows(d, i, n, slow, Q_s, 0.0)
        if A is not None:
            rate += energy_lost(n, lost, volume, i)
            if at_end:
                relax_over_step(branches, F, F0, A)
                copy_branches_out(field_A, i, n, A, symmetric)
        if at_end:
            waves_tile(law, d == 2, branches, F, H, J, A, branch_sum, Q_p, Q_s, bound, values)
            largest = largest_modulus(largest, Q_p, bound, n)
    return sound, rate, largest
