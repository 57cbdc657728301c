"""The two passes of correspondence peridynamics on one rank: from displacements to forces."""

from typing import Any

import numpy as np

from decomposition.recalled import RecalledEach
from parsolid.methods.peridynamics.correspondence import BondedBody, relaxing_records, stresses
from parsolid.numerics.lanes import aligned_zeros
from parsolid.pairs.lattice_sums import LatticeSums, lattice_sums
from parsolid.pairs.pair_system import PairSystem
from parsolid.pairs.passes import Vector
from parsolid.pairs.terms import KINEMATICS, AlongBonds, ShearScaled, matrix_columns, record_columns
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Within

SYMMETRIC_ROWS = {2: ((0, 0), (1, 1), (1, 0)), 3: ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))}


class BondForce:
    """Internal forces of a field f, the relaxing displacement, and of a displacement u; d = 2 for bars, too.

    field, displacement (rows, d) [m], force (rows, 4) [N]: views of the particles' fields, the force of the last
    evaluation, of the whole particle where it lies on a mirror plane. evaluations: so many of the forces so far. sound:
    whether every settled Jacobian is positive; at small strain there is none to look at.
    stored [J]: energy of histories of its own.
    passes: over the bonds.
    stiffens: whether stiffness depends on the state; growth: bound of the largest to come over that at rest.
    """

    sound = True
    stiffens, growth, stored = False, 1.0, 0.0

    def __init__(
        self, particles: Particles, bond_system: PairSystem, scale: np.ndarray | None, fixed_planes: np.ndarray
    ) -> None:
        """scale (owned,): coefficient times shear modulus [Pa] of `ShearScaled`, c of `AlongBonds`, else None.

        bond_system: with all bonds whole; fixed_planes (owned, d) bool: normals of the fixed planes a particle lies on.
        Collective.
        """
        self.particles, self.bond_system, self.stabiliser = particles, bond_system, bond_system.terms
        self.owned, self.space, self.dimension = particles.owned, bond_system.space, bond_system.space.dimension
        self.columns, self.record_columns = KINEMATICS[self.dimension], record_columns(self.space, self.stabiliser)
        self.passes: PairSystem | LatticeSums = bond_system
        self.evaluations, self._put_records = 0, RecalledEach(relaxing_records)
        self.projection = self._projection(fixed_planes)
        # rows that tell nothing in the next divergences; records are made four at a time, over the end of a law's rows
        self.silent: tuple[np.ndarray, slice] | None = None
        if scale is not None:
            self._declare_stiffness(scale)

    def stay_whole(self) -> None:
        """From now on no bond breaks: passes may do without their list."""
        self.passes = lattice_sums(self.bond_system) or self.bond_system

    def _declare_stiffness(self, scale: np.ndarray) -> None:
        """C1 or c, for the particle itself and in its record, where it stays."""
        particles, columns, d = self.particles, self.record_columns, self.dimension
        told: dict[str, Any] = {"ghosts": "forward", "message": "stiffness"}
        if isinstance(self.stabiliser, AlongBonds):
            particles.declare(Field("stiffness", 1, "N/m^6", layout=Columns()), scale)
            lanes = Field(
                "stiffness_record",
                columns.width - columns.modulus,
                "N/m^6",
                layout=Within("record", columns.modulus),
                **told,
            )
            particles.declare(lanes, scale[:, None])
        elif isinstance(self.stabiliser, ShearScaled):
            C = self.control_matrices(scale)
            upper = [C[:, i, j] for i, j in SYMMETRIC_ROWS[d]]
            particles.declare(Field("stiffness", len(upper), "Pa/m^2", layout=Columns()), np.stack(upper, axis=1))
            whole = np.zeros((self.owned, d, matrix_columns(d) // d))
            whole[:, :, :d] = C.swapaxes(1, 2)
            kept = Field(
                "stiffness_record", matrix_columns(d), "Pa/m^2", layout=Within("record", columns.stiffness), **told
            )
            particles.declare(kept, whole.reshape(self.owned, -1))
        particles.update("stiffness")

    def control_matrices(self, scale: np.ndarray) -> np.ndarray:
        """C1 = coefficient G (tr K^-1 I + 2 K^-1) (owned, d, d) of `ShearScaled`, with all bonds whole."""
        K = self.bond_system.weights.initial_inverse_shape
        return scale[:, None, None] * (np.trace(K, axis1=1, axis2=2)[:, None, None] * np.eye(self.dimension) + 2.0 * K)

    # --- fields, as kernels take them ---------------------------------------------------------------------------

    @property
    def kinematics(self) -> np.ndarray:
        """f u X of `pairs.passes`, ghosts behind."""
        return self.particles.storage("kinematics")

    @property
    def field(self) -> np.ndarray:
        """The field f (rows, d) [m] that drives stress and stabiliser."""
        return self.particles.kept(("driving field",), lambda: self.kinematics[:, : self.dimension])

    @property
    def displacement(self) -> np.ndarray:
        """The displacement u (rows, d) [m]."""
        at = self.columns.position
        return self.particles.kept(("moved",), lambda: self.kinematics[:, at : at + self.dimension])

    @property
    def record(self) -> np.ndarray:
        """What particles tell their neighbours, see `pairs.terms`."""
        return self.particles.storage("record")

    @property
    def force(self) -> np.ndarray:
        """Force (rows, 4) [N] of the last evaluation."""
        return self.particles.storage("pair_force")

    @property
    def body(self) -> BondedBody:
        """What kernels know of the particles."""
        return self.particles.kept(("bonded body",), self._body)

    def _body(self) -> BondedBody:
        stiffness = self.particles.storage("stiffness") if "stiffness" in self.particles else None
        return BondedBody(self.particles.storage("correction"), stiffness, self.particles.storage("pair_volume"))

    def install_shape(self) -> None:
        """Take over the shape tensors of the bonds that are left."""
        inverse = self.bond_system.weights.inverse_shape
        self.particles.owned_rows("correction")[:] = inverse.reshape(self.owned, -1)

    # --- histories of its own, which small strain has not ---------------------------------------------------------

    def prepare(self, step: float) -> None:
        """The next evaluations are of the end of a step [s] from the settled states."""

    def settle(self) -> float:
        """Take the histories through the step; the energy dissipated [J]."""
        return 0.0

    def relax_fully(self) -> None:
        """Let the histories relax."""

    # --- passes ------------------------------------------------------------------------------------------------

    def evaluate(self, laws: Any) -> np.ndarray:
        """Force (owned, d) [N] of the field f by small-strain laws that relax alike; laws: (first, last, law) each."""
        self.evaluations += 1
        sums = self.field_gradient()
        for first, last, law in laws:
            self._put_records(first, self.space, first, last, law, self.stabiliser, self.body, sums, self.record)
        return self.divergence(self.stabiliser)

    def evaluate_linear(self, laws: Any) -> np.ndarray:
        """What of the force (owned, d) [N] is linear in the field f, of the laws' particles: all of it."""
        return BondForce.evaluate(self, laws)

    def combine(self, laws: Any, linear: np.ndarray) -> np.ndarray:
        """The whole force (owned, d) [N] of the displacement u, from what is linear in fields."""
        self.owned_force[:] = linear
        return self.owned_force

    def evaluate_stiffness(self, laws: Any) -> np.ndarray:
        """Force (owned, d) [N] that is linear in the field f, by the laws of a stiffness (see
        `operator.algorithmic_law`).
        """
        return BondForce.evaluate(self, laws)

    def field_gradient(self) -> np.ndarray:
        """sum w V V (f_b - f_a) (x) xi, after f and u have been sent to ghosts."""
        sums = self.particles.storage("pair_sums")
        sums[:] = 0.0
        return self.passes.gradient("motion")

    def displacement_gradient(self, message: str | None, sums: np.ndarray) -> np.ndarray:
        """sum w V V (u_b - u_a) (x) xi into sums; message: "motion" where ghosts do not know u yet."""
        sums[:] = 0.0
        return self.passes.gradient(message, (Vector(self.columns.position),), sums)

    def divergence(self, terms: Any) -> np.ndarray:
        """Force (owned, d) [N] of the records, with a stabiliser or None."""
        if self.silent is not None:
            self.record[self.silent] = 0.0
        if self.projection is not None:
            particles, factors = self.projection
            self.record[particles, : factors.shape[1]] *= factors
        self.force[:] = 0.0
        self.passes.divergence(terms)
        return self.owned_force

    @property
    def owned_force(self) -> np.ndarray:
        """Force (owned, d) [N] of the last evaluation."""
        return self.particles.kept(("owned force",), lambda: self.force[: self.owned, : self.dimension])

    @property
    def linear_force(self) -> np.ndarray:
        """What of the last force (owned, d) [N] is linear in the field f: all of it."""
        return self.owned_force

    def of_stress(self, stress: np.ndarray) -> np.ndarray:
        """Force (owned, d) [N] of given stresses (owned, d, d) [Pa], without a stabiliser; what balances a consistent
        load.
        """
        d, width = self.dimension, matrix_columns(self.dimension) // self.dimension
        S = stress @ self.bond_system.weights.inverse_shape
        for j in range(d):
            self.record[: self.owned, j * width : j * width + d] = S[:, :, j]
        return self.divergence(None)

    def _projection(self, fixed_planes: np.ndarray) -> Any:
        """(particles, factors): what is left of M of a particle on a fixed plane, (M + Q M R)/2 with Q = -1."""
        if not fixed_planes.any():
            return None
        particles = np.flatnonzero(fixed_planes.any(axis=1))
        factors = np.ones((len(particles), self.dimension))
        for axis in range(self.dimension):
            on = fixed_planes[particles, axis]
            others = np.arange(self.dimension) != axis
            factors[np.ix_(on, others)] = 0.0
        return particles, np.repeat(factors, matrix_columns(self.dimension) // self.dimension, axis=1)

    # --- what the output and the reports ask -------------------------------------------------------------------

    def displacement_gradients(self) -> np.ndarray:
        """grad u (owned, d, d) with the ghosts' displacements of the last evaluation."""
        sums = self.displacement_gradient(None, aligned_zeros(self.particles.storage("pair_sums").shape))
        columns = sums[: self.owned].reshape(self.owned, self.dimension, -1)[:, :, : self.dimension].swapaxes(1, 2)
        return columns @ self.bond_system.weights.inverse_shape / self.bond_system.volume[: self.owned, None, None]

    def cauchy_stresses(self, laws: Any, first: int, last: int, F: np.ndarray) -> np.ndarray:
        """sigma (n, 3, 3) [Pa] of particles first..last-1 at the last evaluation's fields; F (n, 3, 3): their
        deformation gradients.
        """
        result = np.zeros((self.owned, 3, 3))
        for begin, end, law in laws:
            stresses(self.space, begin, end, law, self.body, self.particles.storage("pair_sums"), result)
        return result[first:last]

    def arrays(self) -> list[np.ndarray]:
        """What counts as memory besides lists and particles."""
        return self.passes.arrays() if isinstance(self.passes, LatticeSums) else []

    def bytes_sent(self) -> int:
        """Bytes this rank sends in one evaluation."""
        return self.particles.bytes_sent("motion") + self.particles.bytes_sent("record")


def pushed_forward(P: np.ndarray, F: np.ndarray) -> np.ndarray:
    """sigma = P F^T / J (n, 3, 3) [Pa]."""
    return P @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]
