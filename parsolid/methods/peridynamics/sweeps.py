"""Sums over bonds of correspondence peridynamics, in space and in the plane.

With the weight w_ab = w(|xi|) V_a V_b of a bond xi = X_b - X_a, the two sweeps are

    gradient      sum_b w_ab (f_b - f_a) (x) xi                                  = V_a G_a K_a of a field f
    divergence    sum_b w_ab [(M_a + M_b) xi + (C_a + C_b) (f_b - f_a)]          force [N]

The divergence with M = P K^-1 - C G is the adjoint of the gradient, so that it is the derivative of an energy. A bond
is stored at one of its ends, and both receive; a ghost and a mirror image receive nothing. The image of a particle
stands at R X + T and has the field Q f and the matrices Q M R and Q C Q, with which the sweeps are adjoint at every
kind of plane.

Every particle has one row of each array. In space, vectors and columns of matrices are padded to four numbers, so that
LLVM makes one vector instruction of each:

    motion (n, 8)   X 0 f 0          sums, M, C (n, 12)   the three columns of a matrix          force (owned, 4)

In the plane they are motion (n, 4) = X f, a matrix (n, 4) column by column, and force (owned, 4), half of it unused.
"""

from typing import NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel


class BondList(NamedTuple):
    """Bonds of particle a in rows start[a] : start[a + 1], (n + 1,) int64.

    neighbour (m,) uint32, of which no sign need be tested; weight (m,): w(|xi|) V_a V_b [m^6, in the plane m^4], 0 of a
    broken bond.
    """

    start: np.ndarray
    neighbour: np.ndarray
    weight: np.ndarray


class Images(NamedTuple):
    """Mirror images of the neighbours: code (m,) int8 of each bond, a row of signs Q, reflections R (+-1) and shifts T
    [m], each (codes, 4)."""

    code: np.ndarray
    signs: np.ndarray
    reflections: np.ndarray
    shifts: np.ndarray


@inlined
def four(A, i, j):
    """Four numbers of row i from column j on."""
    return (A[i, j], A[i, j + 1], A[i, j + 2], A[i, j + 3])


@inlined
def minus(a, b):
    """a - b of four numbers."""
    return (a[0] - b[0], a[1] - b[1], a[2] - b[2], a[3] - b[3])


@inlined
def plus(a, b):
    """a + b of four numbers."""
    return (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3])


@inlined
def product(a, b):
    """a b of four numbers each."""
    return (a[0] * b[0], a[1] * b[1], a[2] * b[2], a[3] * b[3])


@inlined
def scaled(s, a):
    """s a of four numbers."""
    return (s * a[0], s * a[1], s * a[2], s * a[3])


@inlined
def plus_scaled(a, s, b):
    """a + s b of four numbers."""
    return (a[0] + s * b[0], a[1] + s * b[1], a[2] + s * b[2], a[3] + s * b[3])


@inlined
def add_four(A, i, j, a):
    """Add four numbers to row i from column j on."""
    A[i, j] += a[0]
    A[i, j + 1] += a[1]
    A[i, j + 2] += a[2]
    A[i, j + 3] += a[3]


@inlined
def store_four(A, i, j, a):
    """Store four numbers in row i from column j on."""
    A[i, j], A[i, j + 1], A[i, j + 2], A[i, j + 3] = a[0], a[1], a[2], a[3]


# what a particle itself is beside its images
ONE, ZERO = (1.0, 1.0, 1.0, 1.0), (0.0, 0.0, 0.0, 0.0)


@inlined
def bond_vectors(motion, Q, R, T, a, b):
    """xi and f_b - f_a of a bond, of which b is seen as an image, in the plane with a third component 0.

    Seen from its other end a bond without an image has the negatives, to the bit, so that two ranks decide alike about
    one across their border. That does not hold with an image: whoever decides looks at both (a, b') and (b, a').
    """
    d = 2 if motion.shape[1] == 4 else 3
    f, last = 2 * (d - 1), d - 1
    xi = (R[0] * motion[b, 0] + T[0] - motion[a, 0], R[1] * motion[b, 1] + T[1] - motion[a, 1],
          R[2] * motion[b, last] + T[2] - motion[a, last] if d == 3 else 0.0)  # fmt: skip
    jump = (Q[0] * motion[b, f] - motion[a, f], Q[1] * motion[b, f + 1] - motion[a, f + 1],
            Q[2] * motion[b, f + last] - motion[a, f + last] if d == 3 else 0.0)  # fmt: skip
    return xi, jump


@kernel
def add_gradients_in_space(bonds, images, receivers, motion, sums):
    """Add sum_b w_ab (f_b - f_a) (x) xi to sums; neighbours below row `receivers` receive, too."""
    for a in range(bonds.start.shape[0] - 1):
        X, f = four(motion, a, 0), four(motion, a, 4)
        s0, s1, s2 = four(sums, a, 0), four(sums, a, 4), four(sums, a, 8)
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            X_b, f_b = four(motion, b, 0), four(motion, b, 4)
            if images is not None:
                c = images.code[k]
                X_b = plus(product(four(images.reflections, c, 0), X_b), four(images.shifts, c, 0))
                f_b = product(four(images.signs, c, 0), f_b)
            xi, jump = minus(X_b, X), scaled(bonds.weight[k], minus(f_b, f))
            d0, d1, d2 = scaled(xi[0], jump), scaled(xi[1], jump), scaled(xi[2], jump)
            s0, s1, s2 = plus(s0, d0), plus(s1, d1), plus(s2, d2)
            if b < receivers:
                add_four(sums, b, 0, d0)
                add_four(sums, b, 4, d1)
                add_four(sums, b, 8, d2)
        store_four(sums, a, 0, s0)
        store_four(sums, a, 4, s1)
        store_four(sums, a, 8, s2)


