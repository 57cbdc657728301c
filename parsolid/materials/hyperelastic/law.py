"""What a hyperelastic law offers to the particle kernels.

A law is a `NamedTuple` of parameters, among them density [kg/m^3], and branch_moduli [Pa] and relaxation_times [s] of
its Maxwell branches (tuples of equal length, or None), which every hyperelastic law may have. Its functions are
implementations of the stubs below (see `numerics.dispatch.generic`), chosen when a kernel is compiled. A law implements
equilibrium_energy, equilibrium_stress, equilibrium_wave_tensor and elastic_moduli; all else follows from these,
branches included. Tensors are those of `numerics.tensors`, scalars floats or four particles at once
(`numerics.lanes.Lanes`). `branch_sum` is sum_alpha mu_alpha A_alpha [Pa] of the Maxwell branches, a symmetric tensor,
or None without branches.
"""

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.tensors import I, Tensor, gram, zero_like_gram


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
    """rho c_s^2 [Pa] when it is the same for every direction and state, so that no shear wave tensor is kept; else
    None.
    """


@generic
def equilibrium_stress(law, F: Tensor, H: Tensor, J):
    """First Piola-Kirchhoff stress [Pa] without the branches, the derivative of `equilibrium_energy`."""


@generic
def equilibrium_wave_tensor(law, F: Tensor, H: Tensor, J):
    """`pressure_wave_tensor` without the branches; never less than the acoustic tensor, where no quadratic form is
    exact.
    """


@generic
def elastic_moduli(law):
    """Shear modulus and first Lame constant [Pa] in the undeformed state, without the branches."""


@register_jitable
def total_modulus(moduli):
    """sum_alpha mu_alpha [Pa], 0 without branches."""
    if moduli is None:
        return 0.0
    result = 0.0
    for modulus in moduli:
        result += modulus
    return result


@none_without("branch_sum")
def _branch_stress(branch_sum, law, F, H, J):
    """F sum mu_alpha A_alpha - sum mu_alpha / J H (A.1)."""
    return F @ branch_sum - total_modulus(law.branch_moduli) / J * H


@none_without("branch_sum")
def _branch_waves(branch_sum, law, H, J):
    """sum mu_alpha (A_alpha + H^T H / J^2) (56)."""
    return total_modulus(law.branch_moduli) / (J * J) * gram(H) + branch_sum


@first_piola_kirchhoff_stress.otherwise
def _stress_with_branches(law, F, H, J, branch_sum):
    return equilibrium_stress(law, F, H, J) + _branch_stress(branch_sum, law, F, H, J)


@pressure_wave_tensor.otherwise
def _waves_with_branches(law, F, H, J, branch_sum):
    return equilibrium_wave_tensor(law, F, H, J) + _branch_waves(branch_sum, law, H, J)


@shear_wave_tensor.otherwise
def _undeformed_shear(law, F, branch_sum):
    # it scales the dissipation of shear waves alone
    return zero_like_gram(F) + elastic_moduli(law)[0] * I + branch_sum


@isotropic_shear_modulus.otherwise
def _isotropic_without_branches(law):
    return _without_branches(law.branch_moduli, law)


@generic
def _without_branches(branch_moduli, law):
    """The shear modulus [Pa] where there is no branch, else None."""


@_without_branches.of(None)
def _elastic(branch_moduli, law):
    return elastic_moduli(law)[0]


@_without_branches.otherwise
def _viscous(branch_moduli, law):
    return None
