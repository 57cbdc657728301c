"""Small tensors with operators, for floats and for `Lanes` alike, in compiled functions and in plain Python.

General tensors: plane strain (11, 12, 21, 22, 33), space (11, 12, 13, 21, 22, 23, 31, 32, 33).
Symmetric tensors: plane strain (11, 22, 33, 12), space (11, 22, 33, 12, 13, 23).
The out-of-plane component 33 is carried so that every formula is the three-dimensional one; where it is the
constant 1.0 the compiler folds it. With tensors A, B and a scalar s: A + B, A - B, -A, s * A, A / s (one division), A @
B, A.T; `I` is the identity, so that A + s * I adds to the diagonal alone; a symmetric tensor meets a general one as a
general one; None, what a scene lacks, adds nothing: A + None is A. Products written A x B are the tensor cross product
of Bonet, Gil & Ortigosa, (A x B)_iI = eps_ijk eps_IJK A_jJ B_kK. Functions take plain tuples of as many scalars, too.
Every formula is plain Python, traced by numba (see `numerics.tracing`).
"""

import functools
import math
from collections import namedtuple

from decomposition.compiled import compiled
from parsolid.numerics.lanes import lane  # noqa: F401
from parsolid.numerics.tracing import BY_SIZE, Traceable, Unknown, traced

PLANE, SPACE, SYMMETRIC_PLANE, SYMMETRIC_SPACE = 5, 9, 4, 6


class Tensor(Traceable):
    """What the kinds of tensors have in common: the operators."""

    __slots__ = ()
    __array_ufunc__ = None  # numpy's scalars leave products with tensors to them

    def __add__(self, other):
        if other is None:
            return self
        if not isinstance(other, Tensor):
            return NotImplemented
        if isinstance(self, Spherical) != isinstance(other, Spherical):
            a, s = (self, other.value) if isinstance(other, Spherical) else (other, self.value)
            return type(a)(*(x + s if i in _DIAGONAL[type(a)] else x for i, x in enumerate(a)))
        a, b = (self, other) if type(self) is type(other) else (expand(self), expand(other))
        return type(a)(*(x + y for x, y in zip(a, b)))

    def __sub__(self, other):
        return self + -other if isinstance(other, Tensor) else NotImplemented

    def __mul__(self, factor):
        return NotImplemented if isinstance(factor, tuple) else type(self)(*(factor * x for x in self))

    __rmul__ = __mul__

    def __truediv__(self, divisor):
        return NotImplemented if isinstance(divisor, tuple) else (1.0 / divisor) * self

    def __neg__(self):
        return type(self)(*(-x for x in self))

    def __matmul__(self, other):
        return matmul(self, other) if isinstance(other, Tensor) else NotImplemented

    @property
    def T(self):
        """The transpose."""
        return transposed(self)


class GeneralPlane(Tensor, namedtuple("GeneralPlane", "xx xy yx yy zz")):
    """A general tensor of plane strain."""

    __slots__ = ()


class GeneralSpace(Tensor, namedtuple("GeneralSpace", "xx xy xz yx yy yz zx zy zz")):
    """A general tensor of space."""

    __slots__ = ()


class SymmetricPlane(Tensor, namedtuple("SymmetricPlane", "xx yy zz xy")):
    """A symmetric tensor of plane strain."""

    __slots__ = ()


class SymmetricSpace(Tensor, namedtuple("SymmetricSpace", "xx yy zz xy xz yz")):
    """A symmetric tensor of space."""

    __slots__ = ()


class Spherical(Tensor, namedtuple("Spherical", "value")):
    """A multiple of the identity."""

    __slots__ = ()


I = Spherical(1.0)  # noqa: E741  (the field's name of the identity)
_DIAGONAL = {GeneralPlane: (0, 3, 4), GeneralSpace: (0, 4, 8), SymmetricPlane: (0, 1, 2), SymmetricSpace: (0, 1, 2)}
BY_SIZE.update({len(kind._fields): kind for kind in _DIAGONAL})