@kernel
def add_gradients_in_plane(bonds, images, receivers, motion, sums):
    """As `add_gradients_in_space`."""
    for a in range(bonds.start.shape[0] - 1):
        own, s = four(motion, a, 0), four(sums, a, 0)
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            other = four(motion, b, 0)
            if images is not None:
                c = images.code[k]
                Q, R, T = four(images.signs, c, 0), four(images.reflections, c, 0), four(images.shifts, c, 0)
                other = (R[0] * other[0] + T[0], R[1] * other[1] + T[1], Q[0] * other[2], Q[1] * other[3])
            step = minus(other, own)
            g0, g1 = bonds.weight[k] * step[0], bonds.weight[k] * step[1]
            d = (step[2] * g0, step[3] * g0, step[2] * g1, step[3] * g1)
            s = plus(s, d)
            if b < receivers:
                add_four(sums, b, 0, d)
        store_four(sums, a, 0, s)


@kernel
def add_forces_in_space(bonds, images, receivers, motion, M, C, force):
    """Add the forces of the bonds [N]; C None: without control; neighbours below row `receivers` receive, too."""
    for a in range(bonds.start.shape[0] - 1):
        X, f, total = four(motion, a, 0), four(motion, a, 4), four(force, a, 0)
        M0, M1, M2 = four(M, a, 0), four(M, a, 4), four(M, a, 8)
        if C is not None:
            C0, C1, C2 = four(C, a, 0), four(C, a, 4), four(C, a, 8)
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b, w = bonds.neighbour[k], bonds.weight[k]
            X_b, m0, m1, m2 = four(motion, b, 0), four(M, b, 0), four(M, b, 4), four(M, b, 8)
            if images is not None:
                Q, R = four(images.signs, images.code[k], 0), four(images.reflections, images.code[k], 0)
                X_b = plus(product(R, X_b), four(images.shifts, images.code[k], 0))
                m0, m1, m2 = scaled(R[0], product(Q, m0)), scaled(R[1], product(Q, m1)), scaled(R[2], product(Q, m2))
            xi = scaled(w, minus(X_b, X))
            t = plus_scaled(scaled(xi[0], plus(M0, m0)), xi[1], plus(M1, m1))
            t = plus_scaled(t, xi[2], plus(M2, m2))
            if C is not None:
                f_b, c0, c1, c2 = four(motion, b, 4), four(C, b, 0), four(C, b, 4), four(C, b, 8)
                if images is not None:
                    f_b, c0 = product(Q, f_b), scaled(Q[0], product(Q, c0))
                    c1, c2 = scaled(Q[1], product(Q, c1)), scaled(Q[2], product(Q, c2))
                jump = scaled(w, minus(f_b, f))
                t = plus_scaled(t, jump[0], plus(C0, c0))
                t = plus_scaled(plus_scaled(t, jump[1], plus(C1, c1)), jump[2], plus(C2, c2))
            total = plus(total, t)
            if b < receivers:
                add_four(force, b, 0, scaled(-1.0, t))
        store_four(force, a, 0, total)


@kernel
def add_forces_in_plane(bonds, images, receivers, motion, M, C, force):
    """As `add_forces_in_space`."""
    for a in range(bonds.start.shape[0] - 1):
        own, M_a, t0, t1 = four(motion, a, 0), four(M, a, 0), force[a, 0], force[a, 1]
        if C is not None:
            C_a = four(C, a, 0)
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b, w = bonds.neighbour[k], bonds.weight[k]
            other, M_b = four(motion, b, 0), four(M, b, 0)
            if images is not None:
                c = images.code[k]
                Q0, Q1, R0, R1 = (
                    images.signs[c, 0],
                    images.signs[c, 1],
                    images.reflections[c, 0],
                    images.reflections[c, 1],
                )
                other = (
                    R0 * other[0] + images.shifts[c, 0],
                    R1 * other[1] + images.shifts[c, 1],
                    Q0 * other[2],
                    Q1 * other[3],
                )
                M_b = product((Q0 * R0, Q1 * R0, Q0 * R1, Q1 * R1), M_b)
            step, m = scaled(w, minus(other, own)), plus(M_a, M_b)
            f0, f1 = m[0] * step[0] + m[2] * step[1], m[1] * step[0] + m[3] * step[1]
            if C is not None:
                C_b = four(C, b, 0)
                if images is not None:
                    C_b = product((1.0, Q0 * Q1, Q0 * Q1, 1.0), C_b)
                c = plus(C_a, C_b)
                f0, f1 = f0 + (c[0] * step[2] + c[2] * step[3]), f1 + (c[1] * step[2] + c[3] * step[3])
            t0, t1 = t0 + f0, t1 + f1
            if b < receivers:
                force[b, 0] -= f0
                force[b, 1] -= f1
        force[a, 0], force[a, 1] = t0, t1


@kernel
def fill_columns(first, last, vectors, column, rows):
    """Copy vectors (d, n) of some particles into rows from a column on."""
    for i in range(vectors.shape[0]):
        for a in range(first, last):
            rows[a, column + i] = vectors[i, a]
