"""Deformation and stress of particles whose neighbours stand in lists: from the rows of the gradient sweep to those of
the divergence sweep (`pairs.list_sweeps`), tile by tile."""

from parsolid.kernels import kernel
from parsolid.methods.tlsph.point_update import (
    TILE,
    largest_modulus,
    load,
    relax_over_step,
    stage_tile,
    store,
    update_tile,
    waves_tile,
)
from parsolid.methods.tlsph.tile_fields import (
    copy,
    copy_branches_in,
    copy_branches_out,
    copy_in,
    copy_out,
    load_deformation,
)
from parsolid.tensors import cofactor, matmul, matmul_transposed, plus, times


@kernel
def load_gradient(d, tensor, sums, correction, volume, i, n, S, L, V, G):
    """G = S L^T / V of n particles from row i on into a tile, eq (70): L is symmetric only where spacings are equal.

    Sets the rows of the sums to zero, while they are in the cache; L stays in its tile. S, V: scratch tiles.
    """
    if d == 3:
        for p in range(n):
            row = sums[i + p]
            S[p], S[3 * TILE + p], S[6 * TILE + p] = row[0], row[1], row[2]
            S[TILE + p], S[4 * TILE + p], S[7 * TILE + p] = row[4], row[5], row[6]
            S[2 * TILE + p], S[5 * TILE + p], S[8 * TILE + p] = row[8], row[9], row[10]
            row[0], row[1], row[2], row[3], row[4], row[5] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
            row[6], row[7], row[8], row[9], row[10], row[11] = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
    else:
        for p in range(n):
            row = sums[i + p]
            S[p], S[3 * TILE + p], S[TILE + p], S[4 * TILE + p] = row[0], row[1], row[2], row[3]
            row[0], row[1], row[2], row[3] = 0.0, 0.0, 0.0, 0.0
    copy(V[:n], volume[i : i + n])
    copy_in(L, tensor, correction, i, n)
    for p in range(TILE):
        store(G, p, times(1.0 / V[p], matmul_transposed(load(S, p), load(L, p))))
    if d == 2:
        for p in range(TILE):
            G[8 * TILE + p] = 0.0


@kernel
def store_record(d, half, i, n, record, inverse, P, L, G, Z, S):
    """P L, half the velocity gradient (or none of it, half = 0) and half impedances of n particles from row i on into
    their rows. inverse: F_r^-1 of an updated reference, in which the gradient is G F_r^-1, or None; S: a scratch
    tile."""
    for p in range(TILE):
        store(S, p, matmul(load(P, p), load(L, p)))
    if inverse is not None:
        for p in range(TILE):
            store(G, p, matmul(load(G, p), load(inverse, p)))
    if d == 3:
        for p in range(n):
            row = record[i + p]
            row[0], row[1], row[2], row[3] = S[p], S[3 * TILE + p], S[6 * TILE + p], Z[p]
            row[4], row[5], row[6], row[7] = S[TILE + p], S[4 * TILE + p], S[7 * TILE + p], Z[TILE + p]
            row[8], row[9], row[10], row[11] = S[2 * TILE + p], S[5 * TILE + p], S[8 * TILE + p], 0.0
            row[12], row[13], row[14] = half * G[p], half * G[3 * TILE + p], half * G[6 * TILE + p]
            row[16], row[17], row[18] = half * G[TILE + p], half * G[4 * TILE + p], half * G[7 * TILE + p]
            row[20], row[21], row[22] = half * G[2 * TILE + p], half * G[5 * TILE + p], half * G[8 * TILE + p]
    else:
        for p in range(n):
            row = record[i + p]
            row[0], row[1], row[2], row[3] = S[p], S[3 * TILE + p], S[TILE + p], S[4 * TILE + p]
            row[4], row[5] = half * G[p], half * G[3 * TILE + p]
            row[6], row[7] = half * G[TILE + p], half * G[4 * TILE + p]
            row[8], row[9] = Z[p], Z[TILE + p]


@kernel
def store_waves(d, i, n, rows, Q, isotropic):
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
def add_initial_stress(F, initial, P):
    """P += F S0 on a tile."""
    for p in range(TILE):
        store(P, p, plus(load(P, p), matmul(load(F, p), load(initial, p))))


