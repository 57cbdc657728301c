"""The elements of a mesh around each rank's own particles: read by one rank, which sends every rank those alone."""

from itertools import combinations
from typing import Any

import numpy as np

from parsolid.collective import minimum, raise_together
from parsolid.scene.mesh import read_mesh, used_nodes
from parsolid.scene.validation_errors import SceneError

_READER = 0
_NOBODY = np.iinfo(np.int64).max


def elements_around(
    comm: Any, body: Any, dimension: int, identifiers: np.ndarray
) -> tuple[list[tuple[str, np.ndarray]], float]:
    """Blocks (kind, (elements, nodes)) of elements with a node among this rank's particles, by their identifiers, and
    the largest distance [m] of two nodes of an element of the mesh.

    body: of a scene, with a mesh as its shape and particles on the nodes; identifiers (n,): of this rank's particles of
    the body. All ranks get the elements in the order of the mesh. Collective. Raises SolverError on all ranks for a
    mesh that cannot be read or is not that of the particles.
    """
    first = int(minimum(comm, float(identifiers.min(initial=_NOBODY))))
    gathered = comm.gather(identifiers, _READER)
    pieces: list[Any] = []
    fault, extent = None, 0.0
    if comm.rank == _READER:
        try:
            points, blocks, *_ = read_mesh(body.shape.model.file, body.shape.model.scale, dimension)
            pieces, extent = _pieces(points, blocks, first, gathered), _largest_extent(points, blocks)
            if not pieces:
                wanted, found = sum(len(own) for own in gathered), len(used_nodes(points, blocks))
                fault = f"bodies: expected the mesh of the {wanted} particles, found {found} nodes in "
                fault += str(body.shape.model.file)
        except SceneError as error:
            fault = f"bodies: {error.faults[0]}"
    raise_together(comm, fault)
    mine = comm.scatter(pieces if comm.rank == _READER else None, _READER)
    return [(kind, cells) for kind, cells in mine if len(cells)], float(comm.bcast(extent, _READER))


def _largest_extent(points: np.ndarray, blocks: Any) -> float:
    """Of all elements, the largest distance [m] of two nodes."""
    square = 0.0
    for _, cells in blocks:
        for i, j in combinations(range(cells.shape[1]), 2):
            square = max(square, float(((points[cells[:, i]] - points[cells[:, j]]) ** 2).sum(axis=1).max(initial=0.0)))
    return float(np.sqrt(square))


def _pieces(points: np.ndarray, blocks: Any, first: int, gathered: list[np.ndarray]) -> list[Any]:
    """Blocks of each rank; nothing where nodes and particles are not the same."""
    used = used_nodes(points, blocks)
    if sum(len(own) for own in gathered) != len(used):
        return []
    number = np.full(len(points), -1, np.int64)
    number[used] = np.arange(len(used))
    owner = np.full(len(used), -1, np.int32)
    for rank, own in enumerate(gathered):
        owner[own - first] = rank
    if (owner < 0).any():
        return []
    of_particles = [(kind, number[cells]) for kind, cells in blocks]
    return [
        [(kind, first + cells[(owner[cells] == rank).any(axis=1)]) for kind, cells in of_particles]
        for rank in range(len(gathered))
    ]
