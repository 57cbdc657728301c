"""A stress at time 0 that no deformation has made: geostatic, residual. It turns with the matter and adds to its law's.

With the stress S0 where F = 1, constant in the reference, the energy has 1/2 S0 : (F^T F - 1) and the first
Piola-Kirchhoff stress F S0, which a rotation R turns to R S0 R^T as Cauchy stress. Kernels add it on tiles
(`point_update.add_initial_stress`).
"""

from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.methods.tlsph.state import deformation_gradients
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.initial_fields import initial_stress, states_stress

FIELD = "initial_stress"


class InitialStress:
    """The initial stress of one rank's particles."""

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH`, whose particles get the field."""
        self.system, self.particles, self.dimension = system, system.particles, system.dimension
        role: dict[str, Any] = {"checkpointed": True, "mirror": "tensor", "layout": Columns()}
        self.particles.declare(Field(FIELD, self.dimension**2, "Pa", **role))
        self._stored = 0.0

    def begin(self, *place: Any) -> None:
        """Set it by the scene's formulas; place: as `initial_fields.initial_stress` takes it."""
        rows = self.particles.owned_rows(FIELD)
        rows[:] = initial_stress(*place).reshape(rows.shape)
        self.resume()

    def resume(self) -> None:
        """Count the largest tension of all ranks in the wave speeds that bound the step, and find the energy that a
        linear elastic body has under the stress; collective."""
        system, stress, d = self.system, self._tensors(), self.dimension
        body, share = self.particles.owned_rows("body"), 0.0
        square, mean = np.einsum("nij,nij->n", stress, stress), np.einsum("nii->n", stress)
        density = np.zeros(len(stress))
        for number in np.unique(body):
            here, (shear, lame) = body == number, elastic_moduli(system.laws[number])
            tension = max(0.0, float(np.linalg.eigvalsh(stress[here]).max()))
            share = max(share, tension / (lame + 2.0 * shear))
            density[here] = (square[here] - lame / (d * lame + 2.0 * shear) * mean[here] ** 2) / (4.0 * shear)
        self._stored = float(density @ self.particles.owned_rows("volume"))
        system.spacing /= np.sqrt(1.0 + maximum(system.comm, share))

    def energy(self) -> float:
        """1/2 S0 : (F^T F - 1) V [J] of this rank's particles, and what made S0."""
        rows, d = self.particles.owned_rows, self.dimension
        F = rows("deformation_gradient").reshape(-1, d, d)
        strain = np.einsum("nki,nkj->nij", F, F) - np.eye(d)
        return self._stored + 0.5 * float(np.einsum("nij,nij,n->", self._tensors(), strain, rows("volume")))

    def first_piola_kirchhoff_stress(self, first: int, last: int) -> Any:
        """F S0 (n, 3, 3) [Pa] of particles first .. last - 1."""
        d, F = self.dimension, deformation_gradients(self.particles, first, last)
        stress = np.zeros_like(F)
        stress[:, :d, :d] = self._tensors()[first:last]
        return F @ stress

    def _tensors(self) -> np.ndarray:
        d = self.dimension
        return np.asarray(self.particles.owned_rows(FIELD).reshape(-1, d, d))


def initial_stress_of(system: Any, scene: Any) -> InitialStress | None:
    """That of a scene's system, which gets the field where there is one."""
    return InitialStress(system) if states_stress(scene) else None
