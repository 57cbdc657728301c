"""The elements of a mesh around each rank's own particles: read by one rank, which sends every rank those alone."""

from itertools import combinations
from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import minimum, raise_together
from parsolid.scene.mesh import read_mesh, used_nodes
from parsolid.scene.validation_errors import SceneError

_READER = 0


class ElementsAround(NamedTuple):
    """Elements with a node among a rank's particles, (kind, (elements, nodes)) by identifiers of particles; of the
    whole mesh the largest distance [m] of two nodes of an element, and kinds of elements of second order, of which the
    corners are taken."""

    blocks: list[tuple[str, np.ndarray]]
    extent: float
    of_second_order: tuple[str, ...]


def elements_around(comm: Any, body: Any, dimension: int, identifiers: np.ndarray) -> ElementsAround:
    """The elements of a body's mesh around this rank's particles.

    body: of a scene, with a mesh as its shape and particles on the nodes; identifiers (n,): of this rank's particles of
    the body. All ranks get the elements in the order of the mesh. Collective. Raises SolverError on all ranks for a
    mesh that cannot be read or is not that of the particles.
    """
    first = int(minimum(comm, float(identifiers.min(initial=np.iinfo(np.int64).max))))
    gathered = comm.gather(identifiers, _READER)
    pieces: list[Any] = []
    fault: str | None = None
    of_mesh: tuple[float, tuple[str, ...]] = (0.0, ())
    if comm.rank == _READER:
        try:
            mesh = read_mesh(body.shape.model.file, body.shape.model.scale, dimension)
            points, blocks = mesh.points, mesh.blocks
            pieces, of_mesh = _pieces(points, blocks, first, gathered), (_extent(points, blocks), mesh.of_second_order)
            if not pieces:
                wanted, found = sum(len(own) for own in gathered), len(used_nodes(points, blocks))
                fault = f"bodies: expected the mesh of the {wanted} particles, found {found} nodes in "
                fault += str(body.shape.model.file)
        except SceneError as error:
            fault = f"bodies: {error.faults[0]}"
    raise_together(comm, fault)
    mine = comm.scatter(pieces if comm.rank == _READER else None, _READER)
    return ElementsAround([(kind, cells) for kind, cells in mine if len(cells)], *comm.bcast(of_mesh, _READER))


def _extent(points: np.ndarray, blocks: Any) -> float:
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
