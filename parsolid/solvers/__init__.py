"""Matrix-free solvers of K u = f on all ranks: vectors are rows of owned particles, a product is a function.

Vectors are float64 arrays (n, d) of this rank's particles, n may be 0; `apply(x, out)` writes K x of all ranks' x into
out and may exchange ghosts; `free` (n, d) is true where a component is not prescribed, or None. All functions are
collective.
"""

from parsolid.solvers.conjugate_gradients import conjugate_gradients
from parsolid.solvers.dynamic_relaxation import dynamic_relaxation, relaxation_mass
from parsolid.solvers.node_grid import Grid
from parsolid.solvers.power_iteration import largest_eigenvalue, start_vector
from parsolid.solvers.solution import Solution
from parsolid.solvers.stiff_volumes import StiffVolumes
from parsolid.solvers.two_level import TwoLevel, motions_without

__all__ = [
    "Grid",
    "Solution",
    "StiffVolumes",
    "TwoLevel",
    "conjugate_gradients",
    "dynamic_relaxation",
    "largest_eigenvalue",
    "motions_without",
    "relaxation_mass",
    "start_vector",
]
