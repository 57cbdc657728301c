"""A preconditioner for bodies that resist a change of their volumes far more than one of their shape.

With K = A + D^T Lambda D, D the divergence at the particles and Lambda their first Lame constants times volumes, it is

    M = B^-1 + D^T Lambda D,     B = Delta^-1 + P A_c^-1 P^T

where B is that of a single grid for A alone. Its inverse, by Woodbury's identity, is
B - B D^T S^-1 D B with S = Lambda^-1 + D B D^T, of which the sparse quasi-definite matrix

    | Lambda^-1 + D Delta^-1 D^T   D P  |
    | (D P)^T                      -A_c |

is the whole of: Vanderbei, SIAM J. Optim. 5 (1995) 100. A divergence over a horizon does not see waves of certain
lengths, whatever their direction: pressures that it hardly sees are as many as Helmholtz's equation has solutions, and
neither smoothing nor a coarse grid finds those. The matrix is factorised on every rank, and its size therefore bounded.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.solvers.grid_levels import GridLevels


class NearlyIncompressible:
    """The preconditioner on one rank; all methods are collective."""

    def __init__(self, shear: GridLevels, divergence: Any, compliance: np.ndarray) -> None:
        """shear: for A, with its moduli and no grid but the coarsest; divergence: D (particles of all ranks, n d) [1/m]
        of this rank's components, sparse; compliance (particles of all ranks,) [1/(Pa m^3)]: 1/Lambda.
        """
        from scipy import sparse
        from scipy.sparse.linalg import splu

        free, coarsest = sparse.diags_array(shear.free.ravel().astype(float)), shear.coarsest
        self.comm, self.shear, self.divergence = shear.comm, shear, (divergence @ free).tocsr()
        D, size = self.divergence, len(coarsest.matrix)
        places = np.arange(len(coarsest.places)), coarsest.places
        numbered = sparse.coo_array((np.ones(len(coarsest.places)), places), (len(coarsest.places), size))
        onto = shear.prolongation @ numbered.tocsr()
        both = self.comm.allreduce((D @ sparse.diags_array(1.0 / shear.diagonal.ravel()) @ D.T).tocsr())
        coupling = self.comm.allreduce((D @ onto).tocsr())
        whole = [[both + sparse.diags_array(compliance), coupling], [coupling.T, -sparse.csr_array(coarsest.matrix)]]
        matrix = sparse.block_array(whole, format="csc")
        # every order of elimination is stable, so that pivots need not be sought
        self.factors = splu(matrix, permc_spec="MMD_AT_PLUS_A", diag_pivot_thresh=0.0, options={"SymmetricMode": True})
        self.pressures = np.zeros(matrix.shape[0])

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) of a residual (n, d) that is 0 where a component is prescribed."""
        result, D = self.shear(residual), self.divergence
        count = D.shape[0]
        self.pressures[:count] = sums(self.comm, D @ result.ravel())
        pressures = self.factors.solve(self.pressures)[:count]
        return result - self.shear((D.T @ pressures).reshape(residual.shape))
