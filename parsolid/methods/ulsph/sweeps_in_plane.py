"""The sweeps of `sweeps` in plane strain, where rows of motion hold velocity and position together."""

from parsolid.kernels import inlined, kernel
from parsolid.methods.ulsph.pair_weights import held_weight, pull_in_plane, room_for_pairs, weigh_in_plane
from parsolid.methods.ulsph.sweeps import downhill, viscous_pressure
from parsolid.pairs.rows_of_four import add, load_row, store_row, subtract


@inlined
def traction_in_plane(record, a, b, x, y):
    """(P_a + P_b) r of r = (x, y)."""
    P = add(load_row(record, a, 0), load_row(record, b, 0))
    return (P[0] * x + P[2] * y, P[1] * x + P[3] * y)


@kernel
def add_rates_in_plane(
    smoothing, pairs, both, pressing, reference, tension, flux, fourier, motion, record, rates, flows
):
    """As `sweeps.add_rates_in_space`."""
    start, neighbour = pairs
    room = room_for_pairs(start)
    for a in range(start.shape[0] - 1):
        first, last = start[a], start[a + 1]
        if first == last:
            continue
        weigh_in_plane(smoothing, a, first, last, neighbour, motion, room)
        here, m_a = load_row(motion, a, 0), motion[a, 4]
        pulls = reference is not None and tension[a, 3] > 0.0
        sum_0, sum_1, sum_flow = load_row(rates, a, 0), load_row(rates, a, 4), load_row(flows, a, 0)
        for k in range(first, last):
            b = neighbour[k]
            square, h, weight = room[0, k - first], room[1, k - first], room[2, k - first]
            if weight == 0.0:
                continue
            step = subtract(load_row(motion, b, 0), here)
            u, v, x, y = step
            if pressing is not None:
                S = traction_in_plane(record, a, b, x, y)
                if not (u * x + v * y < 0.0 or S[0] * x + S[1] * y < 0.0):
                    continue
            if pulls and (reference[k] - weight) * tension[b, 3] > 0.0:
                pull = pull_in_plane(tension, a, x, y), pull_in_plane(tension, b, x, y)
                weight = held_weight(smoothing, weight, reference[k], h, square, *pull)
            product = m_a * motion[b, 4] * weight
            g_x, g_y = product * x, product * y
            to_0, to_1 = (u * g_x, v * g_x, u * g_y, v * g_y), (x * g_x, y * g_y, x * g_y, 0.0)
            sum_0, sum_1 = add(sum_0, to_0), add(sum_1, to_1)
            if both:
                store_row(rates, b, 0, add(load_row(rates, b, 0), to_0))
                store_row(rates, b, 4, add(load_row(rates, b, 4), to_1))
            if flux is not None:
                S = add(load_row(flux, a, 0), load_row(flux, b, 0))
                heat = S[1] * g_x + S[3] * g_y
                if fourier is not None:
                    heat = downhill(heat, record[a, 7], record[b, 7])
                to_flow = (S[0] * g_x + S[2] * g_y, heat, 0.0, 0.0)
                sum_flow = add(sum_flow, to_flow)
                if both:
                    store_row(flows, b, 0, subtract(load_row(flows, b, 0), to_flow))
        store_row(rates, a, 0, sum_0)
        store_row(rates, a, 4, sum_1)
        store_row(flows, a, 0, sum_flow)


@kernel
def add_forces_in_plane(
    smoothing, pairs, both, pressing, reference, tension, flux, viscosity, motion, record, forces, heating, slopes
):
    """As `sweeps.add_forces_in_space`."""
    start, neighbour = pairs
    room = room_for_pairs(start)
    for a in range(start.shape[0] - 1):
        first, last = start[a], start[a + 1]
        if first == last:
            continue
        weigh_in_plane(smoothing, a, first, last, neighbour, motion, room)
        here, m_a, N_a = load_row(motion, a, 0), motion[a, 4], load_row(record, a, 4)
        pulls = reference is not None and tension[a, 3] > 0.0
        sum_F, sum_q, slope = load_row(forces, a, 0), heating[a], load_row(slopes, a, 0)
        for k in range(first, last):
            b = neighbour[k]
            square, h, weight = room[0, k - first], room[1, k - first], room[2, k - first]
            if weight == 0.0:
                continue
            step = subtract(load_row(motion, b, 0), here)
            u, v, x, y = step
            if pulls and (reference[k] - weight) * tension[b, 3] > 0.0:
                pull = pull_in_plane(tension, a, x, y), pull_in_plane(tension, b, x, y)
                weight = held_weight(smoothing, weight, reference[k], h, square, *pull)
            product, N_b = m_a * motion[b, 4] * weight, load_row(record, b, 4)
            g_x, g_y = product * x, product * y
            F_x, F_y = traction_in_plane(record, a, b, g_x, g_y)
            if pressing is not None and not F_x * x + F_y * y < 0.0:
                F_x, F_y = 0.0, 0.0
            V_x, V_y = 0.0, 0.0
            if viscosity is not None:
                Pi = viscous_pressure(viscosity, h, u * x + v * y, square, add(N_a, N_b))
                V_x, V_y = -Pi * g_x, -Pi * g_y
                q = 0.5 * (V_x * u + V_y * v)
                sum_q += q
                if both:
                    heating[b] += q
            F = (F_x, F_y, V_x, V_y)
            sum_F = add(sum_F, F)
            if both:
                store_row(forces, b, 0, subtract(load_row(forces, b, 0), F))
            if flux is not None:
                micro, heat = N_b[2] - N_a[2], N_b[3] - N_a[3]
                to_slope = (micro * g_x, micro * g_y, heat * g_x, heat * g_y)
                slope = add(slope, to_slope)
                if both:
                    store_row(slopes, b, 0, add(load_row(slopes, b, 0), to_slope))
        store_row(forces, a, 0, sum_F)
        heating[a] = sum_q
        store_row(slopes, a, 0, slope)
