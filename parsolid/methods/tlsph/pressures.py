"""Pressures of nearly incompressible bodies from meshes, as unknowns of equilibria beside the displacement.

A pressure at every node that follows from its own volume has too many waves: those from node to node resist motions
that change no volume of the elements. With the pressures p of particles as unknowns, j = J - 1, and C, which takes from
a pressure its means over elements, equilibrium is where

    E(u, p) = sum_a V_a [W(F_a) - k j_a^2/2 + p_a j_a - p_a^2/(2 k)] - p.C p/2

is stationary. k is the law's first Lame constant: without C the pressure is k j and the body that of its law, whatever
that is. p.C p/2 is of fourth order in the spacing where p is smooth, zero where it is even, and limits the stiffness
against rough changes of volume to about that against shear (C. R. Dohrmann, P. B. Bochev, Int. J. Numer. Meth. Fluids
46 (2004) 183). Of simplices, with m_ab = int N_a N_b,

    (C p)_a = sum_b c_ab (p_a - p_b),   c_ab = m_ab/((d + 1) mu)

In motion the difference p - k j of the last equilibrium stays, as a part of the law: then the forces are the same.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.methods.tlsph.tangent import Volumes
from parsolid.particles.declaration import Columns, Field
from parsolid.solvers.conjugate_gradients import conjugate_gradients

# p [Pa], and k [Pa] that the law does without: what a tile adds to P is (p - k (J - 1)) H
FIELDS = ("pressure_unknown", "released_modulus")
# energy [J/m^3] beside that of W and of p j - k j^2/2
_REST = "pressure_energy"
# Poisson's ratio beyond which pressures are unknowns, and its ratio of Lame's first to the shear modulus
STIFF = 0.45
_RATIO = 2.0 * STIFF / (1.0 - 2.0 * STIFF) * (1.0 + 1e-9)

# of what is not balanced, what is left where pressures follow from a deformation
_BALANCED = 1e-13


def nearly_incompressible(law: Any) -> bool:
    """Whether volumes of a law are so stiff that pressures are unknowns."""
    shear, lame = elastic_moduli(law)
    return bool(lame > _RATIO * shear)


class Pressures:
    """The pressures of one rank's particles; all methods are collective.

    Vectors (owned,) are 0 at particles of other bodies. free (owned,): those with pressures as unknowns; scale (owned,)
    [Pa/m]: of pressures over the lengths that stand for them among the unknowns, so that both have forces of one size;
    diagonal (owned,) [N/m]: about that of the pressures' own stiffness with the one that displacements give them.
    """

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH` with meshes, of which some are nearly incompressible."""
        from scipy import sparse

        self.system, self.particles = system, system.particles
        self.free = np.zeros(system.owned, bool)
        self.lame, shear = np.zeros(system.owned), np.ones(system.owned)
        for block in system.meshes.blocks:
            own = slice(block.first, block.last)
            self.free[own] = nearly_incompressible(block.law)
            if self.free[block.first]:
                shear[own], self.lame[own] = elastic_moduli(block.law)
        role: dict[str, Any] = {"checkpointed": True, "layout": Columns()}
        for name in (*FIELDS, _REST):
            self.particles.declare(Field(name, 1, "J/m^3" if name == _REST else "Pa", **role))
        self.volume = np.where(self.free, self.particles.owned_rows("volume"), 0.0)
        # 1/k, of particles that have one
        self.compliance = np.divide(1.0, self.lame, out=np.zeros(system.owned), where=self.free)
        d, near = system.dimension, system.meshes.near
        self.scale = np.where(self.free, shear / self.particles.owned_rows("volume") ** (1.0 / d), 0.0)
        self.diagonal = self.scale**2 * self.volume * (1.0 / shear + self.compliance)
        self._halo, entries = near.halo, []
        for rows, pairs, overlap in zip(near.rows_of_pairs, near.lists, near.overlap):
            weight = np.where(self.free[rows], overlap / ((d + 1) * shear[rows]), 0.0)
            for a, b in ((rows, pairs.neighbour), (pairs.neighbour, rows)):
                entries += [(weight, a, a), (-weight, a, b)]
        values, row, column = (np.concatenate(one) for one in zip(*entries))
        self._C = sparse.coo_array((values, (row, column)), (near.rows, near.rows)).tocsr()[: near.owned]

    def precondition(self, residual: np.ndarray) -> np.ndarray:
        """About what lengths (owned,) [m] balance a residual (owned,) [N]."""
        return np.divide(residual, self.diagonal, out=np.zeros(len(residual)), where=self.free)

    def unknowns(self) -> np.ndarray:
        """Lengths (owned,) [m] of the present pressures."""
        return np.divide(self._of(FIELDS[0]), self.scale, out=np.zeros(len(self.free)), where=self.free)

    def set(self, unknowns: np.ndarray) -> None:
        """Take pressures for the next deformation."""
        self._of(FIELDS[0])[:] = self.scale * unknowns

    def complied(self, p: np.ndarray) -> np.ndarray:
        """V p/k + C p (owned,) [m^3] of pressures (owned,) [Pa]; collective."""
        result = self.volume * self.compliance * p
        result[: self._C.shape[0]] += self._C @ self._halo.with_ghosts(p[: self._C.shape[0]])
        return result

    def residual(self, unknowns: np.ndarray, jacobian: np.ndarray) -> np.ndarray:
        """-dE/dp (owned,) [N], over lengths, of unknowns (owned,) [m] and J (owned,)."""
        return -self.scale * (self.volume * (jacobian - 1.0) - self.complied(self.scale * unknowns))

    def settle(self) -> None:
        """Find the energy of the present state."""
        p = self._of(FIELDS[0])
        rest = np.divide(-0.5 * p * self.complied(p), self.volume, out=np.zeros(len(p)), where=self.free)
        self._of(_REST)[:] = rest

    def energy(self) -> float:
        """That of E [J] of this rank's particles beside W."""
        p, k, rest = (self._of(name) for name in (*FIELDS, _REST))
        j = self._of("jacobian") - 1.0
        return float(self.volume @ (p * j - 0.5 * k * j * j + rest))

    def release(self, balance: bool) -> float:
        """Pressures of the present deformation become unknowns; the energy [J] that this rank's lose. balance: whether
        they are to be those of this deformation at once, as where it goes on to move. Collective."""
        before, p, j = self.energy(), self._of(FIELDS[0]), self._of("jacobian") - 1.0
        p += (self.lame - self._of(FIELDS[1])) * j
        self._of(FIELDS[1])[:] = self.lame
        if balance:
            # the pressures by which these volumes [m^3] comply are added
            volumes = self.volume * j - self.complied(p)
            diagonal = self.volume * self.compliance + np.pad(self._C.diagonal(), (0, len(volumes) - self._C.shape[0]))
            over = np.divide(1.0, diagonal, out=np.zeros(len(volumes)), where=self.free)[:, None]

            def product(p: np.ndarray, out: np.ndarray) -> None:
                out[:, 0] = self.complied(p[:, 0])

            target = _BALANCED * float(np.sqrt(sums(self.system.comm, [np.vdot(volumes, volumes)])[0]))
            found = conjugate_gradients(
                self.system.comm, product, volumes[:, None], target, precondition=lambda r: over * r
            )
            p += found.value[:, 0]
        self.settle()
        return before - self.energy()

    def hold(self) -> None:
        """What pressures have beyond those of the law becomes a part of it."""
        j, k = self._of("jacobian") - 1.0, self._of(FIELDS[1])
        self._of(FIELDS[0])[:] -= k * j
        self._of(_REST)[:] += 0.5 * k * j * j
        k[:] = 0.0

    def stresses(self, first: int, last: int, F: np.ndarray) -> np.ndarray:
        """What they add to first Piola-Kirchhoff stresses (last - first, 3, 3) [Pa] at F."""
        p, k = (self._of(name)[first:last] for name in FIELDS)
        J = np.linalg.det(F)
        return np.asarray(((p - k * (J - 1.0)) * J)[:, None, None] * np.linalg.inv(F).swapaxes(1, 2))

    def linearise(self, moduli: np.ndarray, index: np.ndarray) -> None:
        """Add to the laws' moduli (entries, owned) [Pa] those of the present pressures, see `tangent.packed`, and find
        H of the present deformation."""
        d, rows = self.system.dimension, self.free
        F = self.particles.owned_rows("deformation_gradient").reshape(-1, d, d)
        J = np.linalg.det(F)
        H = J[:, None, None] * np.linalg.inv(F).swapaxes(1, 2)
        part = np.where(rows, self._of(FIELDS[0]) - self.lame * (J - 1.0), 0.0)
        self._H = np.ascontiguousarray(np.where(rows[:, None], H.reshape(-1, d * d), 0.0).T)
        # dH_iJ/dF_kL = (H_iJ H_kL - H_iL H_kJ)/J
        for a in range(d * d):
            for b in range(a, d * d):
                (i, K), (m, L) = divmod(a, d), divmod(b, d)
                product = H[:, i, K] * H[:, m, L]
                change = part / J * (product - H[:, i, L] * H[:, m, K])
                moduli[index[a, b]] += np.where(rows, change - self.lame * product, 0.0)

    def product(self, tangent: Any, change: np.ndarray) -> np.ndarray:
        """K (owned, d + 1) [N] of changes (owned, d + 1) [m] of displacements and pressures, at the state that was
        linearised."""
        p = self.scale * change[:, -1]
        volumes = Volumes(self._H, p, np.zeros(len(p)))
        force = tangent.product(np.ascontiguousarray(change[:, :-1]), None, volumes)
        return np.column_stack((force, self.scale * (self.volume * volumes.strain - self.complied(p))))

    def _of(self, name: str) -> np.ndarray:
        """A field (owned,)."""
        return np.asarray(self.particles.owned_rows(name))


def pressures_of(system: Any) -> Pressures | None:
    """Those of a system, None where no body with the weights of its mesh is nearly incompressible."""
    of_meshes = [law for law, kind in zip(system.laws, system.body_weights) if kind == "mesh"]
    return Pressures(system) if any(map(nearly_incompressible, of_meshes)) else None
