"""The two passes of the pair engine in three dimensions (see `pairs` for the formulas and the arrays)."""

import math

from numba.extending import overload, register_jitable

from decomposition.compiled import compiled
from parsolid.numerics.dispatch import is_instance, none_without
from parsolid.numerics.lanes import (
    broadcast,
    fused,
    horizontal_sums,
    lane,
    last_two_roots,
    load,
    store,
    swizzle,
    total,
    without_fourth,
)
from parsolid.pairs.terms import ShearScaled

_x = swizzle(0, 0, 0, 0)
_y = swizzle(1, 1, 1, 1)
_z = swizzle(2, 2, 2, 2)
_fourth = swizzle(3, 3, 3, 3)
_cross_first = swizzle(0, 0, 1, 3)
_cross_second = swizzle(1, 2, 2, 3)


@register_jitable
def _columns(array, row, first):
    return load(array, row, first), load(array, row, first + 4), load(array, row, first + 8)


@register_jitable
def _field(images, k, kinematics, b, column):
    """A vector of the neighbour, or Q times it for its image."""
    if images is None:
        return load(kinematics, b, column)
    return load(images.table, images.code[k], 0) * load(kinematics, b, column)


@register_jitable
def _reference(images, k, kinematics, b):
    X = load(kinematics, b, 8)
    if images is None:
        return X
    return fused(load(images.table, images.code[k], 4), X, load(images.table, images.code[k], 8))


def _first_column(weight, column):
    """The column of the field: of lists with vectors as weights always 0, which then costs nothing."""
    raise NotImplementedError


@overload(_first_column)
def _first_column_of(weight, column):
    if weight.ndim == 2:
        return lambda weight, column: 0
    return lambda weight, column: column


def _bond(weight, images, k, kinematics, b, Xa):
    """g_ab with the pair's scalar weight repeated: as stored, or weight (X_b - X_a) where the list is radial."""
    raise NotImplementedError


@overload(_bond)
def _bond_of(weight, images, k, kinematics, b, Xa):
    if weight.ndim == 2:
        return lambda weight, images, k, kinematics, b, Xa: load(weight, k, 0)
    return lambda weight, images, k, kinematics, b, Xa: (
        broadcast(weight[k]) * (_reference(images, k, kinematics, b) - Xa)
    )


@register_jitable
def _kinematics(images, k, kinematics, b):
    v, x, X = _columns(kinematics, b, 0)
    if images is None:
        return v, x, X
    code = images.code[k]
    Q = load(images.table, code, 0)
    image = fused(load(images.table, code, 4), X, load(images.table, code, 8))
    return Q * v, fused(Q, x - X, image), image


@register_jitable
def _stress(images, k, record, b):
    P = _columns(record, b, 0)
    if images is None:
        return P
    Q = load(images.table, images.code[k], 0)
    signed = Q * images.table[images.code[k], 15]
    return signed * P[0] * _x(Q), signed * P[1] * _y(Q), signed * P[2] * _z(Q)


@register_jitable
def _gradient_like(images, k, record, b, first):
    """A matrix of the neighbour, or Q G R of its image."""
    G = _columns(record, b, first)
    if images is None:
        return G
    Q, R = load(images.table, images.code[k], 0), load(images.table, images.code[k], 4)
    return Q * G[0] * _x(R), Q * G[1] * _y(R), Q * G[2] * _z(R)


@register_jitable
def _stiffness(images, k, record, b):
    """C_1 of the neighbour, or Q C_1 Q of its image."""
    C = _columns(record, b, 12)
    if images is None:
        return C
    Q = load(images.table, images.code[k], 0)
    return Q * C[0] * _x(Q), Q * C[1] * _y(Q), Q * C[2] * _z(Q)


@register_jitable
def _product(A, B, vector):
    """(A + B) vector, of two matrices by their columns."""
    result = (A[0] + B[0]) * _x(vector)
    result = fused(A[1] + B[1], _y(vector), result)
    return fused(A[2] + B[2], _z(vector), result)


