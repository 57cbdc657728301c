"""Deformation and stress of particles whose neighbours stand in lists: from the rows of the gradient sweep to those of
the divergence sweep (`pairs.list_sweeps`), tile by tile."""

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.methods.tlsph.point_update import TILE, add_initial_stress, add_pressure, update_tile
from parsolid.methods.tlsph.tile_fields import (
    copy,
    copy_branches_in,
    copy_branches_out,
    copy_in,
    copy_out,
    energy_lost,
    tiles_in,
)
from parsolid.pairs.list_sweeps import (
    divergence_in_plane,
    divergence_in_space,
    gradient_in_plane,
    gradient_in_space,
    stress_divergence_in_plane,
    stress_divergence_in_space,
)
from parsolid.pairs.pair_list import PairList
from parsolid.pairs.rows_of_four import combine_rows, load_row, scale, store_row

_ZERO = (0.0, 0.0, 0.0, 0.0)


@kernel
def finish_gradients_in_space(i, n, half, operator, inverse, record, G):
    """G = S L^T / V of n particles from row i on into a tile, eq (70), and half of it (none of it, half = 0) into their
    records, in place of the sums S: L is symmetric only where spacings are equal.

    inverse (9, n): F_r^-1 of an updated reference, in which the gradient is G F_r^-1, or None.
    """
    for p in range(n):
        a = i + p
        S1, S2, S3 = load_row(record, a, 0), load_row(record, a, 4), load_row(record, a, 8)
        L1, L2, L3 = load_row(operator, a, 0), load_row(operator, a, 4), load_row(operator, a, 8)
        one_over_volume = L1[3]
        G1 = scale(one_over_volume, combine_rows(L1, S1, S2, S3))
        G2 = scale(one_over_volume, combine_rows(L2, S1, S2, S3))
        G3 = scale(one_over_volume, combine_rows(L3, S1, S2, S3))
        G[p], G[3 * TILE + p], G[6 * TILE + p] = G1[0], G1[1], G1[2]
        G[TILE + p], G[4 * TILE + p], G[7 * TILE + p] = G2[0], G2[1], G2[2]
        G[2 * TILE + p], G[5 * TILE + p], G[8 * TILE + p] = G3[0], G3[1], G3[2]
        if inverse is not None:
            K1 = combine_rows((inverse[0, a], inverse[3, a], inverse[6, a]), G1, G2, G3)
            K2 = combine_rows((inverse[1, a], inverse[4, a], inverse[7, a]), G1, G2, G3)
            K3 = combine_rows((inverse[2, a], inverse[5, a], inverse[8, a]), G1, G2, G3)
            G1, G2, G3 = K1, K2, K3
        store_row(record, a, 0, scale(half, G1))
        store_row(record, a, 4, scale(half, G2))
        store_row(record, a, 8, scale(half, G3))


@kernel
def finish_gradients_in_plane(i, n, half, operator, inverse, record, G):
    """`finish_gradients_in_space`, in plane strain; inverse (4, n) or None."""
    for p in range(n):
        a = i + p
        S11, S21, S12, S22 = load_row(record, a, 0)
        L11, L12, L21, L22 = load_row(operator, a, 0)
        one_over_volume = operator[a, 4]
        G11, G12 = one_over_volume * (S11 * L11 + S12 * L12), one_over_volume * (S11 * L21 + S12 * L22)
        G21, G22 = one_over_volume * (S21 * L11 + S22 * L12), one_over_volume * (S21 * L21 + S22 * L22)
        G[p], G[TILE + p], G[3 * TILE + p], G[4 * TILE + p] = G11, G12, G21, G22
        if inverse is not None:
            K11, K12, K21, K22 = inverse[0, a], inverse[1, a], inverse[2, a], inverse[3, a]
            G11, G12 = G11 * K11 + G12 * K21, G11 * K12 + G12 * K22
            G21, G22 = G21 * K11 + G22 * K21, G21 * K12 + G22 * K22
        store_row(record, a, 0, (half * G11, half * G21, half * G12, half * G22))


