"""Grid to particle: nodal velocities, their changes and gradients gathered to the particles of a cell from a copy of
its nodes.

FLIP  v_p <- fraction (v_p + sum_i w_ip a_i) + (1 - fraction) sum_i w_ip v_i        a_i: change of nodal velocity in the
step
APIC  v_p <- sum_i w_ip v_i,   C_p <- sum_i v_i (x) u_ip                            u_ip: see weights.store_distances
AFLIP v_p as FLIP, C_p as APIC
TPIC  v_p as APIC, C_p <- sum_i v_i (x) grad w_ip
all   x_p <- x_p + dt sum_i w_ip v_i,   l_p = sum_i v_i (x) grad w_ip
"""

from decomposition.compiled import compiled
from decomposition.deferred import overload, register_jitable
from parsolid.methods.mpm.grid import AffineFlip, Apic, Flip, Taylor, weigh
from parsolid.methods.mpm.weights import nodes_across, store_derivatives, store_distances
from parsolid.numerics.dispatch import generic, is_instance
from parsolid.numerics.lanes import broadcast, from_floats, fused, lane, load, shuffle, store, transpose, without_fourth
from parsolid.numerics.layout import Axisymmetric, Space

_fourth_from = shuffle(0, 1, 2, 7)


@compiled(fastmath={"contract"}, error_model="numpy")
def gather(interpolation, nodes, motion, step, transfer, rate, remapped, ways):
    """Velocities, positions and velocity gradients of the particles of all cells, after `grid.update_nodes`.

    transfer: Flip or Apic, by which motion's velocities change, or None to leave them. rate (capacity, 12): velocity
    gradients [1/s], rows padded to 4 (in axisymmetry l33 = v_r/r), or None, and then positions do not change either.
    remapped (nodes, 8): the nodes that gradients are taken of where momentum was mapped back (MUSL), or None. ways
    (capacity, 4): where the velocities by which positions change are kept, or None.
    """
    space, basis, grid, scratch = interpolation.space, interpolation.basis, interpolation.grid, interpolation.scratch
    for c in range(len(grid.start) - 1):
        if grid.start[c] == grid.start[c + 1]:
            continue
        base = load(grid.base, c, 0)
        _copy_nodes(grid, c, nodes, remapped, scratch.cell)
        for n in range(grid.start[c], grid.start[c + 1]):
            p = grid.order[n]
            place, xi = weigh(interpolation, base, p)
            if transfer is not None:
                _prepare(transfer, basis, xi, scratch.weights)
            sums = sum_nodes(space, basis, scratch, transfer, rate, remapped)
            if transfer is not None:
                _move_velocity(transfer, motion, p, sums, grid.inverse_spacing)
            if rate is not None:
                moved = fused(without_fourth(sums[0]), broadcast(step), load(motion, p, 0))
                store(motion, p, 0, moved)
                if ways is not None:
                    store(ways, p, 0, without_fourth(sums[0]))
                hoop = _hoop_rate(space, remapped, sums, place)
                _store_rows(rate, p, sums[2], grid.inverse_spacing, hoop)


@register_jitable
def _copy_nodes(grid, c, nodes, remapped, cell):
    """Nodes of a cell side by side; columns 4..7: changes of velocity, or velocities of remapped momentum."""
    for k in range(cell.shape[0]):
        node = grid.stencil[c, k]
        store(cell, k, 0, load(nodes, node, 0))
        if remapped is None:
            store(cell, k, 4, load(nodes, node, 4))
        else:
            store(cell, k, 4, load(remapped, node, 0))


@generic
def _prepare(transfer, basis, xi, weights):
    """What a transfer needs beside the weights."""


@_prepare.of(Apic, AffineFlip)
def _prepare_slopes(transfer, basis, xi, weights):
    store_distances(basis, xi, weights)


@_prepare.of(Taylor)
def _prepare_gradient(transfer, basis, xi, weights):
    store_derivatives(basis, weights)


@_prepare.otherwise
def _prepare_nothing(transfer, basis, xi, weights):
    pass


@generic
def _move_velocity(transfer, motion, p, sums, inverse_spacing):
    """New velocity of a particle, and its slope."""


@_move_velocity.of(Apic, Taylor)
def _take_nodal(transfer, motion, p, sums, inverse_spacing):
    store(motion, p, 4, _fourth_from(sums[0], load(motion, p, 4)))
    _store_rows(transfer.affine, p, sums[3], inverse_spacing, 0.0)


@_move_velocity.of(AffineFlip)
def _add_change_and_take_slope(transfer, motion, p, sums, inverse_spacing):
    store(motion, p, 4, _changed(load(motion, p, 4), sums, transfer.fraction))
    _store_rows(transfer.affine, p, sums[3], inverse_spacing, 0.0)


@_move_velocity.of(Flip)
def _add_change(transfer, motion, p, sums, inverse_spacing):
    store(motion, p, 4, _changed(load(motion, p, 4), sums, transfer.fraction))


@register_jitable
def _changed(velocity, sums, fraction):
    """A velocity with the change of the nodes', the rest of the fraction the nodes' own; the fourth stays."""
    moved = velocity + sums[1]
    nodal = _fourth_from(sums[0], moved)
    return fused(moved - nodal, broadcast(fraction), nodal)


