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


# the share of the flux that smooth small motion keeps, and from which jumps on all of it acts: of the speed of pressure
# waves at rest, and of the jump that is not reconstructed
SMOOTH_SHARE = 0.1
SMALL_JUMP, STEEP_JUMP = 2e-4, 0.25


def sharpness(speed: float) -> float:
    """The factor `sharpness` of `share_of_flux` [s^2/m^2] by the speed of pressure waves at rest [m/s]."""
    return (SMALL_JUMP * speed) ** -2


# all of the flux acts on any jump
ALWAYS_SHARP = 1e300


@inlined
def share_of_flux(u_u, w_w, sharpness):
    """Share of the flux that acts, from SMOOTH_SHARE to 1. The dissipation keeps large deformations stable and damps
    what is not resolved; smooth small motion needs little of it, and it is its largest error there.

    u_u, w_w: squares of the jump of the velocity [m^2/s^2], reconstructed and as it is. All of the flux acts where u is
    above SMALL_JUMP of the wave speed, or above STEEP_JUMP of w: at fronts, and in motion that alternates from node to
    node.
    """
    steep = 1.0 / (STEEP_JUMP * STEEP_JUMP)
    share = (u_u * max(sharpness, steep / (w_w + 1e-300))) ** 0.5
    return min(1.0, max(SMOOTH_SHARE, share))
