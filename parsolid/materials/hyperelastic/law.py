"""What a hyperelastic law offers to the particle kernels.

A law is a `NamedTuple` of parameters; its functions are implementations of the stubs below (see `numerics.dispatch.generic`), chosen
when a kernel is compiled. Tensors are those of `numerics.tensors`, scalars floats or four particles at once (`numerics.lanes.Lanes`).
`branch_sum` is sum_alpha mu_alpha A_alpha [Pa] of the Maxwell branches, a symmetric tensor, or None without branches.
"""

from parsolid.numerics.dispatch import generic
from parsolid.numerics.tensors import Tensor


@generic
def first_piola_kirchhoff_stress(law, F: Tensor, H: Tensor, J, branch_sum: Tensor):
    """First Piola-Kirchhoff stress P [Pa] from the deformation gradient F, its cofactor H and Jacobian J."""


@generic
def pressure_wave_tensor(law, F: Tensor, H: Tensor, J, branch_sum: Tensor):
    """Symmetric tensor Q with rho c_p(N)^2 = N . Q N [Pa]."""


@generic
def shear_wave_tensor(law, F: Tensor, branch_sum: Tensor):
    """Symmetric tensor Q with rho c_s(N)^2 = N . Q N [Pa], the mean over the two shear waves."""


@generic
def equilibrium_energy(law, F: Tensor, H: Tensor, J):
    """Stored energy density W_infinity [J/m^3] without the branches."""


@generic
def isotropic_shear_modulus(law):
    """rho c_s^2 [Pa] when it is the same for every direction and state, so that no shear wave tensor is kept; else None."""
