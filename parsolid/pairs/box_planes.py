"""One plane of a box at a time: velocity gradients, and forces of stresses and of dissipation, as sums along the axes.

A rank has a part of a box (`decomposition.boxes`): planes of nodes across the slowest axis in memory, in which the
nodes follow one another in rows along the fastest; in two dimensions a plane is one row. Two planes, and two rows (in
two dimensions two nodes) in every plane, beyond each side where other ranks go on hold their nodes as ghosts.

Inner loops run over many nodes of a plane, which LLVM vectorises, and weights stay in the first-level cache with what
they weigh: of all nodes of a plane, or of equal rows in it, the weights of the neighbours in other planes or rows are
the same seven numbers; those along rows are a table of a few rows. Loops index arrays by unsigned numbers: numba asks
of every signed index whether it counts from the end. numba counts references of arrays where there are slices, and
around whatever may raise, which would take longer than a loop: loops over nodes are in inlined functions, and no range
has a step that is no constant.

Arrays have one row a component: component d c + J of a tensor A in d dimensions is A_cJ. Velocity v [m/s] and position
x [m] have all planes. Velocity gradient G [1/s], first Piola-Kirchhoff stress P [Pa] and half impedances Z [Pa s/m]
have a window of so many planes as the forces of one plane need, which the planes take in turn: a step goes from plane
to plane, and the windows stay in the cache. Planes beside those of other ranks have places of their own: their forces
wait for messages.

The dissipation is that of the acoustic Riemann problem between nearest neighbours along the axes (Lee et al., eqs (74),
(75)): with the jump u of the velocities, less what both gradients explain of it, and n along x_b - x_a the flux from b
to a is Z_s u + (Z_p - Z_s) (u . n) n [Pa], times `riemann.dissipation_limiter`.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel
from parsolid.pairs.box_weights import REACH
from parsolid.pairs.riemann import dissipation_limiter, riemann_factors

# planes that the stresses of one plane's forces reach, and its fluxes
STRESS_WINDOW, PAIR_WINDOW = 2 * REACH + 1, 2


class Window(NamedTuple):
    """Places of the planes of a box in an array (c, places).

    Planes before `low` and from `high` to `planes` have places of their own, one plane after the other from `kept` on;
    those in between take turns in `ring` planes from place 0 on.
    """

    kept: int
    planes: int
    nodes: int
    low: int
    high: int
    ring: int = 1

    @property
    def end(self) -> int:
        """Place after the last kept one."""
        return self.kept + (self.low + self.planes - self.high) * self.nodes


class Box(NamedTuple):
    """This rank's part of a box as kernels take it; memory axes 0, 1 (and 2 in space), the slowest first.

    first: row of its first node in the fields; planes, nodes, row: how many planes the box has, how many nodes a plane
    and a row, with ghosts; motion: places in v and x; stresses: in P; pairs: in G and Z; first_plane, last_plane,
    first_node, last_node: own planes and nodes of a plane, the last ones excluded; axes: the axis in space of each
    memory axis.

    gradient, divergence: weights (2, 7, n) as in `box_weights.AxisTables`, of all memory axes one behind the other: by
    plane, by row (in space), and by node of a row, these repeated over `period` nodes of whole rows; runs (k, 2): first
    and last row, that excluded, of own rows with equal weights. jump (2, 2, n), half_step (n,): by plane, and for the
    other axes by node of a plane. length (planes,) [m], area (nodes,) [m^2]: their product is the volume of a node.
    full_jump: as in `riemann.dissipation_limiter`.
    """

    first: int
    planes: int
    nodes: int
    row: int
    motion: Window
    stresses: Window
    pairs: Window
    first_plane: int
    last_plane: int
    first_node: int
    last_node: int
    axes: tuple[int, ...]
    gradient: np.ndarray
    divergence: np.ndarray
    period: int
    runs: np.ndarray
    jump: np.ndarray
    half_step: np.ndarray
    length: np.ndarray
    area: np.ndarray
    full_jump: float


class PlaneScratch(NamedTuple):
    """Scratch arrays of the present plane.

    values: a component of v or P, with REACH zeros before and after it. Fluxes of pairs along axis 0 with the next
    plane across[(i + 1) % 2] and the one before across[i % 2] (2 d, n), between rows of a node with the one a row
    before it between_rows[:, p] and behind between_rows[:, p + row], and within them in_rows, with a row of one. The
    last rows (two of across) are what the fluxes take.
    half_step: that of axis 0 for all nodes.
    """

    values: np.ndarray
    across: np.ndarray
    between_rows: np.ndarray
    in_rows: np.ndarray
    half_step: np.ndarray


def plane_scratch(box: Box, d: int) -> PlaneScratch:
    """`PlaneScratch` of a box."""
    n = box.last_node - box.first_node
    return PlaneScratch(
        aligned_zeros(box.nodes + 2 * REACH),
        aligned_zeros((2 * d + 2, n)),
        aligned_zeros((d + 1, n + box.row)),
        aligned_zeros((d + 1, n + 1)),
        aligned_zeros(box.nodes),
    )


def unnamed(it: Any) -> Any:
    """A tuple, and those in it, without names: a call of a kernel takes .6 us more for each that has some."""
    return tuple(map(unnamed, it)) if isinstance(it, tuple) else it


@inlined
def box_in(it):
    """The `Box` that `unnamed` was given."""
    windows = (Window(*it[4]), Window(*it[5]), Window(*it[6]))
    return Box(*(it[:4] + windows + it[7:]))


@inlined
def place_of(window, i):
    """Place of the first node of plane i."""
    slot = i if i < window.low else window.low + i - window.high
    kept = i < window.low or i >= window.high
    return window.kept + slot * window.nodes if kept else i % window.ring * window.nodes


# --- differences --------------------------------------------------------------------------------------------------


@inlined
def around(i, last):
    """The seven planes around plane i: for those before plane 0 and behind the last one, whose weights are 0, another
    one."""
    return (max(i - 3, 0), max(i - 2, 0), max(i - 1, 0), i, min(i + 1, last), min(i + 2, last), min(i + 3, last))


@inlined
def places_of(window, i, last, node):
    """Places of a node in the seven planes around plane i."""
    a = around(i, last)
    return (
        np.uintp(place_of(window, a[0]) + node), np.uintp(place_of(window, a[1]) + node),
        np.uintp(place_of(window, a[2]) + node), np.uintp(place_of(window, a[3]) + node),
        np.uintp(place_of(window, a[4]) + node), np.uintp(place_of(window, a[5]) + node),
        np.uintp(place_of(window, a[6]) + node),
    )  # fmt: skip


@inlined
def weigh(n, f, c, places, weights, k, i, out, component, place, add):
    """Sum of component c of f at n nodes from seven places on, by the weights (2, 7, ..)[k, :, i], into a row of out
    from `place` on, or added to it."""
    w0, w1, w2, w3 = weights[k, 0, i], weights[k, 1, i], weights[k, 2, i], weights[k, 3, i]
    w4, w5, w6 = weights[k, 4, i], weights[k, 5, i], weights[k, 6, i]
    p0, p1, p2, p3, p4, p5, p6 = places
    to = np.uintp(place)
    if w0 == 0.0 and w6 == 0.0:
        for p in range(np.uintp(n)):
            total = w1 * f[c, p1 + p] + w2 * f[c, p2 + p] + w3 * f[c, p3 + p]
            total = total + w4 * f[c, p4 + p] + w5 * f[c, p5 + p]
            out[component, to + p] = out[component, to + p] + total if add else total
    else:
        for p in range(np.uintp(n)):
            total = w0 * f[c, p0 + p] + w1 * f[c, p1 + p] + w2 * f[c, p2 + p] + w3 * f[c, p3 + p]
            total = total + w4 * f[c, p4 + p] + w5 * f[c, p5 + p] + w6 * f[c, p6 + p]
            out[component, to + p] = out[component, to + p] + total if add else total


@inlined
def weigh_rows(runs, rows, row, plane, f, c, weights, k, first_table, out, component, place, add):
    """As `weigh`, of the own nodes of a plane, whose first node is at place `plane` in f, with neighbours in other rows
    of it. runs, rows, row: as in `Box`; first_table: of row 0 in weights; place: in out of the plane's first node."""
    for r in range(runs.shape[0]):
        first, last = runs[r, 0], runs[r, 1]
        a = around(first, rows - (last - first))
        places = (
            np.uintp(plane + a[0] * row), np.uintp(plane + a[1] * row), np.uintp(plane + a[2] * row),
            np.uintp(plane + a[3] * row), np.uintp(plane + a[4] * row), np.uintp(plane + a[5] * row),
            np.uintp(plane + a[6] * row),
        )  # fmt: skip
        n, table, to = (last - first) * row, first_table + first, place + first * row
        weigh(n, f, c, places, weights, k, table, out, component, to, add)