def as_tensor(components):
    """The tensor of a plain tuple of 4, 5, 6 or 9 scalars; a tensor, and None, as they are."""
    return components if components is None or isinstance(components, Tensor) else BY_SIZE[len(components)](*components)


def formula(function):
    """Decorator of a formula of tensors and scalars that numba traces; plain tuples are made tensors for it."""

    @functools.wraps(function)
    def with_tensors(*arguments):
        return function(*(as_tensor(a) if type(a) is tuple and len(a) in BY_SIZE else a for a in arguments))

    return traced(with_tensors)


as_tensor = traced(as_tensor)


@formula
def add(a, b):
    """a + b."""
    return a + b


@formula
def scale(s, a):
    """s a."""
    return s * a


@formula
def cross(a, b):
    """Tensor cross product a x b of two general tensors."""
    if len(a) == PLANE:
        return GeneralPlane(
            a[3] * b[4] + a[4] * b[3],
            -(a[2] * b[4] + a[4] * b[2]),
            -(a[1] * b[4] + a[4] * b[1]),
            a[0] * b[4] + a[4] * b[0],
            a[0] * b[3] + a[3] * b[0] - a[1] * b[2] - a[2] * b[1],
        )
    return GeneralSpace(
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


@formula
def cofactor(a):
    """cof a = 1/2 a x a = det(a) a^{-T}."""
    if len(a) == PLANE:
        return GeneralPlane(a[3] * a[4], -a[2] * a[4], -a[1] * a[4], a[0] * a[4], a[0] * a[3] - a[1] * a[2])
    return GeneralSpace(
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


@formula
def determinant(a):
    """Determinant of a tensor."""
    if len(a) == PLANE:
        return a[4] * (a[0] * a[3] - a[1] * a[2])
    if len(a) == SYMMETRIC_PLANE:
        return a[2] * (a[0] * a[1] - a[3] * a[3])
    if len(a) == SYMMETRIC_SPACE:
        return (
            a[0] * (a[1] * a[2] - a[5] * a[5]) - a[3] * (a[3] * a[2] - a[4] * a[5]) + a[4] * (a[3] * a[5] - a[4] * a[1])
        )
    return a[0] * (a[4] * a[8] - a[5] * a[7]) + a[1] * (a[5] * a[6] - a[3] * a[8]) + a[2] * (a[3] * a[7] - a[4] * a[6])


@formula
def contract(a, b):
    """a : b of two tensors of one kind."""
    if len(a) == PLANE:
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + a[3] * b[3] + a[4] * b[4]
    if len(a) == SYMMETRIC_PLANE:
        return a[0] * b[0] + a[1] * b[1] + a[2] * b[2] + 2.0 * (a[3] * b[3])
    if len(a) == SYMMETRIC_SPACE:
        return (a[0] * b[0] + a[1] * b[1] + a[2] * b[2]) + 2.0 * (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
    return (
        (a[0] * b[0] + a[1] * b[1] + a[2] * b[2])
        + (a[3] * b[3] + a[4] * b[4] + a[5] * b[5])
        + (a[6] * b[6] + a[7] * b[7] + a[8] * b[8])
    )


@formula
def trace(s):
    """Trace of a tensor."""
    return s[0] + s[1] + s[2] if len(s) in (SYMMETRIC_PLANE, SYMMETRIC_SPACE) else _sum_of_diagonal(s)


def _sum_of_diagonal(a):
    first, second, third = _DIAGONAL[type(a)]
    return a[first] + a[second] + a[third]


@formula
def matmul(a, b):
    """a b of two tensors, general unless one is a multiple of the identity."""
    if isinstance(a, Spherical) or isinstance(b, Spherical):
        return a.value * b if isinstance(a, Spherical) else b.value * a
    a, b = expand(a), expand(b)
    if len(a) == PLANE:
        return GeneralPlane(
            a[0] * b[0] + a[1] * b[2],
            a[0] * b[1] + a[1] * b[3],
            a[2] * b[0] + a[3] * b[2],
            a[2] * b[1] + a[3] * b[3],
            a[4] * b[4],
        )
    return GeneralSpace(
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


@formula
def transposed(a):
    """a^T."""
    if len(a) == PLANE:
        return GeneralPlane(a[0], a[2], a[1], a[3], a[4])
    if len(a) == SPACE:
        return GeneralSpace(a[0], a[3], a[6], a[1], a[4], a[7], a[2], a[5], a[8])
    return a


@formula
def matmul_transposed(a, b):
    """a b^T of two general tensors."""
    return matmul(a, transposed(b))


@formula
def expand(s):
    """A symmetric tensor as a general one; a general one as it is."""
    if len(s) == SYMMETRIC_PLANE:
        return GeneralPlane(s[0], s[3], s[3], s[1], s[2])
    if len(s) == SYMMETRIC_SPACE:
        return GeneralSpace(s[0], s[3], s[4], s[3], s[1], s[5], s[4], s[5], s[2])
    return s


@formula
def gram(a):
    """a^T a of a general tensor, symmetric."""
    if len(a) == PLANE:
        return SymmetricPlane(
            a[0] * a[0] + a[2] * a[2], a[1] * a[1] + a[3] * a[3], a[4] * a[4], a[0] * a[1] + a[2] * a[3]
        )
    return SymmetricSpace(
        a[0] * a[0] + a[3] * a[3] + a[6] * a[6],
        a[1] * a[1] + a[4] * a[4] + a[7] * a[7],
        a[2] * a[2] + a[5] * a[5] + a[8] * a[8],
        a[0] * a[1] + a[3] * a[4] + a[6] * a[7],
        a[0] * a[2] + a[3] * a[5] + a[6] * a[8],
        a[1] * a[2] + a[4] * a[5] + a[7] * a[8],
    )


@formula
def zero_like_gram(a):
    """The zero symmetric tensor with the dimension of a general tensor a."""
    return SymmetricPlane(0.0, 0.0, 0.0, 0.0) if len(a) == PLANE else SymmetricSpace(0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


@formula
def inverse_symmetric(s):
    """Inverse of a symmetric tensor."""
    if len(s) == SYMMETRIC_PLANE:
        r = 1.0 / (s[0] * s[1] - s[3] * s[3])
        return SymmetricPlane(s[1] * r, s[0] * r, 1.0 / s[2], -s[3] * r)
    c0 = s[1] * s[2] - s[5] * s[5]
    c3 = s[4] * s[5] - s[3] * s[2]
    c4 = s[3] * s[5] - s[4] * s[1]
    r = 1.0 / (s[0] * c0 + s[3] * c3 + s[4] * c4)
    return SymmetricSpace(
        c0 * r,
        (s[0] * s[2] - s[4] * s[4]) * r,
        (s[0] * s[1] - s[3] * s[3]) * r,
        c3 * r,
        c4 * r,
        (s[3] * s[4] - s[0] * s[5]) * r,
    )


@formula
def plus_identity(s, factor):
    """s + factor I."""
    return s + factor * I


contract_symmetric, determinant_symmetric, trace_symmetric = contract, determinant, trace


def _lane(x, k):
    return x.lane(k) if isinstance(x, Unknown) else x


@functools.partial(traced, with_index=True)
def lane_of(a, k):
    """Lane k of a tensor of Lanes, as a tensor of floats of the same kind."""
    a = as_tensor(a)
    return type(a)(*(_lane(x, k) for x in a))


@functools.partial(traced, with_index=True)
def lane_of_symmetric(s, k):
    """Lane k of a symmetric tensor of Lanes, as floats in space order (plane strain gets zeros)."""
    return SymmetricSpace(*(_lane(x, k) for x in s), *((0.0, 0.0) if len(s) == SYMMETRIC_PLANE else ()))


lane_of_general = lane_of_stored_symmetric = lane_of


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
