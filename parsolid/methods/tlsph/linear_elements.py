"""Linear elements on the nodes of bodies, from which PETSc makes a preconditioner of equilibria.

Elements of meshes that are no simplices, and cells of boxes, are split into those along the diagonal from their first
corner (H. W. Kuhn, IBM J. Res. Dev. 4 (1960) 518). Moduli are those at rest.
"""

from itertools import permutations, product
from math import factorial
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import Halo
from parsolid.collective import SolverError
from parsolid.pairs.mesh_weights import nodes_of_products
from parsolid.particles.meshes.elements import CORNERS, ELEMENTS
from parsolid.solvers.grid_levels import SOFTEST
from parsolid.solvers.petsc import Multigrid, start_petsc

# of numbers of nodes: more than the diagonal of a cell
_REACH = 1.8
# simplices whose stiffness is found at once
_CHUNK = 50_000
# of the diagonal, what holds matrices that are singular, as of bodies that contact alone holds
_FLOOR = 1e-7


class Simplices(NamedTuple):
    """rows (p,): of some particles among all that the rank owns; halo: `decomposition.halo.Halo` of them; corners (m,
    d + 1): places in that halo, of all simplices around owned particles."""

    rows: np.ndarray
    halo: Any
    corners: np.ndarray


class LinearElements:
    """Those of one rank's bodies; all methods are collective."""

    def __init__(self, system: Any, lame: np.ndarray, shear: np.ndarray) -> None:
        """system: `system.TotalLagrangianSPH`, set up; lame, shear (owned,) [Pa]. Raises SolverError on all ranks where
        bodies share nodes, or PETSc does not start."""
        if system.meshes is not None and system.meshes.shared is not None:
            expected = "method.linear_solver: expected 'embedded' with bodies that share nodes"
            raise SolverError(f"{expected}, found 'petsc'")
        self.system, self.shear, self.lame = system, shear, np.minimum(lame, SOFTEST * shear)
        self.PETSc = start_petsc(system.settings.petsc_options)
        self.multigrid: Multigrid | None = None
        self.simplices = [] if system.meshes is None else [self._of_meshes()]
        self.simplices += [] if system.boxes is None else [self._of_boxes()]

    def build(self, places: np.ndarray, free: np.ndarray, diagonal: np.ndarray, added: np.ndarray) -> Multigrid:
        """The preconditioner in present places (owned, d) [m]; free (owned, d) bool; diagonal (owned, d) [N/m]: of
        components that are not free; added (owned, d) [N/m]: what masses and tools add."""
        from scipy import sparse

        if self.multigrid is not None:
            self.multigrid.destroy()
        comm, (n, d) = self.system.comm, places.shape
        start, count = comm.exscan(n) or 0, comm.allreduce(n)
        held = (np.where(free, _FLOOR, 1.0) * diagonal + added).ravel()
        matrix = sparse.csr_array((held, (np.arange(n * d), np.arange(n * d) + start * d)), (n * d, count * d))
        for one in self.simplices:
            x, number, moduli, moves = (
                one.halo.with_ghosts(np.ascontiguousarray(values[one.rows]))
                for values in (
                    places,
                    np.arange(start, start + n, dtype=float),
                    np.stack((self.lame, self.shear), axis=1),
                    free.astype(float),
                )
            )
            for first in range(0, len(one.corners), _CHUNK):
                corners = one.corners[first : first + _CHUNK]
                parts = _stiffness(x, moves, moduli, corners)
                down, across = np.concatenate((one.rows, np.full(one.halo.ghosts, -1)))[corners], number[corners]
                matrix = matrix + _placed(parts, down, across.astype(np.int64), matrix.shape)
        self.multigrid = Multigrid(self.PETSc, comm, places, free, matrix)
        return self.multigrid

    def _of_meshes(self) -> Simplices:
        near, d = self.system.meshes.near, self.system.dimension
        found = [np.zeros((0, d + 1), np.int64)]
        for kind, cells in near.elements:
            nodes = nodes_of_products(kind, cells)
            simplex = ELEMENTS[kind].product is None
            found.append(nodes if simplex else _split(nodes[:, np.lexsort((CORNERS[d] > 0).T)]))
        return Simplices(np.arange(near.owned), near.halo, np.concatenate(found))

    def _of_boxes(self) -> Simplices:
        system, of, d = self.system, self.system.particles.owned_rows, self.system.dimension
        rows = np.concatenate([np.zeros(0, np.int64), *(np.arange(one.first, one.last) for one in system.boxes.blocks)])
        X, body = of("reference_position")[rows], of("body")[rows]
        number, shift = np.zeros(X.shape), 0
        for one, nodes in zip([one for one in system.lattice_bodies if one.box], system.boxes.nodes):
            here = body == one.body
            for k, planes in enumerate(map(np.asarray, nodes.places)):
                number[here, k] = np.searchsorted(0.5 * (planes[1:] + planes[:-1]), X[here, k])
            # no neighbours of nodes of other boxes
            number[here, 0] += shift
            shift += len(nodes.places[0]) + 2
        halo = Halo(system.comm, number, _REACH)
        whole = halo.with_ghosts(number).astype(np.int64)
        lower = whole.min(axis=0, initial=0)
        size = whole.max(axis=0, initial=0) - lower + 2
        keys = np.ravel_multi_index(tuple((whole - lower).T), tuple(size))
        order = np.argsort(keys)
        steps = np.array([bits[::-1] for bits in product((0, 1), repeat=d)])
        wanted = keys[:, None] + np.ravel_multi_index(tuple(steps.T), tuple(size))
        place = np.minimum(np.searchsorted(keys, wanted, sorter=order), max(len(keys) - 1, 0))
        cells = order[place] if len(keys) else np.zeros((0, 2**d), np.int64)
        there = (keys[cells] == wanted).all(axis=1) & (cells < len(rows)).any(axis=1)
        return Simplices(rows, halo, _split(cells[there]))


