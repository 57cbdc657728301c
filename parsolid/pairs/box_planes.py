"""One plane of a box at a time: velocity gradients, and forces of stresses and of dissipation, as sums along the axes.

A rank has a part of a box (`decomposition.boxes`): planes of nodes across the slowest axis in memory, in which the
nodes follow one another in rows. Two planes, and two rows in every plane, beyond each side where other ranks go on hold
their nodes as ghosts. Inner loops run over the nodes of a plane, which LLVM vectorises.

Arrays have one row a component: component d c + J of a tensor A in d dimensions is A_cJ. Velocity v [m/s] and position
x [m] have all planes. Velocity gradient G [1/s], first Piola-Kirchhoff stress P [Pa] and half impedances Z [Pa s/m]
have a window of so many planes as the forces of one plane need, which the planes take in turn: a step goes from plane
to plane, and the window stays in the cache. Where other ranks have planes of a box the window is all of it.

The dissipation is that of the acoustic Riemann problem between nearest neighbours along the axes (Lee et al., eqs (74),
(75)): with the jump u of the velocities, less what both gradients explain of it, and n along x_b - x_a the flux from b
to a is Z_s u + (Z_p - Z_s) (u . n) n [Pa].
"""

from typing import NamedTuple

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel
from parsolid.pairs.box_weights import REACH
from parsolid.pairs.riemann import riemann_factors

# planes that the sums of one plane reach
WINDOW = 2 * REACH + 1


class Box(NamedTuple):
    """This rank's part of a box as kernels take it; memory axes 0, 1 (and 2 in space), the slowest first.

    first: row of its first node in the fields; start: place of its first node in v and x; window: how many planes G, P
    and Z have, window_start: place of the first of them; planes, nodes: how many planes the box has and how many nodes
    a plane, with ghosts; row: nodes along the fastest axis of space, 1 in the plane; first_plane, last_plane,
    first_node, last_node: own planes and nodes of a plane, the last ones excluded; axes: the axis in space of each
    memory axis.

    Tables as in `box_weights.AxisTables`, those of axis 0 by plane, the others by node of a plane: gradient, divergence
    (2, 7, n), jump (2, 2, n), half_step (n,). length (planes,) [m], area (nodes,) [m^2]: their product is the volume of
    a node.
    """

    first: int
    start: int
    window: int
    window_start: int
    planes: int
    nodes: int
    row: int
    first_plane: int
    last_plane: int
    first_node: int
    last_node: int
    axes: tuple[int, ...]
    gradient: tuple[np.ndarray, ...]
    divergence: tuple[np.ndarray, ...]
    jump: tuple[np.ndarray, ...]
    half_step: tuple[np.ndarray, ...]
    length: np.ndarray
    area: np.ndarray


class PlaneScratch(NamedTuple):
    """Of one plane after the other.

    values: a component of v or P, with REACH rows of zeros before and after it; sums (d, n): of the own nodes. Fluxes
    of pairs along axis 0 with the next plane across[(i + 1) % 2] and the one before across[i % 2] (2 d, n), along axis
    1 of a node with the one a row before it along_rows[:, p] and behind along_rows[:, p + row], along axis 2 in_rows,
    with a row of one. half_step: that of axis 0 for all nodes.
    """

    values: np.ndarray
    sums: np.ndarray
    across: np.ndarray
    along_rows: np.ndarray
    in_rows: np.ndarray
    half_step: np.ndarray


def plane_scratch(box: Box, d: int) -> PlaneScratch:
    """`PlaneScratch` of a box."""
    n = box.last_node - box.first_node
    return PlaneScratch(
        aligned_zeros(box.nodes + 2 * REACH * box.row),
        aligned_zeros((d, n)),
        aligned_zeros((2 * d, n)),
        aligned_zeros((d, n + box.row)),
        aligned_zeros((d, n + 1)),
        aligned_zeros(box.nodes),
    )


