"""The two adjoint sweeps over pair lists: the gradient of the velocity, and the force of stresses with its dissipation.

With an antisymmetric weight g_ab and a matrix L_a of each particle,

    gradient     (grad v)_a = [sum_b (v_b - v_a) (x) g_ab] L_a^T / V_a
    divergence   T_a = sum_b (P_a L_a + P_b L_b) g_ab                                           [N]
    dissipation  D_a = sum_b k_ab [Z_s u + (Z_p - Z_s)(u . n) n],   n along x_b - x_a           [N]

where u = v_b - v_a - 1/2 (grad v_a + grad v_b)(X_b - X_a) is the jump of the velocity with linear reconstruction, and
Z = Z_a + Z_b are halves of the impedances of pressure and shear waves (Lee et al., eqs (70) to (75)). Impedances are
means over all directions, or those of the direction of g_ab by wave tensors.

A list has every pair once, and both its particles receive; rows of ghosts and of mirror images, behind the owned ones,
gather sums that nobody reads. Arrays are rows of four numbers a vector (`rows_of_four`): in space and in plane strain

    motion   v 0 | x 0 | X 0                                        v x | X 0 0
    record   1/2 grad v by columns: c1 0 | c2 0 | c3 0              c1 c2
             P L by columns: c1 Z_p | c2 Z_s | c3 0                 c1 c2 | Z_p Z_s 0 0
    fast     1/2 rho^2 Q_p: 11 22 33 Z_s | 12 13 23 0               11 22 12 Z_s
    slow     1/2 rho^2 Q_s: 11 22 33 0 | 12 13 23 0                 11 22 12 0
    force    T 0 | D 0                                              T D
    operator L by rows: l1 1/V | l2 0 | l3 0                        l1 l2 | 1/V 0 0 0
    weight   g_ab k_ab                                              g_ab k_ab 0

Where the record has 1/2 grad v, the sums sum_b (v_b - v_a) (x) g_ab are gathered before; they begin at zero. They stand
first so that a vector of eight numbers, as LLVM makes it of two rows of four, does not cross cache lines.
fast and slow are None where the record holds mean impedances, and k_ab then is a length times |g_ab|; slow alone is
None where shear waves have one speed in all directions.
"""

from typing import NamedTuple

from parsolid.kernels import inlined, kernel
from parsolid.pairs.pair_list import weight_row
from parsolid.pairs.riemann import riemann_factors
from parsolid.pairs.rows_of_four import add, add_scaled, load_row, scale, store_row, subtract


class RowsOfFour(NamedTuple):
    """Widths of the rows of a particle, the columns in them at which vectors begin, and numbers a vector."""

    motion: int
    record: int
    force: int
    operator: int
    tensor: int
    position: int
    reference: int
    stress: int
    vector: int


ROWS = {2: RowsOfFour(8, 12, 4, 8, 4, 2, 4, 4, 2), 3: RowsOfFour(12, 24, 8, 12, 8, 4, 8, 12, 4)}


@inlined
def _along(g1, g2, g3, diagonal, rest):
    """g . Q g of a symmetric tensor in two rows, its diagonal and the rest."""
    oblique = rest[0] * g1 * g2 + rest[1] * g1 * g3 + rest[2] * g2 * g3
    return diagonal[0] * g1 * g1 + diagonal[1] * g2 * g2 + diagonal[2] * g3 * g3 + 2.0 * oblique


@kernel
def gradient_in_space(pairs, first, last, motion, record):
    """Add the sums of the velocity gradient of the pairs in rows first .. last - 1 of a list. Then those of the rows
    are complete, if all rows before them have been added: pairs stand at the lower of their rows."""
    start, neighbour, weight, kind = pairs.start, pairs.neighbour, pairs.weight, pairs.kind
    for a in range(first, last):
        if start[a] == start[a + 1]:
            continue
        v = load_row(motion, a, 0)
        c1, c2, c3 = load_row(record, a, 0), load_row(record, a, 4), load_row(record, a, 8)
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight_row(kind, k)
            jump = subtract(load_row(motion, b, 0), v)
            g1, g2, g3 = weight[w, 0], weight[w, 1], weight[w, 2]
            c1, c2, c3 = add_scaled(c1, g1, jump), add_scaled(c2, g2, jump), add_scaled(c3, g3, jump)
            store_row(record, b, 0, add_scaled(load_row(record, b, 0), g1, jump))
            store_row(record, b, 4, add_scaled(load_row(record, b, 4), g2, jump))
            store_row(record, b, 8, add_scaled(load_row(record, b, 8), g3, jump))
        store_row(record, a, 0, c1)
        store_row(record, a, 4, c2)
        store_row(record, a, 8, c3)


