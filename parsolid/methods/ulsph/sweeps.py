"""The two sweeps over pairs at their present places, each the adjoint of the other (Rahaman et al., (3.6)-(3.10), with
the corrections of docs/ulsph.md).

With the kernel's weights k_ab = k_ba, grad_a W = k_ab r, r = x_b - x_a, g_ab = m_a m_b k_ab r and B symmetric:

    rates    grad v_a  = sum_b (v_b - v_a) (x) g_ab B_a / (m_a rho_a)
             div xi_a  = rho_a/m_a sum_b [xi_a B_a/rho_a^2 + xi_b B_b/rho_b^2] . g_ab
    forces   m_a v'_a  = sum_b [sigma_a B_a/rho_a^2 + sigma_b B_b/rho_b^2 - Pi_ab] g_ab
             grad f_a  = sum_b (f_b - f_a) B_a g_ab / (m_a rho_a),   f = v^p, T
             q_a       = 1/2 sum_b Pi_ab (v_a - v_b) . g_ab           heat of the artificial viscosity, alike for both

so that the power of stresses and fluxes on velocities equals that on gradients, to round-off. B is the inverse of the
moment sum_b r (x) g_ab/(m_a rho_a), see `update`.

Kernels read rows of particles: owned ones, ghosts of other ranks, mirror images. P = sigma B/rho^2.
    motion   space [v m | x h]; plane [v x | m h 0 0]
    record   space [P_1 0 | P_2 0 | P_3 0 | rho c v^p T] with the columns of P; plane [P_1 P_2 | rho c v^p T]
    flux     space [X_1 Y_1 X_2 Y_2 | X_3 Y_3 0 0], plane [X_1 Y_1 X_2 Y_2]: X = xi B/rho^2, Y = q B/rho^2, None where
             neither flows
and add to rows of owned particles:
    rates    sums of (v_b - v_a) (x) g and r (x) g:
             space [dv g_1, r_1 g_1 | dv g_2, r_1 g_2 | dv g_3, r_1 g_3 | r_2 g_2, r_3 g_3, r_2 g_3, .]
             plane [dv g_1, dv g_2 | r_1 g_1, r_2 g_2, r_1 g_2, .]
    flows    [m div xi/rho, m div q/rho, . .]
    forces   of stresses F and of the artificial viscosity V: space [F . | V .]; plane [F V]
    heating  q
    slopes   sums of (v^p_b - v^p_a) g and of (T_b - T_a) g: space [micro . | heat .]; plane [micro heat]
pressing: None, or for pairs of two bodies, which exert no tension on one another. reference: weights of pairs at their
reference distances, or None where pairs in tension do not keep them; tension: rows of `pair_weights`.
"""

from typing import NamedTuple

from parsolid.kernels import inlined, kernel
from parsolid.methods.ulsph.pair_weights import held_weight, pull_in_space, room_for_pairs, weigh_in_space
from parsolid.pairs.rows_of_four import add, add_scaled, dot, load_row, scale, store_row, subtract


class ArtificialViscosity(NamedTuple):
    """Pi_ab = (-linear c mu + quadratic mu^2)/rho in approach, mu = h v.r/(r^2 + softening h^2) (Monaghan, J. Comput.
    Phys. 82, 1989)."""

    linear: float
    quadratic: float
    softening: float


@inlined
def viscous_pressure(viscosity, h, approach, square, N):
    """Pi_ab [Pa m^6/kg^2] of a pair with v.r = approach, |r|^2 = square and N = the sum of both rows rho, c, v^p, T."""
    mu = h * min(approach, 0.0)
    s = square + viscosity.softening * h * h
    # with the means rho = N[0]/2, c = N[1]/2
    return mu * (2.0 * viscosity.quadratic * mu - viscosity.linear * N[1] * s) / (s * s * N[0])


@inlined
def traction_in_space(record, a, b, r):
    """(P_a + P_b) r."""
    u = scale(r[0], add(load_row(record, a, 0), load_row(record, b, 0)))
    u = add_scaled(u, r[1], add(load_row(record, a, 4), load_row(record, b, 4)))
    return add_scaled(u, r[2], add(load_row(record, a, 8), load_row(record, b, 8)))


@inlined
def downhill(flow, here, there):
    """A flow of heat from a particle to another one, 0 unless the first one is the warmer: gradients of kernels see no
    differences from particle to particle, and would draw heat from the coldest one."""
    return flow if flow * (here - there) > 0.0 else 0.0