@kernel
def place_in_window(box, i):
    """Place of the first node of plane i in G, P and Z."""
    return box.window_start + (i % box.window) * box.nodes


@kernel
def copy(out, f):
    """Of slices, in which LLVM sees that no index is negative, so that it vectorises the loop."""
    for p in range(out.size):
        out[p] = f[p]


# --- differences --------------------------------------------------------------------------------------------------

# Functions with loops take whole arrays and make slices themselves: numba counts references of slices that are
# arguments, which would take longer than these loops.


@kernel
def differences_across(n, f, c, places, weights, k, i, out, component, place):
    """Differences along axis 0 of component c of f at n nodes of plane i, into a row of out from `place` on.

    places: of the first node in seven planes around; weights (2, 7, planes), of which the first index is k.
    """
    w0, w1, w2, w3 = weights[k, 0, i], weights[k, 1, i], weights[k, 2, i], weights[k, 3, i]
    w4, w5, w6 = weights[k, 4, i], weights[k, 5, i], weights[k, 6, i]
    p0, p1, p2, p3, p4, p5, p6 = places
    f0, f1, f2, f3 = f[c, p0 : p0 + n], f[c, p1 : p1 + n], f[c, p2 : p2 + n], f[c, p3 : p3 + n]
    f4, f5, f6, result = f[c, p4 : p4 + n], f[c, p5 : p5 + n], f[c, p6 : p6 + n], out[component, place : place + n]
    for p in range(n):
        total = w0 * f0[p] + w1 * f1[p] + w2 * f2[p] + w3 * f3[p]
        result[p] = total + w4 * f4[p] + w5 * f5[p] + w6 * f6[p]


@kernel
def differences_within(n, values, first, stride, weights, k, node, out, component, place, add):
    """Differences of values of a plane along an axis whose neighbours are `stride` places apart, at n nodes from place
    `first` on, into a row of out from `place` on, or added to it.

    weights (2, 7, nodes) from `node` on, of which the first index is k: 0 where a neighbour would be in another row.
    """
    end, p0, p1, p2 = node + n, first - 3 * stride, first - 2 * stride, first - stride
    p4, p5, p6 = first + stride, first + 2 * stride, first + 3 * stride
    w0, w1, w2, w3 = weights[k, 0, node:end], weights[k, 1, node:end], weights[k, 2, node:end], weights[k, 3, node:end]
    w4, w5, w6 = weights[k, 4, node:end], weights[k, 5, node:end], weights[k, 6, node:end]
    f0, f1, f2, f3 = values[p0 : p0 + n], values[p1 : p1 + n], values[p2 : p2 + n], values[first : first + n]
    f4, f5, f6, result = (
        values[p4 : p4 + n],
        values[p5 : p5 + n],
        values[p6 : p6 + n],
        out[component, place : place + n],
    )
    for p in range(n):
        total = w0[p] * f0[p] + w1[p] * f1[p] + w2[p] * f2[p] + w3[p] * f3[p]
        total = total + w4[p] * f4[p] + w5[p] * f5[p] + w6[p] * f6[p]
        result[p] = result[p] + total if add else total


@inlined
def around(i, last, start, nodes, window):
    """Places of the seven planes around plane i, of which there are last + 1: of those beyond, whose weights are 0,
    another one."""
    return (
        start + max(i - 3, 0) % window * nodes,
        start + max(i - 2, 0) % window * nodes,
        start + max(i - 1, 0) % window * nodes,
        start + i % window * nodes,
        start + min(i + 1, last) % window * nodes,
        start + min(i + 2, last) % window * nodes,
        start + min(i + 3, last) % window * nodes,
    )


@kernel
def load_values(f, c, place, n, values, margin):
    """Component c of f in a plane into `values`, with zeros around it, so that neighbours are never outside."""
    plane, inside = f[c, place : place + n], values[margin : margin + n]
    for p in range(n):
        inside[p] = plane[p]


