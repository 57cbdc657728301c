"""Deformation and stress of boxes: velocity gradients along the axes and the new state, plane by plane while the plane
is in the cache."""

import numpy as np

from parsolid.kernels import kernel
from parsolid.methods.tlsph.list_update import add_initial_stress, load_start, store_deformation
from parsolid.methods.tlsph.point_update import (
    TILE,
    clear_sums,
    deform_tile,
    largest_modulus,
    load,
    relax_branch,
    relax_over_step,
    stage_tile,
    store,
    waves_tile,
)
from parsolid.methods.tlsph.tile_fields import copy_branches_in, copy_branches_out, copy_in, copy_out, load_deformation
from parsolid.pairs.box_planes import (
    dissipative_forces_in_plane,
    gradient_in_plane,
    place_of,
    stress_forces_in_plane,
)
from parsolid.pairs.box_weights import REACH


@kernel
def take_extremes(n, J, signal, least, most):
    """Least J and greatest signal so far of n places of tiles, one by one, which vectorises; what is not a number
    stays."""
    for p in range(np.uintp(n)):
        least[p] = least[p] if (least[p] <= J[p]) | (least[p] != least[p]) else J[p]
        most[p] = most[p] if (most[p] >= signal[p]) | (most[p] != most[p]) else signal[p]


@kernel
def add_losses(n, total, lost, volume, row):
    """total (n,) += lost volume, of volumes from a row on."""
    first = np.uintp(row)
    for p in range(np.uintp(n)):
        total[p] += lost[p] * volume[first + p]


@kernel
def store_waves(Z, place, n, fast, slow, count):
    """Rows of tiles of pressure and shear waves, `count` of each, into Z from a place on."""
    start = np.uintp(place)
    for k in range(count):
        row = np.uintp(k * TILE)
        for p in range(np.uintp(n)):
            Z[k, start + p], Z[count + k, start + p] = fast[row + p], slow[row + p]


@kernel
def store_numbers(field, row, n, numbers):
    """Numbers of a tile into a field (n,) from a row on."""
    first = np.uintp(row)
    for p in range(np.uintp(n)):
        field[first + p] = numbers[p]


@kernel
def advance_box(
    box, scratch, law, step, d, signals, branches, places, v, gradient, jacobian, field_A, volume, initial, G, P, Z,
    tiles, A, branch_sum, x, force, dissipation,
):  # fmt: skip
    """Leapfrog: state of the nodes of a box after a step [s] with their velocity gradients in its middle.

    Fields (components, n): gradient, the deformation gradient F, jacobian (n,), field_A of the branches, volume (n,)
    [m^3], initial stress [Pa]; box arrays: v, and G, P, Z, which are filled. Z: None without dissipation. force,
    dissipation (d, n) [N]: fields of V Div P and V D, which are filled while stresses are in the cache; None where
    planes of other ranks are needed first. Otherwise as in `list_update.advance_step`, as is what is returned.
    """
    values = scratch.values
    row, least, most, dissipated = box.first, np.ones(TILE), np.zeros(TILE), np.zeros(TILE)
    # out of their tuples once: each time costs a count of references
    tensor, symmetric, tile_F, tile_G, tile_P, tile_J, tile_Z = (
        places.tensor, places.symmetric, tiles.F, tiles.G, tiles.P, tiles.J, tiles.impedance
    )  # fmt: skip
    slow_Z, signal, lost, stress = tile_Z[TILE:], tiles.signal, tiles.lost, tiles.initial
    moduli, times, weights, losses = branches.moduli, branches.times, branches.weights, branches.losses
    total, third = 0.0, 0.0 if d == 2 else 1.0
    for k in range(moduli.size):
        total += moduli[k]
    if d == 2:
        tile_G[:] = 0.0
    for i in range(box.first_plane, box.last_plane):
        of_pairs, of_stresses = place_of(box.pairs, i), place_of(box.stresses, i)
        gradient_in_plane(box, i, v, values, G, of_pairs + box.first_node)
        for a in range(box.first_node, box.last_node, TILE):
            n, place = min(TILE, box.last_node - a), of_pairs + a
            copy_in(tile_G, tensor, G, place, n)
            copy_in(tile_F, tensor, gradient, row, n)
            if A is not None:
                copy_branches_in(A, symmetric, field_A, row, n)
                clear_sums(branch_sum, lost)
                for k in range(moduli.size):
                    relax_branch(
                        moduli[k], times[k], (weights[k, 0], weights[k, 1], weights[k, 2]),
                        (losses[k, 0], losses[k, 1], losses[k, 2]), step, tile_F, tile_G,
                        A[6 * TILE * k : 6 * TILE * (k + 1)], branch_sum, lost,
                    )  # fmt: skip
            # not `update_tile`: functions that call others count references of their arrays, once a tile
            deform_tile(
                law, step, total, third, signals, tile_F, tile_G, branch_sum, None, tile_J, tile_P, tile_Z, signal
            )
            if initial is not None:
                copy_in(stress, tensor, initial, row, n)
                add_initial_stress(tile_F, stress, tile_P)
            copy_out(gradient, row, n, tile_F, tensor)
            copy_out(P, of_stresses + a, n, tile_P, tensor)
            if Z is not None:
                store_waves(Z, place, n, tile_Z, slow_Z, 1)
            if A is not None:
                copy_branches_out(field_A, row, n, A, symmetric)
                add_losses(n, dissipated, lost, volume, row)
            store_numbers(jacobian, row, n, tile_J)
            take_extremes(n, tile_J, signal, least, most)
            row += n
        if force is not None:
            if Z is not None and i > 0:
                dissipative_forces_in_plane(box, scratch, i - 1, v, x, G, Z, None, dissipation)
            if i >= REACH:
                stress_forces_in_plane(box, i - REACH, P, values, force)
    if force is not None:
        if Z is not None:
            dissipative_forces_in_plane(box, scratch, box.last_plane - 1, v, x, G, Z, None, dissipation)
        for i in range(max(0, box.last_plane - REACH), box.last_plane):
            stress_forces_in_plane(box, i, P, values, force)
    sound, lost_energy, greatest = True, 0.0, 0.0
    for p in range(TILE):
        sound = sound and least[p] > 0.0
        lost_energy += dissipated[p]
        # max gives its second argument where either is not a number
        greatest = max(greatest, most[p])
    return sound, lost_energy, greatest