@kernel
def add_rates_in_space(
    smoothing, pairs, both, pressing, reference, tension, flux, fourier, motion, record, rates, flows
):
    """Add what pairs have of rates and flows; both: whether the neighbours receive it, too; fourier: None unless heat
    flows by Fourier's law alone."""
    start, neighbour = pairs
    room = room_for_pairs(start)
    for a in range(start.shape[0] - 1):
        first, last = start[a], start[a + 1]
        if first == last:
            continue
        weigh_in_space(smoothing, a, first, last, neighbour, motion, room)
        v_a, x_a = load_row(motion, a, 0), load_row(motion, a, 4)
        pulls = reference is not None and tension[a, 6] > 0.0
        sum_0, sum_1, sum_flow = load_row(rates, a, 0), load_row(rates, a, 4), load_row(flows, a, 0)
        sum_2, sum_3 = load_row(rates, a, 8), load_row(rates, a, 12)
        for k in range(first, last):
            b = neighbour[k]
            square, h, weight = room[0, k - first], room[1, k - first], room[2, k - first]
            if weight == 0.0:
                continue
            r = subtract(load_row(motion, b, 4), x_a)
            v_b = load_row(motion, b, 0)
            dv = subtract(v_b, v_a)
            if pressing is not None and not (dot(dv, r) < 0.0 or dot(traction_in_space(record, a, b, r), r) < 0.0):
                continue
            if pulls and (reference[k] - weight) * tension[b, 6] > 0.0:
                pull = pull_in_space(tension, a, r), pull_in_space(tension, b, r)
                weight = held_weight(smoothing, weight, reference[k], h, square, *pull)
            g = scale(v_a[3] * v_b[3] * weight, r)
            dv_r = (dv[0], dv[1], dv[2], r[0])
            to_0, to_1, to_2 = scale(g[0], dv_r), scale(g[1], dv_r), scale(g[2], dv_r)
            to_3 = (r[1] * g[1], r[2] * g[2], r[1] * g[2], 0.0)
            sum_0, sum_1, sum_2, sum_3 = add(sum_0, to_0), add(sum_1, to_1), add(sum_2, to_2), add(sum_3, to_3)
            if both:
                store_row(rates, b, 0, add(load_row(rates, b, 0), to_0))
                store_row(rates, b, 4, add(load_row(rates, b, 4), to_1))
                store_row(rates, b, 8, add(load_row(rates, b, 8), to_2))
                store_row(rates, b, 12, add(load_row(rates, b, 12), to_3))
            if flux is not None:
                S, U = add(load_row(flux, a, 0), load_row(flux, b, 0)), add(load_row(flux, a, 4), load_row(flux, b, 4))
                heat = S[1] * g[0] + S[3] * g[1] + U[1] * g[2]
                if fourier is not None:
                    heat = downhill(heat, record[a, 15], record[b, 15])
                to_flow = (S[0] * g[0] + S[2] * g[1] + U[0] * g[2], heat, 0.0, 0.0)
                sum_flow = add(sum_flow, to_flow)
                if both:
                    store_row(flows, b, 0, subtract(load_row(flows, b, 0), to_flow))
        store_row(rates, a, 0, sum_0)
        store_row(rates, a, 4, sum_1)
        store_row(rates, a, 8, sum_2)
        store_row(rates, a, 12, sum_3)
        store_row(flows, a, 0, sum_flow)


@kernel
def add_forces_in_space(
    smoothing, pairs, both, pressing, reference, tension, flux, viscosity, motion, record, forces, heating, slopes
):
    """Add what pairs have of forces, heating and slopes; both: whether the neighbours receive it, too."""
    start, neighbour = pairs
    room = room_for_pairs(start)
    for a in range(start.shape[0] - 1):
        first, last = start[a], start[a + 1]
        if first == last:
            continue
        weigh_in_space(smoothing, a, first, last, neighbour, motion, room)
        v_a, x_a, N_a = load_row(motion, a, 0), load_row(motion, a, 4), load_row(record, a, 12)
        pulls = reference is not None and tension[a, 6] > 0.0
        sum_F, sum_V, sum_q = load_row(forces, a, 0), load_row(forces, a, 4), heating[a]
        slope_micro, slope_heat = load_row(slopes, a, 0), load_row(slopes, a, 4)
        for k in range(first, last):
            b = neighbour[k]
            square, h, weight = room[0, k - first], room[1, k - first], room[2, k - first]
            if weight == 0.0:
                continue
            r = subtract(load_row(motion, b, 4), x_a)
            v_b, N_b = load_row(motion, b, 0), load_row(record, b, 12)
            if pulls and (reference[k] - weight) * tension[b, 6] > 0.0:
                pull = pull_in_space(tension, a, r), pull_in_space(tension, b, r)
                weight = held_weight(smoothing, weight, reference[k], h, square, *pull)
            product = v_a[3] * v_b[3] * weight
            g = scale(product, r)
            F = traction_in_space(record, a, b, g)
            if pressing is not None and not dot(F, r) < 0.0:
                F = (0.0, 0.0, 0.0, 0.0)
            sum_F = add(sum_F, F)
            if both:
                store_row(forces, b, 0, subtract(load_row(forces, b, 0), F))
            if viscosity is not None:
                approach = dot(subtract(v_b, v_a), r)
                Pi = viscous_pressure(viscosity, h, approach, square, add(N_a, N_b))
                V, q = scale(-Pi, g), -0.5 * Pi * product * approach
                sum_V, sum_q = add(sum_V, V), sum_q + q
                if both:
                    store_row(forces, b, 4, subtract(load_row(forces, b, 4), V))
                    heating[b] += q
            if flux is not None:
                to_micro, to_heat = scale(N_b[2] - N_a[2], g), scale(N_b[3] - N_a[3], g)
                slope_micro, slope_heat = add(slope_micro, to_micro), add(slope_heat, to_heat)
                if both:
                    store_row(slopes, b, 0, add(load_row(slopes, b, 0), to_micro))
                    store_row(slopes, b, 4, add(load_row(slopes, b, 4), to_heat))
        store_row(forces, a, 0, sum_F)
        store_row(forces, a, 4, sum_V)
        heating[a] = sum_q
        store_row(slopes, a, 0, slope_micro)
        store_row(slopes, a, 4, slope_heat)
