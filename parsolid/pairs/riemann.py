"""The dissipation of total-Lagrangian SPH: the acoustic Riemann problem between two particles, for all weights."""

from parsolid.kernels import inlined


@inlined
def riemann_factors(Z_p, Z_s, u_r, r_r):
    """Factors (s, a) of the flux s u + a r [Pa] from b to a, Lee et al., eqs (74), (75).

    u: jump of the velocity [m/s], less what the gradients of both particles explain of it; r = x_b - x_a [m];
    u_r = u.r; r_r = r.r; Z_p, Z_s: sums of the half impedances of pressure and shear waves [Pa s/m]. With n along r
    this is Z_s u + (Z_p - Z_s) (u.n) n.
    """
    return Z_s, (Z_p - Z_s) * u_r / r_r
