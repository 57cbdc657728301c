"""The two passes of the pair engine in the plane (see `pairs` for the formulas and the arrays).

A 2 x 2 matrix is one Lanes value, column by column; (v, x) of a particle are another.
"""

import math

from numba.extending import overload, register_jitable

from decomposition.compiled import compiled
from parsolid.numerics.dispatch import is_instance, none_without
from parsolid.numerics.lanes import (
    broadcast,
    from_floats,
    fused,
    horizontal_sums,
    lane,
    last_two_roots,
    load,
    store,
    swizzle,
)
from parsolid.pairs.terms import ShearScaled

_rows = swizzle(0, 1, 0, 1)
_columns = swizzle(0, 0, 1, 1)
_swap = swizzle(2, 3, 0, 1)
_third = swizzle(2, 2, 2, 2)


@register_jitable
def _times(matrix, vector):
    """Matrix times the vector in the first two lanes; the result stands in the first and again in the last two lanes."""
    product = matrix * _columns(vector)
    return product + _swap(product)


@register_jitable
def _motion(images, k, kinematics, b):
    """(v, x) of the neighbour or of its mirror image."""
    motion = load(kinematics, b, 0)
    if images is None:
        return motion
    code = images.code[k]
    X = load(kinematics, b, 4)
    image = _reference(images, k, kinematics, b)
    zero = broadcast(0.0)
    shifted = motion - from_floats(0.0, 0.0, lane(X, 0), lane(X, 1))
    return fused(load(images.table, code, 0), shifted, zero) + from_floats(0.0, 0.0, lane(image, 0), lane(image, 1))


@register_jitable
def _reference(images, k, kinematics, b):
    X = load(kinematics, b, 4)
    if images is None:
        return X
    reflection = load(images.table, images.code[k], 4)
    return fused(reflection, X, _swap(reflection))


@register_jitable
def _field(images, k, kinematics, b, column):
    """A vector of the neighbour, or Q times it for its image, in the first two lanes."""
    if images is None:
        return load(kinematics, b, column)
    return load(images.table, images.code[k], 0) * load(kinematics, b, column)


def _first_column(weight, column):
    """The column of the field: of lists with vectors as weights always 0, which then costs nothing."""
    raise NotImplementedError


@overload(_first_column)
def _first_column_of(weight, column):
    if weight.ndim == 2:
        return lambda weight, column: 0
    return lambda weight, column: column


def _bond(weight, images, k, kinematics, b, Xa):
    """g_ab in the first two lanes: as stored, or weight (X_b - X_a) where the list is radial."""
    raise NotImplementedError


@overload(_bond)
def _bond_of(weight, images, k, kinematics, b, Xa):
    if weight.ndim == 2:
        return lambda weight, images, k, kinematics, b, Xa: load(weight, k, 0)
    return lambda weight, images, k, kinematics, b, Xa: (
        broadcast(weight[k]) * (_reference(images, k, kinematics, b) - Xa)
    )


@register_jitable
def _stiffness(images, k, record, b):
    """C_1 of the neighbour, or Q C_1 Q of its image."""
    C = load(record, b, 4)
    if images is None:
        return C
    Q = load(images.table, images.code[k], 0)
    return Q * _columns(Q) * C