@kernel
def gradient_in_plane(pairs, first, last, motion, record):
    """`gradient_in_space`, in plane strain."""
    start, neighbour, weight, kind = pairs.start, pairs.neighbour, pairs.weight, pairs.kind
    for a in range(first, last):
        if start[a] == start[a + 1]:
            continue
        v1, v2 = motion[a, 0], motion[a, 1]
        total = load_row(record, a, 0)
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight_row(kind, k)
            u1, u2, g1, g2 = motion[b, 0] - v1, motion[b, 1] - v2, weight[w, 0], weight[w, 1]
            pair = (u1 * g1, u2 * g1, u1 * g2, u2 * g2)
            total = add(total, pair)
            store_row(record, b, 0, add(load_row(record, b, 0), pair))
        store_row(record, a, 0, total)


@kernel
def divergence_in_space(pairs, first, last, motion, record, fast, slow, force, heat):
    """Add the forces of the pairs in rows first .. last - 1 of a list [N]: T of stresses and D of the dissipation.

    heat (rows,) [W]: half of what D takes in each pair is added to both particles; None where nobody asks."""
    start, neighbour, weight, kind = pairs.start, pairs.neighbour, pairs.weight, pairs.kind
    for a in range(first, last):
        if start[a] == start[a + 1]:
            continue
        v, x, X = load_row(motion, a, 0), load_row(motion, a, 4), load_row(motion, a, 8)
        P1, P2, P3 = load_row(record, a, 12), load_row(record, a, 16), load_row(record, a, 20)
        G1, G2, G3 = load_row(record, a, 0), load_row(record, a, 4), load_row(record, a, 8)
        T, D = load_row(force, a, 0), load_row(force, a, 4)
        if fast is not None:
            fast1, fast2 = load_row(fast, a, 0), load_row(fast, a, 4)
        if slow is not None:
            slow1, slow2 = load_row(slow, a, 0), load_row(slow, a, 4)
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight_row(kind, k)
            g1, g2, g3, jump_factor = weight[w, 0], weight[w, 1], weight[w, 2], weight[w, 3]
            S1, S2 = add(P1, load_row(record, b, 12)), add(P2, load_row(record, b, 16))
            S3 = add(P3, load_row(record, b, 20))
            stress = add_scaled(add_scaled(scale(g1, S1), g2, S2), g3, S3)
            T = add(T, stress)
            # at once: kept until the dissipation is known it takes half as long again
            store_row(force, b, 0, subtract(load_row(force, b, 0), stress))
            u, line = subtract(load_row(motion, b, 0), v), subtract(load_row(motion, b, 4), x)
            back = subtract(X, load_row(motion, b, 8))
            u = add_scaled(u, back[0], add(G1, load_row(record, b, 0)))
            u = add_scaled(u, back[1], add(G2, load_row(record, b, 4)))
            u = add_scaled(u, back[2], add(G3, load_row(record, b, 8)))
            if fast is None:
                Z_p, Z_s = S1[3], S2[3]
            else:
                Q1, Q2 = add(fast1, load_row(fast, b, 0)), add(fast2, load_row(fast, b, 4))
                Z_p = _along(g1, g2, g3, Q1, Q2) ** 0.5
                if slow is None:
                    Z_s = (g1 * g1 + g2 * g2 + g3 * g3) ** 0.5 * Q1[3]
                else:
                    Q1, Q2 = add(slow1, load_row(slow, b, 0)), add(slow2, load_row(slow, b, 4))
                    Z_s = _along(g1, g2, g3, Q1, Q2) ** 0.5
            u_r = u[0] * line[0] + u[1] * line[1] + u[2] * line[2]
            r_r = line[0] * line[0] + line[1] * line[1] + line[2] * line[2]
            s, along = riemann_factors(Z_p, Z_s, u_r, r_r)
            dissipative = scale(jump_factor, add_scaled(scale(s, u), along, line))
            D = add(D, dissipative)
            store_row(force, b, 4, subtract(load_row(force, b, 4), dissipative))
            if heat is not None:
                jump = subtract(load_row(motion, b, 0), v)
                taken = 0.5 * (dissipative[0] * jump[0] + dissipative[1] * jump[1] + dissipative[2] * jump[2])
                heat[a] += taken
                heat[b] += taken
        store_row(force, a, 0, T)
        store_row(force, a, 4, D)


