"""Pair weights of a mesh: integrals of the linear shape functions of its elements.

With shape functions N_a of the elements around a particle (node) a,

    V_a  = int N_a,   G_ab = int N_a grad N_b,   w_ab = - int grad N_a . grad N_b,   m_ab = int N_a N_b
    g_ab = (G_ab - G_ba)/2,   s_ab = G_ab + G_ba = int over the surface of N_a N_b n

so that sum_b G_ab = 0, sum_b G_ab (x) (X_b - X_a) = V_a 1, and sum_a G_ab = A_b, the area vector of the surface around
b (zero inside). g is the antisymmetric weight of every pair list; s is zero but for pairs on the surface. Gradients of
linear fields are exact, a constant stress has exactly the force of its tractions, and both sweeps are adjoint. Nodal
averages of this kind are those of Dohrmann et al. (2000) and of Puso and Solberg (2006), whose stabilisation by a part
of the elements' own energy is here the number w_ab of a pair (`stabilised`):

    T_a = sum_b [(P'_a + P'_b) g_ab + (P'_a - P'_b) s_ab/2 + beta mu w_ab (x_b - x_a)],   P' = P - beta mu F

is the force of the energy beta mu/2 [sum_e V_e |F_e|^2 - sum_a V_a |F_a|^2], which is not negative and zero where F is
the same everywhere.

All integrals are exact but that of w_ab where edges of an element are not parallel. Wedges and pyramids are hexahedra
with nodes in one place.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import kernel
from parsolid.particles.meshes.elements import CORNERS, ELEMENTS

# a pair's s_ab below this part of its face is zero but for rounding
_ROUNDING = 1e-11
# least mass over that of the lumped volume, to which corrections are limited; factors on their sources in each pass
LEAST_MASS, _LIMITING, _PASSES = 0.4, 0.7, 40


class Quadrature(NamedTuple):
    """Points of a reference element: values N (points, nodes), gradients dN (points, nodes, d), weights (points,)."""

    N: np.ndarray
    dN: np.ndarray
    weight: np.ndarray


def nodes_of_products(kind: str, cells: np.ndarray) -> np.ndarray:
    """Nodes (elements, nodes) as the functions of `quadrature` count them."""
    product = ELEMENTS[kind].product
    return np.ascontiguousarray(cells if product is None else cells[:, product])


def quadrature(kind: str) -> Quadrature:
    """The quadrature of a kind of elements: exact for products of two functions of a simplex, and for the surface
    integrals of products of two functions of the others, of degree 5 in each direction."""
    d = ELEMENTS[kind].dimension
    if ELEMENTS[kind].product is None:
        near = {2: 2.0 / 3.0, 3: (5.0 + 3.0 * 5.0**0.5) / 20.0}[d]
        N = np.full((d + 1, d + 1), (1.0 - near) / d)
        np.fill_diagonal(N, near)
        gradient = np.concatenate([-np.ones((1, d)), np.eye(d)])
        volume = {2: 1.0 / 2.0, 3: 1.0 / 6.0}[d]
        return Quadrature(N, np.tile(gradient, (d + 1, 1, 1)), np.full(d + 1, volume / (d + 1)))
    corners, (points, weights) = CORNERS[d], np.polynomial.legendre.leggauss(3)
    places = np.stack(np.meshgrid(*[points] * d, indexing="ij"), axis=-1).reshape(-1, d)
    weight = np.stack(np.meshgrid(*[weights] * d, indexing="ij"), axis=-1).reshape(-1, d).prod(axis=1)
    factor = 0.5 * (1.0 + places[:, None, :] * corners[None, :, :])
    gradient = np.empty((len(places), *corners.shape))
    for i in range(d):
        others = [k for k in range(d) if k != i]
        gradient[:, :, i] = 0.5 * corners[None, :, i] * factor[:, :, others].prod(axis=2)
    return Quadrature(factor.prod(axis=2), gradient, weight)


class MeshPairs(NamedTuple):
    """Pairs of particles that share an element, of particles owned by a rank: rows start[a] : start[a + 1] of
    neighbour (m,) with a the lower row; half_difference g_ab, sum s_ab (m, d) [m^2], stretch w_ab [m], overlap m_ab
    [m^3], (m,)."""

    start: np.ndarray
    neighbour: np.ndarray
    difference: np.ndarray
    surface: np.ndarray
    stretch: np.ndarray
    overlap: np.ndarray


def pairs_of_elements(elements: list[tuple[str, np.ndarray]], owned: int, positions: np.ndarray) -> Any:
    """(`MeshPairs`, V (rows,), A (rows, d)) of elements (kind, (elements, nodes) rows of particles).

    positions (rows, d): of owned particles and of ghosts behind them. All elements around owned particles are there, so
    that V and A of these, and all their pairs, are whole.
    """
    rows, d = positions.shape
    products = [(quadrature(kind), nodes_of_products(kind, cells)) for kind, cells in elements]
    keys = [np.zeros(0, np.int64)]
    for _, cells in elements:
        for i in range(cells.shape[1]):
            for j in range(i):
                low, high = np.minimum(cells[:, i], cells[:, j]), np.maximum(cells[:, i], cells[:, j])
                keys.append(np.unique((low * rows + high)[low < owned]))
    low, high = np.divmod(np.unique(np.concatenate(keys)), max(rows, 1))
    start = np.zeros(owned + 1, np.int64)
    np.cumsum(np.bincount(low, minlength=owned)[:owned], out=start[1:])
    count = len(high)
    pairs = MeshPairs(
        start, high.astype(np.int32), np.zeros((count, d)), np.zeros((count, d)), np.zeros(count), np.zeros(count)
    )
    volume, area = np.zeros(rows), np.zeros((rows, d))
    for points, cells in products:
        add_elements(*points, cells, positions, owned, pairs, volume, area)
    return pairs, volume, area


@kernel
def add_elements(N, dN, weight, cells, positions, owned, pairs, volume, area):
    """Add the integrals of elements (elements, nodes) of one kind; see `Quadrature`, `MeshPairs`."""
    nodes, d = cells.shape[1], positions.shape[1]
    gradient, J, cofactor = np.zeros((nodes, d)), np.zeros((3, 3)), np.zeros((3, 3))
    for e in range(cells.shape[0]):
        for q in range(weight.size):
            # J[i, k] = dX_i/dxi_k; one in the third direction of the plane
            J[:] = 0.0
            J[2, 2] = 1.0
            for i in range(d):
                for k in range(d):
                    J[i, k] = 0.0
                    for n in range(nodes):
                        J[i, k] += positions[cells[e, n], i] * dN[q, n, k]
            for i in range(3):
                p, r = (i + 1) % 3, (i + 2) % 3
                for k in range(3):
                    s, t = (k + 1) % 3, (k + 2) % 3
                    cofactor[i, k] = J[p, s] * J[r, t] - J[p, t] * J[r, s]
            determinant = J[0, 0] * cofactor[0, 0] + J[0, 1] * cofactor[0, 1] + J[0, 2] * cofactor[0, 2]
            size = weight[q] * abs(determinant)
            for n in range(nodes):
                for i in range(d):
                    gradient[n, i] = 0.0
                    for k in range(d):
                        gradient[n, i] += cofactor[i, k] * dN[q, n, k] / determinant
            for n in range(nodes):
                volume[cells[e, n]] += size * N[q, n]
                for i in range(d):
                    area[cells[e, n], i] += size * gradient[n, i]
            for n in range(nodes):
                for m in range(n):
                    add_pair(cells[e, n], cells[e, m], gradient[n], gradient[m], N[q, n], N[q, m], size, owned, pairs)


@kernel
def add_pair(a, b, grad_a, grad_b, N_a, N_b, size, owned, pairs):
    """Add one point's part of the integrals of a pair of nodes, in any order, unless it is one node or no owned one."""
    if a == b or min(a, b) >= owned:
        return
    sign = 1.0 if a < b else -1.0
    low, high = min(a, b), max(a, b)
    first, last = pairs.start[low], pairs.start[low + 1]
    while first < last:
        middle = (first + last) // 2
        if pairs.neighbour[middle] < high:
            first = middle + 1
        else:
            last = middle
    product = 0.0
    for i in range(grad_a.size):
        forth, back = size * N_a * grad_b[i], size * N_b * grad_a[i]
        pairs.difference[first, i] += sign * 0.5 * (forth - back)
        pairs.surface[first, i] += forth + back
        product += grad_a[i] * grad_b[i]
    pairs.stretch[first] -= size * product
    pairs.overlap[first] += size * N_a * N_b