@inlined
def load_values(f, c, place, n, values):
    """Component c of f in a plane into `values`, with zeros around it, so that neighbours are never outside."""
    start, margin = np.uintp(place), np.uintp(REACH)
    for p in range(np.uintp(n)):
        values[margin + p] = f[c, start + p]


@inlined
def weigh_in_row(n, values, node, weights, k, q, out, component, place, area, length):
    """Differences of `values` of a plane along its rows at n nodes from `node` on, by the weights (2, 7, ..)[k] from q
    on, into a row of out from place on; where area is not None added to what is there, and all times the volumes of the
    nodes.

    Weights are 0 where a neighbour would be in another row.
    """
    first, to, q = np.uintp(node), np.uintp(place), np.uintp(q)
    p1, p2, p3 = np.uintp(node + 1), np.uintp(node + 2), np.uintp(node + REACH)
    p4, p5, p6 = np.uintp(node + 4), np.uintp(node + 5), np.uintp(node + 6)
    for p in range(np.uintp(n)):
        total = weights[k, 0, q + p] * values[first + p] + weights[k, 1, q + p] * values[p1 + p]
        total = total + weights[k, 2, q + p] * values[p2 + p] + weights[k, 3, q + p] * values[p3 + p]
        total = total + weights[k, 4, q + p] * values[p4 + p] + weights[k, 5, q + p] * values[p5 + p]
        total = total + weights[k, 6, q + p] * values[p6 + p]
        if area is not None:
            total = length * area[first + p] * (out[component, to + p] + total)
        out[component, to + p] = total


