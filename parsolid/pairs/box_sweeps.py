"""Gradients of velocities and divergences of stresses on boxes of nodes, as sums along the axes of the lattice.

A rank has a part of a box (`decomposition.boxes`): planes of nodes across the slowest axis in memory, in which the
nodes follow one another in rows. Two planes, and two rows in every plane, beyond each side where other ranks go on hold
their nodes as ghosts. Inner loops run over the neighbouring nodes of a plane, which LLVM vectorises.

Arrays have one row a component, (c, places): component d c + J of a tensor A in d dimensions is A_cJ. Fields of the
particles have the nodes of this rank alone, box arrays (velocity v [m/s], position x [m], velocity gradient G [1/s],
first Piola-Kirchhoff stress P [Pa], half impedances Z [Pa s/m]) have the ghosts, too.

The dissipation is that of the acoustic Riemann problem between nearest neighbours along the axes (Lee et al., eqs (74),
(75)): with the jump u of the velocities, less what both gradients explain of
it, and n along x_b - x_a the flux from b to a is Z_s u + (Z_p - Z_s) (u . n) n [Pa].
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from decomposition.boxes import BoxOfNodes, GhostExchange, Link, Transfer, links_of, with_ghosts
from parsolid.kernels import inlined, kernel
from parsolid.pairs.box_weights import REACH, AxisTables


class Box(NamedTuple):
    """This rank's part of a box as kernels take it; memory axes 0, 1 (and 2 in space), the slowest first.

    first: row of its first node in the fields; start: place of its first node in box arrays; planes, nodes: how many
    planes its box arrays have and how many nodes a plane, with ghosts; row: nodes along the fastest axis of space, 1 in
    the plane; first_plane, last_plane, first_node, last_node: own planes and nodes of a plane, the last ones excluded.
    axes: the axis in space of each memory axis. far_nodes, far_offsets: own nodes of a plane with a neighbour three
    steps off along the axes within planes, and whether it is the one below (0) or above (6). Tables as in
    `box_weights.AxisTables`, those of axis 0 by plane, the others by node of a plane: gradient, divergence (2, 7, n),
    jump (2, 2, n), half_step (n,). length (planes,) [m], area (nodes,) [m^2]: their product is the volume of a node.
    """

    first: int
    start: int
    planes: int
    nodes: int
    row: int
    first_plane: int
    last_plane: int
    first_node: int
    last_node: int
    axes: tuple[int, ...]
    far_nodes: tuple[np.ndarray, ...]
    far_offsets: tuple[np.ndarray, ...]
    gradient: tuple[np.ndarray, ...]
    divergence: tuple[np.ndarray, ...]
    jump: tuple[np.ndarray, ...]
    half_step: tuple[np.ndarray, ...]
    length: np.ndarray
    area: np.ndarray


@kernel
def add_scaled(out, weight, f):
    for p in range(out.size):
        out[p] += weight * f[p]


@kernel
def add_weighted(out, weight, f):
    for p in range(out.size):
        out[p] += weight[p] * f[p]


@kernel
def fill(out, value):
    for p in range(out.size):
        out[p] = value


@kernel
def copy(out, f):
    for p in range(out.size):
        out[p] = f[p]


@inlined
def in_plane(f, c, box, i, first, last):
    """Component c of a box array at nodes first .. last - 1 of plane i."""
    place = box.start + i * box.nodes
    return f[c, place + first : place + last]


@kernel
def add_scaled_five(out, weights, f, place, stride):
    """out (n,) += sum of weights[k] f[place + (k - 3) stride + p] over k = 1 .. 5."""
    n = out.size
    w1, w2, w3, w4, w5 = weights[1], weights[2], weights[3], weights[4], weights[5]
    a, b = f[place - 2 * stride : place - 2 * stride + n], f[place - stride : place - stride + n]
    c = f[place : place + n]
    d, e = f[place + stride : place + stride + n], f[place + 2 * stride : place + 2 * stride + n]
    for p in range(n):
        sum_ = out[p] + w1 * a[p]
        sum_ += w2 * b[p]
        sum_ += w3 * c[p]
        sum_ += w4 * d[p]
        out[p] = sum_ + w5 * e[p]


@kernel
def add_weighted_five(out, weights, first, f, place, stride):
    """out (n,) += sum of weights[k, first + p] f[place + (k - 3) stride + p] over k = 1 .. 5."""
    n = out.size
    w1, w2, w3 = weights[1, first : first + n], weights[2, first : first + n], weights[3, first : first + n]
    w4, w5 = weights[4, first : first + n], weights[5, first : first + n]
    a, b = f[place - 2 * stride : place - 2 * stride + n], f[place - stride : place - stride + n]
    c = f[place : place + n]
    d, e = f[place + stride : place + stride + n], f[place + 2 * stride : place + 2 * stride + n]
    for p in range(n):
        sum_ = out[p] + w1[p] * a[p]
        sum_ += w2[p] * b[p]
        sum_ += w3[p] * c[p]
        sum_ += w4[p] * d[p]
        out[p] = sum_ + w5[p] * e[p]


@kernel
def add_far(out, weights, nodes, offsets, f, place, stride):
    """Add to out what its nodes have of the neighbours three steps off."""
    for q in range(nodes.size):
        k, p = offsets[q], nodes[q]
        out[p] += weights[k, p] * f[place + p + (k - REACH) * stride]


@kernel
def add_differences(box, tables, c, i, f, components, outs):
    """Add to outs[k], rows of the nodes of plane i, the sums along memory axis k of component components[k] of f, which
    is of the direction c. Sums have the same order whatever the range of nodes is, so that they have the same bits."""
    first, last, nodes = box.first_node, box.last_node, box.nodes
    place, end = box.start + i * nodes, f.shape[1]
    for axis in range(len(box.axes)):
        weights = tables[axis][int(box.axes[axis] == c)]
        row, out = f[components[axis]], outs[axis]
        stride = nodes if axis == 0 else box.row if axis == 1 else 1
        # neighbours of the last node of a row are in the next one, where weights are 0; not beyond the whole array
        if place + first - 2 * stride >= 0 and place + last + 2 * stride <= end:
            if axis == 0:
                add_scaled_five(out[first:last], weights[:, i], row, place + first, stride)
            else:
                add_weighted_five(out[first:last], weights, first, row, place + first, stride)
        else:
            for k in range(1, 2 * REACH):
                shift = (k - REACH) * stride
                p, q = max(first, -place - shift), min(last, end - place - shift)
                if p < q and axis == 0:
                    add_scaled(out[p:q], weights[k, i], row[place + shift + p : place + shift + q])
                elif p < q:
                    add_weighted(out[p:q], weights[k, p:q], row[place + shift + p : place + shift + q])
        for k in (0, 2 * REACH):
            shift = (k - REACH) * stride
            if axis == 0 and weights[k, i] != 0.0:
                add_scaled(out[first:last], weights[k, i], row[place + shift + first : place + shift + last])
        if axis > 0:
            add_far(out, weights, box.far_nodes[axis], box.far_offsets[axis], row, place, stride)


@kernel
def gradient_in_plane(box, i, v, G):
    """G of the own nodes of plane i."""
    d = v.shape[0]
    for c in range(d):
        for k in range(d):
            fill(in_plane(G, d * c + k, box, i, box.first_node, box.last_node), 0.0)
        if d == 3:
            x = in_plane(G, 3 * c + box.axes[0], box, i, 0, box.nodes)
            y = in_plane(G, 3 * c + box.axes[1], box, i, 0, box.nodes)
            z = in_plane(G, 3 * c + box.axes[-1], box, i, 0, box.nodes)
            add_differences(box, box.gradient, c, i, v, (c, c, c), (x, y, z))
        else:
            x = in_plane(G, 2 * c + box.axes[0], box, i, 0, box.nodes)
            y = in_plane(G, 2 * c + box.axes[1], box, i, 0, box.nodes)
            add_differences(box, box.gradient, c, i, v, (c, c, c), (x, y, y))


@kernel
def gradient_pass(box, v, G):
    """Velocity gradient G of a box."""
    for i in range(box.first_plane, box.last_plane):
        gradient_in_plane(box, i, v, G)


@kernel
def flux_in_space(half_step, v, v_b, x, x_b, G, G_b, Z, Z_b, directional, flux):
    """Riemann flux [Pa] of nodes and their neighbours b, rows (n,).

    Z: half impedances of pressure and of shear waves; where directional is not None halves of the density times their
    moduli along the axis, of which impedances are roots.
    """
    for p in range(flux[0].size):
        h = half_step[p]
        u0 = v_b[0][p] - v[0][p] - h * (G[0][p] + G_b[0][p])
        u1 = v_b[1][p] - v[1][p] - h * (G[1][p] + G_b[1][p])
        u2 = v_b[2][p] - v[2][p] - h * (G[2][p] + G_b[2][p])
        x0, x1, x2 = x_b[0][p] - x[0][p], x_b[1][p] - x[1][p], x_b[2][p] - x[2][p]
        pressure, shear = Z[0][p] + Z_b[0][p], Z[1][p] + Z_b[1][p]
        if directional is not None:
            pressure, shear = pressure**0.5, shear**0.5
        along = (pressure - shear) * (u0 * x0 + u1 * x1 + u2 * x2) / (x0 * x0 + x1 * x1 + x2 * x2)
        flux[0][p], flux[1][p], flux[2][p] = shear * u0 + along * x0, shear * u1 + along * x1, shear * u2 + along * x2


@kernel
def flux_in_strain_plane(half_step, v, v_b, x, x_b, G, G_b, Z, Z_b, directional, flux):
    """`flux_in_space` in plane strain."""
    for p in range(flux[0].size):
        h = half_step[p]
        u0 = v_b[0][p] - v[0][p] - h * (G[0][p] + G_b[0][p])
        u1 = v_b[1][p] - v[1][p] - h * (G[1][p] + G_b[1][p])
        x0, x1 = x_b[0][p] - x[0][p], x_b[1][p] - x[1][p]
        pressure, shear = Z[0][p] + Z_b[0][p], Z[1][p] + Z_b[1][p]
        if directional is not None:
            pressure, shear = pressure**0.5, shear**0.5
        along = (pressure - shear) * (u0 * x0 + u1 * x1) / (x0 * x0 + x1 * x1)
        flux[0][p], flux[1][p] = shear * u0 + along * x0, shear * u1 + along * x1


@kernel
def fluxes(box, axis, i, j, first, last, shift, half_step, v, x, G, Z, directional, flux, begin):
    """Fluxes between nodes first .. last - 1 of plane i and those `shift` behind them in plane j, their neighbours
    above along a memory axis, into the rows of flux (d, ..) from `begin` on."""
    d, k, end = v.shape[0], box.axes[axis], begin + last - first
    a, b, A, B = first, last, first + shift, last + shift
    pressure, shear = 0, 1
    if directional is not None:
        pressure, shear = k, d + k
    here = in_plane(Z, pressure, box, i, a, b), in_plane(Z, shear, box, i, a, b)
    there = in_plane(Z, pressure, box, j, A, B), in_plane(Z, shear, box, j, A, B)
    if d == 3:
        flux_in_space(
            half_step[a:b],
            (in_plane(v, 0, box, i, a, b), in_plane(v, 1, box, i, a, b), in_plane(v, 2, box, i, a, b)),
            (in_plane(v, 0, box, j, A, B), in_plane(v, 1, box, j, A, B), in_plane(v, 2, box, j, A, B)),
            (in_plane(x, 0, box, i, a, b), in_plane(x, 1, box, i, a, b), in_plane(x, 2, box, i, a, b)),
            (in_plane(x, 0, box, j, A, B), in_plane(x, 1, box, j, A, B), in_plane(x, 2, box, j, A, B)),
            (in_plane(G, k, box, i, a, b), in_plane(G, 3 + k, box, i, a, b), in_plane(G, 6 + k, box, i, a, b)),
            (in_plane(G, k, box, j, A, B), in_plane(G, 3 + k, box, j, A, B), in_plane(G, 6 + k, box, j, A, B)),
            here, there, directional, (flux[0, begin:end], flux[1, begin:end], flux[2, begin:end]),
        )  # fmt: skip
    else:
        flux_in_strain_plane(
            half_step[a:b],
            (in_plane(v, 0, box, i, a, b), in_plane(v, 1, box, i, a, b)),
            (in_plane(v, 0, box, j, A, B), in_plane(v, 1, box, j, A, B)),
            (in_plane(x, 0, box, i, a, b), in_plane(x, 1, box, i, a, b)),
            (in_plane(x, 0, box, j, A, B), in_plane(x, 1, box, j, A, B)),
            (in_plane(G, k, box, i, a, b), in_plane(G, 2 + k, box, i, a, b)),
            (in_plane(G, k, box, j, A, B), in_plane(G, 2 + k, box, j, A, B)),
            here, there, directional, (flux[0, begin:end], flux[1, begin:end]),
        )  # fmt: skip


@kernel
def add_fluxes(out, jump, first, above, below):
    """out (n,) += jump[0, first + p] above[p] + jump[1, first + p] below[p]."""
    n = out.size
    to_above, from_below = jump[0, first : first + n], jump[1, first : first + n]
    for p in range(n):
        out[p] += to_above[p] * above[p] + from_below[p] * below[p]


@kernel
def add_plane_fluxes(out, jump, above, below):
    """out (n,) = jump[0] above + jump[1] below."""
    to_above, from_below = jump[0], jump[1]
    for p in range(out.size):
        out[p] = to_above * above[p] + from_below * below[p]


@kernel
def scale_to_volume(out, length, area, f):
    """out (n,) = length area f."""
    for p in range(out.size):
        out[p] = length * area[p] * f[p]


@kernel
def divergence_pass(box, P, v, x, G, Z, directional, force, dissipation):
    """Forces V Div P and V D [N] of the own nodes of a box, into the fields force and dissipation (d, n).

    Z: None without dissipation; directional: see `flux_in_space`. Every node gathers the fluxes of its own pairs, so
    that no result depends on where a box is cut.
    """
    d, nodes, first, last = v.shape[0], box.nodes, box.first_node, box.last_node
    row, n, area = box.first, last - first, box.area[first:last]
    sum_, below, above, half_step = np.zeros((d, nodes)), np.zeros((d, n)), np.zeros((d, n)), np.zeros(nodes)
    # of pairs of a node with the one before it (flux[:, p]) and the one behind (flux[:, p + shift]) along axes 1 and 2
    along_rows, in_rows = np.zeros((d, n + box.row)), np.zeros((d, n + 1))
    if Z is not None and box.first_plane > 0:
        i = box.first_plane - 1
        fill(half_step, box.half_step[0][i])
        fluxes(box, 0, i, i + 1, first, last, 0, half_step, v, x, G, Z, directional, above, 0)
    for i in range(box.first_plane, box.last_plane):
        for c in range(d):
            stress = sum_[c]
            fill(stress, 0.0)
            columns = (d * c + box.axes[0], d * c + box.axes[1], d * c + box.axes[-1])
            add_differences(box, box.divergence, c, i, P, columns, (stress, stress, stress))
            scale_to_volume(force[c, row : row + n], box.length[i], area, stress[first:last])
        if Z is not None:
            below, above = above, below
            if i + 1 < box.planes:
                fill(half_step, box.half_step[0][i])
                fluxes(box, 0, i, i + 1, first, last, 0, half_step, v, x, G, Z, directional, above, 0)
            for axis in range(1, len(box.axes)):
                shift, flux = (box.row, along_rows) if axis == 1 else (1, in_rows)
                # pairs with an own node
                p, q = max(0, first - shift), min(nodes, last + shift) - shift
                begin = p - (first - shift)
                fluxes(box, axis, i, i, p, q, shift, box.half_step[axis], v, x, G, Z, directional, flux, begin)
            for c in range(d):
                upwind = sum_[c, :n]
                jump = box.jump[0][int(box.axes[0] == c), :, i]
                add_plane_fluxes(upwind, jump, above[c], below[c])
                jump = box.jump[1][int(box.axes[1] == c)]
                add_fluxes(upwind, jump, first, along_rows[c, box.row :], along_rows[c, :n])
                if len(box.axes) > 2:
                    add_fluxes(upwind, box.jump[-1][int(box.axes[-1] == c)], first, in_rows[c, 1:], in_rows[c, :n])
                scale_to_volume(dissipation[c, row : row + n], box.length[i], area, upwind)
        row += n


@kernel
def copy_to_box(box, field, array):
    """Copy the own nodes of a field (c, n) into a box array (c, places)."""
    row, width = box.first, box.last_node - box.first_node
    for i in range(box.first_plane, box.last_plane):
        for c in range(field.shape[0]):
            copy(in_plane(array, c, box, i, box.first_node, box.last_node), field[c, row : row + width])
        row += width


@kernel
def copy_from_box(box, array, field):
    """The way back of `copy_to_box`."""
    row, width = box.first, box.last_node - box.first_node
    for i in range(box.first_plane, box.last_plane):
        for c in range(field.shape[0]):
            copy(field[c, row : row + width], in_plane(array, c, box, i, box.first_node, box.last_node))
        row += width


# --- the boxes of a rank ------------------------------------------------------------------------------------------


class BoxOnRank(NamedTuple):
    """What a rank knows of a box of the scene: the rank's parts (ranks, 2, d) by `decomposition.boxes.cut_boxes`, the
    tables of the axes in space, and the row of its first node here in the fields of the particles."""

    nodes: BoxOfNodes
    parts: np.ndarray
    tables: Sequence[AxisTables]
    first: int


class BoxSweeps:
    """Sweeps over all boxes of this rank, with the arrays and messages that they need.

    boxes: `Box` of each box of the scene, None where this rank has no part of it. v, x, G, P, Z: box arrays; without
    ghosts on this rank v and x are the fields of the particles themselves, else copies with ghosts (a copy of both
    takes 2 to 3 % of a step, ghosts within fields would make the particles of a rank no contiguous range).
    """

    def __init__(self, comm: Any, boxes: Sequence[BoxOnRank], dimension: int, directional: bool, upwind: bool) -> None:
        """directional: whether impedances depend on the axis, see `flux_in_space`; upwind: whether anything dissipates.
        Exchanges are made, so that all ranks make their sweeps together."""
        d, self.directional = dimension, True if directional else None
        bounds = [with_ghosts(one.parts, comm.rank, one.nodes.shape) for one in boxes]
        own = [one.parts[comm.rank] for one in boxes]
        self.has_ghosts = any(not np.array_equal(one, whole) for one, whole in zip(own, bounds))
        self.boxes: list[Box | None] = []
        places = 0
        for one, part, bound in zip(boxes, own, bounds):
            empty = bool(np.any(part[0] >= part[1]))
            start = places if self.has_ghosts else one.first
            self.boxes.append(None if empty else _box_of(one, part, bound, start))
            places += 0 if empty else int(np.prod(bound[1] - bound[0]))
        self.places = max([0, *(box.start + box.planes * box.nodes for box in self.boxes if box is not None)])
        self.G, self.P = np.zeros((2, d * d, self.places))
        self.Z = np.zeros((2 * d if directional else 2, self.places)) if upwind else None
        self.v, self.x = np.zeros((2, d, self.places if self.has_ghosts else 0))
        self._motion, self._stress = self._exchanges(comm, boxes, d)

    def _exchanges(self, comm: Any, boxes: Sequence[BoxOnRank], d: int) -> tuple[GhostExchange, GhostExchange]:
        """Of v two and x one plane deep; of the columns of P along the axis two deep, of those of G and of Z one."""
        motion, stress = [], []
        for one, box in zip(boxes, self.boxes):
            for link in links_of(one.parts, comm.rank, one.nodes.shape):
                of_axis = slice(one.nodes.axes[link.axis], None, d)
                motion.append(_transfer(box, link, self.v, slice(None), 2))
                stress.append(_transfer(box, link, self.P, of_axis, 2))
                if self.Z is not None:
                    motion.append(_transfer(box, link, self.x, slice(None), 1))
                    stress.append(_transfer(box, link, self.G, of_axis, 1))
                    stress.append(_transfer(box, link, self.Z, of_axis if self.directional else slice(None), 1))
        return GhostExchange(comm, motion), GhostExchange(comm, stress)

    def exchange_motion(self, velocity: np.ndarray, position: np.ndarray) -> None:
        """Take v and x of the fields (d, n) of the particles, and of the ghosts; collective."""
        if not self.has_ghosts:
            self.v, self.x = velocity, position
            return
        for box in self.here:
            copy_to_box(box, velocity, self.v)
            copy_to_box(box, position, self.x)
        self._motion.start()
        self._motion.finish()

    def exchange_stress(self) -> None:
        """Take P, G and Z of the ghosts; collective."""
        self._stress.start()
        self._stress.finish()

    @property
    def here(self) -> list[Box]:
        """Parts on this rank."""
        return [box for box in self.boxes if box is not None]

    def gradient(self) -> np.ndarray:
        """Fill G with the gradients of v, for what is not fused with an update of the particles."""
        for box in self.here:
            gradient_pass(box, self.v, self.G)
        return self.G

    def divergence(self, force: np.ndarray, dissipation: np.ndarray) -> None:
        """Put the forces of the stresses and of the dissipation [N] into fields (d, n) of the particles."""
        for box in self.here:
            divergence_pass(box, self.P, self.v, self.x, self.G, self.Z, self.directional, force, dissipation)

    @property
    def bytes_sent(self) -> int:
        """Of both messages of an evaluation."""
        return self._motion.bytes_sent + self._stress.bytes_sent

    def arrays(self) -> list[np.ndarray]:
        """Box arrays, for what counts memory."""
        return [self.G, self.P, *([] if self.Z is None else [self.Z]), *([self.v, self.x] if self.has_ghosts else [])]


def _transfer(box: Any, link: Link, array: np.ndarray, rows: slice, depth: int) -> Transfer:
    """Some rows of a box array beside a cut, so many planes deep."""
    planes = array[rows, box.start : box.start + box.planes * box.nodes]
    planes = planes.reshape(len(planes), box.planes, box.nodes)
    inside, outside = ((slice(None), *there[depth]) for there in (link.inside, link.outside))
    return Transfer(link.rank, planes[inside], planes[outside])


def _box_of(one: BoxOnRank, part: np.ndarray, bound: np.ndarray, start: int) -> Box:
    """part, bound (2, d): first nodes and those after the last, without and with ghosts."""
    axes, (first, last), (low, high) = one.nodes.axes, part - bound[0], bound
    count = high - low
    row = int(count[2]) if len(axes) > 2 else 1
    spans = [slice(a, b) for a, b in zip(low, high)]

    def by_node(name: str) -> tuple[np.ndarray, ...]:
        """Tables of axis 0 by plane, of the others by node of a plane."""
        tables = [getattr(one.tables[axis], name)[..., span] for axis, span in zip(axes, spans)]
        tables[1] = np.repeat(tables[1], row, axis=-1)
        if len(axes) > 2:
            tables[2] = np.tile(tables[2], int(count[1]))
        return tuple(np.ascontiguousarray(table) for table in tables)

    length, *across = by_node("length")
    gradient, far = by_node("gradient"), []
    for axis in range(len(axes)):
        offset, node = np.nonzero(gradient[axis][:, :: 2 * REACH].any(axis=0)) if axis else np.zeros((2, 0), np.int64)
        own = (node >= first[1] * row) & (node < last[1] * row)
        far.append((node[own], 2 * REACH * offset[own]))
    return Box(
        first=one.first,
        start=start,
        planes=int(count[0]),
        nodes=int(count[1]) * row,
        row=row,
        first_plane=int(first[0]),
        last_plane=int(last[0]),
        first_node=int(first[1]) * row,
        last_node=int(last[1]) * row,
        axes=axes,
        far_nodes=tuple(node for node, _ in far),
        far_offsets=tuple(offset for _, offset in far),
        gradient=gradient,
        divergence=by_node("divergence"),
        jump=by_node("jump"),
        half_step=by_node("half_step"),
        length=length,
        area=np.prod(across, axis=0),
    )
