"""Deformation, stress and wave speeds of single particles, on tiles of 96.

A tile holds the tensors of TILE particles in flat arrays: component c of particle p stands at c * TILE + p, general
tensors with nine components, symmetric ones with six (`parsolid.tensors`). Flat tiles stay in the first-level cache,
and LLVM sees that their components do not overlap, without which it does not vectorise these loops. In plane strain
the components out of the plane are those of F33 = 1; `plane` excludes that direction from wave speeds.

Whatever sums over neighbours (pair lists, box sweeps) loads a tile, calls `update_tile` (leapfrog) or `stage_tile`
(`list_stages`), and stores what it needs. A tile that is only partly filled must hold sound values in the rest, as
`make_tile` gives them.
"""

from typing import NamedTuple

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel
from parsolid.materials.hyperelastic.at_particles import after_step, at_particle, keep_state
from parsolid.materials.hyperelastic.functions import dissipated_energy, pressure_waves, shear_waves, stress
from parsolid.materials.law_functions import law_function
from parsolid.materials.viscoelastic.maxwell import branch_stress, branch_waves, relax
from parsolid.tensors import (
    cofactor,
    combine,
    combine_symmetric,
    congruence,
    gram,
    largest_eigenvalue_bound,
    matmul,
    plus,
    plus_symmetric,
)

# what an update reads and writes of so many stays in a first-level cache of 48 kB
TILE = 96
# particles of a tile are handled in groups of so many, of which LLVM makes vectors
LANES = 8


class Branches(NamedTuple):
    """The Maxwell branches of a law over one step.

    moduli [Pa], times [s]: (branches,). weights (branches, 3): `maxwell.relaxation_weights` over the step. losses
    (branches, 3): leapfrog's `maxwell.loss_weights` times tau [s]; for SSP-RK3 column 0 is the `dissipation_factor` of
    the stage. to_stage (branches, 3): relaxation weights from the start of the step to the stage (SSP-RK3).
    """

    moduli: np.ndarray
    times: np.ndarray
    weights: np.ndarray
    losses: np.ndarray
    to_stage: np.ndarray


class ParticleValues(NamedTuple):
    """What a law has of each particle (`materials.hyperelastic.at_particles`): field (values, n), of which the last
    ones are `states` state variables; volume (n,) [m^3]; tile (values * TILE), with sound particles in all of it, and
    lost (TILE): what the state variables dissipate there [J/m^3]; dissipated (TILE,): the sums of a step [J]."""

    field: np.ndarray
    states: int
    volume: np.ndarray
    tile: np.ndarray
    lost: np.ndarray
    dissipated: np.ndarray


@inlined
def load(t, p):
    """General tensor of particle p of a tile."""
    return (t[p], t[TILE + p], t[2 * TILE + p], t[3 * TILE + p], t[4 * TILE + p],
            t[5 * TILE + p], t[6 * TILE + p], t[7 * TILE + p], t[8 * TILE + p])  # fmt: skip


@inlined
def store(t, p, A):
    """Put a general tensor into a tile."""
    t[p], t[TILE + p], t[2 * TILE + p], t[3 * TILE + p], t[4 * TILE + p] = A[0], A[1], A[2], A[3], A[4]
    t[5 * TILE + p], t[6 * TILE + p], t[7 * TILE + p], t[8 * TILE + p] = A[5], A[6], A[7], A[8]


@inlined
def load_symmetric(t, p):
    """Symmetric tensor of particle p of a tile."""
    return (t[p], t[TILE + p], t[2 * TILE + p], t[3 * TILE + p], t[4 * TILE + p], t[5 * TILE + p])


@inlined
def store_symmetric(t, p, S):
    """Put a symmetric tensor into a tile."""
    t[p], t[TILE + p], t[2 * TILE + p] = S[0], S[1], S[2]
    t[3 * TILE + p], t[4 * TILE + p], t[5 * TILE + p] = S[3], S[4], S[5]


def make_tile(components: int) -> np.ndarray:
    """A tile of tensors that are 1 (nine or six components), or of numbers that are 1."""
    diagonal = {9: (0, 4, 8), 6: (0, 1, 2)}.get(components, range(components))
    tile = aligned_zeros((components, TILE))
    tile[list(diagonal)] = 1.0
    return tile.ravel()


