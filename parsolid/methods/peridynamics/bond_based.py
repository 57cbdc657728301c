"""Bond-based peridynamics on the bonds of the correspondence method: forces of
`methods.peridynamics.bond_based_kernels`, without a stabiliser.
"""

from typing import Any

import numpy as np

from decomposition.recalled import RecalledEach
from parsolid.materials.damage.bond_based import POISSONS_RATIO, micromodulus
from parsolid.methods.peridynamics.bond_based_kernels import add_bond_forces, bond_energy
from parsolid.methods.peridynamics.bond_force import BondForce, pushed_forward
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field


class BondBasedForce(BondForce):
    """As `BondForce`, of bodies whose laws are all bond-based."""

    def __init__(
        self,
        particles: Particles,
        bond_system: Any,
        settings: Any,
        blocks: Any,
        horizon: np.ndarray,
        fixed_planes: np.ndarray,
    ) -> None:
        """horizon (owned,) [m]; settings: `settings.Peridynamics`. Collective."""
        super().__init__(particles, bond_system, None, fixed_planes)
        self._add_forces = RecalledEach(add_bond_forces)
        self.state = settings.state(particles["displacement"].shape[1])
        modulus = np.zeros(self.owned)
        for block in blocks:
            rows = slice(block.first, block.last)
            modulus[rows] = micromodulus(block.law.youngs_modulus, self.state, settings.influence, horizon[rows])
        particles.declare(Field("micromodulus", 1, "N/m^6", ghosts="forward", message="stiffness"), modulus)
        particles.update("stiffness")

    @property
    def linear_force(self) -> np.ndarray:
        """Nothing has a history, so nothing of the force is carried on."""
        return self.particles.kept(("no force",), lambda: np.zeros((self.owned, self.dimension)))

    def evaluate(self, laws: Any) -> np.ndarray:
        """Force (owned, d) [N] of the displacement."""
        return self._forces(None, self.columns.position)

    def evaluate_stiffness(self, laws: Any) -> np.ndarray:
        """Force (owned, d) [N] to first order in the field f."""
        return self._forces(True, self.columns.field)

    def _forces(self, linear: bool | None, column: int) -> np.ndarray:
        self.evaluations += 1
        self.force[:] = 0.0
        what = (linear, column, self.particles.storage("micromodulus"), self.kinematics, self.force)
        key = self.bond_system.key
        self.bond_system.sweep(
            lambda pairs: self._add_forces(key(pairs, column), self.space, pairs, *what),
            "motion",
        )
        return self.owned_force

    def stored_energy(self) -> float:
        """Energy [J] of the bonds at the displacement of the last evaluation."""
        what = (
            self.columns.position,
            self.particles.storage("micromodulus"),
            self.particles.storage("share"),
            self.kinematics,
        )
        energies: list[float] = []
        self.bond_system.sweep(lambda pairs: energies.append(bond_energy(self.space, pairs, *what)))
        return sum(energies[1:], energies[0])

    def cauchy_stresses(self, laws: Any, first: int, last: int, F: np.ndarray) -> np.ndarray:
        """sigma (n, 3, 3) [Pa] of particles first..last-1; F (n, 3, 3): their deformation gradients."""
        return pushed_forward(self.classical_stresses(laws)[first:last], F)

    def classical_stresses(self, laws: Any) -> np.ndarray:
        """Stress (owned, 3, 3) [Pa] of the classical solid with the same constants under the gradient of the
        displacement.
        """
        result, d, nu = np.zeros((self.owned, 3, 3)), self.dimension, POISSONS_RATIO[self.state]
        gradient = self.displacement_gradients()
        strain = 0.5 * (gradient + gradient.swapaxes(1, 2))
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        for first, last, law in laws:
            G = law.youngs_modulus / (2.0 * (1.0 + nu))
            lame = 2.0 * G * nu / (1.0 - nu if self.state == "plane-stress" else 1.0 - 2.0 * nu)
            result[first:last, :d, :d] = 2.0 * G * strain[first:last]
            result[first:last] += lame * trace[first:last]
        if self.state in ("plane-stress", "bar"):
            result[:, 2, 2] = 0.0
        return result


class BondBasedHistory(ViscoelasticHistory):
    """A history of nothing, with the energy of the bonds."""

    def stored_energy(self) -> float:
        """Energy [J] of the bonds."""
        return self.engine.stored_energy()
