"""Particle to grid: masses, momenta and forces of the particles of a cell summed in a small array, then added to the
nodes once.

    m_i = sum_p w_ip m_p      p_i = sum_p w_ip m_p [v_p + C_p (x_i - x_p)]      f_i = sum_p [w_ip f_p - V_p sigma_p grad
    w_ip]

f_p is an external force on a particle; C_p only in affine transfers. A row of nodes along the last direction takes
its factors of the other directions once: of sigma grad w, w' of the last direction multiplies `along` and w multiplies
`across`.
"""

from decomposition.compiled import compiled
from decomposition.deferred import register_jitable
from parsolid.methods.mpm.grid import (
    AffineFlip,
    Apic,
    CauchyStress,
    FirstPiolaKirchhoffStress,
    Taylor,
    clear_cell,
    weigh,
)
from parsolid.methods.mpm.weights import nodes_across, store_distances
from parsolid.numerics.dispatch import generic, none_without
from parsolid.numerics.lanes import broadcast, from_floats, fused, lane, load, shuffle, store, swizzle, transpose
from parsolid.numerics.layout import Axisymmetric, Space

_x, _y, _z = swizzle(0, 0, 0, 0), swizzle(1, 1, 1, 1), swizzle(2, 2, 2, 2)
_column_x, _column_y, _column_z = shuffle(0, 6, 5, 3), shuffle(6, 1, 4, 3), shuffle(5, 4, 2, 3)
_fourth_from = shuffle(0, 1, 2, 7)


@compiled(fastmath={"contract"}, error_model="numpy")
def scatter(interpolation, motion, transfer, stress, external, nodes, partials):
    """Add mass, momentum and force of the particles of all cells to nodes (see `grid`), which must be zeroed before.

    transfer: one of `grid`, of velocities; stress: CauchyStress or FirstPiolaKirchhoffStress; external (capacity, 4):
    forces [N], fourth 0, or None; partials (cells, K**dimension, 8): if not None the sums of each cell are left there
    and nothing is added to nodes. motion None: forces alone; stress None: mass and momentum alone.
    """
    space, basis, grid, scratch = interpolation.space, interpolation.basis, interpolation.grid, interpolation.scratch
    for c in range(len(grid.start) - 1):
        begin, end = grid.start[c], grid.start[c + 1]
        if begin == end:
            continue
        cell = scratch.cell if partials is None else partials[c]
        clear_cell(cell)
        base = load(grid.base, c, 0)
        for n in range(begin, end):
            p = grid.order[n]
            place, xi = weigh(interpolation, base, p)
            momentum = _momentum(motion, p)
            slopes = _slopes(transfer, motion, basis, grid, scratch, xi, p)
            columns = _columns(stress, grid, p)
            force = _force(space, stress, external, place, p)
            add_particle(space, basis, scratch.weights, cell, momentum, slopes, columns, force)
        if partials is None:
            for k in range(cell.shape[0]):
                node = grid.stencil[c, k]
                store(nodes, node, 0, load(nodes, node, 0) + load(cell, k, 0))
                store(nodes, node, 4, load(nodes, node, 4) + load(cell, k, 4))


@none_without("motion")
def _momentum(motion, p):
    """m vx, m vy, m vz, m."""
    return broadcast(motion[p, 3]) * _fourth_from(load(motion, p, 4), broadcast(1.0))


@none_without("motion")
def _slopes(transfer, motion, basis, grid, scratch, xi, p):
    """Columns of m C h in the affine transfer, for which node distances are stored; otherwise None."""
    return _affine_slopes(transfer, motion, basis, grid, scratch, xi, p)


@generic
def _affine_slopes(transfer, motion, basis, grid, scratch, xi, p):
    """As `_slopes`, of particles with a mass."""


@_affine_slopes.of(Apic, AffineFlip, Taylor)
def _apic_slopes(transfer, motion, basis, grid, scratch, xi, p):
    store_distances(basis, xi, scratch.weights)
    return _scaled_columns(transfer.affine, p, motion[p, 3] * grid.spacing)


@_affine_slopes.otherwise
def _no_slopes(transfer, motion, basis, grid, scratch, xi, p):
    return None


@register_jitable
def _scaled_columns(rows, p, factor):
    """Columns of a particle's tensor, whose rows are padded to 4, times a factor."""
    scale = broadcast(factor)
    columns = transpose(load(rows, p, 0), load(rows, p, 4), load(rows, p, 8), broadcast(0.0))
    return scale * columns[0], scale * columns[1], scale * columns[2]


@generic
def _columns(stress, grid, p):
    """Columns of -V sigma/h, or of -V0 P/h; None without stress."""


@_columns.of(None)
def _no_columns(stress, grid, p):
    return None


