"""The two passes over lists along the axes of lattices, in space; arrays are as `pairs.passes` says."""

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.lanes import WIDTH, broadcast, from_floats, fused, horizontal_sums, lane, load, total
from parsolid.pairs.axis_lists import AXES, JUMP, NEXT, SECOND, STEP, InnerAxes, OneSidedAxes
from parsolid.pairs.lane_tuples import add_lanes
from parsolid.pairs.terms import KINEMATICS, MeanRiemann, record_columns

_FIELD, _POSITION = KINEMATICS[3].field, KINEMATICS[3].position
# squared distance [m^2] in place of none, that of a particle that stands for a neighbour it has not
_NO_DISTANCE = 1e-300


# --- gradients ---------------------------------------------------------------------------------------------------


@generic(on="pairs")
def _gradients(pairs, kinematics, sums):
    """Add what the pairs of a list have of grad v."""


@_gradients.of(InnerAxes)
def _inner_gradients(pairs, kinematics, sums):
    neighbour, table = pairs.neighbour, pairs.table
    for a in range(neighbour.shape[0]):
        own, kind = load(kinematics, a, _FIELD), pairs.kind[a]
        for axis in range(AXES):
            b, c, column = neighbour[a, axis], neighbour[a, AXES + axis], WIDTH * axis
            near = (load(kinematics, b, _FIELD) - own) * table[kind, NEXT + axis]
            far = (load(kinematics, c, _FIELD) - own) * table[kind, SECOND + axis]
            add_lanes(sums, b, column, (near,))
            add_lanes(sums, c, column, (far,))
            add_lanes(sums, a, column, (near + far,))
    _edge_gradients(pairs.others, True, kinematics, sums)


@_gradients.of(OneSidedAxes)
def _rim_gradients(pairs, kinematics, sums):
    _edge_gradients(pairs.edges, False, kinematics, sums)


@register_jitable
def _edge_gradients(edges, both, kinematics, sums):
    for k in range(edges.first.shape[0]):
        a, b, column = edges.first[k], edges.second[k], WIDTH * edges.axis[k]
        term = (load(kinematics, b, _FIELD) - load(kinematics, a, _FIELD)) * edges.weight[k, 0]
        add_lanes(sums, a, column, (term,))
        if both:
            add_lanes(sums, b, column, (term,))


@compiled(fastmath={"contract"}, error_model="numpy")
def add_gradients_along_axes(space, pairs, fields, kinematics, sums):
    """`passes.add_gradients`; fields: the vector in the first columns."""
    _gradients(pairs, kinematics, sums)


# --- forces ------------------------------------------------------------------------------------------------------


@register_jitable
def _add_stresses(pairs, kind, a, record, force):
    """Those of a particle's own pairs, without what it gets itself, which is returned."""
    neighbour, table, result = pairs.neighbour, pairs.table, broadcast(0.0)
    for axis in range(AXES):
        b, c, column = neighbour[a, axis], neighbour[a, AXES + axis], WIDTH * axis
        P = load(record, a, column)
        near = (P + load(record, b, column)) * table[kind, NEXT + axis]
        far = (P + load(record, c, column)) * table[kind, SECOND + axis]
        add_lanes(force, b, 0, (-near,))
        add_lanes(force, c, 0, (-far,))
        result = result + (near + far)
    return result


@none_without("reconstruction", returns="jump")
def _reconstructed(reconstruction, jump, record, a, b, column, step):
    """The jump less what the mean of both gradients explains."""
    return jump - (load(record, a, column) + load(record, b, column)) * step


@register_jitable
def _jump(space, terms, kinematics, record, a, b, axis, step):
    column = record_columns(space, terms).gradient + WIDTH * axis
    jump = load(kinematics, b, _FIELD) - load(kinematics, a, _FIELD)
    return _reconstructed(terms.reconstruction, jump, record, a, b, column, step)


@register_jitable
def _line(kinematics, a, b):
    return load(kinematics, b, _POSITION) - load(kinematics, a, _POSITION)


