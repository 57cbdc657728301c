"""The two passes over a pair list, for every pair method, in the plane and in space.

With an antisymmetric weight g_ab and one matrix L_a a particle, the two passes are
    gradient    (grad v)_a = [sum_b (v_b - v_a) (x) g_ab] L_a^T / V_a
    divergence  T_a        =  sum_b (P_a L_a + P_b L_b) g_ab              [N]
and the dissipation of the upwinding is, eqs (74), (75) with linear reconstruction,
    D_a = sum_b k_ab [c_s u + (c_p - c_s) (u.n) n],  u = v_b - v_a - 1/2 (grad v_a + grad v_b)(X_b - X_a),  n =
    x_ab/|x_ab|.

Arrays (rows are particles, owned first; columns by name in `pairs.terms`):
    kinematics  d=3: (n, 12) v|0 x|0 X|0;  d=2: (n, 8) v x X 0 0
    record      what a particle tells its neighbours in the divergence pass
    sums        of each field in turn: of a vector the columns of sum (v_b - v_a) (x) g, d=3 padded to 4 each;
                of a scalar sum (q_b - q_a) g, padded to 4
    force       (n, 8) T padded to 4, D padded to 4; (n, 4) T alone where nothing dissipates apart
Pair weights (m, 4) are rows: d=3: (g1, g2, g3, k); d=2: (g1, g2, k, 0), where k is 1/2 |C_skew| / |g| times the factor
on the dissipation, and C_skew = (L_a + L_b) g; without |g| where impedances have no direction (`mean_impedance`).

Radial lists (peridynamics) hold one number a pair, weight (m,) = w(|xi|) V_a V_b, and g_ab = weight xi with xi = X_b -
X_a is formed as it is needed: 12 bytes a pair; 0 is a broken bond. Their kinematics are f u X, f the field that drives
stress and stabiliser, their records hold (S = P K^{-1}) M and what the stabiliser needs. The stabiliser adds to T_a
    ShearScaled   sum_b weight (C1_a + C1_b) (f_b - f_a),     M = S - C1 G
    AlongBonds    sum_b weight xi/(2 |xi|^3) xi . [(c_a + c_b)(f_b - f_a) - (c_a G_a + c_b G_b) xi],     M = S
"""

from typing import NamedTuple

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import constant, generic
from parsolid.numerics.lanes import WIDTH, broadcast, load
from parsolid.pairs.lane_tuples import add_lanes, opposite, plus, store_lanes
from parsolid.pairs.lists import InnerTable, OneSidedTable, images_of, mutual
from parsolid.pairs.pair_terms import own_side, pair_forces
from parsolid.pairs.primitives import matrix, outer, reference, vector
from parsolid.pairs.terms import MeanRiemann, RiemannDissipation, dimension_of, matrix_columns


class Vector(NamedTuple):
    """A vector in some columns of the kinematics; None for the first ones, known when a kernel is compiled."""

    column: int | None = None


class Scalar(NamedTuple):
    """A number in a column of the kinematics."""

    column: int


def sum_columns(dimension: int, fields: tuple) -> int:
    """Columns of the sums of fields."""
    return sum(matrix_columns(dimension) if isinstance(field, Vector) else WIDTH for field in fields)


# --- fields of the gradient pass ---------------------------------------------------------------------------------


@generic
def _own_values(fields, kinematics, a):
    """The values of particle a, a number in every lane."""


@_own_values.of(1)
def _own_value(fields, kinematics, a):
    return (_value(fields[0], None, a, kinematics, a),)


@_own_values.otherwise
def _several_own_values(fields, kinematics, a):
    return (_value(fields[0], None, a, kinematics, a), *_own_values(fields[1:], kinematics, a))


@generic
def _value(field, images, k, kinematics, b):
    """The value of a neighbour or of its image."""


@_value.of(Scalar)
def _scalar_value(field, images, k, kinematics, b):
    return broadcast(kinematics[b, field.column])


@_value.of(Vector)
def _vector_value(field, images, k, kinematics, b):
    return vector(images, k, kinematics, b, _column(field.column))


@register_jitable
def _column(column):
    if column is None:
        return 0
    return column


@generic(on="field")
def _sum(space, field, sums, a, column):
    """The sum so far of particle a."""


@_sum.of(Scalar)
def _scalar_sum(space, field, sums, a, column):
    return (load(sums, a, column),)


@_sum.of(Vector)
def _vector_sum(space, field, sums, a, column):
    return matrix(space, sums, a, column)


@constant
def _columns_of(space, field):
    return sum_columns(dimension_of(space), (field,))


@generic(on="fields")
def _sums(space, fields, sums, a, column):
    """The sums so far of particle a."""


