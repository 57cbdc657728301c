"""Small tensors as tuples of numbers, for kernels and plain Python alike.

A general tensor has nine components, row by row (11, 12, 13, 21, ...); a symmetric one has six: 11, 22, 33, 12, 13, 23.
In plane strain the tensors are the same, with zeros out of the plane.
"""

import math

from parsolid.kernels import inlined

IDENTITY = (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)


@inlined
def plus(A, B):
    """A + B of general tensors."""
    return (A[0] + B[0], A[1] + B[1], A[2] + B[2], A[3] + B[3], A[4] + B[4],
            A[5] + B[5], A[6] + B[6], A[7] + B[7], A[8] + B[8])  # fmt: skip


@inlined
def times(a, A):
    """a A of a general tensor."""
    return (a * A[0], a * A[1], a * A[2], a * A[3], a * A[4], a * A[5], a * A[6], a * A[7], a * A[8])


@inlined
def combine(a, A, b, B):
    """a A + b B of general tensors."""
    return (a * A[0] + b * B[0], a * A[1] + b * B[1], a * A[2] + b * B[2],
            a * A[3] + b * B[3], a * A[4] + b * B[4], a * A[5] + b * B[5],
            a * A[6] + b * B[6], a * A[7] + b * B[7], a * A[8] + b * B[8])  # fmt: skip


@inlined
def transpose(A):
    """A^T of a general tensor."""
    return (A[0], A[3], A[6], A[1], A[4], A[7], A[2], A[5], A[8])


@inlined
def matmul(A, B):
    """A B of general tensors."""
    return (A[0] * B[0] + A[1] * B[3] + A[2] * B[6],
            A[0] * B[1] + A[1] * B[4] + A[2] * B[7],
            A[0] * B[2] + A[1] * B[5] + A[2] * B[8],
            A[3] * B[0] + A[4] * B[3] + A[5] * B[6],
            A[3] * B[1] + A[4] * B[4] + A[5] * B[7],
            A[3] * B[2] + A[4] * B[5] + A[5] * B[8],
            A[6] * B[0] + A[7] * B[3] + A[8] * B[6],
            A[6] * B[1] + A[7] * B[4] + A[8] * B[7],
            A[6] * B[2] + A[7] * B[5] + A[8] * B[8])  # fmt: skip


@inlined
def matmul_transposed(A, B):
    """A B^T of general tensors."""
    return matmul(A, transpose(B))


@inlined
def determinant(A):
    """Of a general tensor."""
    return A[0] * (A[4] * A[8] - A[5] * A[7]) - A[1] * (A[3] * A[8] - A[5] * A[6]) + A[2] * (A[3] * A[7] - A[4] * A[6])


@inlined
def cofactor(A):
    """det(A) A^-T of a general tensor."""
    return (A[4] * A[8] - A[5] * A[7], A[5] * A[6] - A[3] * A[8], A[3] * A[7] - A[4] * A[6],
            A[2] * A[7] - A[1] * A[8], A[0] * A[8] - A[2] * A[6], A[1] * A[6] - A[0] * A[7],
            A[1] * A[5] - A[2] * A[4], A[2] * A[3] - A[0] * A[5], A[0] * A[4] - A[1] * A[3])  # fmt: skip


@inlined
def inverse(A):
    """A^-1 of a general tensor."""
    H = cofactor(A)
    return times(1.0 / (A[0] * H[0] + A[1] * H[1] + A[2] * H[2]), transpose(H))


@inlined
def cross(A, B):
    """The tensor cross product of Bonet, Gil & Ortigosa: d(cof A) = A x dA, and cof A = 1/2 A x A."""
    return (A[4] * B[8] - A[5] * B[7] + A[8] * B[4] - A[7] * B[5],
            A[5] * B[6] - A[3] * B[8] + A[6] * B[5] - A[8] * B[3],
            A[3] * B[7] - A[4] * B[6] + A[7] * B[3] - A[6] * B[4],
            A[2] * B[7] - A[1] * B[8] + A[7] * B[2] - A[8] * B[1],
            A[0] * B[8] - A[2] * B[6] + A[8] * B[0] - A[6] * B[2],
            A[1] * B[6] - A[0] * B[7] + A[6] * B[1] - A[7] * B[0],
            A[1] * B[5] - A[2] * B[4] + A[5] * B[1] - A[4] * B[2],
            A[2] * B[3] - A[0] * B[5] + A[3] * B[2] - A[5] * B[0],
            A[0] * B[4] - A[1] * B[3] + A[4] * B[0] - A[3] * B[1])  # fmt: skip


@inlined
def contract(A, B):
    """A : B of general tensors."""
    return ((A[0] * B[0] + A[1] * B[1] + A[2] * B[2]) + (A[3] * B[3] + A[4] * B[4] + A[5] * B[5])
            + (A[6] * B[6] + A[7] * B[7] + A[8] * B[8]))  # fmt: skip


