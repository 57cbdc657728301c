"""Transfers between particles and the background grid.

Particles to grid, w_ip the shape function of node i at particle p, f_p an external force, C_p the slope of the
velocity, which only some transfers have:

    m_i = sum_p w_ip m_p      p_i = sum_p w_ip m_p [v_p + C_p (x_i - x_p)]
    f_i = sum_p [w_ip f_p - V_p sigma_p grad w_ip]

Grid to particles, a_i the change of a node's velocity in the step, u_ip the weights of `shape_functions.put_moments`:

    FLIP    v_p <- fraction (v_p + sum_i w_ip a_i) + (1 - fraction) sum_i w_ip v_i
    APIC    v_p <- sum_i w_ip v_i,   C_p <- sum_i v_i (x) u_ip
    AFLIP   v_p as FLIP, C_p as APIC
    all     x_p <- x_p + dt sum_i w_ip v_i,   l_p = sum_i v_i (x) grad w_ip

Brackbill, Kothe and Ruppel, Comput. Phys. Commun. 48 (1988) 25 (FLIP); Jiang et al., ACM Trans. Graph. 34 (2015) 51
(APIC); Fei et al., ACM Trans. Graph. 40 (2021) 109 (AFLIP).

Arrays of rows of four, which LLVM handles as one vector each; unused components are 0:

    motion  (capacity, 8)   x y z m | vx vy vz V0       position [m], mass [kg], velocity [m/s], reference volume [m^3]
    slope   (capacity, 12)  rows of C [1/s], each padded to 4
    stress  (capacity, 8)   xx yy zz 0 | yz xz xy -     V sigma [J], V the present volume
    rate    (capacity, 12)  rows of the velocity gradient l [1/s], each padded to 4
    nodes   (slots, 8)      px py pz m | fx fy fz 0     momentum [kg m/s], mass, force [N], as particles give them
                            vx vy vz m | ax ay az 0     velocity [m/s], and its change in the step, as they take them

In two dimensions z = 0; in plane strain masses and volumes are those of a metre of thickness, in axisymmetry of a
radian, with x the radius and y along the axis.
"""

from typing import NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.methods.mpm.shape_functions import nodes_across, put_moments, shape_functions
from parsolid.pairs.rows_of_four import add, add_scaled, load_row, scale, store_row


class Cells(NamedTuple):
    """The cells of a rank with their particles and nodes.

    axes: (0, 1) or (0, 1, 2), by which kernels are compiled for two or three dimensions; axisymmetric: about the axis
    x = 0; origin (4,) [m]: a node; spacing h [m]; base (cells, 4): indices of base nodes, unused columns 0; start
    (cells + 1,), order: particles order[start[c]]..order[start[c+1]-1] lie in cell c; stencil (cells, K^d): slots of
    nodes, the last axis fastest.
    """

    axes: tuple[int, ...]
    axisymmetric: bool
    origin: np.ndarray
    spacing: float
    base: np.ndarray
    start: np.ndarray
    order: np.ndarray
    stencil: np.ndarray


@inlined
def put_weights(basis, cells, c, p, motion, table):
    """Shape functions of a particle of cell c into table (3, K, 4) [axis, node, kind]: w, dw/dxi, and the distance to
    the node in spacings. In two dimensions the axes are the last two, and the first has one node of weight 1.
    """
    inverse, first = 1.0 / cells.spacing, 3 - len(cells.axes)
    for a in cells.axes:
        xi = (motion[p, a] - cells.origin[a]) * inverse - cells.base[c, a]
        w, g = shape_functions(basis, p, a, xi)
        for k in range(nodes_across(basis)):
            table[first + a, k, 0], table[first + a, k, 1], table[first + a, k, 2] = w[k], g[k], k - xi


