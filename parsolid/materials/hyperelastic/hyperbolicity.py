"""Hyperbolicity of polyconvex viscoelasticity as functions: everything that Lee et al.'s sections 3, 4 and appendix A
state.

energy, stresses, relaxation, entropy    `conjugates`: (11)-(15), (19), (20), (25)-(28), (35), (36), (A.1), (A.2)
second derivatives of the energy         `hessians`:   (17), (18), (A.3)-(A.6), corrected
acoustic tensor and wave speeds          `waves`:      (54), (56), (59), (60), and the sharper (79)
"""

from parsolid.materials.hyperelastic.conjugates import (
    EntropyVariables,
    PolyconvexState,
    assembled_stress,
    branch_sum,
    cauchy_stress,
    conjugate_stresses,
    dissipation_rates,
    energies,
    energy,
    entropy,
    entropy_variables,
    first_piola_kirchhoff,
    polyconvex_state,
    relaxation_rates,
    right_cauchy_green,
)
from parsolid.materials.hyperelastic.hessians import (
    SYMMETRIC_BASIS,
    BranchHessian,
    EquilibriumHessian,
    branch_hessian,
    equilibrium_hessian,
    hessian_matrix,
)
from parsolid.materials.hyperelastic.waves import (
    acoustic_tensor,
    largest_shear_wave_speed,
    largest_wave_speed,
    pressure_wave_speed,
    shear_wave_speeds,
    smallest_acoustic_eigenvalue,
    surface_stretches,
)

__all__ = [
    "SYMMETRIC_BASIS",
    "BranchHessian",
    "EntropyVariables",
    "EquilibriumHessian",
    "PolyconvexState",
    "acoustic_tensor",
    "assembled_stress",
    "branch_hessian",
    "branch_sum",
    "cauchy_stress",
    "conjugate_stresses",
    "dissipation_rates",
    "energies",
    "energy",
    "entropy",
    "entropy_variables",
    "equilibrium_hessian",
    "first_piola_kirchhoff",
    "hessian_matrix",
    "largest_shear_wave_speed",
    "largest_wave_speed",
    "polyconvex_state",
    "pressure_wave_speed",
    "relaxation_rates",
    "right_cauchy_green",
    "shear_wave_speeds",
    "smallest_acoustic_eigenvalue",
    "surface_stretches",
]
