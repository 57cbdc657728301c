"""Particles of hyperelastic laws in methods that advance deformation gradients by velocity gradients: stress and wave
speed after a step, Maxwell branches included, on tiles of 32 particles.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.hyperelastic.at_particles import (
    after_step,
    at_particle,
    keep_state,
    state_count,
    values_at_rest,
)
from parsolid.materials.hyperelastic.functions import (
    dissipated_energy,
    elastic_moduli,
    energy,
    pressure_waves,
    stress,
)
from parsolid.materials.viscoelastic.maxwell import (
    branch_energy,
    branch_stress,
    branch_waves,
    loss_weights,
    relax,
    relaxation_weights,
    total_modulus,
)
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.initial_fields import initial_deformation_gradient, initial_displacement
from parsolid.particles.law_values import RECORD, flat_values, rows_of_laws
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene
from parsolid.tensors import (
    cofactor,
    combine,
    combine_symmetric,
    congruence,
    determinant,
    gram,
    largest_eigenvalue_bound,
    matmul,
    matmul_transposed,
    plus,
    plus_symmetric,
)
from parsolid.tiles import (
    TILE,
    load,
    load_placed,
    load_rows,
    load_symmetric,
    store,
    store_placed,
    store_rows,
    store_symmetric,
)

DEFORMATION = "deformation_gradient"
# A of all Maxwell branches, 6 numbers each, and that of an undeformed particle
BRANCHES, _AT_REST = "viscous_strain_inverses", (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
# F of the undeformed body: 11, 12, 21, 22, 33 in two dimensions, its rows in three
_IDENTITY = {2: (1.0, 0.0, 0.0, 1.0, 1.0), 3: (1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0)}
# components of nine that F has in two and three dimensions
TENSOR_ROWS = {2: np.array([0, 1, 3, 4, 8]), 3: np.arange(9)}
# of a length of the particles, for the gradients of formulas
_DIFFERENCE = 1e-4


def declare_deformation(particles: Particles, dimension: int, laws: list[Any]) -> None:
    """F of all particles, and A of branches where any law has some."""
    F = _IDENTITY[dimension]
    particles.declare(Field(DEFORMATION, len(F), "1", checkpointed=True, layout=Columns(), padding=F), F)
    branches = max(len(getattr(law, "branch_moduli", None) or ()) for law in laws)
    if branches:
        rest = _AT_REST * branches
        particles.declare(Field(BRANCHES, len(rest), "1", checkpointed=True, layout=Columns(), padding=rest), rest)


def deformation_at_start(scene: Scene, particle_set: ParticleSet, length: Any) -> np.ndarray:
    """F (n, d, d) of the bodies' formulas at time 0; length [m]: of their differences, see `gradient_of`."""
    place, d = (scene, particle_set.body, particle_set.position, particle_set.regions), particle_set.position.shape[1]
    F = np.tile(np.eye(d), (len(particle_set.body), 1, 1))
    if initial_displacement(*place) is not None:
        F += gradient_of(initial_displacement, scene, particle_set, length)
    given = initial_deformation_gradient(*place)
    if given is not None:
        F[given[1]] = given[0][given[1]]
    return F


def gradient_of(formula: Any, scene: Scene, particle_set: ParticleSet, length: Any) -> np.ndarray:
    """(n, d, d) of the bodies' formulas, by reference place, by central differences over a small part of a length, one
    or (n,) [m]; wider ones far from the origin, where places have fewer digits."""
    columns, body, place = [], particle_set.body, particle_set.position
    rounding = np.finfo(float).eps * np.abs(place).max(axis=1, initial=0.0)
    small = length * np.maximum(_DIFFERENCE, np.cbrt(rounding / length))
    for axis in np.eye(place.shape[1]):
        step = small[:, None] * axis
        ahead, behind = (formula(scene, body, place + s * step, particle_set.regions) for s in (1.0, -1.0))
        columns.append((ahead - behind) / (2.0 * small[:, None]))
    return np.stack(columns, axis=2)