@kernel
def store_stresses_in_space(i, n, P, Z, operator, record):
    """P L and half impedances of n particles of a tile into their records, from row i on."""
    # first P alone: products with numbers out of tiles would be made by gathers, which take twice as long
    for p in range(n):
        a = i + p
        store_row(record, a, 12, (P[p], P[3 * TILE + p], P[6 * TILE + p], 0.0))
        store_row(record, a, 16, (P[TILE + p], P[4 * TILE + p], P[7 * TILE + p], 0.0))
        store_row(record, a, 20, (P[2 * TILE + p], P[5 * TILE + p], P[8 * TILE + p], 0.0))
    for p in range(n):
        a = i + p
        L1, L2, L3 = load_row(operator, a, 0), load_row(operator, a, 4), load_row(operator, a, 8)
        P1, P2, P3 = load_row(record, a, 12), load_row(record, a, 16), load_row(record, a, 20)
        store_row(record, a, 12, combine_rows((L1[0], L2[0], L3[0]), P1, P2, P3))
        store_row(record, a, 16, combine_rows((L1[1], L2[1], L3[1]), P1, P2, P3))
        store_row(record, a, 20, combine_rows((L1[2], L2[2], L3[2]), P1, P2, P3))
        record[a, 15], record[a, 19] = Z[p], Z[TILE + p]


@kernel
def store_stresses_in_plane(i, n, P, Z, operator, record):
    """`store_stresses_in_space`, in plane strain."""
    for p in range(n):
        a = i + p
        L11, L12, L21, L22 = load_row(operator, a, 0)
        P11, P12, P21, P22 = P[p], P[TILE + p], P[3 * TILE + p], P[4 * TILE + p]
        first, second = (P11 * L11 + P12 * L21, P21 * L11 + P22 * L21), (P11 * L12 + P12 * L22, P21 * L12 + P22 * L22)
        store_row(record, a, 4, (first[0], first[1], second[0], second[1]))
        record[a, 8], record[a, 9] = Z[p], Z[TILE + p]


@inlined
def find_gradients(d, pairs, i, n, motion, half, operator, inverse, record, G):
    """Velocity gradients of n particles from row i on into a tile and, times half, into their records."""
    if d == 3:
        gradient_in_space(pairs, i, i + n, motion, record)
        finish_gradients_in_space(i, n, half, operator, inverse, record, G)
    else:
        gradient_in_plane(pairs, i, i + n, motion, record)
        finish_gradients_in_plane(i, n, half, operator, inverse, record, G)


@inlined
def store_stresses(d, i, n, P, Z, operator, record):
    """P L and half impedances of n particles of a tile into their records, from row i on."""
    if d == 3:
        store_stresses_in_space(i, n, P, Z, operator, record)
    else:
        store_stresses_in_plane(i, n, P, Z, operator, record)