@register_jitable
def _store_rows(array, p, columns, scale, corner):
    """Columns of a tensor, scaled, as rows; `corner` is added to the last diagonal entry, in two dimensions."""
    rows = transpose(scale * columns[0], scale * columns[1], scale * columns[2], broadcast(0.0))
    store(array, p, 0, rows[0])
    store(array, p, 4, rows[1])
    store(array, p, 8, rows[2] + from_floats(0.0, 0.0, corner, 0.0))


@generic
def _hoop_rate(space, remapped, sums, place):
    """v_r/r in axisymmetry."""


@_hoop_rate.of(Axisymmetric)
def _hoop_rate_of_radius(space, remapped, sums, place):
    if remapped is None:
        return lane(sums[0], 0) / lane(place, 0)
    return lane(sums[1], 0) / lane(place, 0)


@_hoop_rate.otherwise
def _no_hoop_rate(space, remapped, sums, place):
    return 0.0


@register_jitable
def _row(basis, weights, offset, cell, row, column):
    """Sum over a row of nodes, along the direction that column `offset` of the weights belongs to."""
    result = weights[0, offset] * load(cell, row, column)
    for k in range(1, nodes_across(basis)):
        result = fused(load(cell, row + k, column), weights[k, offset], result)
    return result


def sum_nodes(space, basis, scratch, transfer, rate, remapped):
    """Sums over scratch.cell, v its columns 0..3: (sum w v, sum w of columns 4..7, sums of v dw/dxi_d, sums of v u_d).

    The second only for Flip, AffineFlip or where remapped is not None, and then the third is of columns 4..7; the third
    only where rate is not None, the fourth only with slopes. What is not asked for is 0.
    """
    raise NotImplementedError


@overload(sum_nodes)
def _choose_sums(space, basis, scratch, transfer, rate, remapped):
    from numba import types

    # constants of the compiled code, which drops what the transfer, the rate or remapped momentum does not need
    source = 0 if isinstance(remapped, types.NoneType) else 4
    with_second = source == 4 or is_instance(transfer, Flip) or is_instance(transfer, AffineFlip)
    with_slope = any(is_instance(transfer, affine) for affine in (Apic, AffineFlip, Taylor))
    sums = _sums_in_space if is_instance(space, Space) else _sums_in_plane
    return sums(source, with_second, not isinstance(rate, types.NoneType), with_slope)


def _sums_in_space(source, with_second, with_rate, with_slope):
    def in_space(space, basis, scratch, transfer, rate, remapped):
        zero = broadcast(0.0)
        across, weights, cell = nodes_across(basis), scratch.weights, scratch.cell
        v, second, Gx, Gy, Gz, Cx, Cy, Cz = zero, zero, zero, zero, zero, zero, zero, zero
        for i in range(across):
            wx, gx, ux = weights[i, 0], weights[i, 4], weights[i, 12]
            for j in range(across):
                wy, gy, uy = weights[j, 1], weights[j, 5], weights[j, 13]
                row, w = (i * across + j) * across, wx * wy
                first = _row(basis, weights, 2, cell, row, 0)
                v = fused(first, w, v)
                base = first
                if with_second:
                    base = _row(basis, weights, 2, cell, row, 4)
                    second = fused(base, w, second)
                if with_rate:
                    along = _row(basis, weights, 6, cell, row, source)
                    base = base if source == 4 else first
                    Gx, Gy, Gz = fused(base, gx * wy, Gx), fused(base, wx * gy, Gy), fused(along, w, Gz)
                if with_slope:
                    along = _row(basis, weights, 14, cell, row, 0)
                    Cx, Cy, Cz = fused(first, ux * wy, Cx), fused(first, wx * uy, Cy), fused(along, w, Cz)
        return v, second, (Gx, Gy, Gz), (Cx, Cy, Cz)

    return in_space


def _sums_in_plane(source, with_second, with_rate, with_slope):
    def in_plane(space, basis, scratch, transfer, rate, remapped):
        zero = broadcast(0.0)
        across, weights, cell = nodes_across(basis), scratch.weights, scratch.cell
        v, second, Gx, Gy, Cx, Cy = zero, zero, zero, zero, zero, zero
        for i in range(across):
            wx, gx, ux = weights[i, 0], weights[i, 4], weights[i, 12]
            row = i * across
            first = _row(basis, weights, 1, cell, row, 0)
            v = fused(first, wx, v)
            base = first
            if with_second:
                base = _row(basis, weights, 1, cell, row, 4)
                second = fused(base, wx, second)
            if with_rate:
                along = _row(basis, weights, 5, cell, row, source)
                base = base if source == 4 else first
                Gx, Gy = fused(base, gx, Gx), fused(along, wx, Gy)
            if with_slope:
                along = _row(basis, weights, 13, cell, row, 0)
                Cx, Cy = fused(first, ux, Cx), fused(along, wx, Cy)
        return v, second, (Gx, Gy, zero), (Cx, Cy, zero)

    return in_plane