def full_gradients(particles: Particles, dimension: int, first: int, last: int) -> np.ndarray:
    """F (n, 3, 3)."""
    components = particles[DEFORMATION][first:last]
    result = np.zeros((len(components), 9))
    result[:, TENSOR_ROWS[dimension]] = components
    return result.reshape(-1, 3, 3)


@inlined
def load_gradient(deformation, p):
    """F of particle p, nine numbers, from 5 rows (11, 12, 21, 22, 33) in two dimensions or 9 in three."""
    if len(deformation) == 9:
        F = (deformation[0, p], deformation[1, p], deformation[2, p], deformation[3, p], deformation[4, p],
             deformation[5, p], deformation[6, p], deformation[7, p], deformation[8, p])  # fmt: skip
    else:
        F = (deformation[0, p], deformation[1, p], 0.0, deformation[2, p], deformation[3, p], 0.0,
             0.0, 0.0, deformation[4, p])  # fmt: skip
    return F


class Branches(NamedTuple):
    """The Maxwell branches of a law over one step: numbers (branches, 8) of each, mu [Pa], tau [s], its
    `maxwell.relaxation_weights` and `maxwell.loss_weights` times tau; A (6 branches, capacity): of all particles.

    tile (6 branches * TILE), total (6 TILE), lost (TILE): A and sum mu A of a tile, and what branches dissipate there
    [J/m^3].
    """

    numbers: np.ndarray
    A: np.ndarray
    tile: np.ndarray
    total: np.ndarray
    lost: np.ndarray


@inlined
def load_particles(components, deformation, field, tile, branches, first, count, F):
    """What particles first .. first + count - 1 carry into tiles; see `HyperelasticParticles.carried`."""
    load_placed(deformation, components, first, count, F, 0)
    if field is not None:
        load_rows(field, first, count, tile, 0)
    if branches is not None:
        load_rows(branches.A, first, count, branches.tile, 0)


@inlined
def store_particles(components, deformation, field, tile, branches, first, count, F):
    """The way back of `load_particles`."""
    store_placed(deformation, components, first, count, F, 0)
    if field is not None:
        store_rows(field, first, count, tile, 0)
    if branches is not None:
        store_rows(branches.A, first, count, branches.tile, 0)


@kernel
def relax_branches(branches, step, F, rates):
    """Take the branches of a tile through a step [s] from F on with velocity gradients `rates` [1/s]."""
    branches.total[:] = 0.0
    branches.lost[:] = 0.0
    for k in range(len(branches.numbers)):
        n, A_of_all = branches.numbers[k], branches.tile[6 * TILE * k : 6 * TILE * (k + 1)]
        for p in range(TILE):
            old = load(F, p)
            C_old, C = gram(old), gram(combine(1.0, old, step, matmul(load(rates, p), old)))
            weights, losses = (n[2], n[3], n[4]), (n[5], n[6], n[7])
            A, lost = relax(n[0], n[1], weights, losses, C_old, C, load_symmetric(A_of_all, p))
            store_symmetric(A_of_all, p, A)
            total = combine_symmetric(1.0, load_symmetric(branches.total, p), n[0], A)
            store_symmetric(branches.total, p, total)
            branches.lost[p] += lost