@inlined
def law_in(law, values, p):
    """The law at particle p of the tile of `ParticleValues`, or None."""
    return law if values is None else at_particle(law, values.tile, TILE, p)


@kernel
def load_values(values, i, n):
    """What a law has of n particles from row i on into its tile."""
    start, field, tile = np.uintp(i), values.field, values.tile
    for c in range(field.shape[0]):
        for p in range(np.uintp(n)):
            tile[np.uintp(c * TILE) + p] = field[c, start + p]


@kernel
def store_values(values, i, n):
    """State variables of n particles of a tile into rows from i on, and what they have dissipated to the sums."""
    start, field, tile = np.uintp(i), values.field, values.tile
    for c in range(field.shape[0] - values.states, field.shape[0]):
        for p in range(np.uintp(n)):
            field[c, start + p] = tile[np.uintp(c * TILE) + p]
    dissipated, lost, volume = values.dissipated, values.lost, values.volume
    for p in range(np.uintp(n)):
        dissipated[p] += lost[p] * volume[start + p]


@inlined
def stress_with_branches(law, total, branch_sum, p, F, H, J):
    """P [Pa] of particle p of a tile. total: sum of the moduli mu of its branches [Pa]; branch_sum: tile of sum mu A,
    None where a law has no branches."""
    P = stress(law, F, H, J)
    if branch_sum is not None:
        P = plus(P, branch_stress(total, load_symmetric(branch_sum, p), F, H, J))
    return P


@inlined
def waves_with_branches(law, total, branch_sum, p, F, H, J):
    """Wave tensors [Pa] of pressure and shear waves of particle p of a tile, see `stress_with_branches`."""
    fast, slow = pressure_waves(law, F, H, J), shear_waves(law, F)
    if branch_sum is not None:
        S = load_symmetric(branch_sum, p)
        fast, slow = plus_symmetric(fast, branch_waves(total, S, H, J)), plus_symmetric(slow, S)
    return fast, slow


@inlined
def in_directions(third, Q):
    """A wave tensor whose eigenvalues are those of directions in the plane for third = 0, of all for third = 1."""
    # a factor, as numba warns of conditions in inlined functions
    return (Q[0], Q[1], third * Q[2] + (1.0 - third) * 0.5 * (Q[0] + Q[1]), Q[3], Q[4], Q[5])


@inlined
def mean_impedance(density, Q):
    """Root of the mean over directions of rho^2 c^2 [kg/(m^2 s)], rho c^2 = N . Q N."""
    return (density * (Q[0] + Q[1] + Q[2]) * (1.0 / 3.0)) ** 0.5


@inlined
def speeds(density, third, signals, push, p, fast, slow):
    """Signal and half impedances of pressure and of shear waves of particle p of a tile from its wave tensors [Pa], see
    `update_tile`."""
    p1, s1, p2, s2, p3, s3 = signals
    fast, slow = in_directions(third, fast), in_directions(third, slow)
    c_p, c_s = largest_eigenvalue_bound(fast) ** 0.5, largest_eigenvalue_bound(slow) ** 0.5
    signal = max(p1 * c_p + s1 * c_s, p2 * c_p + s2 * c_s, p3 * c_p + s3 * c_s)
    if push is not None:
        # rho_r^2 c_r^2 of the moved reference: F_r Q F_r^T / J_r^2
        fast, slow = congruence(load(push, p), fast), congruence(load(push, p), slow)
        fast, slow = in_directions(third, fast), in_directions(third, slow)
    return signal, 0.5 * mean_impedance(density, fast), 0.5 * mean_impedance(density, slow)


@kernel
def relax_branch(modulus, time, weights, rates, step, F, G, A, branch_sum, lost):
    """Relax A of a branch of a tile over a step [s] in which F grows by step G; add its share to branch_sum (mu A) and
    what it dissipates [J/m^3] to lost. weights, rates: its rows of `Branches`."""
    for p in range(TILE):
        F_old = load(F, p)
        C_old, C = gram(F_old), gram(combine(1.0, F_old, step, load(G, p)))
        A_new, loss = relax(modulus, time, weights, rates, C_old, C, load_symmetric(A, p))
        store_symmetric(A, p, A_new)
        store_symmetric(branch_sum, p, combine_symmetric(1.0, load_symmetric(branch_sum, p), modulus, A_new))
        lost[p] += loss


