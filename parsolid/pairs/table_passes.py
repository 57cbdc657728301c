"""Forces of pairs whose weights stand in a table, four side by side in space; arrays are as `pairs.passes` says."""

import numpy as np

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic
from parsolid.numerics.lanes import WIDTH, broadcast, from_floats, fused, horizontal_sums, lane, load, store
from parsolid.numerics.layout import Plane
from parsolid.pairs.lane_tuples import store_lanes
from parsolid.pairs.lists import mutual
from parsolid.pairs.passes import forces_so_far, sum_forces
from parsolid.pairs.terms import KINEMATICS, MeanRiemann, record_columns

_FIELD, _POSITION = KINEMATICS[3].field, KINEMATICS[3].position
# widths of rows in space: constants, so that places in arrays take no products
_MOTION, _RECORD, _FORCE, _ROW = KINEMATICS[3].width, 6 * WIDTH, 2 * WIDTH, 2 * WIDTH


@generic
def _forces(space, terms, pairs, kinematics, record, force):
    """Add the forces of the pairs of a list."""


@_forces.of(Plane)
def _forces_in_plane(space, terms, pairs, kinematics, record, force):
    sum_forces(space, pairs, terms, kinematics, record, force)


@_forces.otherwise
def _forces_in_space(space, terms, pairs, kinematics, record, force):
    _forces_of_terms(terms, space, pairs, kinematics, record, force)


@generic
def _forces_of_terms(terms, space, pairs, kinematics, record, force):
    """In space, by what dissipates."""


@_forces_of_terms.of(None)
def _forces_of_stresses(terms, space, pairs, kinematics, record, force):
    sum_forces(space, pairs, terms, kinematics, record, force)


@_forces_of_terms.of(MeanRiemann)
def _forces_of_waves(terms, space, pairs, kinematics, record, force):
    _forces_of_jumps(terms.reconstruction, space, pairs, terms, kinematics, record, force)


@generic
def _forces_of_jumps(reconstruction, space, pairs, terms, kinematics, record, force):
    """In space, by whether jumps are reconstructed."""


@_forces_of_jumps.of(None)
def _forces_of_plain_jumps(reconstruction, space, pairs, terms, kinematics, record, force):
    sum_forces(space, pairs, terms, kinematics, record, force)


@_forces_of_jumps.otherwise
def _forces_four_by_four(reconstruction, space, pairs, terms, kinematics, record, force):
    """Four pairs side by side: what one waits for, sums of lanes and a division, is done for all of them at once."""
    start, neighbour, kind, table = pairs.start, pairs.neighbour, pairs.kind, pairs.table.ravel()
    arrays = kinematics.ravel(), record.ravel(), force.ravel(), table
    both = mutual(pairs)
    for a in range(start.shape[0] - 1):
        if start[a] == start[a + 1]:
            continue
        own, total = _own(space, terms, arrays, a), forces_so_far(terms, force, a)
        first, last = np.uint64(start[a]), np.uint64(start[a + 1])
        while first + np.uint64(3) < last:
            one = _pair(own, arrays, neighbour[first], kind[first], both)
            two = _pair(own, arrays, neighbour[first + np.uint64(1)], kind[first + np.uint64(1)], both)
            three = _pair(own, arrays, neighbour[first + np.uint64(2)], kind[first + np.uint64(2)], both)
            four = _pair(own, arrays, neighbour[first + np.uint64(3)], kind[first + np.uint64(3)], both)
            normal = _normals(one, two, three, four)
            d1 = _dissipation(one, lane(normal, 0), arrays, both)
            d2 = _dissipation(two, lane(normal, 1), arrays, both)
            d3 = _dissipation(three, lane(normal, 2), arrays, both)
            d4 = _dissipation(four, lane(normal, 3), arrays, both)
            total = total[0] + ((one[5] + two[5]) + (three[5] + four[5])), total[1] + ((d1 + d2) + (d3 + d4))
            first += np.uint64(4)
        while first < last:
            one = _pair(own, arrays, neighbour[first], kind[first], both)
            d1 = _dissipation(one, lane(_normals(one, one, one, one), 0), arrays, both)
            total = total[0] + one[5], total[1] + d1
            first += np.uint64(1)
        store_lanes(force, a, 0, total)


@register_jitable
def _own(space, terms, arrays, a):
    """Stress, gradient, v and x of the first particle."""
    kinematics, record = arrays[0], arrays[1]
    at, r, m = record_columns(space, terms), a * _RECORD, a * _MOTION
    P = load(record, r, 0), load(record, r + WIDTH, 0), load(record, r + 2 * WIDTH, 0)
    r = r + at.gradient
    G = load(record, r, 0), load(record, r + WIDTH, 0), load(record, r + 2 * WIDTH, 0)
    return P, G, load(kinematics, m + _FIELD, 0), load(kinematics, m + _POSITION, 0)


@register_jitable
def _pair(own, arrays, b, kind, both):
    """(jump, x, slow, fast - slow, (b, row of the table), stress force) of a pair, whose stress acts on b already."""
    kinematics, record, force, table = arrays
    P, G, v, x = own
    m, r, w = b * _MOTION, b * _RECORD, kind * np.uint64(_ROW)
    first, second = P[0] + load(record, r, 0), P[1] + load(record, r + WIDTH, 0)
    third = P[2] + load(record, r + 2 * WIDTH, 0)
    stress = fused(third, table[w + np.uint64(2)], fused(second, table[w + np.uint64(1)], first * table[w]))
    if both:
        store(force, b * _FORCE, 0, load(force, b * _FORCE, 0) - stress)
    jump, line = load(kinematics, m + _FIELD, 0) - v, load(kinematics, m + _POSITION, 0) - x
    r = r + 3 * WIDTH
    jump = fused(G[0] + load(record, r, 0), table[w + np.uint64(4)], jump)
    jump = fused(G[1] + load(record, r + WIDTH, 0), table[w + np.uint64(5)], jump)
    jump = fused(G[2] + load(record, r + 2 * WIDTH, 0), table[w + np.uint64(6)], jump)
    # impedances stand in the pads of the stress
    fast, slow = lane(first, 3), lane(second, 3)
    return jump, line, slow, fast - slow, (b, w), stress


@register_jitable
def _normals(one, two, three, four):
    """(Z_p - Z_s) (u . x)/|x|^2 of each."""
    along = horizontal_sums(one[0] * one[1], two[0] * two[1], three[0] * three[1], four[0] * four[1])
    square = horizontal_sums(one[1] * one[1], two[1] * two[1], three[1] * three[1], four[1] * four[1])
    return from_floats(one[3], two[3], three[3], four[3]) * along / square


@register_jitable
def _dissipation(pair, normal, arrays, both):
    """D of a pair, which acts on b already."""
    jump, line, slow, _, (b, w), _ = pair
    d = arrays[3][w + np.uint64(3)] * fused(broadcast(slow), jump, broadcast(normal) * line)
    if both:
        force = arrays[2]
        store(force, b * _FORCE + WIDTH, 0, load(force, b * _FORCE + WIDTH, 0) - d)
    return d


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces_by_table(space, pairs, terms, kinematics, record, force):
    """`passes.add_forces`; terms: None or `MeanRiemann`."""
    _forces(space, terms, pairs, kinematics, record, force)