@kernel
def particles_to_grid(basis, cells, motion, slope, stress, external, nodes):
    """Add mass, momentum and force of all particles to nodes, which must be 0 before.

    slope: None without slopes; stress: None for mass and momentum alone; external (capacity, 4): forces [N], or None.
    """
    across, first = nodes_across(basis), 3 - len(cells.axes)
    planes = across if first == 0 else 1
    table, near = np.zeros((3, across, 4)), np.empty((across**3, 8))
    table[0, 0, 0] = 1.0
    inward, zero, pull = -1.0 / cells.spacing, (0.0, 0.0, 0.0, 0.0), np.zeros((1, 4))
    for c in range(len(cells.base)):
        if cells.start[c] == cells.start[c + 1]:
            continue
        for k in range(cells.stencil.shape[1]):
            store_row(near, k, 0, zero)
            store_row(near, k, 4, zero)
        for n in range(cells.start[c], cells.start[c + 1]):
            p = np.uintp(cells.order[n])
            put_weights(basis, cells, c, p, motion, table)
            m = motion[p, 3]
            momentum = (m * motion[p, 4], m * motion[p, 5], m * motion[p, 6], m)
            if slope is not None:
                size, o = m * cells.spacing, slope[p, 3]
                cx = scale(size, (slope[p, 0], slope[p, 4], slope[p, 8], o))
                cy = scale(size, (slope[p, 1], slope[p, 5], slope[p, 9], o))
                cz = scale(size, (slope[p, 2], slope[p, 6], slope[p, 10], o))
                if first:
                    cx, cy, cz = cz, cx, cy
            if stress is not None:
                xx, yy, zz, o = load_row(stress, p, 0)
                yz, xz, xy, _ = load_row(stress, p, 4)
                sx, sy = scale(inward, (xx, xy, xz, o)), scale(inward, (xy, yy, yz, o))
                sz = scale(inward, (xz, yz, zz, o))
                if first:
                    sx, sy, sz = sz, sx, sy
                if external is not None:
                    store_row(pull, 0, 0, load_row(external, p, 0))
                if cells.axisymmetric:
                    pull[0, 0] = (0.0 if external is None else external[p, 0]) - stress[p, 2] / motion[p, 0]
                force = load_row(pull, 0, 0)
            for i in range(planes):
                for j in range(across):
                    wx, wy, row = table[0, i, 0], table[1, j, 0], (i * across + j) * across
                    w, there = wx * wy, momentum
                    if slope is not None:
                        there = add_scaled(add_scaled(momentum, table[1, j, 2], cy), table[0, i, 2], cx)
                    if stress is not None:
                        side = add_scaled(add_scaled(scale(w, force), wx * table[1, j, 1], sy), table[0, i, 1] * wy, sx)
                        along = scale(w, sz)
                    for k in range(across):
                        carried = there
                        if slope is not None:
                            carried = add_scaled(there, table[2, k, 2], cz)
                        store_row(near, row + k, 0, add_scaled(load_row(near, row + k, 0), w * table[2, k, 0], carried))
                        if stress is not None:
                            pulled = add_scaled(load_row(near, row + k, 4), table[2, k, 0], side)
                            store_row(near, row + k, 4, add_scaled(pulled, table[2, k, 1], along))
        for k in range(cells.stencil.shape[1]):
            node = np.uintp(cells.stencil[c, k])
            store_row(nodes, node, 0, add(load_row(nodes, node, 0), load_row(near, k, 0)))
            if stress is not None:
                store_row(nodes, node, 4, add(load_row(nodes, node, 4), load_row(near, k, 4)))


