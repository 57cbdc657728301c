"""A preconditioner of two levels for stiffnesses of particles: the particles themselves, and a grid over all of them.

M^-1 r = D^-1 r + P A^-1 P^T r (additive Schwarz: Smith, Bjorstad and Gropp, Domain Decomposition, 1996, chapter 2).
P takes multilinear functions of a grid to the particles, A is their stiffness by quadrature over the particles, as in
the material point method. A nonlocal stiffness is nearly a multiple of 1 for all that varies within the horizon, so
that a grid a little wider than that leaves nothing which takes many iterations. A is factorised on every rank; its size
is bounded, not that of the scene.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from decomposition.compiled import compiled
from decomposition.reduction import sums
from parsolid.collective import maximum, minimum

# nodes of the grid are as many at most, in so many dimensions: A's factors fill up faster in space
_MOST_NODES = {1: 4000, 2: 8000, 3: 1400}
# of the greatest stiffness, what keeps motions that nothing holds from being without any
_FLOOR = 1e-9
# of all its squares, what a motion that nothing holds may be where something holds: rounding
_LOOSE = 1e-13


class Grid(NamedTuple):
    """lower (d,) [m]; width (d,) [m] of a cell; cells (d,)."""

    lower: np.ndarray
    width: np.ndarray
    cells: np.ndarray

    @classmethod
    def over(cls, comm: Any, places: np.ndarray, width: float) -> "Grid":
        """From the least to the greatest of places (n, d) [m] on all ranks, in cells of a width [m] or wider; not all
        ranks need have places. Collective.
        """
        d = places.shape[1]
        lower = minimum(comm, places.min(axis=0, initial=np.inf))
        size = np.maximum(maximum(comm, places.max(axis=0, initial=-np.inf)) - lower, 1e-9 * width)
        cells = np.maximum(np.ceil(size / width - 1e-6), 1.0)
        while np.prod(cells + 1) > _MOST_NODES[d]:
            width *= 1.05
            cells = np.maximum(np.ceil(size / width - 1e-6), 1.0)
        return cls(lower, size / cells, cells.astype(np.int64))

    @property
    def nodes(self) -> int:
        """How many."""
        return int(np.prod(self.cells + 1))

    def within(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Cells (n, d), and places within them (n, d), from 0 to 1."""
        scaled = (places - self.lower) / self.width
        cell = np.clip(scaled.astype(np.int64), 0, self.cells - 1)
        return cell, scaled - cell

    def corners(self, cell: np.ndarray) -> np.ndarray:
        """Numbers (n, 2^d) of the nodes of cells (n, d)."""
        offsets = np.array(list(product((0, 1), repeat=len(self.cells))))
        strides = np.append(np.cumprod((self.cells + 1)[:0:-1])[::-1], 1)
        return (cell[:, None, :] + offsets) @ strides


def shape_values(within: np.ndarray) -> np.ndarray:
    """Multilinear shape functions (n, 2^d) at places within cells (n, d)."""
    d = within.shape[1]
    factors = [[1.0 - within[:, axis], within[:, axis]] for axis in range(d)]
    return np.stack(
        [np.prod([factors[axis][k] for axis, k in enumerate(corner)], axis=0) for corner in product((0, 1), repeat=d)],
        axis=1,
    )


@compiled
def add_stiffness(
    row: np.ndarray,
    within: np.ndarray,
    width: np.ndarray,
    lame: np.ndarray,
    shear: np.ndarray,
    volume: np.ndarray,
    result: np.ndarray,
) -> None:
    """Add the elastic stiffness of particles to that of their cells (cells, 2^d d, 2^d d), to its blocks (d, d) on
    and above the diagonal.

    row (n,): the particle's cell in result; within (n, d); width (d,) [m]; lame, shear (n,) [Pa]; volume (n,) [m^3].
    """
    d = within.shape[1]
    slope = np.empty((1 << d, d))
    for p in range(len(row)):
        for corner in range(1 << d):
            for i in range(d):
                value = 1.0 / width[i]
                for axis in range(d):
                    upper = (corner >> (d - 1 - axis)) & 1
                    if axis == i:
                        value *= 1.0 if upper else -1.0
                    else:
                        value *= within[p, axis] if upper else 1.0 - within[p, axis]
                slope[corner, i] = value
        for a in range(1 << d):
            for b in range(a, 1 << d):
                along = 0.0
                for i in range(d):
                    along += slope[a, i] * slope[b, i]
                for i in range(d):
                    for j in range(d):
                        value = lame[p] * slope[a, i] * slope[b, j] + shear[p] * slope[a, j] * slope[b, i]
                        if i == j:
                            value += shear[p] * along
                        result[row[p], a * d + i, b * d + j] += volume[p] * value


