"""Matrix-free solvers of K u = f on all ranks: vectors are rows of owned particles, a product is a function.

Vectors are float64 arrays (n, d) of this rank's particles, n may be 0; `apply(x, out)` writes K x of all ranks' x into
out and may exchange ghosts; `free` (n, d) is true where a component is not prescribed, or None. All functions are
collective.
"""

from parsolid.solvers.conjugate_gradients import Solution, conjugate_gradients
from parsolid.solvers.dynamic_relaxation import dynamic_relaxation, relaxation_mass
from parsolid.solvers.eigenmodes import LowestModes, Modes, rigid_modes, unrestrained_modes
from parsolid.solvers.grid_levels import GridLevels, moduli_of_rows, rigid_motions
from parsolid.solvers.nearly_incompressible import NearlyIncompressible
from parsolid.solvers.newton import State, Unsolvable, newton
from parsolid.solvers.power_iteration import largest_eigenvalue, scaled_diagonal, start_vector

__all__ = [
    "GridLevels",
    "LowestModes",
    "Modes",
    "NearlyIncompressible",
    "Solution",
    "State",
    "Unsolvable",
    "conjugate_gradients",
    "dynamic_relaxation",
    "largest_eigenvalue",
    "moduli_of_rows",
    "newton",
    "relaxation_mass",
    "rigid_modes",
    "rigid_motions",
    "scaled_diagonal",
    "start_vector",
    "unrestrained_modes",
]