@register_jitable
def _add_dissipation(space, terms, pairs, kind, a, kinematics, record, force):
    """As `_add_stresses`, of the three next nodes at once: D = k [Z_s u + (Z_p - Z_s)(u . x) x/|x|^2]."""
    at, neighbour, table = record_columns(space, terms), pairs.neighbour, pairs.table
    b, c, d = neighbour[a, 0], neighbour[a, 1], neighbour[a, 2]
    u = _jump(space, terms, kinematics, record, a, b, 0, table[kind, STEP])
    v = _jump(space, terms, kinematics, record, a, c, 1, table[kind, STEP + 1])
    w = _jump(space, terms, kinematics, record, a, d, 2, table[kind, STEP + 2])
    x, y, z = _line(kinematics, a, b), _line(kinematics, a, c), _line(kinematics, a, d)
    zero, k = broadcast(0.0), load(table, kind, JUMP)
    along = horizontal_sums(u * x, v * y, w * z, zero)
    square = max(horizontal_sums(x * x, y * y, z * z, zero), broadcast(_NO_DISTANCE))
    fast = from_floats(record[b, at.pressure], record[c, at.pressure], record[d, at.pressure], 0.0)
    slow = from_floats(record[b, at.shear], record[c, at.shear], record[d, at.shear], 0.0)
    fast, slow = k * (fast + record[a, at.pressure]), k * (slow + record[a, at.shear])
    normal = (fast - slow) * along / square
    u = fused(lane(slow, 0), u, lane(normal, 0) * x)
    v = fused(lane(slow, 1), v, lane(normal, 1) * y)
    w = fused(lane(slow, 2), w, lane(normal, 2) * z)
    add_lanes(force, b, WIDTH, (-u,))
    add_lanes(force, c, WIDTH, (-v,))
    add_lanes(force, d, WIDTH, (-w,))
    return u + v + w


@generic(on="terms")
def _inner_forces(terms, space, pairs, kinematics, record, force):
    """Those of pairs of owned particles, but of `others`."""


@_inner_forces.of(None)
def _inner_stresses(terms, space, pairs, kinematics, record, force):
    for a in range(pairs.neighbour.shape[0]):
        add_lanes(force, a, 0, (_add_stresses(pairs, pairs.kind[a], a, record, force),))


@_inner_forces.of(MeanRiemann)
def _inner_stresses_and_dissipation(terms, space, pairs, kinematics, record, force):
    for a in range(pairs.neighbour.shape[0]):
        kind = pairs.kind[a]
        add_lanes(force, a, 0, (_add_stresses(pairs, kind, a, record, force),))
        add_lanes(force, a, WIDTH, (_add_dissipation(space, terms, pairs, kind, a, kinematics, record, force),))


@generic(on="terms")
def _edge_dissipation(terms, space, edges, k, kinematics, record):
    """D_a of one pair, None where nothing dissipates."""


@_edge_dissipation.of(None)
def _no_dissipation(terms, space, edges, k, kinematics, record):
    return broadcast(0.0)


@_edge_dissipation.of(MeanRiemann)
def _riemann_dissipation(terms, space, edges, k, kinematics, record):
    at, a, b = record_columns(space, terms), edges.first[k], edges.second[k]
    u = _jump(space, terms, kinematics, record, a, b, edges.axis[k], edges.weight[k, 2])
    x = _line(kinematics, a, b)
    fast, slow = record[a, at.pressure] + record[b, at.pressure], record[a, at.shear] + record[b, at.shear]
    normal = (fast - slow) * total(u * x) / total(x * x)
    return edges.weight[k, 1] * fused(broadcast(slow), u, broadcast(normal) * x)


@register_jitable
def _edge_forces(terms, space, edges, both, kinematics, record, force):
    for k in range(edges.first.shape[0]):
        a, b, column = edges.first[k], edges.second[k], WIDTH * edges.axis[k]
        t = (load(record, a, column) + load(record, b, column)) * edges.weight[k, 0]
        add_lanes(force, a, 0, (t,))
        if both:
            add_lanes(force, b, 0, (-t,))
        if edges.weight[k, 1] != 0.0:
            d = _edge_dissipation(terms, space, edges, k, kinematics, record)
            add_lanes(force, a, WIDTH, (d,))
            if both:
                add_lanes(force, b, WIDTH, (-d,))


@generic(on="pairs")
def _forces(pairs, space, terms, kinematics, record, force):
    """Add the forces of the pairs of a list."""


@_forces.of(InnerAxes)
def _forces_within(pairs, space, terms, kinematics, record, force):
    _inner_forces(terms, space, pairs, kinematics, record, force)
    _edge_forces(terms, space, pairs.others, True, kinematics, record, force)


@_forces.of(OneSidedAxes)
def _forces_of_ghosts(pairs, space, terms, kinematics, record, force):
    _edge_forces(terms, space, pairs.edges, False, kinematics, record, force)


@compiled(fastmath={"contract"}, error_model="numpy")
def add_forces_along_axes(space, pairs, terms, kinematics, record, force):
    """`passes.add_forces`; terms: None or `MeanRiemann`."""
    _forces(pairs, space, terms, kinematics, record, force)