@kernel
def gradient_in_plane(box, i, v, values, G, place):
    """G of the own nodes of plane i, into places from `place` on."""
    d, n, first, margin = v.shape[0], box.last_node - box.first_node, box.first_node, REACH * box.row
    places = around(i, box.planes - 1, box.start + first, box.nodes, box.planes)
    for c in range(d):
        along = int(box.axes[0] == c)
        differences_across(n, v, c, places, box.gradient[0], along, i, G, d * c + box.axes[0], place)
        load_values(v, c, box.start + i * box.nodes, box.nodes, values, margin)
        for axis in range(1, len(box.axes)):
            along, stride, column = int(box.axes[axis] == c), box.row if axis == 1 else 1, d * c + box.axes[axis]
            differences_within(
                n, values, margin + first, stride, box.gradient[axis], along, first, G, column, place, False
            )


@kernel
def gradient_pass(box, scratch, v, G):
    """Velocity gradient G of a box whose window has all planes."""
    values = scratch.values
    for i in range(box.first_plane, box.last_plane):
        gradient_in_plane(box, i, v, values, G, place_in_window(box, i) + box.first_node)


# --- fluxes -------------------------------------------------------------------------------------------------------


@kernel
def flux_in_space(n, half_step, node, v, x, a, b, G, k, Z, pressure, shear, A, B, directional, flux, component, begin):
    """Riemann flux [Pa] of n nodes and their neighbours above along axis k of space, into three rows of flux.

    a, b: places of the first node and its neighbour in v and x; A, B: in G and Z; half_step from `node` on. pressure,
    shear: rows of Z, half impedances, or where directional is not None halves of the density times the moduli along
    the axis, of which impedances are roots.
    """
    h = half_step[node : node + n]
    v0, v1, v2, w0, w1, w2 = (
        v[0, a : a + n], v[1, a : a + n], v[2, a : a + n], v[0, b : b + n], v[1, b : b + n], v[2, b : b + n]
    )  # fmt: skip
    x0, x1, x2, y0, y1, y2 = (
        x[0, a : a + n], x[1, a : a + n], x[2, a : a + n], x[0, b : b + n], x[1, b : b + n], x[2, b : b + n]
    )  # fmt: skip
    G0, G1, G2, H0, H1, H2 = (
        G[k, A : A + n], G[3 + k, A : A + n], G[6 + k, A : A + n],
        G[k, B : B + n], G[3 + k, B : B + n], G[6 + k, B : B + n],
    )  # fmt: skip
    fast_a, slow_a, fast_b, slow_b = (
        Z[pressure, A : A + n], Z[shear, A : A + n], Z[pressure, B : B + n], Z[shear, B : B + n]
    )  # fmt: skip
    c = component
    f0, f1, f2 = flux[c, begin : begin + n], flux[c + 1, begin : begin + n], flux[c + 2, begin : begin + n]
    for p in range(n):
        u0, u1, u2 = (
            w0[p] - v0[p] - h[p] * (G0[p] + H0[p]),
            w1[p] - v1[p] - h[p] * (G1[p] + H1[p]),
            w2[p] - v2[p] - h[p] * (G2[p] + H2[p]),
        )
        r0, r1, r2 = y0[p] - x0[p], y1[p] - x1[p], y2[p] - x2[p]
        Z_p, Z_s = fast_a[p] + fast_b[p], slow_a[p] + slow_b[p]
        if directional is not None:
            Z_p, Z_s = Z_p**0.5, Z_s**0.5
        s, along = riemann_factors(Z_p, Z_s, u0 * r0 + u1 * r1 + u2 * r2, r0 * r0 + r1 * r1 + r2 * r2)
        f0[p], f1[p], f2[p] = s * u0 + along * r0, s * u1 + along * r1, s * u2 + along * r2


