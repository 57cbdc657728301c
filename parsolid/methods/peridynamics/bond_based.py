"""Forces of the bond-based law (prototype microelastic brittle), on the bonds of the correspondence method.

The ends of a bond of stretch s = (|y| - |xi|)/|xi| pull each other with w_ab c s y/|y| [N], and the bond stores
w_ab c s^2 |xi|/2 [J], where w_ab = w(|xi|) V_a V_b and c is the micromodulus, the mean of both ends'. Source: Silling
and Askari, Comput. Struct. 83 (2005), eqs (8) to (10).
"""

from typing import Any

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.damage.bond_based import POISSONS_RATIO, micromodulus
from parsolid.methods.peridynamics.bond_damage import BondDamage, Failing
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.correspondence import BondForces, pushed_forward
from parsolid.methods.peridynamics.sweeps import Lists, bond_vectors, part_of
from parsolid.particles.declaration import Field


class BondBasedForces(BondForces):
    """Forces of bodies whose laws are all bond-based: without memory, and without control."""

    def __init__(self, bonds: Bonds, blocks: list[Any], settings: Any, fixed: np.ndarray) -> None:
        """settings: `settings.Peridynamics`; blocks, fixed: see `BondForces`. Collective."""
        super().__init__(bonds, blocks, fixed)
        self.state = settings.state(self.d)
        modulus = np.zeros(self.owned)
        for first, last, law in self.laws:
            rows = slice(first, last)
            modulus[rows] = micromodulus(law.youngs_modulus, self.state, settings.influence, bonds.horizon[rows])
        told: dict[str, Any] = {"ghosts": "forward", "message": "stiffness"}
        self.particles.declare(Field("micromodulus", 1, "N/m^6", **told), modulus)
        self.particles.update("stiffness")

    def internal_force(self, step: float) -> np.ndarray:
        """Force (owned, d) [N] of the displacement of the particles, whatever the step [s]."""
        return self.store(self._add_forces("displacement", "motion", False))

    def stiffness_force(self, laws: Any, change: np.ndarray, step: float) -> np.ndarray:
        """Force (owned, 4) [N] to first order in a displacement (owned, d) [m] of the undeformed body."""
        self.particles.owned_rows("trial_displacement")[:] = change
        return self._add_forces("trial_displacement", "trial", True)

    def _add_forces(self, field: str, message: str, linear: bool) -> np.ndarray:
        self.evaluations += 1
        force, bonds, micromodulus = self.rows, self.bonds, self.particles["micromodulus"]
        force[:] = 0.0
        bonds.fill(field, 0, self.owned)
        self.particles.send(message)
        motion = bonds.motion_of(field)
        add_bond_forces(bonds.inner, None, True, self.plane, linear, motion, micromodulus, force)
        self.particles.receive(message)
        bonds.fill(field, self.owned, len(bonds.positions))
        for pairs, images, mutual in bonds.lists[1:]:
            add_bond_forces(pairs, images, mutual, self.plane, linear, motion, micromodulus, force)
        return force

    def commit(self, step: float) -> float:
        """Nothing dissipates."""
        return 0.0

    def start(self, instantaneous: bool) -> None:
        """Forces of the displacement at time 0."""
        self.internal_force(0.0)

    def resume(self) -> None:
        """Forces of a state that was put back."""
        self.internal_force(0.0)

    def evaluate_anew(self) -> None:
        """Forces of the state of another run."""
        self.internal_force(0.0)

    def break_bonds(self, damage: BondDamage, failing: Failing | None) -> float:
        """Break bonds of this rank, found at the displacement of the last evaluation; the energy [J] they stored."""
        if failing is None:
            return 0.0
        gone = [part_of(one, rows) for one, rows in zip(self.bonds.lists, failing.rows)]
        motion, micromodulus, force = self.bonds.motion_of("displacement"), self.particles["micromodulus"], self.rows
        force[:] = 0.0
        for pairs, images, mutual in gone:
            add_bond_forces(pairs, images, mutual, self.plane, False, motion, micromodulus, force)
        self.force[:] -= force[:, : self.d]
        damage.cut(failing)
        return self._energy(gone)

    def factor(self, step: float) -> np.ndarray:
        """1 (owned,), as nothing relaxes."""
        return np.ones(self.owned)

    def stored_energy(self) -> float:
        """Energy [J] of the bonds at the displacement of the last evaluation."""
        self.bonds.fill("displacement", 0, len(self.bonds.positions))
        return self._energy(self.bonds.lists)

    def _energy(self, lists: Lists) -> float:
        given = self.plane, self.bonds.motion_of("displacement"), self.particles["micromodulus"], self.share
        return sum(bond_energy(pairs, images, mutual, *given) for pairs, images, mutual in lists)

    def cauchy_stresses(self, F: np.ndarray) -> np.ndarray:
        """sigma (owned, 3, 3) [Pa] at the last evaluation; F (owned, 3, 3): its deformation gradients.

        Before it is pushed forward it is the stress of the classical solid with the same constants at small strain.
        """
        d, nu, result = self.d, POISSONS_RATIO[self.state], np.zeros((self.owned, 3, 3))
        strain = 0.5 * (F + F.swapaxes(1, 2)) - np.eye(3)
        trace = np.trace(strain, axis1=1, axis2=2)[:, None, None] * np.eye(3)
        for first, last, law in self.laws:
            G = law.youngs_modulus / (2.0 * (1.0 + nu))
            lame = 2.0 * G * nu / (1.0 - nu if self.state == "plane-stress" else 1.0 - 2.0 * nu)
            result[first:last, :d, :d] = 2.0 * G * strain[first:last, :d, :d]
            result[first:last] += lame * trace[first:last]
        if self.state in ("plane-stress", "bar"):
            result[:, 2, 2] = 0.0
        return pushed_forward(result, F)


