"""The elements of a mesh around each rank's own particles, wherever particles have gone."""

from itertools import combinations
from typing import Any, NamedTuple

import numpy as np
from mpi4py import MPI

from decomposition.migration import migrate
from decomposition.slices import Slices, count_before
from parsolid.collective import SolverError, anywhere, maximum
from parsolid.particles.meshes.slices import MeshSlices, part_of_body, whole_mesh
from parsolid.scene.validation_errors import SceneError


class ElementsAround(NamedTuple):
    """Elements with a node among a rank's particles, (kind, (elements, nodes)) by identifiers of particles; of the
    whole mesh the largest distance [m] of two nodes of an element, and kinds of elements of second order, of which the
    corners are taken; of the nodes that this rank keeps of the mesh, identifiers of the particles and the ranks that
    own them, -1 where the body has none."""

    blocks: list[tuple[str, np.ndarray]]
    extent: float
    of_second_order: tuple[str, ...]
    identifier: np.ndarray
    rank: np.ndarray


def elements_around(
    comm: Any, body: Any, dimension: int, identifiers: np.ndarray, meshes: dict[Any, MeshSlices] | None = None
) -> ElementsAround:
    """The elements of a body's mesh around this rank's particles, those of a kind in the order of the mesh.

    body: of a scene, with a mesh as its shape and particles on the nodes; identifiers (n,): of this rank's particles of
    the body; meshes: see `slices.whole_mesh`. Collective. Raises SolverError on all ranks for a mesh
    that cannot be read or is not that of the particles.
    """
    try:
        stated = body.shape.model
        mesh = part_of_body(whole_mesh(comm, stated, dimension, {} if meshes is None else meshes), stated)
    except SceneError as error:
        raise SolverError(f"bodies: {error.faults[0]}") from None
    local = mesh.local
    # nodes of elements are particles, in their order
    used = np.zeros(len(mesh.nodes), bool)
    used[mesh.nodes.deliver(local.nodes)["number"]] = True
    before, count = count_before(comm, int(used.sum()))
    first = comm.allreduce(int(identifiers.min(initial=np.iinfo(np.int64).max)), MPI.MIN)
    particles, owner = _owners(comm, count, identifiers - first)
    if particles != count or anywhere(comm, bool((owner < 0).any())):
        wanted = f"expected the mesh of the {particles} particles, found {count} nodes in {body.shape.model.file}"
        raise SolverError(f"bodies: {wanted}")
    kept = np.where(used, before + np.cumsum(used) - 1, -1)
    rank_of = np.full(len(used), -1, np.int64)
    rank_of[used] = Slices(comm, count).fetch(kept[used], owner)
    number, rank = mesh.nodes.fetch(local.nodes, kept), mesh.nodes.fetch(local.nodes, rank_of)
    blocks = []
    kinds = np.repeat([kind for kind, _ in local.blocks], [len(cells) for _, cells in local.blocks])
    for kind in dict.fromkeys(kind for kind, _ in local.blocks):
        cells = np.concatenate([own for other, own in local.blocks if other == kind])
        element = local.numbers[kinds == kind]
        ranks = np.sort(rank[cells], axis=1)
        another = np.ones(ranks.shape, bool)
        another[:, 1:] = ranks[:, 1:] != ranks[:, :-1]
        row, column = np.nonzero(another)
        come = migrate(comm, ranks[row, column], {"cells": number[cells[row]], "element": element[row]})
        if len(come["cells"]):
            blocks.append((kind, first + come["cells"][np.argsort(come["element"])]))
    identifier = np.where(used, first + kept, -1)
    # of all elements, the largest distance [m] of two nodes
    square, points = 0.0, mesh.local.points
    for _, cells in mesh.local.blocks:
        for i, j in combinations(range(cells.shape[1]), 2):
            square = max(square, float(((points[cells[:, i]] - points[cells[:, j]]) ** 2).sum(axis=1).max(initial=0.0)))
    return ElementsAround(blocks, float(np.sqrt(maximum(mesh.comm, square))), mesh.of_second_order, identifier, rank_of)


def shared_nodes(comm: Any, bodies: list[ElementsAround]) -> tuple[np.ndarray, np.ndarray]:
    """Nodes that several bodies of one mesh have: identifiers (k,) of this rank's particles there, and of all bodies'
    (k, bodies), -1 where a body has none. Collective."""
    identifier = np.stack([one.identifier for one in bodies], axis=1)
    rank = np.stack([one.rank for one in bodies], axis=1)
    node, body = np.nonzero((identifier >= 0) & ((identifier >= 0).sum(axis=1) > 1)[:, None])
    rows = {"own": identifier[node, body], "all": identifier[node]}
    come = migrate(comm, rank[node, body], rows)
    order = np.argsort(come["own"])
    return come["own"][order], come["all"][order]


def _owners(comm: Any, count: int, numbers: np.ndarray) -> tuple[int, np.ndarray]:
    """How many particles there are, and the ranks that own those of this rank's slice of `count`; -1: nobody does."""
    total = comm.allreduce(len(numbers))
    slices = Slices(comm, count)
    owner = np.full(len(slices), -1, np.int64)
    if not anywhere(comm, bool(len(numbers) and not 0 <= numbers.min() <= numbers.max() < count)):
        come = slices.deliver(numbers, rank=np.full(len(numbers), comm.rank))
        owner[come["number"]] = come["rank"]
    return total, owner
