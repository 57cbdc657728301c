"""Tiles: the state of 32 particles in flat arrays, on which kernels work.

Component c of particle p stands at c * TILE + p, or the tile's rows at row * TILE + p. Flat tiles stay in the
first-level cache, and LLVM sees that their rows do not overlap, without which it does not vectorise loops over
particles. Tensors are tuples of `parsolid.tensors`; `at` is where their first component stands.
"""

import numpy as np

from parsolid.kernels import inlined

TILE = 32


@inlined
def load(tile, at):
    """General tensor, nine components."""
    return (tile[at], tile[at + TILE], tile[at + 2 * TILE], tile[at + 3 * TILE], tile[at + 4 * TILE],
            tile[at + 5 * TILE], tile[at + 6 * TILE], tile[at + 7 * TILE], tile[at + 8 * TILE])  # fmt: skip


@inlined
def store(tile, at, A):
    """Put a general tensor into a tile."""
    tile[at], tile[at + TILE], tile[at + 2 * TILE] = A[0], A[1], A[2]
    tile[at + 3 * TILE], tile[at + 4 * TILE], tile[at + 5 * TILE] = A[3], A[4], A[5]
    tile[at + 6 * TILE], tile[at + 7 * TILE], tile[at + 8 * TILE] = A[6], A[7], A[8]


@inlined
def load_symmetric(tile, at):
    """Symmetric tensor, six components."""
    return (tile[at], tile[at + TILE], tile[at + 2 * TILE], tile[at + 3 * TILE], tile[at + 4 * TILE],
            tile[at + 5 * TILE])  # fmt: skip


@inlined
def store_symmetric(tile, at, S):
    """Put a symmetric tensor into a tile."""
    tile[at], tile[at + TILE], tile[at + 2 * TILE] = S[0], S[1], S[2]
    tile[at + 3 * TILE], tile[at + 4 * TILE], tile[at + 5 * TILE] = S[3], S[4], S[5]


@inlined
def load_vector(tile, at):
    """Three components."""
    return (tile[at], tile[at + TILE], tile[at + 2 * TILE])


@inlined
def store_vector(tile, at, u):
    """Put three components into a tile."""
    tile[at], tile[at + TILE], tile[at + 2 * TILE] = u[0], u[1], u[2]


@inlined
def load_rows(field, first, count, tile, row):
    """All components of a field (components, particles), of particles first .. first + count - 1, into rows of a
    tile."""
    # unsigned: numba asks of every signed index whether it counts from the end, which takes six times as long
    start = np.uintp(first)
    for c in range(field.shape[0]):
        at = np.uintp((row + c) * TILE)
        for p in range(np.uintp(count)):
            tile[at + p] = field[c, start + p]


@inlined
def store_rows(field, first, count, tile, row):
    """The way back of `load_rows`."""
    start = np.uintp(first)
    for c in range(field.shape[0]):
        at = np.uintp((row + c) * TILE)
        for p in range(np.uintp(count)):
            field[c, start + p] = tile[at + p]


@inlined
def load_placed(field, places, first, count, tile, row):
    """As `load_rows`, component c into row + places[c]: tensors of the plane into those of space."""
    start = np.uintp(first)
    for c in range(places.size):
        at = np.uintp((row + places[c]) * TILE)
        for p in range(np.uintp(count)):
            tile[at + p] = field[c, start + p]


@inlined
def store_placed(field, places, first, count, tile, row):
    """The way back of `load_placed`."""
    start = np.uintp(first)
    for c in range(places.size):
        at = np.uintp((row + places[c]) * TILE)
        for p in range(np.uintp(count)):
            field[c, start + p] = tile[at + p]
