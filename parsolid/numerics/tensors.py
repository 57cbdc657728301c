"""Small tensors as tuples of scalars, for floats and for `Lanes` alike.

General tensors: plane strain (11, 12, 21, 22, 33), space (11, 12, 13, 21, 22, 23, 31, 32, 33).
Symmetric tensors: plane strain (11, 22, 33, 12), space (11, 22, 33, 12, 13, 23).
The out-of-plane component 33 is carried so that every formula is the three-dimensional one; where it is the
constant 1.0 the compiler folds it. Products written A x B are the tensor cross product of Bonet, Gil & Ortigosa,
(A x B)_iI = eps_ijk eps_IJK A_jJ B_kK.
"""

import math

from numba import types
from numba.extending import overload

from decomposition.compiled import compiled
from parsolid.numerics.lanes import lane

PLANE, SPACE = 5, 9
SYMMETRIC_PLANE, SYMMETRIC_SPACE = 4, 6


def _size(tensor):
    return len(tensor) if isinstance(tensor, types.BaseTuple) else 0


def add(a, b):
    """a + b, component by component (tuples of 4, 5, 6 or 9)."""
    return tuple(x + y for x, y in zip(a, b))


@overload(add)
def _add(a, b):
    if _size(a) == 4:
        return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3])
    if _size(a) == 5:
        return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4])
    if _size(a) == 6:
        return lambda a, b: (a[0] + b[0], a[1] + b[1], a[2] + b[2], a[3] + b[3], a[4] + b[4], a[5] + b[5])
    if _size(a) == 9:
        return lambda a, b: (
            a[0] + b[0],
            a[1] + b[1],
            a[2] + b[2],
            a[3] + b[3],
            a[4] + b[4],
            a[5] + b[5],
            a[6] + b[6],
            a[7] + b[7],
            a[8] + b[8],
        )


def scale(s, a):
    """s a, component by component (tuples of 4, 5, 6 or 9)."""
    return tuple(s * x for x in a)


@overload(scale)
def _scale(s, a):
    if _size(a) == 4:
        return lambda s, a: (s * a[0], s * a[1], s * a[2], s * a[3])
    if _size(a) == 5:
        return lambda s, a: (s * a[0], s * a[1], s * a[2], s * a[3], s * a[4])
    if _size(a) == 6:
        return lambda s, a: (s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5])
    if _size(a) == 9:
        return lambda s, a: (s * a[0], s * a[1], s * a[2], s * a[3], s * a[4], s * a[5], s * a[6], s * a[7], s * a[8])


def cross(a, b):
    """Tensor cross product a x b of two general tensors."""
    raise NotImplementedError


@overload(cross)
def _cross(a, b):
    if _size(a) == PLANE:
        return lambda a, b: (
            a[3] * b[4] + a[4] * b[3],
            -(a[2] * b[4] + a[4] * b[2]),
            -(a[1] * b[4] + a[4] * b[1]),
            a[0] * b[4] + a[4] * b[0],
            a[0] * b[3] + a[3] * b[0] - a[1] * b[2] - a[2] * b[1],
        )
    if _size(a) == SPACE:
        return lambda a, b: (
            a[4] * b[8] - a[5] * b[7] + a[8] * b[4] - a[7] * b[5],
            a[5] * b[6] - a[3] * b[8] + a[6] * b[5] - a[8] * b[3],
            a[3] * b[7] - a[4] * b[6] + a[7] * b[3] - a[6] * b[4],
            a[2] * b[7] - a[1] * b[8] + a[7] * b[2] - a[8] * b[1],
            a[0] * b[8] - a[2] * b[6] + a[8] * b[0] - a[6] * b[2],
            a[1] * b[6] - a[0] * b[7] + a[6] * b[1] - a[7] * b[0],
            a[1] * b[5] - a[2] * b[4] + a[5] * b[1] - a[4] * b[2],
            a[2] * b[3] - a[0] * b[5] + a[3] * b[2] - a[5] * b[0],
            a[0] * b[4] - a[1] * b[3] + a[4] * b[0] - a[3] * b[1],
        )


def cofactor(a):
    """cof a = 1/2 a x a = det(a) a^{-T}."""
    raise NotImplementedError


@overload(cofactor)
def _cofactor(a):
    if _size(a) == PLANE:
        return lambda a: (a[3] * a[4], -a[2] * a[4], -a[1] * a[4], a[0] * a[4], a[0] * a[3] - a[1] * a[2])
    if _size(a) == SPACE:
        return lambda a: (
            a[4] * a[8] - a[5] * a[7],
            a[5] * a[6] - a[3] * a[8],
            a[3] * a[7] - a[4] * a[6],
            a[2] * a[7] - a[1] * a[8],
            a[0] * a[8] - a[2] * a[6],
            a[1] * a[6] - a[0] * a[7],
            a[1] * a[5] - a[2] * a[4],
            a[2] * a[3] - a[0] * a[5],
            a[0] * a[4] - a[1] * a[3],
        )