@inlined
def length(x):
    """|x|."""
    return (x[0] * x[0] + x[1] * x[1] + x[2] * x[2]) ** 0.5


@kernel
def add_bond_forces(bonds, images, mutual, plane, linear, motion, micromodulus, force):
    """Add the forces [N] of a list's bonds, or with `linear` those to first order in the field of the motion.

    micromodulus (n,); force (owned, 4) [N].
    """
    for a in range(bonds.start.shape[0] - 1):
        f0, f1, f2 = 0.0, 0.0, 0.0
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            x, u = bond_vectors(plane, motion, images, k, a, b)
            reference = length(x)
            if linear:
                y, s = x, (x[0] * u[0] + x[1] * u[1] + x[2] * u[2]) / (reference * reference * reference)
            else:
                y = (x[0] + u[0], x[1] + u[1], x[2] + u[2])
                s = (length(y) - reference) / (reference * length(y))
            s *= 0.5 * bonds.weight[k] * (micromodulus[a] + micromodulus[b])
            f0, f1, f2 = f0 + s * y[0], f1 + s * y[1], f2 + s * y[2]
            if mutual is not None:
                force[b, 0] -= s * y[0]
                force[b, 1] -= s * y[1]
                force[b, 2] -= s * y[2]
        force[a, 0] += f0
        force[a, 1] += f1
        force[a, 2] += f2


@kernel
def bond_energy(bonds, images, mutual, plane, motion, micromodulus, share):
    """Energy [J] of a list's bonds, half for each end that receives, times that particle's share (owned,)."""
    total = 0.0
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            x, u = bond_vectors(plane, motion, images, k, a, b)
            reference = length(x)
            stretch = (length((x[0] + u[0], x[1] + u[1], x[2] + u[2])) - reference) / reference
            parts = share[a] + (share[b] if mutual is not None else 0.0)
            modulus = micromodulus[a] + micromodulus[b]
            total += 0.125 * parts * bonds.weight[k] * modulus * stretch * stretch * reference
    return total