@kernel
def flux_in_strain_plane(
    n, half_step, node, v, x, a, b, G, k, Z, pressure, shear, A, B, directional, flux, component, begin
):
    """`flux_in_space` in plane strain."""
    h = half_step[node : node + n]
    v0, v1, w0, w1 = v[0, a : a + n], v[1, a : a + n], v[0, b : b + n], v[1, b : b + n]
    x0, x1, y0, y1 = x[0, a : a + n], x[1, a : a + n], x[0, b : b + n], x[1, b : b + n]
    G0, G1, H0, H1 = G[k, A : A + n], G[2 + k, A : A + n], G[k, B : B + n], G[2 + k, B : B + n]
    fast_a, slow_a, fast_b, slow_b = (
        Z[pressure, A : A + n], Z[shear, A : A + n], Z[pressure, B : B + n], Z[shear, B : B + n]
    )  # fmt: skip
    f0, f1 = flux[component, begin : begin + n], flux[component + 1, begin : begin + n]
    for p in range(n):
        u0 = w0[p] - v0[p] - h[p] * (G0[p] + H0[p])
        u1 = w1[p] - v1[p] - h[p] * (G1[p] + H1[p])
        r0, r1 = y0[p] - x0[p], y1[p] - x1[p]
        Z_p, Z_s = fast_a[p] + fast_b[p], slow_a[p] + slow_b[p]
        if directional is not None:
            Z_p, Z_s = Z_p**0.5, Z_s**0.5
        s, along = riemann_factors(Z_p, Z_s, u0 * r0 + u1 * r1, r0 * r0 + r1 * r1)
        f0[p], f1[p] = s * u0 + along * r0, s * u1 + along * r1


@kernel
def fluxes(box, axis, i, j, node, n, shift, half_step, v, x, G, Z, directional, flux, component, begin):
    """Fluxes between n nodes of plane i from `node` on and those `shift` behind them in plane j, their neighbours above
    along a memory axis, into rows of flux (.., n or more) from component and place `begin` on."""
    d, k = v.shape[0], box.axes[axis]
    pressure, shear = 0, 1
    if directional is not None:
        pressure, shear = k, d + k
    a, b = box.start + i * box.nodes + node, box.start + j * box.nodes + node + shift
    A, B = place_in_window(box, i) + node, place_in_window(box, j) + node + shift
    if d == 3:
        flux_in_space(
            n, half_step, node, v, x, a, b, G, k, Z, pressure, shear, A, B, directional, flux, component, begin
        )
    else:
        flux_in_strain_plane(
            n, half_step, node, v, x, a, b, G, k, Z, pressure, shear, A, B, directional, flux, component, begin
        )


@kernel
def fluxes_across(box, i, v, x, G, Z, directional, half_step, across):
    """Fluxes between planes i and i + 1."""
    n = box.last_node - box.first_node
    for p in range(half_step.size):
        half_step[p] = box.half_step[0][i]
    component = (i + 1) % 2 * v.shape[0]
    fluxes(box, 0, i, i + 1, box.first_node, n, 0, half_step, v, x, G, Z, directional, across, component, 0)


@kernel
def gather_across(n, across, below, above, jump, k, i, out, c):
    """What n nodes of plane i get of fluxes along axis 0, into row c of out; below, above: rows of across."""
    from_below, to_above = jump[k, 1, i], jump[k, 0, i]
    low, high, result = across[below, :n], across[above, :n], out[c, :n]
    for p in range(n):
        result[p] = to_above * high[p] + from_below * low[p]


@kernel
def gather_within(n, flux, c, shift, jump, k, node, out):
    """Add what n nodes from `node` on get of fluxes along an axis within planes, to row c of out."""
    below, above, result = flux[c, :n], flux[c, shift : shift + n], out[c, :n]
    to_above, from_below = jump[k, 0, node : node + n], jump[k, 1, node : node + n]
    for p in range(n):
        result[p] += to_above[p] * above[p] + from_below[p] * below[p]


