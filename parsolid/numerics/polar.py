"""Rotations of deformation gradients, F = R U, and symmetric tensors rotated by them, for floats and `Lanes` alike."""

import math

from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.elementary import choose, some_positive
from parsolid.numerics.tensors import (
    GeneralPlane,
    GeneralSpace,
    I,
    SymmetricPlane,
    SymmetricSpace,
    Tensor,
    cofactor,
    contract,
    formula,
)

# a step of Newton's method that changes R by less than this has an error of the square of it, below rounding
_CHANGE = 1e-15
_MOST_STEPS = 30


@generic
def rotation(F: Tensor):
    """R of F = R U, of a general tensor with a positive determinant.

    Three dimensions: Newton's method X = (g X + X^-T / g)/2 with g^4 = |X^-1|^2 / |X|^2 (Higham, SIAM J. Sci. Stat.
    Comput. 7 (1986) 1160). A lane that has settled is not changed again, so that a particle does not feel its
    neighbours in the lanes.
    """


@rotation.of(GeneralPlane)
def _plane_rotation(F):
    cosine, sine = F[0] + F[3], F[2] - F[1]
    norm = 1.0 / math.sqrt(cosine * cosine + sine * sine)
    cosine, sine = norm * cosine, norm * sine
    return GeneralPlane(cosine, -sine, sine, cosine, 1.0)


@rotation.of(GeneralSpace)
def _space_rotation(F):
    X, moving = F, 1.0 + 0.0 * F[0]
    for _ in range(_MOST_STEPS):
        H = cofactor(X)
        J = X[0] * H[0] + X[1] * H[1] + X[2] * H[2]
        # g = (|X^-1| / |X|)^(1/2) with X^-T = H / J
        squares = contract(H, H) / contract(X, X)
        g = math.sqrt(math.sqrt(squares) / J)
        new = (0.5 * g) * X + (0.5 / (g * J)) * H
        change = new - X
        X = _chosen(moving, new, X)
        moving = choose(moving, contract(change, change) - _CHANGE, moving)
        if not some_positive(moving):
            break
    return X


@register_jitable
def _chosen(condition, X, Y):
    return GeneralSpace(
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


@generic
def rotation_near(near: Tensor, F: Tensor):
    """R of F = R U to second order of the small rotation that leads from `near` to it: one linear equation.

    With near^T F = exp(w) U, the skew part gives (tr U 1 - U) w = (A32 - A23, A13 - A31, A21 - A12).
    """


@rotation_near.of(GeneralPlane)
def _plane_rotation_near(near, F):
    return rotation(F)


@rotation_near.of(GeneralSpace)
def _space_rotation_near(near, F):
    A = near.T @ F
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
    turn = GeneralSpace(
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
    return near @ turn


@formula
def plus_one(a):
    """1 + a of a tensor."""
    return I + a


@formula
def symmetric_part(a):
    """(a + a^T)/2 of a general tensor, symmetric."""
    if isinstance(a, GeneralPlane):
        return SymmetricPlane(a[0], a[3], a[4], 0.5 * (a[1] + a[2]))
    return SymmetricSpace(a[0], a[4], a[8], 0.5 * (a[1] + a[3]), 0.5 * (a[2] + a[6]), 0.5 * (a[5] + a[7]))


@formula
def congruence(a, s):
    """a s a^T of a general and a symmetric tensor, symmetric."""
    b = a @ s
    if isinstance(a, GeneralPlane):
        return SymmetricPlane(
            b[0] * a[0] + b[1] * a[1], b[2] * a[2] + b[3] * a[3], b[4] * a[4], b[0] * a[2] + b[1] * a[3]
        )
    return SymmetricSpace(
        b[0] * a[0] + b[1] * a[1] + b[2] * a[2],
        b[3] * a[3] + b[4] * a[4] + b[5] * a[5],
        b[6] * a[6] + b[7] * a[7] + b[8] * a[8],
        b[0] * a[3] + b[1] * a[4] + b[2] * a[5],
        b[0] * a[6] + b[1] * a[7] + b[2] * a[8],
        b[3] * a[6] + b[4] * a[7] + b[5] * a[8],
    )
