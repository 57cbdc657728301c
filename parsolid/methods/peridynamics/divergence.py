"""The divergence of a displacement at particles, as a sparse matrix over the particles of all ranks."""

from typing import Any

import numpy as np

from parsolid.pairs.lists import images_of, mutual


def divergence_of_components(bond_system: Any, dimension: int) -> Any:
    """D (particles of all ranks, owned d) [1/m] of this rank's components: (D u)_a = tr G_a, see `correspondence`.

    Particles are numbered by rank, then row. Collective.
    """
    from scipy import sparse

    comm, owned = bond_system.comm, bond_system.owned
    counts = np.array(comm.allgather(owned))
    first, count = int(counts[: comm.rank].sum()), int(counts.sum())
    numbers = bond_system.halo.with_ghosts(first + np.arange(owned, dtype=np.int64))
    inverse = bond_system.weights.inverse_shape[:, :dimension, :dimension] / bond_system.volume[:owned, None, None]
    parts = []
    for pairs, places in bond_system.lists():
        a = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start))
        b, R, T = pairs.neighbour, places.reflections[places.code], places.shifts[places.code]
        X = bond_system.positions
        xi = R[:, :dimension] * X[b][:, :dimension] + T[:, :dimension] - X[a][:, :dimension]
        images, Q = images_of(pairs), np.ones(xi.shape)
        if images is not None:
            Q = bond_system.codes.signs[images.code, :dimension]
        g = pairs.weight[:, None] * xi
        parts.append((a, b, np.einsum("kij,kj->ki", inverse[a], g), Q))
        if mutual(pairs):
            parts.append((b, a, np.einsum("kij,kj->ki", inverse[b], -g), Q))
    a, b, g, Q = (np.concatenate(arrays) for arrays in zip(*parts))
    rows, across = np.repeat(first + a, dimension), np.arange(dimension)
    there, here = numbers[b][:, None] * dimension + across, (first + a)[:, None] * dimension + across
    entries = np.concatenate(((Q * g).ravel(), -g.ravel()))
    places_of = (np.concatenate((rows, rows)), np.concatenate((there.ravel(), here.ravel())))
    mine = sparse.coo_array((entries, places_of), (count, count * dimension)).tocsr()
    whole = sum(comm.allgather(mine), start=sparse.csr_array(mine.shape))
    return whole[:, first * dimension : (first + owned) * dimension]
