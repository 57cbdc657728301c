"""SSP-RK3: a stage of boxes, plane by plane, as `box_bodies` takes a step of leapfrog."""

from parsolid.kernels import kernel
from parsolid.methods.tlsph.point_stages import load_start, relax_over_step, stage_tile, store_deformation
from parsolid.methods.tlsph.point_update import TILE, add_initial_stress, load, load_values, store
from parsolid.methods.tlsph.tile_fields import (
    copy_branches_in,
    copy_branches_out,
    copy_in,
    copy_out,
    energy_lost,
    largest_modulus,
    load_deformation,
    store_waves,
    tiles_in,
    waves_tile,
)
from parsolid.pairs.box_planes import gradient_in_plane, place_of, reduce_edges


@kernel
def advance_box_stage(
    box, scratch, law, keep, take, step, at_start, at_end, d, branches, places,
    v, gradient, cofactors, jacobian, gradient_start, cofactors_start, jacobian_start, field_A,
    volume, initial, G, P, Z, tiles, A, branch_sum, of_each, edges, left,
):  # fmt: skip
    """SSP-RK3: one stage of the nodes of a box; box arrays and fields as in `box_bodies.advance_box`, else as in
    `list_stages.advance_stage`, whose `values` are `of_each` here. Z (2 d, places): halves of the density times the
    moduli of pressure and shear waves along each axis. edges, left: see `reduce_edges`."""
    sound, rate, largest, row = True, 0.0, 0.0, box.first
    values, tiles = scratch.values, tiles_in(tiles)
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
            if of_each is not None:
                load_values(of_each, row, n)
            stage_tile(
                law, keep, take, step, branches, tile_F, tile_H, tile_J, F_start, H_start, J_start, tile_G,
                A, branch_sum, None, tile_P, fast, slow, lost, of_each,
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
                rate += energy_lost(n, lost, volume, row)
                if at_end:
                    relax_over_step(branches, tile_F, F_start, A)
                    copy_branches_out(field_A, row, n, A, symmetric)
            if at_end:
                waves_tile(law, d == 2, branches, tile_F, tile_H, tile_J, A, branch_sum, fast, slow, bound, of_each)
                largest = largest_modulus(largest, fast, bound, n)
            row += n
        plane_row = row - box.last_node + box.first_node
        reduce_edges(edges, left, plane_row, row, of_stresses + box.first_node, P)
        if Z is not None:
            reduce_edges(edges, left, plane_row, row, of_pairs + box.first_node, Z)
    return sound, rate, largest
