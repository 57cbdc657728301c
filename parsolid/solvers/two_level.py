"""A preconditioner of two levels for stiffnesses of particles: the particles themselves, and a grid over all of them.

It is that of quasi-static peridynamics. Equilibria of total-Lagrangian SPH, and `modes`, have `solvers.grid_levels`.

M^-1 r = D^-1 r + P A^-1 P^T r (additive Schwarz: Smith, Bjorstad and Gropp, Domain Decomposition, 1996, chapter 2).
P takes multilinear functions of a grid to the particles, A is their stiffness by quadrature over the particles, as in
the material point method. A nonlocal stiffness is nearly a multiple of 1 for all that varies within the horizon, so
that a grid a little wider than that leaves nothing which takes many iterations. A is factorised on every rank; its size
is bounded, not that of the scene.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import anywhere
from parsolid.solvers.node_grid import Functions, Grid, add_moments, stiffness_of_moments

# of the greatest stiffness, what keeps motions that nothing holds from being without any
_FLOOR = 1e-9
# of all its squares, what a motion that nothing holds may be where something holds: rounding
_LOOSE = 1e-13


class TwoLevel:
    """The preconditioner on one rank; all methods are collective."""

    def __init__(self, comm: Any, grid: Grid, places: np.ndarray, free: np.ndarray, held: np.ndarray) -> None:
        """places (n, d) [m] of this rank's particles; free (n, d) bool: their components that move; held (nodes, d)
        bool: components of nodes that do not.
        """
        self.comm, self.grid, self.free = comm, grid, free
        self.functions = Functions.of(grid, places)
        # P (n, nodes) and its transpose, sparse
        self.prolongation = self.functions.matrix(grid.nodes)
        self.restriction = self.prolongation.T.tocsr()
        self.moving = ~held & (sums(comm, self.restriction @ np.ones(places.shape)) > 0.0)
        # whether a component of a particle is prescribed on any rank
        self.prescribes = anywhere(comm, not free.all())
        self.factors: np.ndarray | None = None
        self.diagonal: np.ndarray | None = None
        self.rigid_modes = np.zeros((0, *free.shape))

    def of_moduli(self, lame: np.ndarray, shear: np.ndarray, volume: np.ndarray, diagonal: np.ndarray) -> None:
        """Take moduli (n,) [Pa] and volumes (n,) [m^3] of the particles, and the diagonal D (n, d) [N/m]."""
        from scipy.linalg import cholesky_banded

        weights = np.stack((lame * volume, shear * volume), axis=1)
        if self.prescribes:
            # functions do not stop at prescribed components: what they lack is their jump there, of stiffness D
            weights = np.concatenate((weights, diagonal * ~self.free), axis=1)
        mine = np.zeros((self.grid.nodes, weights.shape[1], 3 ** self.free.shape[1]))
        add_moments(self.functions, weights, mine)
        self.moments, self.diagonal = sums(self.comm, mine), diagonal
        if self.moving.any():
            self.factors = cholesky_banded(self._bands(), overwrite_ab=True, lower=True, check_finite=False)

    def _bands(self) -> np.ndarray:
        """A of all nodes, its diagonal and those below; 1 on the diagonal and nothing beside it where nothing moves."""
        grid, corners, d = self.grid, self.grid.corners, self.free.shape[1]
        size, kinds = corners.size * d, self.moments.shape[1]
        lower = np.flatnonzero((grid.numbers < grid.cells).all(axis=1))
        table = stiffness_of_moments(grid.width)[:kinds].reshape(-1, size**2)
        blocks = (self.moments[lower].reshape(len(lower), -1) @ table).reshape(len(lower), size, size)
        places = ((lower[:, None] + corners)[:, :, None] * d + np.arange(d)).reshape(len(lower), size)
        moves = self.moving.ravel()[places]
        blocks *= moves[:, :, None] & moves[:, None, :]
        bands = np.zeros((int(corners[-1]) * d + d, grid.nodes * d), order="F")
        distance = places[0] - places[0][:, None]
        for i, j in zip(*np.nonzero(distance >= 0)):
            # of one function of each cell the places are distinct
            bands[distance[i, j], places[:, i]] += blocks[:, i, j]
        bands[0] += _FLOOR * bands[0].max(initial=0.0)
        bands[0][~self.moving.ravel()] = 1.0
        return bands

    @property
    def stiffness(self) -> Any:
        """A of what moves, sparse."""
        from scipy import sparse

        bands, moving = self._bands(), np.flatnonzero(self.moving.ravel())
        below = sparse.dia_array((bands[1:], -np.arange(1, len(bands))), (bands.shape[1],) * 2).tocsr()
        whole = below + below.T + sparse.diags_array(bands[0])
        return whole[moving][:, moving].tocsc()

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) of a residual (n, d) that is 0 where a component is prescribed."""
        return self.projected(self.unprojected(residual))

    def unprojected(self, residual: np.ndarray) -> np.ndarray:
        """The same, before `project_out`."""
        from scipy.linalg.lapack import dpbtrs

        assert self.diagonal is not None
        result = residual / self.diagonal
        if self.factors is not None:
            coarse = sums(self.comm, (self.restriction @ residual) * self.moving)
            solved, _ = dpbtrs(self.factors, coarse.ravel(), lower=1)
            result += (self.prolongation @ solved.reshape(coarse.shape)) * self.free
        return result

    def projected(self, result: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) less its part of the rigid-body modes that nothing holds; in place."""
        if len(self.rigid_modes):
            parts = sums(self.comm, np.tensordot(self.rigid_modes, result, 2))
            result -= np.tensordot(parts, self.rigid_modes, 1)
        return result

    def project_out(self, motions: np.ndarray, restraint: np.ndarray) -> None:
        """Give no part of those of some motions (k, n, d) that nothing holds: they have no stiffness, and nothing says
        what they should be. Without a preconditioner conjugate gradients have none of them by themselves.

        restraint (k, k): sums of products of what the motions are wherever something holds, on all ranks together.
        """
        self.rigid_modes = unrestrained_modes(self.comm, motions, restraint) * self.free


def unrestrained_modes(comm: Any, motions: np.ndarray, restraint: np.ndarray) -> np.ndarray:
    """Those (l, n, d), orthonormal over all ranks, of the span of some motions (k, n, d) that have no restraint (k, k),
    see `TwoLevel.project_out`. Collective.
    """
    gram = sums(comm, np.tensordot(motions, motions, ((1, 2), (1, 2))))
    sizes, axes = np.linalg.eigh(gram)
    basis = axes[:, sizes > 1e-12 * sizes[-1]] / np.sqrt(sizes[sizes > 1e-12 * sizes[-1]])
    values, modes = np.linalg.eigh(basis.T @ restraint @ basis)
    return np.asarray(np.tensordot((basis @ modes[:, values < _LOOSE]).T, motions, 1))
