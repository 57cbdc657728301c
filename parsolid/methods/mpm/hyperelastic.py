"""Hyperelastic material points after a step, Maxwell branches included: deformation gradient, stress and wave speed,
on tiles of 32 particles.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.declaration import SOFTENING
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
    relaxation_loss,
    relaxation_weights,
    relaxed,
    total_modulus,
)
from parsolid.methods.mpm.points import BRANCHES, TENSOR_ROWS, MaterialPoints, load_gradient
from parsolid.particles.law_values import RECORD, flat_values, rows_of_laws
from parsolid.tensors import (
    cofactor,
    combine,
    combine_symmetric,
    congruence,
    determinant,
    gram,
    inverse_symmetric,
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

# what branches dissipate [J], among the terms of laws; the ledger has it as material dissipation
MATERIAL = "material_dissipation"
# A of an undeformed particle
_AT_REST = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)


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
            C_old_inverse, C_inverse = inverse_symmetric(C_old), inverse_symmetric(C)
            A_old = load_symmetric(A_of_all, p)
            A = relaxed((n[2], n[3], n[4]), A_old, C_old_inverse, C_inverse)
            store_symmetric(A_of_all, p, A)
            total = combine_symmetric(1.0, load_symmetric(branches.total, p), n[0], A)
            store_symmetric(branches.total, p, total)
            branches.lost[p] += relaxation_loss(
                n[0], n[1], (n[5], n[6], n[7]), C_old, C_old_inverse, A_old, C, C_inverse, A
            )


@kernel
def hyperelastic_tile(law, step, F, rates, tau, speed, values, lost, branches):
    """F after a step [s] with velocity gradients `rates` [1/s], Kirchhoff stress tau = P F^T [Pa], nine components, and
    speed of pressure waves in the present configuration [m/s]. values: a flat tile of what the law has of each
    particle, or None; lost (TILE): what its state variables dissipate [J/m^3]; branches: `Branches`, or None."""
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
def advance_hyperelastic(
    law, first, last, step, components, deformation, motion, rate, stress, field, tile, lost, branches
):
    """Advance F of particles first..last-1 by a step [s] with velocity gradients `rate`, and write V sigma and c + |v|.

    components: of nine, that rows of deformation are; motion, rate, stress: see `transfer`. field (values, n): what
    the law has of each particle, or None; tile (values * TILE), lost (TILE): scratch for it; branches: `Branches` or
    None. Returns (sound, largest c + |v| [m/s], what state variables and what branches dissipate [J]); sound is False
    when a Jacobian is not positive.
    """
    F, rates, tau, speed = np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(TILE)
    F[:TILE] = F[4 * TILE : 5 * TILE] = F[8 * TILE :] = 1.0
    sound, fastest, softened, relaxed_away = True, 0.0, 0.0, 0.0
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_placed(deformation, components, i, count, F, 0)
        for p in range(count):
            for a in range(3):
                for b in range(3):
                    rates[(3 * a + b) * TILE + p] = rate[np.uintp(i + p), 4 * a + b]
        if field is not None:
            for c in range(field.shape[0]):
                for p in range(np.uintp(count)):
                    tile[np.uintp(c * TILE) + p] = field[c, np.uintp(i) + p]
        if branches is not None:
            load_rows(branches.A, i, count, branches.tile, 0)
        hyperelastic_tile(law, step, F, rates, tau, speed, tile, lost, branches)
        if branches is not None:
            store_rows(branches.A, i, count, branches.tile, 0)
            for p in range(count):
                relaxed_away += branches.lost[p] * motion[np.uintp(i + p), 7]
        if field is not None:
            for c in range(field.shape[0]):
                for p in range(np.uintp(count)):
                    field[c, np.uintp(i) + p] = tile[np.uintp(c * TILE) + p]
            for p in range(count):
                softened += lost[p] * motion[np.uintp(i + p), 7]
        store_placed(deformation, components, i, count, F, 0)
        for p in range(count):
            q = np.uintp(i + p)
            V = motion[q, 7]
            t = load(tau, p)
            stress[q, 0], stress[q, 1], stress[q, 2], stress[q, 3] = V * t[0], V * t[4], V * t[8], 0.0
            stress[q, 4], stress[q, 5] = 0.5 * V * (t[5] + t[7]), 0.5 * V * (t[2] + t[6])
            stress[q, 6] = 0.5 * V * (t[1] + t[3])
            total = speed[p] + (motion[q, 4] ** 2 + motion[q, 5] ** 2 + motion[q, 6] ** 2) ** 0.5
            stress[q, 7] = total
            fastest = max(fastest, total)
            # not so for numbers that are none
            if not (determinant(load(F, p)) > 0.0 and total > 0.0):
                sound = False
    return sound, fastest, softened, relaxed_away


@kernel
def elastic_energy(law, first, last, deformation, motion, values, A):
    """Sum of W V0 [J] of particles first..last-1; values: see `flat_values`; A: of `Branches`, or None."""
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
        total += W * motion[p, 7]
    return total


class HyperelasticSolid:
    """Particles of one law whose stress follows from F alone."""

    def __init__(self, law: Any, points: MaterialPoints, settings: Any) -> None:
        self.law, self.points = law, points
        self._rows = rows_of_laws([points.laws[number] for number in points.law_of_body]).get(law)
        self._softens = state_count(law) > 0
        self._tile = np.repeat(values_at_rest(law), TILE) if self._rows is not None else None
        self._lost, terms = np.zeros(TILE), len(law.branch_moduli or ())
        self._scratch = np.repeat(_AT_REST * terms, TILE), np.zeros(6 * TILE), np.zeros(TILE)

    def _branches(self, step: float) -> Branches | None:
        """Those of a step [s], None without."""
        law = self.law
        if not law.branch_moduli:
            return None
        rows = [
            (modulus, tau, *relaxation_weights(step, tau), *(tau * weight for weight in loss_weights(step, tau)))
            for modulus, tau in zip(law.branch_moduli, law.relaxation_times)
        ]
        return Branches(np.array(rows), self.points.storage(BRANCHES)[: 6 * len(rows)], *self._scratch)

    @property
    def _field(self) -> np.ndarray | None:
        """What the law has of each particle (values, n), or None."""
        return None if self._rows is None else self.points.storage(RECORD)[self._rows]

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        """Sound, largest c + |v| [m/s] and terms of the ledger [J] of the law's particles after a step [s]."""
        of, places = self.points.storage, TENSOR_ROWS[self.points.dimension]
        arrays = of("deformation_gradient"), self.points.motion, of("velocity_gradient"), of("stress_and_volume")
        of_particles = self._field, self._tile, self._lost, self._branches(step)
        sound, fastest, softened, relaxed_away = advance_hyperelastic(
            self.law, block.first, block.last, step, places, *arrays, *of_particles
        )
        terms = {SOFTENING: softened} if self._softens else {}
        return sound, fastest, terms | ({MATERIAL: relaxed_away} if self.law.branch_moduli else {})

    def stored_energy(self, block: MaterialBlock) -> float:
        """W V0 [J] of the law's particles."""
        F, motion = self.points.storage("deformation_gradient"), self.points.motion
        values = flat_values(self.points, self._rows)
        A = self.points.storage(BRANCHES) if self.law.branch_moduli else None
        return float(elastic_energy(self.law, block.first, block.last, F, motion, values, A))

    def wave_modulus(self) -> float:
        """rho c^2 [Pa] of pressure waves in the undeformed solid."""
        shear, lame = elastic_moduli(self.law)
        return float(lame + 2.0 * (shear + sum(self.law.branch_moduli or ())))
