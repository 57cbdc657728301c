"""Fragments, connected components of bonded particles: where loads on one do not balance, there is no solution unless
something holds it.

A direction u without stiffness keeps its part u . r of what is not balanced whatever a solver does.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import anywhere
from parsolid.solvers import unrestrained_modes

# fragments are looked at as many at most, the largest first
_MOST = 50


def fragments_of(bonds: Any) -> np.ndarray:
    """Of each owned particle (owned,) the least number of a particle, by rank and row, of its fragment. Collective."""
    from scipy import sparse

    owned, comm, halo = bonds.owned, bonds.comm, bonds.halo
    first = comm.exscan(owned) or 0
    labels = halo.with_ghosts(first + np.arange(owned, dtype=np.int64))
    ends = []
    for pairs, images, _ in bonds.lists:
        if images is None:
            a = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start))
            ends.append((a[pairs.weight != 0.0], pairs.neighbour[pairs.weight != 0.0]))
    a, b = (np.concatenate(one) for one in zip(*ends))
    graph = sparse.coo_array((np.ones(len(a), np.int8), (a, b)), (len(labels), len(labels)))
    _, here = sparse.csgraph.connected_components(graph, directed=False)
    while True:
        least = np.full(here.max(initial=-1) + 1, np.iinfo(np.int64).max)
        np.minimum.at(least, here, labels)
        changed = anywhere(comm, bool((least[here] != labels).any()))
        labels = halo.with_ghosts(least[here][:owned])
        if not changed:
            return np.asarray(labels[:owned])


def unbalanced_fragment(
    operator: Any, motions: np.ndarray, restraint: Callable[..., np.ndarray], residual: np.ndarray, target: float
) -> str:
    """Which fragment moves as a whole under more of a residual (n, d) [N] than the target [N], in words; or nothing.

    motions (k, n, d): rigid ones of all particles; restraint(motions, mask): see `preconditioner`. Collective.
    """
    comm, labels = operator.comm, fragments_of(operator.forces.bonds)
    known: dict[int, int] = {}
    for numbers, counts in comm.allgather(np.unique(labels, return_counts=True)):
        for number, count in zip(numbers.tolist(), counts.tolist()):
            known[number] = known.get(number, 0) + count
    places = operator.particles.owned_rows("reference_position")
    for number in sorted(known, key=lambda one: -known[one])[:_MOST]:
        mask = labels == number
        alone = motions * mask[:, None]
        loose = unrestrained_modes(comm, alone, restraint(alone, mask)) * operator.free
        parts = sums(comm, np.tensordot(loose, residual, 2))
        if np.linalg.norm(parts) > target:
            middle = sums(comm, places[mask].sum(axis=0)) / known[number]
            which = "of the bodies" if len(known) == 1 else f"of {len(known)} that no bond joins"
            around = ", ".join(f"{x:.4g}" for x in middle)
            return f"a piece {which}, {known[number]} particles around ({around}), that nothing holds against its loads"
    return ""
