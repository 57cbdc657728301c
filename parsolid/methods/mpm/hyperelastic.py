"""Hyperelastic material points after a step, on tiles of 32 particles."""

from typing import Any

import numpy as np

from parsolid.kernels import kernel
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.declaration import SOFTENING
from parsolid.methods.hyperelastic_particles import (
    HyperelasticParticles,
    hyperelastic_tile,
    load_particles,
    store_particles,
)
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.tensors import determinant
from parsolid.tiles import TILE, load

# name of the energy that branches dissipate [J] among the terms of laws, and of its column
MATERIAL = "material_dissipation"


@kernel
def advance_hyperelastic(
    law, first, last, step, components, deformation, field, tile, lost, branches, motion, rate, stress
):
    """Advance F of particles first..last-1 by a step [s] with velocity gradients `rate`, and write V sigma and c + |v|.

    components .. branches: see `HyperelasticParticles.carried`; motion, rate, stress: see `transfer`. Returns (sound,
    largest c + |v| [m/s], what state variables and what branches dissipate [J]); sound is False when a Jacobian is not
    positive.
    """
    F, rates, tau, speed = np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(9 * TILE), np.zeros(TILE)
    F[:TILE] = F[4 * TILE : 5 * TILE] = F[8 * TILE :] = 1.0
    sound, fastest, softened, relaxed_away = True, 0.0, 0.0, 0.0
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_particles(components, deformation, field, tile, branches, i, count, F)
        for p in range(count):
            for a in range(3):
                for b in range(3):
                    rates[(3 * a + b) * TILE + p] = rate[np.uintp(i + p), 4 * a + b]
        hyperelastic_tile(law, step, F, rates, tau, speed, tile, lost, branches)
        store_particles(components, deformation, field, tile, branches, i, count, F)
        for p in range(count):
            q = np.uintp(i + p)
            V = motion[q, 7]
            if branches is not None:
                relaxed_away += branches.lost[p] * V
            if field is not None:
                softened += lost[p] * V
            t = load(tau, p)
            stress[q, 0], stress[q, 1], stress[q, 2], stress[q, 3] = V * t[0], V * t[4], V * t[8], 0.0
            stress[q, 4], stress[q, 5] = 0.5 * V * (t[5] + t[7]), 0.5 * V * (t[2] + t[6])
            stress[q, 6] = 0.5 * V * (t[1] + t[3])
            total = speed[p] + (motion[q, 4] ** 2 + motion[q, 5] ** 2 + motion[q, 6] ** 2) ** 0.5
            stress[q, 7] = total
            fastest = max(fastest, total)
            # True for NaN, too
            if not (determinant(load(F, p)) > 0.0 and total > 0.0):
                sound = False
    return sound, fastest, softened, relaxed_away


class HyperelasticSolid(HyperelasticParticles):
    """Particles of one law."""

    def __init__(self, law: Any, points: MaterialPoints, settings: Any) -> None:
        of_bodies = [points.laws[number] for number in points.law_of_body]
        super().__init__(law, points, points.dimension, of_bodies)
        self.points = points

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        """Sound, largest c + |v| [m/s] and terms of the ledger [J] of the law's particles after a step [s]."""
        of = self.points.storage
        sound, fastest, softened, relaxed_away = advance_hyperelastic(
            self.law, block.first, block.last, step, *self.carried(step), self.points.motion, of("velocity_gradient"),
            of("stress_and_volume"),
        )  # fmt: skip
        terms = {SOFTENING: softened} if self.softens else {}
        return sound, fastest, terms | ({MATERIAL: relaxed_away} if self.law.branch_moduli else {})

    def stored_energy(self, block: MaterialBlock) -> float:  # type: ignore[override]
        """W V0 [J] of the law's particles."""
        return super().stored_energy(block.first, block.last, self.points.motion[:, 7])
