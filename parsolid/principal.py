"""Principal values and axes of symmetric tensors, for kernels and plain Python alike (tuples of `parsolid.tensors`)."""

import math

from parsolid.kernels import inlined
from parsolid.tensors import contract_symmetric, determinant_symmetric, general, gram


@inlined
def _turn(first, second, both):
    """Cosine and sine of Jacobi's rotation that makes the product of two axes zero, and its tangent."""
    d, o = second - first, 2.0 * both
    h = (d * d + o * o) ** 0.5
    below = d + (h if d >= 0.0 else -h)
    t = o / (below if h > 0.0 else 1.0)
    c = 1.0 / (1.0 + t * t) ** 0.5
    return c, t * c, t


@inlined
def _sweep(state):
    """One cyclic sweep over the pairs (12), (13), (23) of (S, axes)."""
    S, V = state
    c, s, t = _turn(S[0], S[1], S[3])
    S = (S[0] - t * S[3], S[1] + t * S[3], S[2], 0.0, c * S[4] - s * S[5], s * S[4] + c * S[5])
    V = (c * V[0] - s * V[1], s * V[0] + c * V[1], V[2], c * V[3] - s * V[4], s * V[3] + c * V[4], V[5],
         c * V[6] - s * V[7], s * V[6] + c * V[7], V[8])  # fmt: skip
    c, s, t = _turn(S[0], S[2], S[4])
    S = (S[0] - t * S[4], S[1], S[2] + t * S[4], c * S[3] - s * S[5], 0.0, s * S[3] + c * S[5])
    V = (c * V[0] - s * V[2], V[1], s * V[0] + c * V[2], c * V[3] - s * V[5], V[4], s * V[3] + c * V[5],
         c * V[6] - s * V[8], V[7], s * V[6] + c * V[8])  # fmt: skip
    c, s, t = _turn(S[1], S[2], S[5])
    S = (S[0], S[1] - t * S[5], S[2] + t * S[5], c * S[3] - s * S[4], s * S[3] + c * S[4], 0.0)
    V = (V[0], c * V[1] - s * V[2], s * V[1] + c * V[2], V[3], c * V[4] - s * V[5], s * V[4] + c * V[5],
         V[6], c * V[7] - s * V[8], s * V[7] + c * V[8])  # fmt: skip
    return S, V


@inlined
def principal(S):
    """Three principal values of a symmetric tensor, and a general tensor with the axes as its columns.

    Cyclic Jacobi, four sweeps: values and axes within 1e-14, whatever the distance of the values. A fixed count, so
    that loops over particles are vectorised.
    """
    S, V = _sweep(_sweep(_sweep(_sweep((S, (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0))))))
    return (S[0], S[1], S[2]), V


@inlined
def from_principal(f, V):
    """The symmetric tensor with principal values f along the columns of V."""
    return (f[0] * V[0] * V[0] + f[1] * V[1] * V[1] + f[2] * V[2] * V[2],
            f[0] * V[3] * V[3] + f[1] * V[4] * V[4] + f[2] * V[5] * V[5],
            f[0] * V[6] * V[6] + f[1] * V[7] * V[7] + f[2] * V[8] * V[8],
            f[0] * V[0] * V[3] + f[1] * V[1] * V[4] + f[2] * V[2] * V[5],
            f[0] * V[0] * V[6] + f[1] * V[1] * V[7] + f[2] * V[2] * V[8],
            f[0] * V[3] * V[6] + f[1] * V[4] * V[7] + f[2] * V[5] * V[8])  # fmt: skip


@inlined
def _times(f, second, third, constant):
    """f S + constant 1 of f = f[0] 1 + f[1] S + f[2] S^2, for S^3 = second S + third 1."""
    return (f[2] * third + constant, f[0] + f[2] * second, f[1])


@inlined
def _sum(f, S):
    """f[0] 1 + f[1] S + f[2] S^2 of a symmetric tensor."""
    a, b, c = f
    square = gram(general(S))
    return (a + b * S[0] + c * square[0], a + b * S[1] + c * square[1], a + b * S[2] + c * square[2],
            b * S[3] + c * square[3], b * S[4] + c * square[4], b * S[5] + c * square[5])  # fmt: skip


# |S|^2 up to which the series below are exact to rounding
SMALL = 0.01
_LOGARITHM = tuple((-1.0) ** (n + 1) / n for n in range(16, 0, -1))
_EXPONENTIAL = tuple(1.0 / math.factorial(n) for n in range(10, -1, -1))


@inlined
def log_of_small(S):
    """ln(1 + S) of a symmetric tensor without a trace, |S|^2 <= SMALL, by its series and Cayley & Hamilton's
    theorem."""
    second, third = 0.5 * contract_symmetric(S, S), determinant_symmetric(S)
    f = (0.0, 0.0, 0.0)
    # LLVM unrolls no 16 rounds, and vectorises no loop that has some within it
    for n in range(8):
        f = _times(_times(f, second, third, _LOGARITHM[2 * n]), second, third, _LOGARITHM[2 * n + 1])
    return _sum(_times(f, second, third, 0.0), S)


@inlined
def exp_of_small(S):
    """exp S of a symmetric tensor without a trace, |S|^2 <= SMALL, as `log_of_small`."""
    second, third = 0.5 * contract_symmetric(S, S), determinant_symmetric(S)
    f = (0.0, 0.0, 0.0)
    for n in range(11):
        f = _times(f, second, third, _EXPONENTIAL[n])
    return _sum(f, S)