# --- forces -------------------------------------------------------------------------------------------------------


@kernel
def scale_to_volume(n, length, area, node, sums, c, field, row):
    """Row c of a field from `row` on: length area sums of n nodes from `node` on."""
    per_plane, total, result = area[node : node + n], sums[c, :n], field[c, row : row + n]
    for p in range(n):
        result[p] = length * per_plane[p] * total[p]


@kernel
def stress_forces_in_plane(box, i, P, values, sums, force):
    """V Div P [N] of the own nodes of plane i, into their rows of the field."""
    d, first, n, margin = force.shape[0], box.first_node, box.last_node - box.first_node, REACH * box.row
    places = around(i, box.planes - 1, box.window_start + first, box.nodes, box.window)
    row, plane, length = box.first + (i - box.first_plane) * n, place_in_window(box, i), box.length[i]
    for c in range(d):
        along = int(box.axes[0] == c)
        differences_across(n, P, d * c + box.axes[0], places, box.divergence[0], along, i, sums, c, 0)
        for axis in range(1, len(box.axes)):
            along, stride = int(box.axes[axis] == c), box.row if axis == 1 else 1
            load_values(P, d * c + box.axes[axis], plane, box.nodes, values, margin)
            differences_within(n, values, margin + first, stride, box.divergence[axis], along, first, sums, c, 0, True)
        scale_to_volume(n, length, box.area, first, sums, c, force, row)


@kernel
def dissipative_forces_in_plane(box, scratch, i, v, x, G, Z, directional, dissipation):
    """V D [N] of the own nodes of plane i, into their rows of the field, after those of plane i - 1.

    Every node gathers the fluxes of its own pairs, so that no result depends on where a box is cut.
    """
    d, nodes, first, last = v.shape[0], box.nodes, box.first_node, box.last_node
    n, row = last - first, box.first + (i - box.first_plane) * (last - first)
    sums, across, half_step = scratch.sums, scratch.across, scratch.half_step
    if i == box.first_plane and i > 0:
        fluxes_across(box, i - 1, v, x, G, Z, directional, half_step, across)
    if i + 1 < box.planes:
        fluxes_across(box, i, v, x, G, Z, directional, half_step, across)
    for c in range(d):
        below, above = i % 2 * d + c, (i + 1) % 2 * d + c
        gather_across(n, across, below, above, box.jump[0], int(box.axes[0] == c), i, sums, c)
    for axis in range(1, len(box.axes)):
        shift, flux = (box.row, scratch.along_rows) if axis == 1 else (1, scratch.in_rows)
        # pairs with an own node
        p, q = max(0, first - shift), min(nodes, last + shift) - shift
        begin = p - (first - shift)
        fluxes(box, axis, i, i, p, q - p, shift, box.half_step[axis], v, x, G, Z, directional, flux, 0, begin)
        for c in range(d):
            gather_within(n, flux, c, shift, box.jump[axis], int(box.axes[axis] == c), first, sums)
    for c in range(d):
        scale_to_volume(n, box.length[i], box.area, first, sums, c, dissipation, row)


@kernel
def forces_in_plane(box, scratch, i, P, v, x, G, Z, directional, force, dissipation):
    """Forces V Div P and V D [N] of the own nodes of plane i into their rows of the fields (d, n); planes come in turn.
    Z: None without dissipation; directional: see `flux_in_space`."""
    stress_forces_in_plane(box, i, P, scratch.values, scratch.sums, force)
    if Z is not None:
        dissipative_forces_in_plane(box, scratch, i, v, x, G, Z, directional, dissipation)


@kernel
def divergence_pass(box, scratch, P, v, x, G, Z, directional, force, dissipation):
    """`forces_in_plane` of all planes of a box whose window has all of them."""
    for i in range(box.first_plane, box.last_plane):
        forces_in_plane(box, scratch, i, P, v, x, G, Z, directional, force, dissipation)
