"""SSP-RK3: a stage of particles whose neighbours stand in lists, as `list_update` takes a step of leapfrog."""

from parsolid.kernels import kernel
from parsolid.methods.tlsph.list_update import find_gradients, store_stresses
from parsolid.methods.tlsph.point_stages import load_start, relax_over_step, stage_tile, store_deformation
from parsolid.methods.tlsph.point_update import TILE, add_initial_stress, load, load_values, store
from parsolid.methods.tlsph.tile_fields import (
    copy_branches_in,
    copy_branches_out,
    copy_in,
    energy_lost,
    largest_modulus,
    load_deformation,
    tiles_in,
    waves_tile,
)


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

    Arguments as in `point_stages.stage_tile` and `list_update.advance_step`; fast, slow: rows of wave tensors, or None.

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