def _split(cells: np.ndarray) -> np.ndarray:
    """Corners (m, d + 1) of the simplices of cells (n, 2^d), whose corners differ along axis i where bit i of their
    number does; without those of wedges and pyramids that have a corner twice."""
    d = cells.shape[1].bit_length() - 1
    paths = [np.cumsum([0, *(1 << axis for axis in axes)]) for axes in permutations(range(d))]
    whole = np.concatenate([cells[:, path] for path in paths])
    inside = np.sort(whole, axis=1)
    return whole[(inside[:, 1:] != inside[:, :-1]).all(axis=1)]


def _stiffness(x: np.ndarray, moves: np.ndarray, moduli: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Blocks (m, d + 1, d + 1, d, d) [N/m] of simplices; x, moves (p, d), moduli (p, 2) of places in a halo."""
    d = x.shape[1]
    edges = x[corners[:, 1:]] - x[corners[:, :1]]
    volume = np.abs(np.linalg.det(edges)) / factorial(d)
    # simplices of four corners in a plane, of warped facets
    volume = np.where(volume > 1e-9 * np.abs(edges).max(axis=(1, 2)) ** d, volume, 0.0)
    edges[volume == 0.0] = np.eye(d)
    others = np.linalg.inv(edges).swapaxes(1, 2)
    slopes = np.concatenate((-others.sum(axis=1, keepdims=True), others), axis=1)
    lame, shear = (volume[:, None] * moduli[corners[:, 0]]).T
    both = np.einsum("mai,mbj->mabij", slopes, slopes)
    blocks = lame[:, None, None, None, None] * both + shear[:, None, None, None, None] * both.swapaxes(3, 4)
    along = shear[:, None, None] * np.einsum("mai,mbi->mab", slopes, slopes)
    blocks += along[..., None, None] * np.eye(d)
    moves = moves[corners]
    return blocks * moves[:, :, None, :, None] * moves[:, None, :, None, :]


def _placed(blocks: np.ndarray, down: np.ndarray, across: np.ndarray, shape: tuple[int, int]) -> Any:
    """Those of owned rows; down (m, d + 1): rows, -1 of ghosts, across (m, d + 1): rows of all ranks."""
    from scipy import sparse

    d = blocks.shape[3]
    rows = np.broadcast_to((down[:, :, None, None, None] * d + np.arange(d)[:, None]), blocks.shape)
    columns = np.broadcast_to(across[:, None, :, None, None] * d + np.arange(d), blocks.shape)
    own = rows >= 0
    return sparse.csr_array(sparse.coo_array((blocks[own], (rows[own], columns[own])), shape))