def determinant(a):
    """Determinant of a general tensor."""
    raise NotImplementedError


@overload(determinant)
def _determinant(a):
    if _size(a) == PLANE:
        return lambda a: a[4] * (a[0] * a[3] - a[1] * a[2])
    if _size(a) == SPACE:
        return lambda a: (
            a[0] * (a[4] * a[8] - a[5] * a[7]) + a[1] * (a[5] * a[6] - a[3] * a[8]) + a[2] * (a[3] * a[7] - a[4] * a[6])
        )


def contract(a, b):
    """a : b of two general tensors."""
    raise NotImplementedError


@overload(contract)
def _contract(a, b):
    if _size(a) == PLANE:
        return lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4]
    if _size(a) == SPACE:
        return lambda a, b: (
            (a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
            + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
            + (a[6] * b[6] + a[7] * b[7] + a[8] * b[8])
        )


def contract_symmetric(a, b):
    """a : b of two symmetric tensors."""
    raise NotImplementedError


@overload(contract_symmetric)
def _contract_symmetric(a, b):
    if _size(a) == SYMMETRIC_PLANE:
        return lambda a, b: a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3])
    if _size(a) == SYMMETRIC_SPACE:
        return lambda a, b: (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])


def matmul(a, b):
    """a b of two general tensors."""
    raise NotImplementedError


@overload(matmul)
def _matmul(a, b):
    if _size(a) == PLANE:
        return lambda a, b: (
            a[0] * b[0] + a[1] * b[2],
            a[0] * b[1] + a[1] * b[3],
            a[2] * b[0] + a[3] * b[2],
            a[2] * b[1] + a[3] * b[3],
            a[4] * b[4],
        )
    if _size(a) == SPACE:
        return lambda a, b: (
            a[0] * b[0] + a[1] * b[3] + a[2] * b[6],
            a[0] * b[1] + a[1] * b[4] + a[2] * b[7],
            a[0] * b[2] + a[1] * b[5] + a[2] * b[8],
            a[3] * b[0] + a[4] * b[3] + a[5] * b[6],
            a[3] * b[1] + a[4] * b[4] + a[5] * b[7],
            a[3] * b[2] + a[4] * b[5] + a[5] * b[8],
            a[6] * b[0] + a[7] * b[3] + a[8] * b[6],
            a[6] * b[1] + a[7] * b[4] + a[8] * b[7],
            a[6] * b[2] + a[7] * b[5] + a[8] * b[8],
        )


def transposed(a):
    """a^T of a general tensor."""
    raise NotImplementedError


@overload(transposed)
def _transposed(a):
    if _size(a) == PLANE:
        return lambda a: (a[0], a[2], a[1], a[3], a[4])
    if _size(a) == SPACE:
        return lambda a: (a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8])


def matmul_transposed(a, b):
    """a b^T of two general tensors."""
    raise NotImplementedError


@overload(matmul_transposed)
def _matmul_transposed(a, b):
    return lambda a, b: matmul(a, transposed(b))


def expand(s):
    """A symmetric tensor as a general one."""
    raise NotImplementedError


@overload(expand)
def _expand(s):
    if _size(s) == SYMMETRIC_PLANE:
        return lambda s: (s[0], s[3], s[3], s[1], s[2])
    if _size(s) == SYMMETRIC_SPACE:
        return lambda s: (s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2])


def gram(a):
    """a^T a, symmetric."""
    raise NotImplementedError


@overload(gram)
def _gram(a):
    if _size(a) == PLANE:
        return lambda a: (
            a[0] * a[0] + a[2] * a[2],
            a[1] * a[1] + a[3] * a[3],
            a[4] * a[4],
            a[0] * a[1] + a[2] * a[3],
        )
    if _size(a) == SPACE:
        return lambda a: (
            a[0] * a[0] + a[3] * a[3] + a[6] * a[6],
            a[1] * a[1] + a[4] * a[4] + a[7] * a[7],
            a[2] * a[2] + a[5] * a[5] + a[8] * a[8],
            a[0] * a[1] + a[3] * a[4] + a[6] * a[7],
            a[0] * a[2] + a[3] * a[5] + a[6] * a[8],
            a[1] * a[2] + a[4] * a[5] + a[7] * a[8],
        )


def zero_like_gram(a):
    """The zero symmetric tensor with the dimension of a general tensor a."""
    raise NotImplementedError


