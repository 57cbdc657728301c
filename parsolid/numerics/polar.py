"""Rotations of deformation gradients, F = R U, and symmetric tensors rotated by them, for floats and `Lanes` alike."""

import math

from numba.extending import overload

from parsolid.numerics.elementary import choose, some_positive
from parsolid.numerics.tensors import PLANE, SPACE, _size, cofactor, contract, expand, matmul, transposed

# a step of Newton's method that changes R by less than this has an error of the square of it, below rounding
_CHANGE = 1e-15
_MOST_STEPS = 30


def rotation(F):
    """R of F = R U, of a general tensor with a positive determinant.

    Three dimensions: Newton's method X = (g X + X^-T / g)/2 with g^4 = |X^-1|^2 / |X|^2 (Higham, SIAM J. Sci. Stat. Comput. 7
    (1986) 1160). A lane that has settled is not changed again, so that a particle does not feel its neighbours in the lanes.
    """
    raise NotImplementedError


@overload(rotation)
def _rotation(F):
    if _size(F) == PLANE:

        def plane(F):
            cosine, sine = F[0] + F[3], F[2] - F[1]
            norm = 1.0 / math.sqrt(cosine * cosine + sine * sine)
            cosine, sine = norm * cosine, norm * sine
            return cosine, -sine, sine, cosine, 1.0

        return plane
    if _size(F) == SPACE:

        def space(F):
            X, moving = F, 1.0 + 0.0 * F[0]
            for _ in range(_MOST_STEPS):
                H = cofactor(X)
                J = X[0] * H[0] + X[1] * H[1] + X[2] * H[2]
                # g = (|X^-1| / |X|)^(1/2) with X^-T = H / J
                squares = contract(H, H) / contract(X, X)
                g = math.sqrt(math.sqrt(squares) / J)
                new = _mean(0.5 * g, X, 0.5 / (g * J), H)
                change = _mean(1.0, new, -1.0, X)
                X = _chosen(moving, new, X)
                moving = choose(moving, contract(change, change) - _CHANGE, moving)
                if not some_positive(moving):
                    break
            return X

        return space


def _mean(a, X, b, Y):
    """a X + b Y."""
    raise NotImplementedError


@overload(_mean)
def _weighted(a, X, b, Y):
    return lambda a, X, b, Y: (
        a * X[0] + b * Y[0],
        a * X[1] + b * Y[1],
        a * X[2] + b * Y[2],
        a * X[3] + b * Y[3],
        a * X[4] + b * Y[4],
        a * X[5] + b * Y[5],
        a * X[6] + b * Y[6],
        a * X[7] + b * Y[7],
        a * X[8] + b * Y[8],
    )


def _chosen(condition, X, Y):
    raise NotImplementedError


@overload(_chosen)
def _choose_nine(condition, X, Y):
    return lambda condition, X, Y: (
        choose(condition, X[0], Y[0]),
        choose(condition, X[1], Y[1]),
        choose(condition, X[2], Y[2]),
        choose(condition, X[3], Y[3]),
        choose(condition, X[4], Y[4]),
        choose(condition, X[5], Y[5]),
        choose(condition, X[6], Y[6]),
        choose(condition, X[7], Y[7]),
        choose(condition, X[8], Y[8]),
    )


def rotation_near(near, F):
    """R of F = R U to second order of the small rotation that leads from `near` to it: one linear equation.

    With near^T F = exp(w) U, the skew part gives (tr U 1 - U) w = (A32 - A23, A13 - A31, A21 - A12).
    """
    raise NotImplementedError


@overload(rotation_near)
def _rotation_near(near, F):
    if _size(F) == PLANE:
        return lambda near, F: rotation(F)
    if _size(F) == SPACE:

        def space(near, F):
            A = matmul(transposed(near), F)
            # the symmetric matrix tr U 1 - U, and its inverse
            a, b, c = A[4] + A[8], A[0] + A[8], A[0] + A[4]
            d, e, f = -0.5 * (A[1] + A[3]), -0.5 * (A[2] + A[6]), -0.5 * (A[5] + A[7])
            p, q, r = b * c - f * f, e * f - d * c, d * f - e * b
            g = 1.0 / (a * p + d * q + e * r)
            u, v, w = A[7] - A[5], A[2] - A[6], A[3] - A[1]
            x = g * (p * u + q * v + r * w)
            y = g * (q * u + (a * c - e * e) * v + (d * e - a * f) * w)
            z = g * (r * u + (d * e - a * f) * v + (a * b - d * d) * w)
            # the rotation (1 - w/2)^-1 (1 + w/2) = 1 + (w + w w/2) / (1 + w.w/4) stays one
            h = 1.0 / (1.0 + 0.25 * (x * x + y * y + z * z))
            k = 0.5 * h
            turn = (
                1.0 - k * (y * y + z * z),
                k * x * y - h * z,
                k * x * z + h * y,
                k * x * y + h * z,
                1.0 - k * (x * x + z * z),
                k * y * z - h * x,
                k * x * z - h * y,
                k * y * z + h * x,
                1.0 - k * (x * x + y * y),
            )
            return matmul(near, turn)

        return space


def plus_one(a):
    """1 + a of a general tensor."""
    raise NotImplementedError


@overload(plus_one)
def _plus_one(a):
    if _size(a) == PLANE:
        return lambda a: (1.0 + a[0], a[1], a[2], 1.0 + a[3], 1.0 + a[4])
    if _size(a) == SPACE:
        return lambda a: (1.0 + a[0], a[1], a[2], a[3], 1.0 + a[4], a[5], a[6], a[7], 1.0 + a[8])


def symmetric_part(a):
    """(a + a^T)/2 of a general tensor, symmetric."""
    raise NotImplementedError


@overload(symmetric_part)
def _symmetric_part(a):
    if _size(a) == PLANE:
        return lambda a: (a[0], a[3], a[4], 0.5 * (a[1] + a[2]))
    if _size(a) == SPACE:
        return lambda a: (a[0], a[4], a[8], 0.5 * (a[1] + a[3]), 0.5 * (a[2] + a[6]), 0.5 * (a[5] + a[7]))


def congruence(a, s):
    """a s a^T of a general and a symmetric tensor, symmetric."""
    raise NotImplementedError


@overload(congruence)
def _congruence(a, s):
    if _size(a) == PLANE:

        def plane(a, s):
            b = matmul(a, expand(s))
            return (
                b[0] * a[0] + b[1] * a[1],
                b[2] * a[2] + b[3] * a[3],
                b[4] * a[4],
                b[0] * a[2] + b[1] * a[3],
            )

        return plane
    if _size(a) == SPACE:

        def space(a, s):
            b = matmul(a, expand(s))
            return (
                b[0] * a[0] + b[1] * a[1] + b[2] * a[2],
                b[3] * a[3] + b[4] * a[4] + b[5] * a[5],
                b[6] * a[6] + b[7] * a[7] + b[8] * a[8],
                b[0] * a[3] + b[1] * a[4] + b[2] * a[5],
                b[0] * a[6] + b[1] * a[7] + b[2] * a[8],
                b[3] * a[6] + b[4] * a[7] + b[5] * a[8],
            )

        return space
