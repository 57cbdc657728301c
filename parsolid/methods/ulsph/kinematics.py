"""Velocity gradients of 32 particles at a time, from the sums of the first sweep, and what follows from them alone:
the correction B of gradients, the density, the deviator turned with the spin, the strain increment.

Tiles are those of `parsolid.tiles`.
"""

import numpy as np

from parsolid.elementary import exp
from parsolid.kernels import inlined
from parsolid.materials.plastic.tile_update import BACK_STRESS, DEVIATOR, STRAIN, deviatoric_strain
from parsolid.tensors import (
    add_spherical,
    combine_symmetric,
    congruence,
    contract_symmetric,
    general,
    inverse_symmetric,
    matmul,
    spin_rotation,
    times,
    times_symmetric,
    trace,
    transpose,
)
from parsolid.tiles import TILE, load, load_rows, load_symmetric, store, store_rows, store_symmetric

# rows of the tile: L m rho, then L [1/s]; moment m rho, then B; B for the forces; B of the last step;
# 1/(m rho); growth of the density over half a step
GRADIENT, CORRECTION, CARRIED, LAST, INVERSE, GROWTH, ROWS = 0, 9, 15, 21, 27, 28, 29
# of the moment, below the rounding of its sum, so that it has an inverse
_NEGLIGIBLE = 1e-14
# by how much of its norm B is carried on at most
_MOST_CHANGE = 0.25


@inlined
def load_rates(rates, mass, density, in_plane, deleted, first, count, tile):
    """Sums of the first sweep into a tile; gradients are 0 of particles that were deleted, None where none ever is."""
    tile[:] = 0.0
    for p in range(TILE):
        tile[INVERSE * TILE + p] = 1.0
    for p in range(count):
        a = np.uintp(first + p)
        if in_plane is not None:
            L = (rates[a, 0], rates[a, 2], 0.0, rates[a, 1], rates[a, 3], 0.0, 0.0, 0.0, 0.0)
            moment = (rates[a, 4], rates[a, 5], 0.0, rates[a, 6], 0.0, 0.0)
        else:
            L = (rates[a, 0], rates[a, 4], rates[a, 8], rates[a, 1], rates[a, 5], rates[a, 9],
                 rates[a, 2], rates[a, 6], rates[a, 10])  # fmt: skip
            moment = (rates[a, 3], rates[a, 12], rates[a, 13], rates[a, 7], rates[a, 11], rates[a, 14])
        if deleted is not None and deleted[0, a] > 0.0:
            L = times(0.0, L)
        tile[INVERSE * TILE + p] = 1.0 / (mass[0, a] * density[0, a])
        store(tile, GRADIENT * TILE + p, L)
        store_symmetric(tile, CORRECTION * TILE + p, moment)


@inlined
def find_gradients(step, most, in_plane, tile):
    """B, L and the growth of the density over half a step [s].

    B is the inverse of the moment, scaled so that its norm is at most `most`, None where gradients are not corrected.
    Scaled, not replaced: sigma B A stays symmetric, so that angular momentum is kept where neighbours are few, and B
    stays bounded where they are in a line or a plane. It is of the middle of the step, and so is its density.
    """
    for p in range(TILE):
        inverse = tile[INVERSE * TILE + p]
        B = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
        if most is not None:
            A = add_spherical(times_symmetric(inverse, load_symmetric(tile, CORRECTION * TILE + p)), _NEGLIGIBLE)
            if in_plane is not None:
                A = (A[0], A[1], 1.0, A[3], A[4], A[5])
            B = inverse_symmetric(A)
            B = times_symmetric(min(most / contract_symmetric(B, B) ** 0.5, 1.0), B)
        L = matmul(times(inverse, load(tile, GRADIENT * TILE + p)), general(B))
        growth = exp(-0.5 * step * trace(L))
        store(tile, GRADIENT * TILE + p, L)
        store_symmetric(tile, CORRECTION * TILE + p, times_symmetric(growth, B))
        tile[GROWTH * TILE + p] = growth


@inlined
def carry_on_correction(after, since, tile):
    """B for forces that act a time `after` [s] after its own, from that of a time `since` before, linearly."""
    for p in range(TILE):
        B, last = load_symmetric(tile, CORRECTION * TILE + p), load_symmetric(tile, LAST * TILE + p)
        change = combine_symmetric(1.0, B, -1.0, last)
        # neighbours that come or go change it at once
        most = _MOST_CHANGE * (contract_symmetric(B, B) / max(contract_symmetric(change, change), 1e-300)) ** 0.5
        factor = min(after / max(since, 1e-300), most)
        store_symmetric(tile, CARRIED * TILE + p, combine_symmetric(1.0, B, factor, change))


@inlined
def turn_deviator(step, tile, back_stress, state):
    """DEVIATOR and STRAIN of a tile of `tile_update` after a step [s] in Jaumann's rate: S turned with the spin, half
    of dev D dt before the turn and half after it. back_stress: not None where BACK_STRESS turns with it."""
    for p in range(TILE):
        L = load(tile, GRADIENT * TILE + p)
        turn = spin_rotation(L, step)
        store_symmetric(state, STRAIN * TILE + p, deviatoric_strain(turn, L, step))
        store_symmetric(state, DEVIATOR * TILE + p, congruence(turn, load_symmetric(state, DEVIATOR * TILE + p)))
        if back_stress is not None:
            store_symmetric(
                state, BACK_STRESS * TILE + p, congruence(turn, load_symmetric(state, BACK_STRESS * TILE + p))
            )


@inlined
def store_pair_stress(state, pressure_row, tile, correction_row, density, in_plane, first, count, pair_stress):
    """sigma B/rho^2 of a tile, with DEVIATOR, a row of pressures and rows of B, into the particles' columns; takes the
    place of L in the tile."""
    load_rows(density, first, count, tile, INVERSE)
    for p in range(TILE):
        S = load_symmetric(state, DEVIATOR * TILE + p)
        S = general(add_spherical(S, -state[pressure_row * TILE + p]))
        factor = 1.0 / (tile[INVERSE * TILE + p] * tile[INVERSE * TILE + p])
        P = matmul(S, general(times_symmetric(factor, load_symmetric(tile, correction_row * TILE + p))))
        columns = transpose(P)
        if in_plane is not None:
            columns = (P[0], P[3], P[1], P[4], 0.0, 0.0, 0.0, 0.0, 0.0)
        store(tile, GRADIENT * TILE + p, columns)
    store_rows(pair_stress, first, count, tile, GRADIENT)