def _stabilised(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
    """What the stabiliser adds to T of a pair, see `pairs`; f, X, second, c are of the first particle."""
    raise NotImplementedError


@overload(_stabilised)
def _stabilised_by(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
    if is_instance(stabiliser, ShearScaled):

        def shear_scaled(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
            jump = broadcast(weight[k]) * (_field(images, k, kinematics, b, 0) - f)
            return _times(second + _stiffness(images, k, record, b), jump)

        return shear_scaled

    def along_bonds(stabiliser, images, k, weight, kinematics, record, b, g, f, X, second, c):
        xi = _reference(images, k, kinematics, b) - X
        jump = (c + load(record, b, 8)) * (_field(images, k, kinematics, b, 0) - f)
        jump = jump - _times(second + _signed(images, k, load(record, b, 4), 12), xi)
        x, y = lane(xi, 0), lane(xi, 1)
        square = x * x + y * y
        return broadcast(0.5 * (x * lane(jump, 0) + y * lane(jump, 1)) / (square * math.sqrt(square))) * g

    return along_bonds


def _stress_of(weight, images, k, record, b):
    """P L of the neighbour or of its image; of radial lists the image that makes the two passes adjoint at any plane."""
    raise NotImplementedError


@overload(_stress_of)
def _stress_by_weight(weight, images, k, record, b):
    if weight.ndim == 2:
        return lambda weight, images, k, record, b: _signed(images, k, load(record, b, 0), 8)
    return lambda weight, images, k, record, b: _signed(images, k, load(record, b, 0), 12)


def _bond_modulus(stabiliser, record, a):
    """c of a particle, where the stabiliser has one."""
    raise NotImplementedError


@overload(_bond_modulus)
def _bond_modulus_of(stabiliser, record, a):
    if is_instance(stabiliser, ShearScaled):
        return lambda stabiliser, record, a: None
    return lambda stabiliser, record, a: load(record, a, 8)


@register_jitable
def _signed(images, k, value, column):
    """A matrix of the neighbour, or with the signs in the table's given columns for its image."""
    if images is None:
        return value
    return load(images.table, images.code[k], column) * value


@register_jitable
def _reconstructed(reconstruct, jump, images, k, record, b, Ga, X):
    if reconstruct is None:
        return jump
    return jump - _times(Ga + _signed(images, k, load(record, b, 4), 12), X)


@register_jitable
def _wave_tensor(images, k, record, b, first):
    """(Q11, Q22, Q12, last lane) of the neighbour or of its image, R Q R."""
    tensor = load(record, b, first)
    if images is None:
        return tensor
    reflection = load(images.table, images.code[k], 4)
    return tensor * from_floats(1.0, 1.0, lane(reflection, 0) * lane(reflection, 1), 1.0)


@none_without("shear")
def _shear_tensor(shear, record, a):
    return load(record, a, 12)


@register_jitable
def _shear_products(shear, images, k, record, b, squares, Sa):
    if shear is None:
        return from_floats(lane(squares, 0), lane(squares, 1), 0.0, 0.0)
    return (Sa + _wave_tensor(images, k, record, b, 12)) * squares


@register_jitable
def _shear_impedance(shear, root, isotropic):
    if shear is None:
        return root * isotropic
    return root


@register_jitable
def _riemann_force(shear, reconstruct, images, k, kinematics, record, b, g, motion, Xa, Ga, Ma, Sa):
    """D_ab of eqs (74), (75), in the first two lanes."""
    step = _motion(images, k, kinematics, b) - motion
    X = _reference(images, k, kinematics, b) - Xa
    jump = _reconstructed(reconstruct, _rows(step), images, k, record, b, Ga, X)
    x = _swap(step)
    g0, g1 = lane(g, 0), lane(g, 1)
    squares = from_floats(g0 * g0, g1 * g1, 2.0 * g0 * g1, 0.0)
    Mb = _wave_tensor(images, k, record, b, 8)
    pressure = (Ma + Mb) * squares
    slow = _shear_products(shear, images, k, record, b, squares, Sa)
    first_two = from_floats(1.0, 1.0, 0.0, 0.0)
    sums = horizontal_sums(jump * x * first_two, x * x * first_two, pressure, slow)
    c_p, root = last_two_roots(sums)
    c_s = _shear_impedance(shear, root, lane(Ma, 3) + lane(Mb, 3))
    normal = (c_p - c_s) * lane(sums, 0) / lane(sums, 1)
    return first_two * _third(g) * fused(broadcast(c_s), jump, broadcast(normal) * x)


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
        v, X = load(kinematics, a, column), load(kinematics, a, 4)
        G = load(gradient, a, 0)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            step = _field(images, k, kinematics, b, column) - v
            d = _rows(step) * _columns(_bond(pairs.weight, images, k, kinematics, b, X))
            G = G + d
            if both is not None:
                store(gradient, b, 0, load(gradient, b, 0) + d)
        store(gradient, a, 0, G)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces(first, last, pairs, images, both, stabiliser, riemann, shear, reconstruct, kinematics, record, force):
    """Add T and D of the pairs of particles first..last-1 to particle a, and with `both` to b as well.

    `both`, `stabiliser`, `riemann`, `shear`, `reconstruct` are None for what is left out; see `add_gradients` for the lists.
    """
    for a in range(first, last):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        P, X = load(record, a, 0), load(kinematics, a, 4)
        T = load(force, a, 0)
        if stabiliser is not None:
            f, second, c = load(kinematics, a, 0), load(record, a, 4), _bond_modulus(stabiliser, record, a)
        if riemann is not None:
            motion, Xa, Ga = load(kinematics, a, 0), load(kinematics, a, 4), load(record, a, 4)
            Ma, Sa = load(record, a, 8), _shear_tensor(shear, record, a)
            D = load(force, a, 4)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            g = _bond(pairs.weight, images, k, kinematics, b, X)
            t = _times(P + _stress_of(pairs.weight, images, k, record, b), g)
            if stabiliser is not None:
                t = t + _stabilised(stabiliser, images, k, pairs.weight, kinematics, record, b, g, f, X, second, c)
            T = T + t
            if both is not None:
                store(force, b, 0, load(force, b, 0) - t)
            if riemann is not None:
                s = _riemann_force(shear, reconstruct, images, k, kinematics, record, b, g, motion, Xa, Ga, Ma, Sa)
                D = D + s
                if both is not None:
                    store(force, b, 4, load(force, b, 4) - s)
        store(force, a, 0, T)
        if riemann is not None:
            store(force, a, 4, D)