@kernel
def divergence_in_plane(pairs, first, last, motion, record, fast, slow, force, heat):
    """`divergence_in_space`, in plane strain."""
    start, neighbour, weight, kind = pairs.start, pairs.neighbour, pairs.weight, pairs.kind
    for a in range(first, last):
        if start[a] == start[a + 1]:
            continue
        here, X1, X2 = load_row(motion, a, 0), motion[a, 4], motion[a, 5]
        P, G, waves = load_row(record, a, 4), load_row(record, a, 0), load_row(record, a, 8)
        if fast is not None:
            waves = load_row(fast, a, 0)
        if slow is not None:
            shear = load_row(slow, a, 0)
        total = load_row(force, a, 0)
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight_row(kind, k)
            g1, g2, jump_factor = weight[w, 0], weight[w, 1], weight[w, 2]
            S, grad, step = (
                add(P, load_row(record, b, 4)),
                add(G, load_row(record, b, 0)),
                subtract(load_row(motion, b, 0), here),
            )
            back1, back2 = X1 - motion[b, 4], X2 - motion[b, 5]
            u1 = step[0] + grad[0] * back1 + grad[2] * back2
            u2 = step[1] + grad[1] * back1 + grad[3] * back2
            if fast is None:
                Z_p, Z_s = waves[0] + record[b, 8], waves[1] + record[b, 9]
            else:
                Q = add(waves, load_row(fast, b, 0))
                Z_p = (Q[0] * g1 * g1 + Q[1] * g2 * g2 + 2.0 * Q[2] * g1 * g2) ** 0.5
                if slow is None:
                    Z_s = (g1 * g1 + g2 * g2) ** 0.5 * Q[3]
                else:
                    Q = add(shear, load_row(slow, b, 0))
                    Z_s = (Q[0] * g1 * g1 + Q[1] * g2 * g2 + 2.0 * Q[2] * g1 * g2) ** 0.5
            u_r, r_r = u1 * step[2] + u2 * step[3], step[2] * step[2] + step[3] * step[3]
            s, along = riemann_factors(Z_p, Z_s, u_r, r_r)
            D1, D2 = jump_factor * (s * u1 + along * step[2]), jump_factor * (s * u2 + along * step[3])
            pair = (S[0] * g1 + S[2] * g2, S[1] * g1 + S[3] * g2, D1, D2)
            total = add(total, pair)
            store_row(force, b, 0, subtract(load_row(force, b, 0), pair))
            if heat is not None:
                taken = 0.5 * (D1 * step[0] + D2 * step[1])
                heat[a] += taken
                heat[b] += taken
        store_row(force, a, 0, total)


@kernel
def stress_divergence_in_space(pairs, first, last, record, force):
    """`divergence_in_space` without dissipation."""
    start, neighbour, weight, kind = pairs.start, pairs.neighbour, pairs.weight, pairs.kind
    for a in range(first, last):
        if start[a] == start[a + 1]:
            continue
        P1, P2, P3 = load_row(record, a, 12), load_row(record, a, 16), load_row(record, a, 20)
        T = load_row(force, a, 0)
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight_row(kind, k)
            stress = scale(weight[w, 0], add(P1, load_row(record, b, 12)))
            stress = add_scaled(stress, weight[w, 1], add(P2, load_row(record, b, 16)))
            stress = add_scaled(stress, weight[w, 2], add(P3, load_row(record, b, 20)))
            T = add(T, stress)
            store_row(force, b, 0, subtract(load_row(force, b, 0), stress))
        store_row(force, a, 0, T)


@kernel
def stress_divergence_in_plane(pairs, first, last, record, force):
    """`divergence_in_plane` without dissipation."""
    start, neighbour, weight, kind = pairs.start, pairs.neighbour, pairs.weight, pairs.kind
    for a in range(first, last):
        if start[a] == start[a + 1]:
            continue
        P, T1, T2 = load_row(record, a, 4), force[a, 0], force[a, 1]
        for k in range(start[a], start[a + 1]):
            b, w = neighbour[k], weight_row(kind, k)
            S = add(P, load_row(record, b, 4))
            f1, f2 = S[0] * weight[w, 0] + S[2] * weight[w, 1], S[1] * weight[w, 0] + S[3] * weight[w, 1]
            T1, T2 = T1 + f1, T2 + f2
            force[b, 0] -= f1
            force[b, 1] -= f2
        force[a, 0], force[a, 1] = T1, T2