@kernel
def advance_box_stage(
    box, scratch, law, keep, take, step, at_start, at_end, d, branches, places,
    v, gradient, cofactors, jacobian, gradient_start, cofactors_start, jacobian_start, field_A,
    volume, initial, G, P, Z, tiles, A, branch_sum,
):  # fmt: skip
    """SSP-RK3: one stage of the nodes of a box; box arrays and fields as in `advance_box`, else as in
    `list_update.advance_stage`. Z (2 d, places): halves of the density times the moduli of pressure and shear waves
    along each axis."""
    sound, rate, largest, row = True, 0.0, 0.0, box.first
    values = scratch.values
    tensor, symmetric, tile_F, tile_H, tile_J, F_start, H_start, J_start = (
        places.tensor, places.symmetric, tiles.F, tiles.H, tiles.J, tiles.F_start, tiles.H_start, tiles.J_start
    )  # fmt: skip
    tile_G, tile_P, fast, slow, bound = tiles.G, tiles.P, tiles.fast, tiles.slow, tiles.bound
    lost, F_before, stress = tiles.lost, tiles.initial, tiles.S
    if d == 2:
        tile_G[:] = 0.0
    for i in range(box.first_plane, box.last_plane):
        of_pairs, of_stresses = place_of(box.pairs, i), place_of(box.stresses, i)
        gradient_in_plane(box, i, v, values, G, of_pairs + box.first_node)
        for a in range(box.first_node, box.last_node, TILE):
            n, place = min(TILE, box.last_node - a), of_pairs + a
            copy_in(tile_G, tensor, G, place, n)
            load_deformation(tile_F, tile_H, tile_J, tensor, gradient, cofactors, jacobian, row, n)
            if at_start:
                store_deformation(
                    tile_F, tile_H, tile_J, tensor, gradient_start, cofactors_start, jacobian_start, row, n
                )
            load_start(F_start, H_start, J_start, tensor, gradient_start, cofactors_start, jacobian_start, row, n)
            if A is not None:
                copy_branches_in(A, symmetric, field_A, row, n)
            if initial is not None:
                for p in range(TILE):
                    store(F_before, p, load(tile_F, p))
            stage_tile(
                law, keep, take, step, branches, tile_F, tile_H, tile_J, F_start, H_start, J_start, tile_G,
                A, branch_sum, None, tile_P, fast, slow, lost,
            )  # fmt: skip
            if initial is not None:
                copy_in(stress, tensor, initial, row, n)
                add_initial_stress(F_before, stress, tile_P)
            store_deformation(tile_F, tile_H, tile_J, tensor, gradient, cofactors, jacobian, row, n)
            copy_out(P, of_stresses + a, n, tile_P, tensor)
            if Z is not None:
                store_waves(Z, place, n, fast, slow, d)
            for p in range(n):
                sound = sound and tile_J[p] > 0.0
            if A is not None:
                for p in range(n):
                    rate += lost[p] * volume[row + p]
                if at_end:
                    relax_over_step(branches, tile_F, F_start, A)
                    copy_branches_out(field_A, row, n, A, symmetric)
            if at_end:
                waves_tile(law, d == 2, branches, tile_F, tile_H, tile_J, A, branch_sum, fast, slow, bound)
                largest = largest_modulus(largest, fast, bound, n)
            row += n
    return sound, rate, largest