@kernel
def advance_step(
    law, step, d, signals, branches, half, first, last, places,
    gradient, jacobian, field_A, volume, push, inverse, initial,
    pairs, motion, operator, record, tiles, A, branch_sum, push_tile, carried, pressure, released,
):  # fmt: skip
    """Leapfrog: state of particles first .. last - 1 after a step [s] with their velocity gradients in its middle, and
    records of the new state.

    Arguments as in `point_update.update_tile`; fields (components, n): deformation gradient, jacobian (n,), A of the
    branches, push and inverse of an updated reference, initial stress [Pa]; volume (n,) [m^3]; operator, record:
    rows, see `list_sweeps`. Fields and tiles of what a scene lacks are None. half: 1/2, or 0 without reconstruction.
    pairs: a tuple without names, which a call takes faster. carried: see there; pressure, released: see
    `add_pressure`, or None.

    Returns (whether all Jacobians are positive, energy dissipated in branches [J], greatest signal [sqrt(Pa)]).
    """
    sound, dissipated, greatest, third = True, 0.0, 0.0, 0.0 if d == 2 else 1.0
    # out of their tuples once: each time costs a count of references
    tiles = tiles_in(tiles)
    tensor, symmetric, F, J, G, P, Z, signal, lost, stress = (
        places.tensor, places.symmetric, tiles.F, tiles.J, tiles.G, tiles.P, tiles.impedance, tiles.signal, tiles.lost,
        tiles.initial,
    )  # fmt: skip
    pairs = PairList(*pairs)
    if d == 2:
        G[:] = 0.0
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        find_gradients(d, pairs, i, n, motion, half, operator, inverse, record, G)
        copy_in(F, tensor, gradient, i, n)
        if push is not None:
            copy_in(push_tile, tensor, push, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        update_tile(
            law, step, third, signals, branches, F, G, A, branch_sum, push_tile, J, P, Z, signal, lost, carried, i, n
        )  # fmt: skip
        if A is not None:
            copy_branches_out(field_A, i, n, A, symmetric)
            dissipated += energy_lost(n, lost, volume, i)
        if initial is not None:
            copy_in(stress, tensor, initial, i, n)
            add_initial_stress(F, stress, P)
        if pressure is not None:
            add_pressure(F, J, pressure, released, i, n, P)
        copy_out(gradient, i, n, F, tensor)
        store_stresses(d, i, n, P, Z, operator, record)
        copy(jacobian[i : i + n], J[:n])
        for p in range(n):
            sound = sound and J[p] > 0.0
            # max gives its second argument where either is not a number
            greatest = max(greatest, signal[p])
    return sound, dissipated, greatest


@kernel
def add_forces(d, pairs, first, last, motion, record, fast, slow, force, heat):
    """Add the forces of the pairs in rows first .. last - 1 of a list; motion: None where nothing dissipates; heat: see
    `divergence_in_space`."""
    if motion is not None:
        if d == 3:
            divergence_in_space(pairs, first, last, motion, record, fast, slow, force, heat)
        else:
            divergence_in_plane(pairs, first, last, motion, record, fast, slow, force, heat)
    elif d == 3:
        stress_divergence_in_space(pairs, first, last, record, force)
    else:
        stress_divergence_in_plane(pairs, first, last, record, force)


@kernel
def find_forces(d, pairs, first, last, motion, record, fast, slow, force, heat, T, D, W):
    """Add the forces of the pairs of particles first .. last - 1 and put T and D [N] of these into fields (d, n), and
    what D takes [W] into W (1, n), None where nobody asks; pairs: as in `advance_step`.

    What the next step gathers in rows begins at zero again. Tile by tile, while rows are in the cache: those of a tile
    are complete, and nobody reads them any more, when their pairs and those of all rows before have been added.
    """
    pairs = PairList(*pairs)
    for i in range(first, last, TILE):
        end = min(i + TILE, last)
        add_forces(d, pairs, i, end, motion, record, fast, slow, force, heat)
        if heat is not None:
            for a in range(np.uintp(i), np.uintp(end)):
                W[0, a], heat[a] = heat[a], 0.0
        for a in range(np.uintp(i), np.uintp(end)):
            if d == 3:
                T[0, a], T[1, a], T[2, a] = force[a, 0], force[a, 1], force[a, 2]
                D[0, a], D[1, a], D[2, a] = force[a, 4], force[a, 5], force[a, 6]
                store_row(force, a, 0, _ZERO)
                store_row(force, a, 4, _ZERO)
                store_row(record, a, 0, _ZERO)
                store_row(record, a, 4, _ZERO)
                store_row(record, a, 8, _ZERO)
            else:
                T[0, a], T[1, a], D[0, a], D[1, a] = force[a, 0], force[a, 1], force[a, 2], force[a, 3]
                store_row(force, a, 0, _ZERO)
                store_row(record, a, 0, _ZERO)
