"""Fragments, connected components of bonded particles: where loads on one do not balance, there is no solution unless
something holds it.

A direction u without stiffness keeps its part u . r of what is not balanced whatever a solver does.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.reduction import sums
from decomposition.slices import Slices
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
    total, largest = largest_fragments(comm, labels)
    places = operator.particles.owned_rows("reference_position")
    for number, count in largest:
        mask = labels == number
        alone = motions * mask[:, None]
        loose = unrestrained_modes(comm, alone, restraint(alone, mask)) * operator.free
        parts = sums(comm, np.tensordot(loose, residual, 2))
        if np.linalg.norm(parts) > target:
            middle = sums(comm, places[mask].sum(axis=0)) / count
            which = "of the bodies" if total == 1 else f"of {total} that no bond joins"
            around = ", ".join(f"{x:.4g}" for x in middle)
            return f"a piece {which}, {count} particles around ({around}), that nothing holds against its loads"
    return ""


def largest_fragments(comm: Any, labels: np.ndarray) -> tuple[int, list[tuple[int, int]]]:
    """How many fragments there are, and label and particles of the largest; labels: of `fragments_of`. Collective."""
    slices = Slices(comm, comm.allreduce(len(labels)))
    numbers, counts = np.unique(labels, return_counts=True)
    come = slices.deliver(numbers, count=counts)
    count = np.zeros(len(slices), np.int64)
    np.add.at(count, come["number"], come["count"])
    here = np.flatnonzero(count)
    here = here[np.argsort(-count[here], kind="stable")[:_MOST]]
    mine = list(zip((slices.first + here).tolist(), count[here].tolist()))

    def larger(one: list[tuple[int, int]], other: list[tuple[int, int]]) -> list[tuple[int, int]]:
        return sorted(one + other, key=lambda fragment: (-fragment[1], fragment[0]))[:_MOST]

    return comm.allreduce(np.count_nonzero(count)), comm.allreduce(mine, larger)