@kernel
def grid_to_particles(basis, cells, nodes, remapped, step, motion, fraction, slope, rate, paths):
    """Velocities, positions and velocity gradients of all particles after a step [s].

    remapped (slots, 8): nodes with the velocities that strain matter, where they are not those of nodes, or None;
    fraction of FLIP, or None to leave velocities and slopes as they are; slope: None without slopes; rate: velocity
    gradients, in axisymmetry with l_33 = v_r/r, or None to leave positions, too; paths (capacity, 4): where the
    velocities by which positions change are kept, or None.
    """
    across, first = nodes_across(basis), 3 - len(cells.axes)
    planes = across if first == 0 else 1
    table, near = np.zeros((3, across, 4)), np.empty((across**3, 8))
    table[0, 0, 0] = 1.0
    inverse, zero, sums = 1.0 / cells.spacing, (0.0, 0.0, 0.0, 0.0), np.zeros((5, 4))
    for c in range(len(cells.base)):
        if cells.start[c] == cells.start[c + 1]:
            continue
        for k in range(cells.stencil.shape[1]):
            node = np.uintp(cells.stencil[c, k])
            store_row(near, k, 0, load_row(nodes, node, 0))
            if remapped is None:
                store_row(near, k, 4, load_row(nodes, node, 4))
            else:
                store_row(near, k, 4, load_row(remapped, node, 0))
        for n in range(cells.start[c], cells.start[c + 1]):
            p = np.uintp(cells.order[n])
            put_weights(basis, cells, c, p, motion, table)
            if slope is not None:
                # the weights of the slope are the fourth kind
                for a in range(first, 3):
                    put_moments(basis, table[a])
            v, second, gx, gy, gz, cx, cy, cz = zero, zero, zero, zero, zero, zero, zero, zero
            for i in range(planes):
                for j in range(across):
                    wx, wy, row = table[0, i, 0], table[1, j, 0], (i * across + j) * across
                    w = wx * wy
                    velocity, other, along, slanted = zero, zero, zero, zero
                    for k in range(across):
                        velocity = add_scaled(velocity, table[2, k, 0], load_row(near, row + k, 0))
                        if fraction is not None or remapped is not None:
                            other = add_scaled(other, table[2, k, 0], load_row(near, row + k, 4))
                        if rate is not None:
                            if remapped is None:
                                along = add_scaled(along, table[2, k, 1], load_row(near, row + k, 0))
                            else:
                                along = add_scaled(along, table[2, k, 1], load_row(near, row + k, 4))
                        if slope is not None:
                            slanted = add_scaled(slanted, table[2, k, 3], load_row(near, row + k, 0))
                    v = add_scaled(v, w, velocity)
                    if fraction is not None or remapped is not None:
                        second = add_scaled(second, w, other)
                    if rate is not None:
                        straining = velocity if remapped is None else other
                        gx = add_scaled(gx, table[0, i, 1] * wy, straining)
                        gy = add_scaled(gy, wx * table[1, j, 1], straining)
                        gz = add_scaled(gz, w, along)
                    if slope is not None:
                        cx = add_scaled(cx, table[0, i, 3] * wy, velocity)
                        cy = add_scaled(cy, wx * table[1, j, 3], velocity)
                        cz = add_scaled(cz, w, slanted)
            # LLVM takes tuples of four for vectors where it sees all four of them stored
            store_row(sums, 0, 0, v)
            if fraction is not None:
                store_row(sums, 1, 0, second)
                for a in cells.axes:
                    motion[p, 4 + a] = sums[0, a] + fraction * (motion[p, 4 + a] + sums[1, a] - sums[0, a])
            if slope is not None:
                put_rows(slope, p, first, inverse, cx, cy, cz, sums)
            if rate is not None:
                put_rows(rate, p, first, inverse, gx, gy, gz, sums)
                if cells.axisymmetric:
                    rate[p, 10] = (v[0] if remapped is None else second[0]) / motion[p, 0]
                for a in cells.axes:
                    motion[p, a] += step * sums[0, a]
                if paths is not None:
                    store_row(paths, p, 0, v)


@inlined
def put_rows(array, p, first, factor, x, y, z, sums):
    """Columns of a tensor, scaled, as rows; in two dimensions its columns are y and z."""
    store_row(sums, 2, 0, scale(factor, x))
    store_row(sums, 3, 0, scale(factor, y))
    store_row(sums, 4, 0, scale(factor, z))
    for a in range(3 - first):
        for b in range(3 - first):
            array[p, 4 * a + b] = sums[2 + b + first, a]