@kernel
def clear_sums(branch_sum, lost):
    """Set what `relax_branch` adds to, to 0."""
    for p in range(branch_sum.size):
        branch_sum[p] = 0.0
    for p in range(lost.size):
        lost[p] = 0.0


@kernel
def deform_tile(law, step, total, third, signals, F, G, branch_sum, push, J, P, impedance, signal, values, n):
    """F of n particles after a step, and what follows from it, see `update_tile`. total, branch_sum: of the branches,
    branch_sum None without; third: 0 in plane strain, else 1; values: `ParticleValues` with a tile that is filled, or
    None."""
    for p in range(np.uintp(n)):
        F_new = combine(1.0, load(F, p), step, load(G, p))
        H = cofactor(F_new)
        J_new = F_new[0] * H[0] + F_new[1] * H[1] + F_new[2] * H[2]
        here = law_in(law, values, p)
        if values is not None:
            before = dissipated_energy(here)
            here = after_step(here, F_new, H, J_new)
            keep_state(here, values.tile, TILE, p)
            values.lost[p] = dissipated_energy(here) - before
        P_new = stress_with_branches(here, total, branch_sum, p, F_new, H, J_new)
        fast, slow = waves_with_branches(here, total, branch_sum, p, F_new, H, J_new)
        store(F, p, F_new)
        store(P, p, P_new)
        J[p] = J_new
        signal[p], impedance[p], impedance[TILE + p] = speeds(law.density, third, signals, push, p, fast, slow)


@law_function
def update_tile(
    law, step, third, signals, branches, F, G, A, branch_sum, push, J, P, impedance, signal, lost, carried, row, n
):
    """Leapfrog: the state of a tile after a step [s] with its velocity gradient G [1/s] in the middle of the step.

    law: without branches, see `materials.hyperelastic.functions`. third: 0 in plane strain, else 1. signals: six
    numbers (p1, s1, p2, s2, p3, s3). branches: arrays (moduli, times, weights, losses) of `Branches`;
    they, A (branches * 6 TILE) and the scratch branch_sum (6 TILE) are None for laws without. push (9 TILE): F_r/J_r of
    an updated reference, or None. carried: what particles have besides, of which the tile has rows row .. row + n - 1:
    `ParticleValues`, of a law that flows `plastic.PlasticFields`, or None.

    Advances F and A. Fills J, P [Pa], impedance (2 TILE): half rho c of pressure and of shear waves [kg/(m^2 s)], the
    root of its mean square over directions; signal: the greatest of the sums p_i sqrt(rho) c_p + s_i sqrt(rho) c_s
    [sqrt(Pa)] over all directions; lost: energy that branches dissipate [J/m^3].
    """


@update_tile.otherwise
def _update_elastic(
    law, step, third, signals, branches, F, G, A, branch_sum, push, J, P, impedance, signal, lost, carried, row, n
):
    total = 0.0
    if A is not None:
        moduli, times, weights, losses = branches
        clear_sums(branch_sum, lost)
        for k in range(moduli.size):
            relax_branch(
                moduli[k], times[k], (weights[k, 0], weights[k, 1], weights[k, 2]),
                (losses[k, 0], losses[k, 1], losses[k, 2]), step, F, G,
                A[6 * TILE * k : 6 * TILE * (k + 1)], branch_sum, lost,
            )  # fmt: skip
            total += moduli[k]
    if carried is not None:
        load_values(carried, row, n)
    # a function of its own: LLVM makes twice as fast a loop of it
    lanes = min(TILE, (n + LANES - 1) // LANES * LANES)
    deform_tile(law, step, total, third, signals, F, G, branch_sum, push, J, P, impedance, signal, carried, lanes)
    if carried is not None:
        store_values(carried, row, n)


@kernel
def add_pressure(F, J, pressure, released, i, n, P):
    """P += (p - k (J - 1)) H of n particles from row i on; pressure p, released k [Pa]: fields (1, n)."""
    for p in range(n):
        part = pressure[0, i + p] - released[0, i + p] * (J[p] - 1.0)
        store(P, p, combine(1.0, load(P, p), part, cofactor(load(F, p))))


@kernel
def add_initial_stress(F, initial, P):
    """P += F S0 on a tile."""
    for p in range(TILE):
        store(P, p, plus(load(P, p), matmul(load(F, p), load(initial, p))))
