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


# least factor of the limiter, and jumps from which on it is 1: over the speed of pressure waves at rest, and over the
# jump that is not reconstructed
LEAST_DISSIPATION, SMALL_JUMP, STEEP_JUMP = 0.1, 2e-4, 0.25


@inlined
def dissipation_limiter(u_u, w_w, full_jump):
    """Factor on the flux, from LEAST_DISSIPATION to 1.

    The dissipation keeps large deformations stable and damps what is not resolved. Smooth small motion needs little of
    it, and it is the largest error there. u_u, w_w: squares of the jump of the velocity [m^2/s^2], reconstructed and as
    it is; full_jump: SMALL_JUMP of the wave speed [m/s], or 0 for a factor of 1. The factor is 1 where u is above
    full_jump, or above STEEP_JUMP of w: at fronts, and in motion that alternates from node to node.
    """
    full = min(full_jump * full_jump, STEEP_JUMP * STEEP_JUMP * w_w)
    return min(1.0, max(LEAST_DISSIPATION, (u_u / max(full, 1e-300)) ** 0.5))
