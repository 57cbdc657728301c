"""A stress at time 0 that no deformation has made: geostatic, residual. It turns with the matter and adds to its law's.

With the stress S0 where F = 1, constant in the reference, the energy has 1/2 S0 : (F^T F - 1) and the first
Piola-Kirchhoff stress F S0, which a rotation R turns to R S0 R^T as Cauchy stress.
"""

from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.materials.hyperelastic.law import elastic_moduli
from parsolid.methods.tlsph.initial_stress_kernels import corrected_stress
from parsolid.methods.tlsph.stresses import deformation_gradients
from parsolid.numerics.lanes import aligned_zeros
from parsolid.pairs.terms import record_columns
from parsolid.particles.declaration import Columns, Field
from parsolid.scene.initial import initial_stress, states_stress

FIELD = "initial_stress"


class NoInitialStress:
    """What most scenes have; there: whether steps have anything to do."""

    there = False

    def begin(self, *place: Any) -> None:
        """Nothing."""

    def resume(self) -> None:
        """Nothing."""

    def note(self) -> None:
        """Nothing."""

    def add(self) -> None:
        """Nothing."""

    def energy(self) -> float:
        """None."""
        return 0.0

    def first_piola_kirchhoff_stress(self, first: int, last: int) -> Any:
        """None."""
        return 0.0


class InitialStress(NoInitialStress):
    """The initial stress of one rank's particles."""

    there = True

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`, whose particles get the field."""
        self.system, d = system, system.dimension
        role: dict[str, Any] = {"checkpointed": True, "mirror": "tensor", "layout": Columns()}
        system.particles.declare(Field(FIELD, d * d, "Pa", **role))
        self._part, self._stored = np.zeros((0, 0)), 0.0

    def begin(self, *place: Any) -> None:
        """Set it by the scene's formulas; place: as `scene.initial.initial_stress` takes it."""
        rows = self.system.particles.owned_rows(FIELD)
        rows[:] = initial_stress(*place).reshape(rows.shape)
        self.resume()

    def resume(self) -> None:
        """Count the largest tension of all ranks in the wave speeds that bound the step, and find the energy that a
        linear elastic body has under the stress; collective.
        """
        system, stress, d = self.system, self._tensors(), self.system.dimension
        body, share = system.particles.owned_rows("body"), 0.0
        square, mean = np.einsum("nij,nij->n", stress, stress), np.einsum("nii->n", stress)
        density = np.zeros(len(stress))
        for number in np.unique(body):
            here, (shear, lame) = body == number, elastic_moduli(system.laws[number])
            tension = max(0.0, float(np.linalg.eigvalsh(stress[here]).max()))
            share = max(share, tension / (lame + 2.0 * shear))
            density[here] = (square[here] - lame / (d * lame + 2.0 * shear) * mean[here] ** 2) / (4.0 * shear)
        self._stored = float(density @ system.particles.owned_rows("volume"))
        system.spacing /= np.sqrt(1.0 + maximum(system.comm, share))

    def note(self) -> None:
        """Find what the present deformation makes of it, before a stage puts F at its end."""
        particles, system = self.system.particles, self.system
        shape = len(particles.storage("record")), 4 if system.dimension == 2 else 12
        if self._part.shape != shape:
            self._part = aligned_zeros(shape)
        corrected_stress(system.space, system.owned, system.body_of(None), particles.storage(FIELD), self._part)

    def add(self) -> None:
        """Add what was noted to the stresses of the laws in the records."""
        system = self.system
        first, owned = record_columns(system.space, system.pairs.terms).stress, system.owned
        record = system.particles.storage("record")
        record[:owned, first : first + self._part.shape[1]] += self._part[:owned]

    def energy(self) -> float:
        """1/2 S0 : (F^T F - 1) V [J] of this rank's particles, and what made S0."""
        rows, d = self.system.particles.owned_rows, self.system.dimension
        F = rows("deformation_gradient").reshape(-1, d, d)
        strain = np.einsum("nki,nkj->nij", F, F) - np.eye(d)
        return self._stored + 0.5 * float(np.einsum("nij,nij,n->", self._tensors(), strain, rows("volume")))

    def first_piola_kirchhoff_stress(self, first: int, last: int) -> Any:
        """F S0 (n, 3, 3) [Pa] of particles first..last-1."""
        system = self.system
        d, F = system.dimension, deformation_gradients(system.particles, system.dimension, first, last)
        stress = np.zeros_like(F)
        stress[:, :d, :d] = self._tensors()[first:last]
        return F @ stress

    def _tensors(self) -> np.ndarray:
        d = self.system.dimension
        return np.asarray(self.system.particles.owned_rows(FIELD).reshape(-1, d, d))


def initial_stress_of(system: Any, scene: Any) -> NoInitialStress:
    """That of a scene's system, which gets the field where there is one."""
    return InitialStress(system) if states_stress(scene) else NoInitialStress()