@kernel
def hyperelastic_tile(law, step, F, rates, tau, speed, values, lost, branches):
    """F after a step [s] with velocity gradients `rates` [1/s] of its start, Kirchhoff stress tau = P F^T [Pa], nine
    components, and speed of pressure waves in the present configuration [m/s]. values: a flat tile of what the law has
    of each particle, or None; lost (TILE): what its state variables dissipate [J/m^3]; branches: `Branches`, or
    None."""
    if branches is not None:
        relax_branches(branches, step, F, rates)
    for p in range(TILE):
        new = load(F, p)
        new = combine(1.0, new, step, matmul(load(rates, p), new))
        store(F, p, new)
        H, J = cofactor(new), determinant(new)
        here = law if values is None else at_particle(law, values, TILE, p)
        if values is not None:
            before = dissipated_energy(here)
            here = after_step(here, new, H, J)
            keep_state(here, values, TILE, p)
            lost[p] = dissipated_energy(here) - before
        P, waves = stress(here, new, H, J), pressure_waves(here, new, H, J)
        if branches is not None:
            modulus, total = total_modulus(law.branch_moduli), load_symmetric(branches.total, p)
            P = plus(P, branch_stress(modulus, total, new, H, J))
            waves = plus_symmetric(waves, branch_waves(modulus, total, H, J))
        store(tau, p, matmul_transposed(P, new))
        # a wave with normal n has rho0 c^2 = N.Q N with N = F^T n of the reference configuration
        waves = congruence(new, waves)
        speed[p] = (largest_eigenvalue_bound(waves) / law.density) ** 0.5


@kernel
def elastic_energy(law, first, last, deformation, volume, values, A):
    """Sum of W V0 [J] of particles first..last-1; volume (n,): V0 [m^3]; values: see `flat_values`; A: of `Branches`,
    or None."""
    total = 0.0
    for p in range(first, last):
        F = load_gradient(deformation, p)
        here = law if values is None else at_particle(law, values[0], values[1], p)
        J = determinant(F)
        W = energy(here, F, cofactor(F), J)
        if A is not None:
            C = gram(F)
            for k in range(len(law.branch_moduli)):
                r = 6 * k
                inner = (A[r, p], A[r + 1, p], A[r + 2, p], A[r + 3, p], A[r + 4, p], A[r + 5, p])
                W += branch_energy(law.branch_moduli[k], C, J, inner)
        total += W * volume[p]
    return total


class HyperelasticParticles:
    """Particles of one law whose stress follows from F, its state variables and its branches.

    softens: whether state variables take energy.
    """

    def __init__(self, law: Any, particles: Particles, dimension: int, laws_of_bodies: list[Any]) -> None:
        self.law, self.particles, self._places = law, particles, TENSOR_ROWS[dimension]
        self._rows = rows_of_laws(laws_of_bodies).get(law)
        self.softens = state_count(law) > 0
        self._tile = np.repeat(values_at_rest(law), TILE) if self._rows is not None else None
        self._lost, terms = np.zeros(TILE), len(law.branch_moduli or ())
        self._scratch = np.repeat(_AT_REST * terms, TILE), np.zeros(6 * TILE), np.zeros(TILE)

    def carried(self, step: float) -> tuple[Any, ...]:
        """What kernels take of the particles in a step [s]: the components, of nine, that rows of the deformation are,
        and these; what the law has of each particle (values, n), or None, a flat tile and lost (TILE): scratch for it;
        `Branches`, or None."""
        law, stored, branches = self.law, self.particles.storage, None
        if law.branch_moduli:
            rows = [
                (modulus, tau, *relaxation_weights(step, tau), *(tau * weight for weight in loss_weights(step, tau)))
                for modulus, tau in zip(law.branch_moduli, law.relaxation_times)
            ]
            branches = Branches(np.array(rows), stored(BRANCHES)[: 6 * len(rows)], *self._scratch)
        field = None if self._rows is None else stored(RECORD)[self._rows]
        return self._places, stored(DEFORMATION), field, self._tile, self._lost, branches

    def stored_energy(self, first: int, last: int, volume: np.ndarray) -> float:
        """W V0 [J] of particles first..last-1; volume (capacity,): V0 [m^3]."""
        values = flat_values(self.particles, self._rows)
        A = self.particles.storage(BRANCHES) if self.law.branch_moduli else None
        return float(elastic_energy(self.law, first, last, self.particles.storage(DEFORMATION), volume, values, A))

    def wave_modulus(self) -> float:
        """rho c^2 [Pa] of pressure waves in the undeformed solid."""
        shear, lame = elastic_moduli(self.law)
        return float(lame + 2.0 * (shear + sum(self.law.branch_moduli or ())))