@_sums.of(1)
def _sums_of_one(space, fields, sums, a, column):
    return _sum(space, fields[0], sums, a, column)


@_sums.otherwise
def _sums_of_several(space, fields, sums, a, column):
    first = _sum(space, fields[0], sums, a, column)
    return (*first, *_sums(space, fields[1:], sums, a, column + _columns_of(space, fields[0])))


@generic(on="fields")
def _differences(space, fields, own, images, k, kinematics, b, g):
    """What the pair k adds to the sums of both particles."""


@_differences.of(1)
def _difference_of_one(space, fields, own, images, k, kinematics, b, g):
    return _difference(space, fields[0], own[0], images, k, kinematics, b, g)


@_differences.otherwise
def _differences_of_several(space, fields, own, images, k, kinematics, b, g):
    first = _difference(space, fields[0], own[0], images, k, kinematics, b, g)
    return (*first, *_differences(space, fields[1:], own[1:], images, k, kinematics, b, g))


@generic(on="field")
def _difference(space, field, own, images, k, kinematics, b, g):
    """(v_b - v_a) (x) g of a vector, (q_b - q_a) g of a number."""


@_difference.of(Scalar)
def _scalar_difference(space, field, own, images, k, kinematics, b, g):
    return ((_value(field, images, k, kinematics, b) - own) * g,)


@_difference.of(Vector)
def _vector_difference(space, field, own, images, k, kinematics, b, g):
    return outer(space, _value(field, images, k, kinematics, b) - own, g)


# --- the passes --------------------------------------------------------------------------------------------------


@generic
def _weights(pairs):
    """What pairs have their weights in."""


@_weights.of(InnerTable, OneSidedTable)
def _table(pairs):
    return pairs.table


@_weights.otherwise
def _weights_of_each(pairs):
    return pairs.weight


@generic
def _row(pairs, k):
    """Where that of pair k stands."""


@_row.of(InnerTable, OneSidedTable)
def _kind(pairs, k):
    return pairs.kind[k]


@_row.otherwise
def _own_row(pairs, k):
    return k


@generic(on="weight")
def _weight(space, weight, images, k, kinematics, b, X):
    """g_ab with the number beside it: as stored, or weight (X_b - X_a) where the list is radial."""


@_weight.of(2)
def _stored_weight(space, weight, images, k, kinematics, b, X):
    return load(weight, k, 0)


@_weight.of(1)
def _radial_weight(space, weight, images, k, kinematics, b, X):
    return broadcast(weight[k]) * (reference(space, images, k, kinematics, b) - X)


@generic
def forces_so_far(terms, force, a):
    """(T,) or (T, D) so far of particle a."""


@forces_so_far.of(RiemannDissipation, MeanRiemann)
def _stress_and_dissipation(terms, force, a):
    return load(force, a, 0), load(force, a, WIDTH)


@forces_so_far.otherwise
def _forces_alone(terms, force, a):
    return (load(force, a, 0),)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_gradients(space, pairs, fields, kinematics, sums):
    """Add what the pairs of a list have of the gradients of fields, a tuple of `Vector` and `Scalar`."""
    weights, images = _weights(pairs), images_of(pairs)
    for a in range(pairs.start.shape[0] - 1):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        own, X = _own_values(fields, kinematics, a), reference(space, None, a, kinematics, a)
        total = _sums(space, fields, sums, a, 0)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            g = _weight(space, weights, images, _row(pairs, k), kinematics, b, X)
            difference = _differences(space, fields, own, images, k, kinematics, b, g)
            total = plus(total, difference)
            if mutual(pairs):
                add_lanes(sums, b, 0, difference)
        store_lanes(sums, a, 0, total)


@register_jitable
def sum_forces(space, pairs, terms, kinematics, record, force):
    """`add_forces`, pair by pair."""
    weights, images = _weights(pairs), images_of(pairs)
    for a in range(pairs.start.shape[0] - 1):
        if pairs.start[a] == pairs.start[a + 1]:
            continue
        own, total = own_side(space, terms, kinematics, record, a), forces_so_far(terms, force, a)
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, at = pairs.neighbour[k], _row(pairs, k)
            g = _weight(space, weights, images, at, kinematics, b, own[1])
            t = pair_forces(space, terms, own, images, at, weights, kinematics, record, b, g)
            total = plus(total, t)
            if mutual(pairs):
                add_lanes(force, b, 0, opposite(t))
        store_lanes(force, a, 0, total)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces(space, pairs, terms, kinematics, record, force):
    """Add the forces of the pairs of a list: those of the stresses, and what `terms` says."""
    sum_forces(space, pairs, terms, kinematics, record, force)
