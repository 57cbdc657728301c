"""What a correspondence law offers to the particle kernels.

A law is a `NamedTuple` of parameters; its functions are numba overloads on that type, chosen when a kernel is compiled.
Arguments are tuples of scalars (see `numerics.tensors`), the scalars floats or four particles at once (`numerics.lanes.Lanes`).
`branch_sum` is sum_alpha mu_alpha A_alpha [Pa] of the Maxwell branches, a symmetric tensor, or None without branches.
"""


def first_piola_kirchhoff_stress(law, F, H, J, branch_sum):
    """First Piola-Kirchhoff stress P [Pa] from the deformation gradient F, its cofactor H and Jacobian J."""
    raise NotImplementedError


def pressure_wave_tensor(law, F, H, J, branch_sum):
    """Symmetric tensor Q with rho c_p(N)^2 = N . Q N [Pa]."""
    raise NotImplementedError


def shear_wave_tensor(law, F, branch_sum):
    """Symmetric tensor Q with rho c_s(N)^2 = N . Q N [Pa], the mean over the two shear waves."""
    raise NotImplementedError


def equilibrium_energy(law, F, H, J):
    """Stored energy density W_infinity [J/m^3] without the branches."""
    raise NotImplementedError


def isotropic_shear_modulus(law):
    """rho c_s^2 [Pa] when it is the same for every direction and state, so that no shear wave tensor is kept; else None."""
    raise NotImplementedError