class TwoLevel:
    """The preconditioner on one rank; all methods are collective."""

    def __init__(self, comm: Any, grid: Grid, places: np.ndarray, free: np.ndarray, held: np.ndarray) -> None:
        """places (n, d) [m] of this rank's particles; free (n, d) bool: their components that move; held (nodes, d)
        bool: components of nodes that do not.
        """
        from scipy import sparse

        self.comm, self.grid, self.free = comm, grid, free
        cell, self.within = grid.within(places)
        self.corners = grid.corners(cell)
        n, d = places.shape
        weights, rows = shape_values(self.within), np.repeat(np.arange(n), 1 << d)
        self.prolongation = sparse.csr_array((weights.ravel(), (rows, self.corners.ravel())), (n, grid.nodes))
        self.restriction = self.prolongation.T.tocsr()
        touched = np.zeros(grid.nodes)
        touched[self.corners.ravel()] = 1.0
        self.moving = ~held & (sums(comm, touched) > 0.0)[:, None]
        self.diagonal: np.ndarray | None = None
        self.loose = np.zeros((0, *free.shape))

    def of_moduli(self, lame: np.ndarray, shear: np.ndarray, volume: np.ndarray, diagonal: np.ndarray) -> None:
        """Take moduli (n,) [Pa] and volumes (n,) [m^3] of the particles, and the diagonal D (n, d) [N/m]."""
        from scipy import sparse
        from scipy.sparse.linalg import splu

        d = self.within.shape[1]
        # a cell is known by its first corner
        first = np.full(self.grid.nodes, -1)
        first[self.corners[:, 0]] = np.arange(len(self.corners))
        cells, row = self.corners[first[first >= 0]], np.cumsum(first >= 0)[self.corners[:, 0]] - 1
        blocks = np.zeros((len(cells), d << d, d << d))
        add_stiffness(row, self.within, self.grid.width, lame, shear, volume, blocks)
        below = np.tril_indices(1 << d, -1)
        nodes = blocks.reshape(len(cells), 1 << d, d, 1 << d, d)
        nodes[:, below[0], :, below[1]] = nodes[:, below[1], :, below[0]].swapaxes(2, 3)
        numbers = (cells[:, :, None] * d + np.arange(d)).reshape(len(cells), -1)
        i, j = np.broadcast_arrays(numbers[:, :, None], numbers[:, None, :])
        size = self.grid.nodes * d
        mine = sparse.coo_array((blocks.ravel(), (i.ravel(), j.ravel())), (size, size)).tocsr()
        for component in range(d):
            if not self.free[:, component].all():
                mine = mine + self._held_stiffness(component, diagonal[:, component], size)
        whole = sum(self.comm.allgather(mine), start=sparse.csr_array((size, size)))
        chosen = np.flatnonzero(self.moving.ravel())
        A = whole[chosen][:, chosen].tocsc()
        A += _FLOOR * A.diagonal().max(initial=0.0) * sparse.identity(len(chosen), format="csc")
        self.stiffness = A
        self.factors = splu(A, permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}) if len(chosen) else None
        self.diagonal = diagonal

    def _held_stiffness(self, i: int, diagonal: np.ndarray, size: int) -> Any:
        """What functions lack that stop at prescribed components i: their jump there, of which D is the stiffness."""
        from scipy import sparse

        d = self.free.shape[1]
        jump = (self.restriction @ sparse.diags_array(diagonal * ~self.free[:, i]) @ self.prolongation).tocoo()
        return sparse.coo_array((jump.data, (jump.row * d + i, jump.col * d + i)), (size, size)).tocsr()

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) of a residual (n, d) that is 0 where a component is prescribed."""
        return self.less_loose(self.without_loose(residual))

    def without_loose(self, residual: np.ndarray) -> np.ndarray:
        """The same, whatever is left out."""
        assert self.diagonal is not None
        result = residual / self.diagonal
        if self.factors is not None:
            coarse = sums(self.comm, self.restriction @ residual)
            coarse[self.moving] = self.factors.solve(coarse[self.moving])
            coarse[~self.moving] = 0.0
            result += (self.prolongation @ coarse) * self.free
        return result

    def less_loose(self, result: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) less its part of motions that are left out; in place."""
        if len(self.loose):
            parts = sums(self.comm, np.tensordot(self.loose, result, 2))
            result -= np.tensordot(parts, self.loose, 1)
        return result

    def leave_out(self, motions: np.ndarray, restraint: np.ndarray) -> None:
        """Give no part of those of some motions (k, n, d) that nothing holds: they have no stiffness, and nothing says
        what they should be. Without a preconditioner conjugate gradients have none of them by themselves.

        restraint (k, k): sums of products of what the motions are wherever something holds, on all ranks together.
        """
        self.loose = motions_without(self.comm, motions, restraint) * self.free


def motions_without(comm: Any, motions: np.ndarray, restraint: np.ndarray) -> np.ndarray:
    """Those (l, n, d), orthonormal over all ranks, of the span of some motions (k, n, d) that have no restraint (k, k),
    see `TwoLevel.leave_out`. Collective.
    """
    gram = sums(comm, np.tensordot(motions, motions, ((1, 2), (1, 2))))
    sizes, axes = np.linalg.eigh(gram)
    basis = axes[:, sizes > 1e-12 * sizes[-1]] / np.sqrt(sizes[sizes > 1e-12 * sizes[-1]])
    values, modes = np.linalg.eigh(basis.T @ restraint @ basis)
    return np.asarray(np.tensordot((basis @ modes[:, values < _LOOSE]).T, motions, 1))