@inlined
def weights_along(box, axis):
    """Index in tables at which weights along a memory axis begin; along rows, that of the first own node."""
    rows = box.nodes // box.row if len(box.axes) == 3 else 0
    return (0, box.planes)[axis] if axis < len(box.axes) - 1 else box.planes + rows + box.first_node % box.row


@kernel
def gradient_in_plane(box, i, v, values, G, place):
    """G of the own nodes of plane i, into places from `place` on."""
    d, axes, first, last = len(box.axes), box.axes, box.first_node, box.last_node
    weights, runs, rows, row, period = box.gradient, box.runs, box.nodes // box.row, box.row, box.period
    plane, places = place_of(box.motion, i), places_of(box.motion, i, box.planes - 1, first)
    fast, in_rows = axes[d - 1], weights_along(box, d - 1)
    for c in range(d):
        weigh(last - first, v, c, places, weights, int(axes[0] == c), i, G, d * c + axes[0], place, False)
        if d == 3:
            k, column = int(axes[1] == c), d * c + axes[1]
            weigh_rows(runs, rows, row, plane, v, c, weights, k, box.planes, G, column, place - first, False)
        load_values(v, c, plane, box.nodes, values)
        for part in range((last - first + period - 1) // period):
            node = first + part * period
            n, to = min(period, last - node), place + node - first
            weigh_in_row(n, values, node, weights, int(fast == c), in_rows, G, d * c + fast, to, None, 1.0)


@kernel
def gradient_pass(box, scratch, v, G):
    """Velocity gradient G of all planes of a box."""
    for i in range(box.first_plane, box.last_plane):
        gradient_in_plane(box, i, v, scratch.values, G, place_of(box.motion, i) + box.first_node)


# --- fluxes -------------------------------------------------------------------------------------------------------


@inlined
def flux_in_space(n, half_step, node, v, x, a, b, G, k, Z, A, B, full_jump, flux, component, begin, power, heat):
    """Riemann flux [Pa] of n nodes and their neighbours above along axis k of space, into three rows of flux; and what
    it takes [Pa m/s], times the velocity of the neighbour to the node, into row `power`, unless heat is None.

    a, b: places of the first node and its neighbour in v and x; A, B: in G and Z; half_step from `node` on;
    full_jump: see `dissipation_limiter`.
    """
    a, b, A, B, node, begin = np.uintp(a), np.uintp(b), np.uintp(A), np.uintp(B), np.uintp(node), np.uintp(begin)
    for p in range(np.uintp(n)):
        i, j, i_Z, j_Z, h, to = a + p, b + p, A + p, B + p, half_step[node + p], begin + p
        w0, w1, w2 = v[0, j] - v[0, i], v[1, j] - v[1, i], v[2, j] - v[2, i]
        u0, u1, u2 = (
            w0 - h * (G[k, i_Z] + G[k, j_Z]),
            w1 - h * (G[3 + k, i_Z] + G[3 + k, j_Z]),
            w2 - h * (G[6 + k, i_Z] + G[6 + k, j_Z]),
        )
        limiter = dissipation_limiter(u0 * u0 + u1 * u1 + u2 * u2, w0 * w0 + w1 * w1 + w2 * w2, full_jump)
        r0, r1, r2 = x[0, j] - x[0, i], x[1, j] - x[1, i], x[2, j] - x[2, i]
        Z_p, Z_s = Z[0, i_Z] + Z[0, j_Z], Z[1, i_Z] + Z[1, j_Z]
        u_r, r_r = u0 * r0 + u1 * r1 + u2 * r2, r0 * r0 + r1 * r1 + r2 * r2
        s, along = riemann_factors(limiter * Z_p, limiter * Z_s, u_r, r_r)
        f0, f1, f2 = s * u0 + along * r0, s * u1 + along * r1, s * u2 + along * r2
        flux[component, to], flux[component + 1, to], flux[component + 2, to] = f0, f1, f2
        if heat is not None:
            flux[power, to] = f0 * w0 + f1 * w1 + f2 * w2


@inlined
def flux_in_strain_plane(n, half_step, node, v, x, a, b, G, k, Z, A, B, full_jump, flux, component, begin, power, heat):
    """`flux_in_space` in plane strain."""
    a, b, A, B, node, begin = np.uintp(a), np.uintp(b), np.uintp(A), np.uintp(B), np.uintp(node), np.uintp(begin)
    for p in range(np.uintp(n)):
        i, j, i_Z, j_Z, h, to = a + p, b + p, A + p, B + p, half_step[node + p], begin + p
        w0, w1 = v[0, j] - v[0, i], v[1, j] - v[1, i]
        u0, u1 = w0 - h * (G[k, i_Z] + G[k, j_Z]), w1 - h * (G[2 + k, i_Z] + G[2 + k, j_Z])
        limiter = dissipation_limiter(u0 * u0 + u1 * u1, w0 * w0 + w1 * w1, full_jump)
        r0, r1 = x[0, j] - x[0, i], x[1, j] - x[1, i]
        Z_p, Z_s = Z[0, i_Z] + Z[0, j_Z], Z[1, i_Z] + Z[1, j_Z]
        s, along = riemann_factors(limiter * Z_p, limiter * Z_s, u0 * r0 + u1 * r1, r0 * r0 + r1 * r1)
        f0, f1 = s * u0 + along * r0, s * u1 + along * r1
        flux[component, to], flux[component + 1, to] = f0, f1
        if heat is not None:
            flux[power, to] = f0 * w0 + f1 * w1


@inlined
def fluxes(box, axis, i, j, node, n, shift, half_step, first, v, x, G, Z, flux, component, begin, power, heat):
    """Fluxes between n nodes of plane i from `node` on and those `shift` behind them in plane j, their neighbours above
    along a memory axis, into rows of flux (.., n or more) from component and place `begin` on; half_step: of these
    nodes from `first` on; power, heat: see `flux_in_space`."""
    d, k = len(box.axes), box.axes[axis]
    a, b = place_of(box.motion, i) + node, place_of(box.motion, j) + node + shift
    A, B = place_of(box.pairs, i) + node, place_of(box.pairs, j) + node + shift
    if d == 3:
        flux_in_space(
            n, half_step, first, v, x, a, b, G, k, Z, A, B, box.full_jump, flux, component, begin, power, heat
        )
    else:
        flux_in_strain_plane(
            n, half_step, first, v, x, a, b, G, k, Z, A, B, box.full_jump, flux, component, begin, power, heat
        )


@inlined
def fluxes_across(box, scratch, i, v, x, G, Z, heat):
    """Fluxes between planes i and i + 1."""
    d, n, h, half_step = len(box.axes), box.last_node - box.first_node, box.half_step[i], scratch.half_step
    for p in range(half_step.size):
        half_step[p] = h
    turn = (i + 1) % 2
    fluxes(box, 0, i, i + 1, box.first_node, n, 0, half_step, 0, v, x, G, Z, scratch.across, turn * d, 0,
           2 * d + turn, heat)  # fmt: skip


@inlined
def gather(box, scratch, i, c, out, row):
    """V D [N] of the own nodes of plane i in direction c: what they get of the fluxes of their pairs, times their
    volumes, into row c of out from place `row` on."""
    d, axes, first, jump, area, length = len(box.axes), box.axes, box.first_node, box.jump, box.area, box.length[i]
    across, between, in_rows = scratch.across, scratch.between_rows, scratch.in_rows
    X, Y, Z = int(axes[0] == c), int(axes[1] == c), int(axes[d - 1] == c)
    to_above, from_below, below, above = jump[X, 0, i], jump[X, 1, i], i % 2 * d + c, (i + 1) % 2 * d + c
    to, node, behind, next_node = np.uintp(row), np.uintp(first), np.uintp(box.row), np.uintp(1)
    rows = np.uintp(box.planes + first)
    nodes = np.uintp(box.planes + (d - 2) * box.nodes + first)
    for p in range(np.uintp(box.last_node - first)):
        total = to_above * across[above, p] + from_below * across[below, p]
        if d == 3:
            total += jump[Y, 0, rows + p] * between[c, behind + p] + jump[Y, 1, rows + p] * between[c, p]
        total += jump[Z, 0, nodes + p] * in_rows[c, next_node + p] + jump[Z, 1, nodes + p] * in_rows[c, p]
        out[c, to + p] = length * area[node + p] * total


@inlined
def gather_heat(box, scratch, i, heat, row):
    """Power that the fluxes of pairs dissipate [W], half of it for each node: of the own nodes of plane i, into heat
    (1, n) from place `row` on. Mirror images have the same power."""
    d, first, jump, area, length = len(box.axes), box.first_node, box.jump, box.area, 0.5 * box.length[i]
    across, between, in_rows = scratch.across, scratch.between_rows, scratch.in_rows
    to_above, to_below, below, above = jump[0, 0, i], jump[0, 1, i], 2 * d + i % 2, 2 * d + (i + 1) % 2
    to, node, behind, next_node = np.uintp(row), np.uintp(first), np.uintp(box.row), np.uintp(1)
    rows = np.uintp(box.planes + first)
    nodes = np.uintp(box.planes + (d - 2) * box.nodes + first)
    for p in range(np.uintp(box.last_node - first)):
        power = to_above * across[above, p] - to_below * across[below, p]
        if d == 3:
            power += jump[0, 0, rows + p] * between[d, behind + p] - jump[0, 1, rows + p] * between[d, p]
        power += jump[0, 0, nodes + p] * in_rows[d, next_node + p] - jump[0, 1, nodes + p] * in_rows[d, p]
        heat[0, to + p] = length * area[node + p] * power


# --- forces -------------------------------------------------------------------------------------------------------


@inlined
def reduce_edges(edges, left, first, last, place, array):
    """Multiply by `left` the columns of an array (c, n) of nodes in rows first to last - 1 that are among `edges` (k,),
    ascending; place: the column of the first row."""
    for e in range(np.searchsorted(edges, first), np.searchsorted(edges, last)):
        for c in range(array.shape[0]):
            array[c, place + edges[e] - first] *= left


@kernel
def stress_forces_in_plane(box, i, P, values, force):
    """V Div P [N] of the own nodes of plane i, into their rows of the field."""
    d, axes, first, last = len(box.axes), box.axes, box.first_node, box.last_node
    weights, runs, rows, row, period = box.divergence, box.runs, box.nodes // box.row, box.row, box.period
    plane, places = place_of(box.stresses, i), places_of(box.stresses, i, box.planes - 1, first)
    to, fast, in_rows = box.first + (i - box.first_plane) * (last - first), axes[d - 1], weights_along(box, d - 1)
    area, length = box.area, box.length[i]
    for c in range(d):
        weigh(last - first, P, d * c + axes[0], places, weights, int(axes[0] == c), i, force, c, to, False)
        if d == 3:
            k, column = int(axes[1] == c), d * c + axes[1]
            weigh_rows(runs, rows, row, plane, P, column, weights, k, box.planes, force, c, to - first, True)
        load_values(P, d * c + fast, plane, box.nodes, values)
        for part in range((last - first + period - 1) // period):
            node = first + part * period
            n, place = min(period, last - node), to + node - first
            weigh_in_row(n, values, node, weights, int(fast == c), in_rows, force, c, place, area, length)


@kernel
def dissipative_forces_in_plane(box, scratch, i, begin, v, x, G, Z, dissipation, heat):
    """V D [N] of the own nodes of plane i, into their rows of the field, after those of plane i - 1 unless it is the
    plane to `begin` with; and what it takes [W] into heat (1, n), None where nobody asks.

    Every node gathers the fluxes of its own pairs, so that no result depends on where a box is cut.
    """
    d, first, last, nodes, planes = len(box.axes), box.first_node, box.last_node, box.nodes, box.planes
    if i == begin and i > 0:
        fluxes_across(box, scratch, i - 1, v, x, G, Z, heat)
    if i + 1 < planes:
        fluxes_across(box, scratch, i, v, x, G, Z, heat)
    # within the plane, of pairs with an own node
    half_step, row = box.half_step, box.row
    if d == 3:
        p, q, flux, begin = max(0, first - row), min(nodes, last + row) - row, scratch.between_rows, planes
        to = p - (first - row)
        fluxes(box, 1, i, i, p, q - p, row, half_step, begin + p, v, x, G, Z, flux, 0, to, d, heat)
    p, q, flux, begin = max(0, first - 1), min(nodes, last + 1) - 1, scratch.in_rows, planes + (d - 2) * nodes
    to = p - (first - 1)
    fluxes(box, d - 1, i, i, p, q - p, 1, half_step, begin + p, v, x, G, Z, flux, 0, to, d, heat)
    row = box.first + (i - box.first_plane) * (last - first)
    for c in range(d):
        gather(box, scratch, i, c, dissipation, row)
    if heat is not None:
        gather_heat(box, scratch, i, heat, row)


@kernel
def divergence_pass(box, scratch, begin, end, P, v, x, G, Z, force, dissipation, heat):
    """Forces V Div P and V D [N] of the own nodes of planes begin to end - 1, which the windows keep with those around,
    into their rows of the fields (d, n), and heat (1, n) [W] or None. Z: None without dissipation."""
    for i in range(begin, end):
        stress_forces_in_plane(box, i, P, scratch.values, force)
        if Z is not None:
            dissipative_forces_in_plane(box, scratch, i, begin, v, x, G, Z, dissipation, heat)