@overload(zero_like_gram)
def _zero_like_gram(a):
    if _size(a) == PLANE:
        return lambda a: (0.0, 0.0, 0.0, 0.0)
    if _size(a) == SPACE:
        return lambda a: (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def trace_symmetric(s):
    """Trace of a symmetric tensor."""
    return s[0] + s[1] + s[2]


@overload(trace_symmetric)
def _trace_symmetric(s):
    return lambda s: s[0] + s[1] + s[2]


def determinant_symmetric(s):
    """Determinant of a symmetric tensor."""
    raise NotImplementedError


@overload(determinant_symmetric)
def _determinant_symmetric(s):
    if _size(s) == SYMMETRIC_PLANE:
        return lambda s: s[2] * (s[0] * s[1] - s[3] * s[3])
    if _size(s) == SYMMETRIC_SPACE:
        return lambda s: (
            s[0] * (s[1] * s[2] - s[5] * s[5]) - s[3] * (s[3] * s[2] - s[4] * s[5]) + s[4] * (s[3] * s[5] - s[4] * s[1])
        )


def inverse_symmetric(s):
    """Inverse of a symmetric tensor."""
    raise NotImplementedError


@overload(inverse_symmetric)
def _inverse_symmetric(s):
    if _size(s) == SYMMETRIC_PLANE:

        def plane(s):
            r = 1.0 / (s[0] * s[1] - s[3] * s[3])
            return s[1] * r, s[0] * r, 1.0 / s[2], -s[3] * r

        return plane
    if _size(s) == SYMMETRIC_SPACE:

        def space(s):
            c0 = s[1] * s[2] - s[5] * s[5]
            c3 = s[4] * s[5] - s[3] * s[2]
            c4 = s[3] * s[5] - s[4] * s[1]
            r = 1.0 / (s[0] * c0 + s[3] * c3 + s[4] * c4)
            return (
                c0 * r,
                (s[0] * s[2] - s[4] * s[4]) * r,
                (s[0] * s[1] - s[3] * s[3]) * r,
                c3 * r,
                c4 * r,
                (s[3] * s[4] - s[0] * s[5]) * r,
            )

        return space


def plus_identity(s, factor):
    """s + factor I of a symmetric tensor."""
    raise NotImplementedError


@overload(plus_identity)
def _plus_identity(s, factor):
    if _size(s) == SYMMETRIC_PLANE:
        return lambda s, factor: (s[0] + factor, s[1] + factor, s[2] + factor, s[3])
    if _size(s) == SYMMETRIC_SPACE:
        return lambda s, factor: (s[0] + factor, s[1] + factor, s[2] + factor, s[3], s[4], s[5])


def lane_of_symmetric(s, k):
    """Lane k of a symmetric tensor of Lanes, as floats in space order (plane strain gets zeros)."""
    raise NotImplementedError


@overload(lane_of_symmetric)
def _lane_of_symmetric(s, k):
    if _size(s) == SYMMETRIC_PLANE:
        return lambda s, k: (lane(s[0], k), lane(s[1], k), lane(s[2], k), lane(s[3], k), 0.0, 0.0)
    if _size(s) == SYMMETRIC_SPACE:
        return lambda s, k: (lane(s[0], k), lane(s[1], k), lane(s[2], k), lane(s[3], k), lane(s[4], k), lane(s[5], k))


@compiled(error_model="numpy")
def largest_eigenvalue(s):
    """Largest eigenvalue of a symmetric tensor of floats (11, 22, 33, 12, 13, 23), in closed form."""
    mean = (s[0] + s[1] + s[2]) / 3.0
    d0, d1, d2 = s[0] - mean, s[1] - mean, s[2] - mean
    square = (d0 * d0 + d1 * d1 + d2 * d2 + 2.0 * (s[3] * s[3] + s[4] * s[4] + s[5] * s[5])) / 6.0
    radius = math.sqrt(square)
    scale = 2.0 * square * radius
    # of a multiple of the identity, to round-off or underflow
    if not scale > 0.0:
        return mean
    determinant = d0 * (d1 * d2 - s[5] * s[5]) - s[3] * (s[3] * d2 - s[4] * s[5]) + s[4] * (s[3] * s[5] - s[4] * d1)
    cosine = min(1.0, max(-1.0, determinant / scale))
    return mean + 2.0 * radius * math.cos(math.acos(cosine) / 3.0)


def lane_of_general(a, k):
    """Lane k of a general tensor of Lanes, as a tensor of floats."""
    raise NotImplementedError


@overload(lane_of_general)
def _lane_of_general(a, k):
    if _size(a) == PLANE:
        return lambda a, k: (lane(a[0], k), lane(a[1], k), lane(a[2], k), lane(a[3], k), lane(a[4], k))
    if _size(a) == SPACE:
        return lambda a, k: (
            lane(a[0], k),
            lane(a[1], k),
            lane(a[2], k),
            lane(a[3], k),
            lane(a[4], k),
            lane(a[5], k),
            lane(a[6], k),
            lane(a[7], k),
            lane(a[8], k),
        )


def lane_of_stored_symmetric(s, k):
    """Lane k of a symmetric tensor of Lanes, as a tensor of floats of the same dimension."""
    raise NotImplementedError


@overload(lane_of_stored_symmetric)
def _lane_of_stored_symmetric(s, k):
    if _size(s) == SYMMETRIC_PLANE:
        return lambda s, k: (lane(s[0], k), lane(s[1], k), lane(s[2], k), lane(s[3], k))
    if _size(s) == SYMMETRIC_SPACE:
        return lambda s, k: (lane(s[0], k), lane(s[1], k), lane(s[2], k), lane(s[3], k), lane(s[4], k), lane(s[5], k))