@inlined
def gram(A):
    """A^T A of a general tensor, symmetric."""
    return (A[0] * A[0] + A[3] * A[3] + A[6] * A[6],
            A[1] * A[1] + A[4] * A[4] + A[7] * A[7],
            A[2] * A[2] + A[5] * A[5] + A[8] * A[8],
            A[0] * A[1] + A[3] * A[4] + A[6] * A[7],
            A[0] * A[2] + A[3] * A[5] + A[6] * A[8],
            A[1] * A[2] + A[4] * A[5] + A[7] * A[8])  # fmt: skip


@inlined
def general(S):
    """A symmetric tensor as a general one."""
    return (S[0], S[3], S[4], S[3], S[1], S[5], S[4], S[5], S[2])


@inlined
def symmetric_part(A):
    """(A + A^T)/2 of a general tensor, symmetric."""
    return (A[0], A[4], A[8], 0.5 * (A[1] + A[3]), 0.5 * (A[2] + A[6]), 0.5 * (A[5] + A[7]))


@inlined
def plus_symmetric(S, T):
    """S + T of symmetric tensors."""
    return (S[0] + T[0], S[1] + T[1], S[2] + T[2], S[3] + T[3], S[4] + T[4], S[5] + T[5])


@inlined
def times_symmetric(a, S):
    """a S of a symmetric tensor."""
    return (a * S[0], a * S[1], a * S[2], a * S[3], a * S[4], a * S[5])


@inlined
def combine_symmetric(a, S, b, T):
    """a S + b T of symmetric tensors."""
    return (a * S[0] + b * T[0], a * S[1] + b * T[1], a * S[2] + b * T[2],
            a * S[3] + b * T[3], a * S[4] + b * T[4], a * S[5] + b * T[5])  # fmt: skip


@inlined
def add_spherical(S, a):
    """S + a 1 of a symmetric tensor."""
    return (S[0] + a, S[1] + a, S[2] + a, S[3], S[4], S[5])


@inlined
def trace_symmetric(S):
    """Trace of a symmetric tensor."""
    return S[0] + S[1] + S[2]


@inlined
def trace(A):
    """Trace of a general tensor."""
    return A[0] + A[4] + A[8]


@inlined
def contract_symmetric(S, T):
    """S : T of symmetric tensors."""
    return (S[0] * T[0] + S[1] * T[1] + S[2] * T[2]) + 2.0 * (S[3] * T[3] + S[4] * T[4] + S[5] * T[5])


@inlined
def determinant_symmetric(S):
    """Of a symmetric tensor."""
    return (S[0] * (S[1] * S[2] - S[5] * S[5]) - S[3] * (S[3] * S[2] - S[4] * S[5])
            + S[4] * (S[3] * S[5] - S[4] * S[1]))  # fmt: skip


@inlined
def inverse_symmetric(S):
    """S^-1 of a symmetric tensor."""
    c0 = S[1] * S[2] - S[5] * S[5]
    c3 = S[4] * S[5] - S[3] * S[2]
    c4 = S[3] * S[5] - S[4] * S[1]
    r = 1.0 / (S[0] * c0 + S[3] * c3 + S[4] * c4)
    return (c0 * r, (S[0] * S[2] - S[4] * S[4]) * r, (S[0] * S[1] - S[3] * S[3]) * r,
            c3 * r, c4 * r, (S[3] * S[4] - S[0] * S[5]) * r)  # fmt: skip


@inlined
def congruence(A, S):
    """A S A^T of a general and a symmetric tensor, symmetric."""
    B = matmul(A, general(S))
    return (B[0] * A[0] + B[1] * A[1] + B[2] * A[2],
            B[3] * A[3] + B[4] * A[4] + B[5] * A[5],
            B[6] * A[6] + B[7] * A[7] + B[8] * A[8],
            B[0] * A[3] + B[1] * A[4] + B[2] * A[5],
            B[0] * A[6] + B[1] * A[7] + B[2] * A[8],
            B[3] * A[6] + B[4] * A[7] + B[5] * A[8])  # fmt: skip


@inlined
def largest_eigenvalue_bound(S):
    """m + sqrt(2/3) |dev S| with the mean eigenvalue m: no less than the largest eigenvalue, and cheap."""
    mean = (S[0] + S[1] + S[2]) * (1.0 / 3.0)
    d0, d1, d2 = S[0] - mean, S[1] - mean, S[2] - mean
    deviator = d0 * d0 + d1 * d1 + d2 * d2 + 2.0 * (S[3] * S[3] + S[4] * S[4] + S[5] * S[5])
    return mean + (deviator * (2.0 / 3.0)) ** 0.5