@_columns.of(FirstPiolaKirchhoffStress)
def _nominal_columns(stress, grid, p):
    return _scaled_columns(stress.rows, p, -grid.inverse_spacing)


@_columns.of(CauchyStress)
def _cauchy_columns(stress, grid, p):
    scale = broadcast(-grid.inverse_spacing)
    first, second = scale * load(stress.rows, p, 0), scale * load(stress.rows, p, 4)
    return _column_x(first, second), _column_y(first, second), _column_z(first, second)


@generic
def _force(space, stress, external, place, p):
    """The external force and, in axisymmetry, the pull of the hoop stress -V sigma_33/r towards the axis."""


@_force.otherwise
def _plain_force(space, stress, external, place, p):
    return _external(external, p)


@_force.of(Axisymmetric)
def _pulled(space, stress, external, place, p):
    pull = -_hoop_stress(stress, p) / lane(place, 0)
    return _external(external, p) + from_floats(pull, 0.0, 0.0, 0.0)


@generic
def _hoop_stress(stress, p):
    """V sigma_33, or V0 P_33."""


@_hoop_stress.of(None)
def _no_hoop_stress(stress, p):
    return 0.0


@_hoop_stress.of(FirstPiolaKirchhoffStress)
def _nominal_hoop_stress(stress, p):
    return stress.rows[p, 10]


@_hoop_stress.of(CauchyStress)
def _cauchy_hoop_stress(stress, p):
    return stress.rows[p, 2]


@register_jitable
def _external(external, p):
    if external is None:
        return broadcast(0.0)
    return load(external, p, 0)


@none_without("momentum")
def _row_momentum(momentum, slopes, distance_x, distance_y):
    """Momentum along a row at the particle's place in the last direction."""
    if slopes is None:
        return momentum
    return fused(slopes[0], distance_x, fused(slopes[1], distance_y, momentum))


@none_without("slopes")
def _row_slope(slopes, last):
    return slopes[last]


@none_without("columns")
def _row_across(columns, force, wx, gx, wy, gy):
    return fused(columns[0], gx * wy, fused(columns[1], wx * gy, force * (wx * wy)))


@none_without("columns")
def _row_along(columns, last, w):
    return columns[last] * w


@none_without("slope", returns="momentum")
def _sloped(slope, momentum, distance):
    return fused(slope, distance, momentum)


@register_jitable
def _add_row(basis, weights, last, cell, row, w, momentum, slope, across, along):
    """Add a particle to the K nodes of a row along direction `last`; w is the weight of the other directions."""
    for k in range(nodes_across(basis)):
        weight = weights[k, last]
        if momentum is not None:
            sloped = _sloped(slope, momentum, weights[k, 8 + last])
            store(cell, row + k, 0, fused(w * weight, sloped, load(cell, row + k, 0)))
        if across is not None:
            force = fused(weight, across, load(cell, row + k, 4))
            store(cell, row + k, 4, fused(weights[k, 4 + last], along, force))


@generic
def add_particle(space, basis, weights, cell, momentum, slopes, columns, force):
    """Add a particle to the nodes of its cell, (K**dimension, 8).

    To columns 0..3: w momentum, or where slopes is not None w (momentum + sum_d slopes[d] (i - xi)_d); to columns 4..7:
    w force + sum_d columns[d] dw/dxi_d. momentum, slopes, columns may be None; columns goes with force.
    """


@add_particle.of(Space)
def _add_in_space(space, basis, weights, cell, momentum, slopes, columns, force):
    across = nodes_across(basis)
    slope = _row_slope(slopes, 2)
    for i in range(across):
        wx, gx, dx = weights[i, 0], weights[i, 4], weights[i, 8]
        for j in range(across):
            wy, gy, dy = weights[j, 1], weights[j, 5], weights[j, 9]
            sloped = _row_momentum(momentum, slopes, dx, dy)
            a, b = _row_across(columns, force, wx, gx, wy, gy), _row_along(columns, 2, wx * wy)
            _add_row(basis, weights, 2, cell, (i * across + j) * across, wx * wy, sloped, slope, a, b)


@add_particle.otherwise
def _add_in_plane(space, basis, weights, cell, momentum, slopes, columns, force):
    across = nodes_across(basis)
    slope = _row_slope(slopes, 1)
    for i in range(across):
        wx, gx = weights[i, 0], weights[i, 4]
        sloped = _row_momentum(momentum, slopes, weights[i, 8], 0.0)
        a, b = _row_across(columns, force, wx, gx, 1.0, 0.0), _row_along(columns, 1, wx)
        _add_row(basis, weights, 1, cell, i * across, wx, sloped, slope, a, b)
