"""Hyperelastic material points after a step: deformation gradient, stress and wave speed, on tiles of 32 particles."""

from typing import Any

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
from parsolid.methods.mpm.points import TENSOR_ROWS, MaterialPoints, load_gradient
from parsolid.particles.law_values import RECORD, flat_values, rows_of_laws
from parsolid.tensors import (
    cofactor,
    combine,
    congruence,
    determinant,
    largest_eigenvalue_bound,
    matmul,
    matmul_transposed,
)
from parsolid.tiles import TILE, load, load_placed, store, store_placed


@kernel
def hyperelastic_tile(law, step, F, rates, tau, speed, values, lost):
    """F after a step [s] with velocity gradients `rates` [1/s], Kirchhoff stress tau = P F^T [Pa], nine components, and
    speed of pressure waves in the present configuration [m/s]. values: a flat tile of what the law has of each
    particle, or None; lost (TILE): what its state variables dissipate [J/m^3]."""
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
        store(tau, p, matmul_transposed(stress(here, new, H, J), new))
        # a wave with normal n has rho0 c^2 = N.Q N with N = F^T n of the reference configuration
        waves = congruence(new, pressure_waves(here, new, H, J))
        speed[p] = (largest_eigenvalue_bound(waves) / law.density) ** 0.5


@kernel
def advance_hyperelastic(law, first, last, step, components, deformation, motion, rate, stress, field, tile, lost):
    """Advance F of particles first..last-1 by a step [s] with velocity gradients `rate`, and write V sigma and c + |v|.

    components: of nine, that rows of deformation are; motion, rate, stress: see `transfer`. field (values, n): what
    the law has of each particle, or None; tile (values * TILE), lost (TILE): scratch for it. Returns (sound, largest
    c + |v| [m/s], what state variables dissipate [J]); sound is False when a Jacobian is not positive.
    """
    F, rates, tau, speed = np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(TILE)
    F[:TILE] = F[4 * TILE : 5 * TILE] = F[8 * TILE :] = 1.0
    sound, fastest, softened = True, 0.0, 0.0
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
        hyperelastic_tile(law, step, F, rates, tau, speed, tile, lost)
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
    return sound, fastest, softened


@kernel
def elastic_energy(law, first, last, deformation, motion, values):
    """Sum of W V0 [J] of particles first..last-1; values: see `flat_values`."""
    total = 0.0
    for p in range(first, last):
        F = load_gradient(deformation, p)
        here = law if values is None else at_particle(law, values[0], values[1], p)
        total += energy(here, F, cofactor(F), determinant(F)) * motion[p, 7]
    return total


class HyperelasticSolid:
    """Particles of one law whose stress follows from F alone."""

    def __init__(self, law: Any, points: MaterialPoints, settings: Any) -> None:
        self.law, self.points = law, points
        self._rows = rows_of_laws([points.laws[number] for number in points.law_of_body]).get(law)
        self._softens = state_count(law) > 0
        self._tile = np.repeat(values_at_rest(law), TILE) if self._rows is not None else None
        self._lost = np.zeros(TILE)

    @property
    def _field(self) -> np.ndarray | None:
        """What the law has of each particle (values, n), or None."""
        return None if self._rows is None else self.points.storage(RECORD)[self._rows]

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        """Sound, largest c + |v| [m/s] and terms of the ledger [J] of the law's particles after a step [s]."""
        of, places = self.points.storage, TENSOR_ROWS[self.points.dimension]
        arrays = of("deformation_gradient"), self.points.motion, of("velocity_gradient"), of("stress_and_volume")
        of_particles = self._field, self._tile, self._lost
        sound, fastest, softened = advance_hyperelastic(
            self.law, block.first, block.last, step, places, *arrays, *of_particles
        )
        return sound, fastest, {SOFTENING: softened} if self._softens else {}

    def stored_energy(self, block: MaterialBlock) -> float:
        """W V0 [J] of the law's particles."""
        F, motion = self.points.storage("deformation_gradient"), self.points.motion
        values = flat_values(self.points, self._rows)
        return float(elastic_energy(self.law, block.first, block.last, F, motion, values))

    def wave_modulus(self) -> float:
        """rho c^2 [Pa] of pressure waves in the undeformed solid."""
        shear, lame = elastic_moduli(self.law)
        return float(lame + 2.0 * shear)
