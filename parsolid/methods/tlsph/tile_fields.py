"""Fields of particles on tiles: loading and storing them, and what is asked of a state between steps.

Fields are arrays (components, n). A tensor of the plane has the components 11, 12, 21, 22, a symmetric one 11, 22, 12;
`Places` tells where they stand in the tensors of a tile.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel, reduction
from parsolid.materials.hyperelastic.at_particles import after_step, at_particle, keep_state
from parsolid.materials.hyperelastic.functions import energy
from parsolid.materials.viscoelastic.maxwell import branch_energy
from parsolid.methods.tlsph.point_update import (
    TILE,
    in_directions,
    law_in,
    load,
    load_symmetric,
    load_values,
    make_tile,
    store,
    store_symmetric,
    store_values,
    stress_with_branches,
    waves_with_branches,
)
from parsolid.tensors import cofactor, determinant, gram, largest_eigenvalue, largest_eigenvalue_bound


class Places(NamedTuple):
    """Components in a tile of the components of a field: of general and of symmetric tensors."""

    tensor: np.ndarray
    symmetric: np.ndarray


PLACES = {
    2: Places(np.array([0, 1, 3, 4]), np.array([0, 1, 3])),
    3: Places(np.arange(9), np.arange(6)),
}


class Tiles(NamedTuple):
    """Scratch tiles of one law: deformation F, H, J, also at the start of a step, velocity gradient G, stress P, wave
    tensors and their bounds, a scratch S, and those that an option needs."""

    F: np.ndarray
    H: np.ndarray
    J: np.ndarray
    F_start: np.ndarray
    H_start: np.ndarray
    J_start: np.ndarray
    G: np.ndarray
    P: np.ndarray
    fast: np.ndarray
    slow: np.ndarray
    bound: np.ndarray
    impedance: np.ndarray
    signal: np.ndarray
    lost: np.ndarray
    S: np.ndarray
    initial: np.ndarray


# components of each of `Tiles`, and where it begins
_SIZES = (9, 9, 1, 9, 9, 1, 9, 9, 6, 6, 2, 2, 1, 1, 9, 9)
_ENDS = tuple(sum(_SIZES[: k + 1]) * TILE for k in range(len(_SIZES)))


def make_tiles() -> np.ndarray:
    """Tiles of sound particles in one array, as kernels take them (`tiles_in`): a call with sixteen takes a
    microsecond longer."""
    result = aligned_zeros(_ENDS[-1])
    for size, end in zip(_SIZES, _ENDS):
        result[end - size * TILE : end] = make_tile(size)
    return result


@inlined
def tiles_in(array):
    """The `Tiles` in an array of `make_tiles`."""
    e = _ENDS
    return Tiles(
        array[: e[0]], array[e[0] : e[1]], array[e[1] : e[2]], array[e[2] : e[3]], array[e[3] : e[4]],
        array[e[4] : e[5]], array[e[5] : e[6]], array[e[6] : e[7]], array[e[7] : e[8]], array[e[8] : e[9]],
        array[e[9] : e[10]], array[e[10] : e[11]], array[e[11] : e[12]], array[e[12] : e[13]],
        array[e[13] : e[14]], array[e[14] : e[15]],
    )  # fmt: skip


def make_branch_tiles(branches: int) -> tuple[Any, Any]:
    """A of all branches and their sum, None without branches."""
    if not branches:
        return None, None
    tiles = aligned_zeros((branches, 6 * TILE))
    tiles[:] = make_tile(6)
    return tiles.ravel(), make_tile(6)


@kernel
def copy(out, numbers):
    """Of slices, in which LLVM sees that no index is negative, so that it vectorises the loop."""
    for p in range(out.size):
        out[p] = numbers[p]


# Indices are unsigned, as numba asks of every signed one whether it counts from the end, and no slices are made, as
# numba would count their references.


@kernel
def copy_in(tile, places, field, i, n):
    """Components of n particles from row i on into a tile."""
    start = np.uintp(i)
    for c in range(places.size):
        first = np.uintp(places[c] * TILE)
        for p in range(np.uintp(n)):
            tile[first + p] = field[c, start + p]


@kernel
def copy_out(field, i, n, tile, places):
    """Components of n particles of a tile into rows i .. i + n - 1."""
    start = np.uintp(i)
    for c in range(places.size):
        first = np.uintp(places[c] * TILE)
        for p in range(np.uintp(n)):
            field[c, start + p] = tile[first + p]


@kernel
def copy_branches_in(A, symmetric, field, i, n):
    """A of all branches of n particles from row i on into tiles."""
    m, start = symmetric.size, np.uintp(i)
    for k in range(A.size // (6 * TILE)):
        for c in range(m):
            first, row = np.uintp((6 * k + symmetric[c]) * TILE), m * k + c
            for p in range(np.uintp(n)):
                A[first + p] = field[row, start + p]
        if m == 3:
            # A33 of the plane, which relaxation leaves 1 but for round-off, is no state: a restart has the same bits
            A[6 * TILE * k + 2 * TILE : 6 * TILE * k + 3 * TILE] = 1.0


@kernel
def copy_branches_out(field, i, n, A, symmetric):
    """The way back of `copy_branches_in`."""
    m, start = symmetric.size, np.uintp(i)
    for k in range(A.size // (6 * TILE)):
        for c in range(m):
            first, row = np.uintp((6 * k + symmetric[c]) * TILE), m * k + c
            for p in range(np.uintp(n)):
                field[row, start + p] = A[first + p]


@kernel
def store_waves(Z, place, n, fast, slow):
    """Half impedances of pressure and shear waves of n particles of a tile into Z from a place on."""
    start = np.uintp(place)
    for p in range(np.uintp(n)):
        Z[0, start + p], Z[1, start + p] = fast[p], slow[p]


@reduction
def energy_lost(n, lost, volume, row):
    """What the first n particles of a tile have dissipated [J], lost (TILE) [J/m^3], of volumes from a row on."""
    total, first = 0.0, np.uintp(row)
    for p in range(np.uintp(n)):
        total += lost[p] * volume[first + p]
    return total


@kernel
def load_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n):
    """F, H and J of n particles from row i on into tiles.

    gradient (4 or 9, n). jacobian (n,), None where J = det F. cofactors (9, n), None where H = cof F, in the plane with
    H33 = J. tensor: `Places`.
    """
    copy_in(F, tensor, gradient, i, n)
    if cofactors is not None:
        copy_in(H, tensor, cofactors, i, n)
    else:
        for p in range(TILE):
            store(H, p, cofactor(load(F, p)))
    if jacobian is not None:
        copy(J[:n], jacobian[i : i + n])
        if cofactors is None:
            copy(H[8 * TILE : 8 * TILE + n], J[:n])
    else:
        for p in range(TILE):
            J[p] = F[p] * H[p] + F[TILE + p] * H[TILE + p] + F[2 * TILE + p] * H[2 * TILE + p]


@kernel
def stored_energy(law, branches, first, last, places, gradient, cofactors, jacobian, field_A, volume, tiles, A, values):
    """Sum of W V [J] over particles first .. last - 1, eqs (19), (20) of Lee et al.; volume (n,): tributary. values:
    `ParticleValues` or None."""
    total, tiles = 0.0, tiles_in(tiles)
    F, H, J, tensor, symmetric = tiles.F, tiles.H, tiles.J, places.tensor, places.symmetric
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        load_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        if values is not None:
            load_values(values, i, n)
        for p in range(n):
            F_p = load(F, p)
            W = energy(law_in(law, values, p), F_p, load(H, p), J[p])
            if A is not None:
                for k in range(branches.moduli.size):
                    A_k = load_symmetric(A[6 * TILE * k : 6 * TILE * (k + 1)], p)
                    W += branch_energy(branches.moduli[k], gram(F_p), J[p], A_k)
            total += W * volume[i + p]
    return total


@kernel
def settle_states(law, first, last, places, gradient, tiles, values):
    """Let state variables of particles first .. last - 1 be those that their deformation asks for; values:
    `ParticleValues`."""
    F, tensor = tiles_in(tiles).F, places.tensor
    values.lost[:] = 0.0
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        copy_in(F, tensor, gradient, i, n)
        load_values(values, i, n)
        for p in range(n):
            F_p = load(F, p)
            here = after_step(at_particle(law, values.tile, TILE, p), F_p, cofactor(F_p), determinant(F_p))
            keep_state(here, values.tile, TILE, p)
        store_values(values, i, n)


@kernel
def sum_branches(branches, A, branch_sum):
    """sum mu A of a tile; sum mu [Pa]."""
    total = 0.0
    for p in range(6 * TILE):
        branch_sum[p] = 0.0
    for k in range(branches.moduli.size):
        total += branches.moduli[k]
        for p in range(6 * TILE):
            branch_sum[p] += branches.moduli[k] * A[6 * TILE * k + p]
    return total


@kernel
def stress_tile(law, branches, F, H, J, A, branch_sum, P, values):
    """P [Pa] of the state of a tile."""
    total = 0.0
    if A is not None:
        total = sum_branches(branches, A, branch_sum)
    for p in range(TILE):
        here = law_in(law, values, p)
        store(P, p, stress_with_branches(here, total, branch_sum, p, load(F, p), load(H, p), J[p]))


@kernel
def stresses(
    law, branches, first, last, places, gradient, cofactors, jacobian, field_A, tiles, A, branch_sum, values, out
):
    """First Piola-Kirchhoff stresses [Pa] of particles first .. last - 1 into out (last - first, 3, 3)."""
    tiles = tiles_in(tiles)
    F, H, J, P, tensor, symmetric = tiles.F, tiles.H, tiles.J, tiles.P, places.tensor, places.symmetric
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        load_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        if values is not None:
            load_values(values, i, n)
        stress_tile(law, branches, F, H, J, A, branch_sum, P, values)
        for p in range(n):
            for c in range(9):
                out[i - first + p, c // 3, c % 3] = P[c * TILE + p]


@kernel
def waves_tile(law, plane, branches, F, H, J, A, branch_sum, fast, slow, bound, values):
    """Wave tensors [Pa] of pressure (fast) and shear (slow) of the state of a tile, and a bound (2 TILE) on the largest
    eigenvalue of each over the directions of propagation."""
    total = 0.0
    if A is not None:
        total = sum_branches(branches, A, branch_sum)
    third = 0.0 if plane else 1.0
    for p in range(TILE):
        here = law_in(law, values, p)
        Q_p, Q_s = waves_with_branches(here, total, branch_sum, p, load(F, p), load(H, p), J[p])
        Q_p, Q_s = in_directions(third, Q_p), in_directions(third, Q_s)
        store_symmetric(fast, p, Q_p)
        store_symmetric(slow, p, Q_s)
        bound[p], bound[TILE + p] = largest_eigenvalue_bound(Q_p), largest_eigenvalue_bound(Q_s)


@kernel
def largest_modulus(largest, fast, bound, count):
    """Greatest rho c_p^2 [Pa] of the first particles of a tile and of what was found before: the eigenvalue is
    computed only where its bound may exceed that."""
    for p in range(count):
        # also where the bound is not a number
        if not bound[p] <= largest:
            largest = max(largest, largest_eigenvalue(load_symmetric(fast, p)))
    return largest


@kernel
def wave_speeds(
    law, plane, signals, branches, first, last, places, gradient, cofactors, jacobian, field_A, tiles, A, branch_sum,
    values,
):  # fmt: skip
    """(Greatest rho c_p^2 [Pa], greatest weighted sum of wave speeds [sqrt(Pa)] as in `update_tile`) of particles
    first .. last - 1."""
    largest, greatest = 0.0, 0.0
    p1, s1, p2, s2, p3, s3 = signals
    tiles = tiles_in(tiles)
    F, H, J, tensor, symmetric = tiles.F, tiles.H, tiles.J, places.tensor, places.symmetric
    fast, slow, bound = tiles.fast, tiles.slow, tiles.bound
    for i in range(first, last, TILE):
        n = min(TILE, last - i)
        load_deformation(F, H, J, tensor, gradient, cofactors, jacobian, i, n)
        if A is not None:
            copy_branches_in(A, symmetric, field_A, i, n)
        if values is not None:
            load_values(values, i, n)
        waves_tile(law, plane, branches, F, H, J, A, branch_sum, fast, slow, bound, values)
        largest = largest_modulus(largest, fast, bound, n)
        for p in range(n):
            c_p, c_s = bound[p] ** 0.5, bound[TILE + p] ** 0.5
            greatest = max(greatest, p1 * c_p + s1 * c_s, p2 * c_p + s2 * c_s, p3 * c_p + s3 * c_s)
    return largest, greatest