def _stabilised(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
    """What the stabiliser adds to T of a pair, see `pairs`; f, X, second, c are of the first particle."""
    raise NotImplementedError


@overload(_stabilised)
def _stabilised_by(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
    if is_instance(stabiliser, ShearScaled):

        def shear_scaled(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
            jump = broadcast(weight[k]) * (_field(images, k, kinematics, b, 0) - f)
            return _product(second, _stiffness(images, k, record, b), jump)

        return shear_scaled

    def along_bonds(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
        xi = _reference(images, k, kinematics, b) - X
        jump = (c + load(record, b, 24)) * (_field(images, k, kinematics, b, 0) - f)
        jump = jump - _product(second, _gradient_like(images, k, record, b, 12), xi)
        square = total(xi * xi)
        return broadcast(0.5 * total(jump * xi) / (square * math.sqrt(square))) * g

    return along_bonds


@register_jitable
def _off_diagonal(images, k, record, b, first):
    if images is None:
        return load(record, b, first)
    return load(images.table, images.code[k], 12) * load(record, b, first)


@register_jitable
def _reconstructed(reconstruct, jump, images, k, record, b, Ga, X):
    if reconstruct is None:
        return jump
    Gb = _gradient_like(images, k, record, b, 12)
    jump = jump - (Ga[0] + Gb[0]) * _x(X)
    jump = jump - (Ga[1] + Gb[1]) * _y(X)
    return jump - (Ga[2] + Gb[2]) * _z(X)


@none_without("shear")
def _shear_tensor(shear, record, a):
    return load(record, a, 32), load(record, a, 36)


@register_jitable
def _shear_products(shear, images, k, record, b, square, cross, Sa):
    """Lanes that add up to g . Q_s g, or to g . g where shear is isotropic."""
    if shear is None:
        return square
    off_diagonal = Sa[1] + _off_diagonal(images, k, record, b, 36)
    return fused(off_diagonal, cross, (Sa[0] + load(record, b, 32)) * square)


@register_jitable
def _shear_impedance(shear, root, isotropic):
    if shear is None:
        return root * isotropic
    return root


@register_jitable
def _riemann_force(shear, reconstruct, images, k, kinematics, record, b, g, place, Ga, Ma, Sa):
    """D_ab of eqs (74), (75)."""
    v, x, X = _kinematics(images, k, kinematics, b)
    jump = _reconstructed(reconstruct, v - place[0], images, k, record, b, Ga, X - place[2])
    x = x - place[1]
    direction = without_fourth(g)
    square = direction * direction
    cross = _cross_first(direction) * _cross_second(direction)
    cross = cross + cross
    diagonal = load(record, b, 24)
    pressure = (Ma[0] + diagonal) * square
    pressure = fused(Ma[1] + _off_diagonal(images, k, record, b, 28), cross, pressure)
    slow = _shear_products(shear, images, k, record, b, square, cross, Sa)
    sums = horizontal_sums(jump * x, x * x, pressure, slow)
    c_p, root = last_two_roots(sums)
    c_s = _shear_impedance(shear, root, lane(Ma[0], 3) + lane(diagonal, 3))
    normal = (c_p - c_s) * lane(sums, 0) / lane(sums, 1)
    return _fourth(g) * fused(broadcast(c_s), jump, broadcast(normal) * x)


def _stress_of(weight, images, k, record, b):
    """P L of the neighbour or of its image; of radial lists the image that makes the two passes adjoint at any plane."""
    raise NotImplementedError


@overload(_stress_of)
def _stress_by_weight(weight, images, k, record, b):
    if weight.ndim == 2:
        return lambda weight, images, k, record, b: _stress(images, k, record, b)
    return lambda weight, images, k, record, b: _gradient_like(images, k, record, b, 0)


def _bond_modulus(stabiliser, record, a):
    """c of a particle, where the stabiliser has one."""
    raise NotImplementedError


@overload(_bond_modulus)
def _bond_modulus_of(stabiliser, record, a):
    if is_instance(stabiliser, ShearScaled):
        return lambda stabiliser, record, a: None
    return lambda stabiliser, record, a: load(record, a, 24)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_gradients(first, last, pairs, images, both, column, kinematics, gradient):
    """Add sum (v_b - v_a) (x) g_ab of the pairs of particles first..last-1 to particle a, and with `both` to b as well.

    v is the vector in the given column of kinematics (0 unless the list is radial). `both` is None for one-sided lists, whose
    neighbours are ghosts (images None) or mirror images.
    """
    column = _first_column(pairs.weight, column)
    for a in range(first, last):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        v, X = load(kinematics, a, column), load(kinematics, a, 8)
        G0, G1, G2 = _columns(gradient, a, 0)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            g = _bond(pairs.weight, images, k, kinematics, b, X)
            jump = _field(images, k, kinematics, b, column) - v
            d0, d1, d2 = _x(g) * jump, _y(g) * jump, _z(g) * jump
            G0, G1, G2 = G0 + d0, G1 + d1, G2 + d2
            if both is not None:
                store(gradient, b, 0, load(gradient, b, 0) + d0)
                store(gradient, b, 4, load(gradient, b, 4) + d1)
                store(gradient, b, 8, load(gradient, b, 8) + d2)
        store(gradient, a, 0, G0)
        store(gradient, a, 4, G1)
        store(gradient, a, 8, G2)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces(first, last, pairs, images, both, stabiliser, riemann, shear, reconstruct, kinematics, record, force):
    """Add T and D of the pairs of particles first..last-1 to particle a, and with `both` to b as well.

    `both`, `stabiliser`, `riemann`, `shear`, `reconstruct` are None for what is left out; see `add_gradients` for the lists.
    """
    for a in range(first, last):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        P, X = _columns(record, a, 0), load(kinematics, a, 8)
        T = load(force, a, 0)
        if stabiliser is not None:
            f, second, c = load(kinematics, a, 0), _columns(record, a, 12), _bond_modulus(stabiliser, record, a)
        if riemann is not None:
            place, Ga = _columns(kinematics, a, 0), _columns(record, a, 12)
            Ma, Sa = (load(record, a, 24), load(record, a, 28)), _shear_tensor(shear, record, a)
            D = load(force, a, 4)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            g = _bond(pairs.weight, images, k, kinematics, b, X)
            t = _product(P, _stress_of(pairs.weight, images, k, record, b), g)
            if stabiliser is not None:
                t = t + _stabilised(stabiliser, images, k, pairs.weight, kinematics, record, b, g, f, X, second, c)
            T = T + t
            if both is not None:
                store(force, b, 0, load(force, b, 0) - t)
            if riemann is not None:
                s = _riemann_force(shear, reconstruct, images, k, kinematics, record, b, g, place, Ga, Ma, Sa)
                D = D + s
                if both is not None:
                    store(force, b, 4, load(force, b, 4) - s)
        store(force, a, 0, T)
        if riemann is not None:
            store(force, a, 4, D)