@kernel
def advance_step(
    law, step, d, signals, branches, half, first, last, places,
    gradient, jacobian, field_A, correction, pair_volume, volume, push, inverse, initial,
    sums, record, tiles, A, branch_sum, push_tile, inverse_tile,
):  # fmt: skip
    """Leapfrog: state of particles first .. last - 1 after a step [s] with their velocity gradients in its middle, and
    records of the new state.

    Arguments as in `point_update.update_tile`; fields (components, n): deformation gradient, jacobian (n,), A of the
    branches, correction, push and inverse of an updated reference, initial stress [Pa]; pair_volume, volume (n,) [m^3];
    those and tiles of what a scene lacks are None. half: 1/2, or 0 without reconstruction.

    Returns (whether all Jacobians are positive, energy dissipated in branches [J], greatest signal [sqrt(Pa)]).
    """
    sound, dissipated, greatest = True, 0.0, 0.0
    # out of their tuples once: each time costs a count of references
    tensor, symmetric, F, J, G, P, L, S, V = (
        places.tensor, places.symmetric, tiles.F, tiles.J, tiles.G, tiles.P, tiles.L, tiles.S, tiles.volume
    )  # fmt: skip
    Z, signal, lost, stress = tiles.impedance, tiles.signal, tiles.lost, tiles.initial
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        load_gradient(d, tensor, sums, correction, pair_volume, i, n, S, L, V, G)
        copy_in(F, tensor, gradient, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        if push is not None:
            copy_in(push_tile, tensor, push, i, n)
            copy_in(inverse_tile, tensor, inverse, i, n)
        update_tile(
            law, step, d == 2, signals, branches, F, G, A, branch_sum, push_tile, J, P, Z, signal, lost
        )  # fmt: skip
        if initial is not None:
            copy_in(stress, tensor, initial, i, n)
            add_initial_stress(F, stress, P)
        copy_out(gradient, i, n, F, tensor)
        if A is not None:
            copy_branches_out(field_A, i, n, A, symmetric)
            for p in range(n):
                dissipated += lost[p] * volume[i + p]
        store_record(d, half, i, n, record, inverse_tile, P, L, G, Z, S)
        copy(jacobian[i : i + n], J[:n])
        for p in range(n):
            sound = sound and J[p] > 0.0
            # max gives its second argument where either is not a number
            greatest = max(greatest, signal[p])
    return sound, dissipated, greatest


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
def advance_stage(
    law, keep, take, step, at_start, at_end, d, branches, half, isotropic, first, last, places,
    gradient, cofactors, jacobian, gradient_start, cofactors_start, jacobian_start, field_A,
    correction, pair_volume, volume, push, inverse, initial,
    sums, record, fast, slow, tiles, A, branch_sum, push_tile, inverse_tile,
):  # fmt: skip
    """SSP-RK3: one stage y <- keep y_start + take (y + step dy/dt) of particles first .. last - 1, with records of the
    state before it; at_start, at_end: whether it is the first or the last of the step.

    Arguments as in `point_update.stage_tile` and `advance_step`; fast, slow: rows of wave tensors, or None.

    Returns (whether all Jacobians are positive, dissipation rate of branches [W], greatest rho c_p^2 [Pa] of the state
    at the end of the step).
    """
    sound, rate, largest = True, 0.0, 0.0
    # out of their tuples once: each time costs a count of references
    tensor, symmetric, F, H, J, F0, H0, J0 = (
        places.tensor, places.symmetric, tiles.F, tiles.H, tiles.J, tiles.F_start, tiles.H_start, tiles.J_start
    )  # fmt: skip
    G, P, L, S, V, Z, lost = tiles.G, tiles.P, tiles.L, tiles.S, tiles.volume, tiles.impedance, tiles.lost
    Q_p, Q_s, bound, F_before = tiles.fast, tiles.slow, tiles.bound, tiles.initial
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        load_gradient(d, tensor, sums, correction, pair_volume, i, n, S, L, V, G)
        load_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        if at_start:
            store_deformation(F, H, J, tensor, gradient_start, cofactors_start, jacobian_start, i, n)
        load_start(F0, H0, J0, tensor, gradient_start, cofactors_start, jacobian_start, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        if push is not None:
            copy_in(push_tile, tensor, push, i, n)
            copy_in(inverse_tile, tensor, inverse, i, n)
        if initial is not None:
            for p in range(TILE):
                store(F_before, p, load(F, p))
        stage_tile(
            law, keep, take, step, branches, F, H, J, F0, H0, J0, G, A, branch_sum, push_tile, P, Q_p, Q_s, lost
        )  # fmt: skip
        if initial is not None:
            copy_in(S, tensor, initial, i, n)
            add_initial_stress(F_before, S, P)
        store_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        for p in range(n):
            sound = sound and J[p] > 0.0
        store_record(d, half, i, n, record, inverse_tile, P, L, G, Z, S)
        store_waves(d, i, n, fast, Q_p, isotropic)
        store_waves(d, i, n, slow, Q_s, 0.0)
        if A is not None:
            for p in range(n):
                rate += lost[p] * volume[i + p]
            if at_end:
                relax_over_step(branches, F, F0, A)
                copy_branches_out(field_A, i, n, A, symmetric)
        if at_end:
            waves_tile(law, d == 2, branches, F, H, J, A, branch_sum, Q_p, Q_s, bound)
            largest = largest_modulus(largest, Q_p, bound, n)
    return sound, rate, largest
