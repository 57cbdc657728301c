"""Rows of four numbers in arrays (rows, width), as pair sweeps read and write them: tuples of four, which LLVM keeps in
one vector register. A sum into a row reads and writes all four of its numbers, else it is not vectorised."""

from parsolid.kernels import inlined


@inlined
def load_row(A, i, k):
    """Numbers k .. k + 3 of row i."""
    return (A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3])


@inlined
def store_row(A, i, k, u):
    """Set numbers k .. k + 3 of row i."""
    A[i, k], A[i, k + 1], A[i, k + 2], A[i, k + 3] = u[0], u[1], u[2], u[3]


@inlined
def add(u, v):
    return (u[0] + v[0], u[1] + v[1], u[2] + v[2], u[3] + v[3])


@inlined
def subtract(u, v):
    return (u[0] - v[0], u[1] - v[1], u[2] - v[2], u[3] - v[3])


@inlined
def multiply(u, v):
    """u v, number by number."""
    return (u[0] * v[0], u[1] * v[1], u[2] * v[2], u[3] * v[3])


@inlined
def scale(f, u):
    return (f * u[0], f * u[1], f * u[2], f * u[3])


@inlined
def add_scaled(u, f, v):
    """u + f v."""
    return (u[0] + f * v[0], u[1] + f * v[1], u[2] + f * v[2], u[3] + f * v[3])


@inlined
def combine_rows(f, u, v, w):
    """f_1 u + f_2 v + f_3 w."""
    return add_scaled(add_scaled(scale(f[0], u), f[1], v), f[2], w)


@inlined
def dot(u, v):
    """u . v of vectors of three components; the fourth number does not count."""
    return u[0] * v[0] + u[1] * v[1] + u[2] * v[2]