def on_surface(pairs: MeshPairs) -> np.ndarray:
    """Numbers (k,) of pairs with s_ab that is not zero but for rounding."""
    size = np.abs(pairs.difference).sum(axis=1) + np.abs(pairs.surface).sum(axis=1)
    return np.flatnonzero(np.abs(pairs.surface).sum(axis=1) > _ROUNDING * max(size.max(initial=0.0), 1e-300))


# --- masses ------------------------------------------------------------------------------------------------------


@kernel
def sources_of_masses(pairs, positions, limit, y):
    """Add m_ab (X_b - X_a)/2 to y (rows, d) of b and take it from a; limit (rows,): factors, of a pair the lesser."""
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            half = 0.5 * min(limit[a], limit[b]) * pairs.overlap[k]
            for i in range(positions.shape[1]):
                term = half * (positions[b, i] - positions[a, i])
                y[b, i] += term
                y[a, i] -= term


def centres_of_functions(pairs: MeshPairs, positions: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """Places int N_a X / V_a (rows, d) [m], to which the means of owned particles belong: X_a + sum_b m_ab (X_b - X_a)
    / V_a, as the functions add up to 1."""
    y = np.zeros_like(positions)
    sources_of_masses(pairs, positions, np.ones(len(volume)), y)
    return np.asarray(positions - 2.0 * y / volume[:, None])


@kernel
def mass_corrections(pairs, y, volume, delta):
    """Add sum_a G_ac . y_a / V_a to delta (rows,) of both particles of each pair."""
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, forth, back = pairs.neighbour[k], 0.0, 0.0
            for i in range(y.shape[1]):
                forth += (0.5 * pairs.surface[k, i] + pairs.difference[k, i]) * y[a, i]
                back += (0.5 * pairs.surface[k, i] - pairs.difference[k, i]) * y[b, i]
            change = forth / volume[a] - back / volume[b]
            delta[b] += change
            delta[a] -= change


@kernel
def reduce_around(pairs, light, factor, limit):
    """Multiply limit (rows,) of light particles and their neighbours by a factor."""
    reduced = light.copy()
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            reduced[a] = reduced[a] or light[b]
            reduced[b] = reduced[b] or light[a]
    for a in range(limit.size):
        if reduced[a]:
            limit[a] *= factor


def corrected_volumes(pairs: MeshPairs, positions: np.ndarray, volume: np.ndarray, halo: Any, anywhere: Any) -> Any:
    """(M/rho (owned,) [m^3] by which sums integrate quadratic functions, how many particles the limit concerns).

    M_a/rho = V_a - delta_a, sum_a delta_a f_a = 1/2 sum_pairs m_ab (X_b - X_a) . [(grad f)_b - (grad f)_a]. Near the
    surface delta may exceed V; where M_a < `LEAST_MASS` V_a, the m_ab of pairs around the particle are reduced until it
    does not. Every pair's part keeps the total mass and its first moments, so that they stay, and only the second
    moments around such particles are those of lumped masses again. anywhere(flag): whether it is true on any rank.
    Collective.
    """
    owned, limit = halo.owned, np.ones(len(volume))
    for attempt in range(_PASSES + 1):
        y = np.zeros_like(positions)
        if attempt == _PASSES:
            limit[:] = np.where(limit < 1.0, 0.0, limit)
        sources_of_masses(pairs, positions, limit, y)
        y = halo.with_ghosts(y[:owned])
        delta = np.zeros(len(volume))
        mass_corrections(pairs, y, volume, delta)
        mass = volume[:owned] - delta[:owned]
        light = halo.with_ghosts((mass < LEAST_MASS * volume[:owned]).astype(np.int64)) > 0
        if attempt == _PASSES or not anywhere(bool(light[:owned].any())):
            break
        reduce_around(pairs, light, _LIMITING, limit)
        limit = halo.with_ghosts(limit[:owned])
    return mass, int(np.sum(limit[:owned] < 1.0))


# --- sweeps of a step --------------------------------------------------------------------------------------------


@kernel
def surface_gradient(start, neighbour, half, motion, sums):
    """Add (v_b - v_a) (x) s_ab/2 to the sums of a, and (v_a - v_b) (x) s_ab/2 to those of b: rows of `list_sweeps`;
    half (m, d): s_ab/2 of a list of pairs."""
    d = half.shape[1]
    stride = 4 if d == 3 else 2
    for a in range(start.size - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            for i in range(d):
                jump = motion[b, i] - motion[a, i]
                for j in range(d):
                    sums[a, stride * j + i] += jump * half[k, j]
                    sums[b, stride * j + i] -= jump * half[k, j]


@kernel
def surface_divergence(start, neighbour, half, record, at_stress, force):
    """Add (P_a - P_b) s_ab/2 to the force of a and take it from b."""
    d = half.shape[1]
    stride = 4 if d == 3 else 2
    for a in range(start.size - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            for i in range(d):
                pair = 0.0
                for j in range(d):
                    column = at_stress + stride * j + i
                    pair += (record[a, column] - record[b, column]) * half[k, j]
                force[a, i] += pair
                force[b, i] -= pair


@kernel
def stretch_forces(start, neighbour, stiffness, motion, at_position, d, force):
    """Add c_ab (x_b - x_a) to the force of a and take it from b; stiffness c (m,) [N/m]."""
    for a in range(start.size - 1):
        for k in range(start[a], start[a + 1]):
            b = neighbour[k]
            for i in range(d):
                pair = stiffness[k] * (motion[b, at_position + i] - motion[a, at_position + i])
                force[a, i] += pair
                force[b, i] -= pair


@kernel
def stretch_energy(start, neighbour, stiffness, motion, at_position, at_reference, d):
    """sum over pairs of c_ab |u_b - u_a|^2/2 [J] with displacements u = x - X."""
    total = 0.0
    for a in range(start.size - 1):
        for k in range(start[a], start[a + 1]):
            b, square = neighbour[k], 0.0
            for i in range(d):
                u_b = motion[b, at_position + i] - motion[b, at_reference + i]
                u_a = motion[a, at_position + i] - motion[a, at_reference + i]
                square += (u_b - u_a) * (u_b - u_a)
            total += 0.5 * stiffness[k] * square
    return total