@inlined
def largest_eigenvalue(S):
    """Largest eigenvalue of a symmetric tensor, in closed form."""
    mean = (S[0] + S[1] + S[2]) / 3.0
    d0, d1, d2 = S[0] - mean, S[1] - mean, S[2] - mean
    square = (d0 * d0 + d1 * d1 + d2 * d2 + 2.0 * (S[3] * S[3] + S[4] * S[4] + S[5] * S[5])) / 6.0
    radius = square**0.5
    scale = 2.0 * square * radius
    # a multiple of the identity, to round-off or underflow
    if not scale > 0.0:
        return mean
    third = d0 * (d1 * d2 - S[5] * S[5]) - S[3] * (S[3] * d2 - S[4] * S[5]) + S[4] * (S[3] * S[5] - S[4] * d1)
    cosine = min(1.0, max(-1.0, third / scale))
    return mean + 2.0 * radius * math.cos(math.acos(cosine) / 3.0)


@inlined
def rotation_step(X):
    """One step of Newton's method to the rotation R of F = R U, from X = F on: (g X + X^-T/g)/2.

    g^4 = |X^-1|^2/|X|^2 (Higham, SIAM J. Sci. Stat. Comput. 7 (1986) 1160). Converges from any positive determinant;
    where a step changes X by |dX|^2 < ROTATION_SETTLED, the error left is the square of that, below rounding.
    """
    H = cofactor(X)
    J = X[0] * H[0] + X[1] * H[1] + X[2] * H[2]
    # X^-T = H/J
    g = ((contract(H, H) / contract(X, X)) ** 0.5 / J) ** 0.5
    return combine(0.5 * g, X, 0.5 / (g * J), H)


ROTATION_SETTLED = 1e-15


@inlined
def rotation(F):
    """R of F = R U, of a general tensor with a positive determinant."""
    X = F
    for _ in range(30):
        new = rotation_step(X)
        change = combine(1.0, new, -1.0, X)
        X = new
        if not contract(change, change) > ROTATION_SETTLED:
            break
    return X


@inlined
def plane_rotation(F):
    """R of F = R U in plane strain."""
    cosine, sine = F[0] + F[4], F[3] - F[1]
    norm = 1.0 / (cosine * cosine + sine * sine) ** 0.5
    cosine, sine = norm * cosine, norm * sine
    return (cosine, -sine, 0.0, sine, cosine, 0.0, 0.0, 0.0, 1.0)


@inlined
def rotation_near(near, F):
    """R of F = R U to second order of the small rotation that leads from `near` to it: one linear equation.

    With near^T F = exp(w) U, the skew part gives (tr U 1 - U) w = (A32 - A23, A13 - A31, A21 - A12).
    """
    A = matmul(transpose(near), F)
    # the symmetric matrix tr U 1 - U, and its inverse
    a, b, c = A[4] + A[8], A[0] + A[8], A[0] + A[4]
    d, e, f = -0.5 * (A[1] + A[3]), -0.5 * (A[2] + A[6]), -0.5 * (A[5] + A[7])
    p, q, r = b * c - f * f, e * f - d * c, d * f - e * b
    g = 1.0 / (a * p + d * q + e * r)
    u, v, w = A[7] - A[5], A[2] - A[6], A[3] - A[1]
    x = g * (p * u + q * v + r * w)
    y = g * (q * u + (a * c - e * e) * v + (d * e - a * f) * w)
    z = g * (r * u + (d * e - a * f) * v + (a * b - d * d) * w)
    # Cayley's rotation (1 - w/2)^-1 (1 + w/2) = 1 + (w + w w/2)/(1 + w.w/4)
    h = 1.0 / (1.0 + 0.25 * (x * x + y * y + z * z))
    k = 0.5 * h
    turn = (1.0 - k * (y * y + z * z), k * x * y - h * z, k * x * z + h * y,
            k * x * y + h * z, 1.0 - k * (x * x + z * z), k * y * z - h * x,
            k * x * z - h * y, k * y * z + h * x, 1.0 - k * (x * x + y * y))  # fmt: skip
    return matmul(near, turn)


@inlined
def spin_rotation(velocity_gradient, step):
    """Cayley's rotation (1 - W dt/2)^-1 (1 + W dt/2) of the spin W of a velocity gradient [1/s] over a step [s]."""
    q = 0.25 * step
    x = q * (velocity_gradient[7] - velocity_gradient[5])
    y = q * (velocity_gradient[2] - velocity_gradient[6])
    z = q * (velocity_gradient[3] - velocity_gradient[1])
    # A of the axial vector a = (x, y, z): A^2 = a a^T - a.a 1
    h = 2.0 / (1.0 + x * x + y * y + z * z)
    return (1.0 - h * (y * y + z * z), h * (x * y - z), h * (x * z + y),
            h * (x * y + z), 1.0 - h * (x * x + z * z), h * (y * z - x),
            h * (x * z - y), h * (y * z + x), 1.0 - h * (x * x + y * y))  # fmt: skip
