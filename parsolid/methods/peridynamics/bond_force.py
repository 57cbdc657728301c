"""The two passes of correspondence peridynamics on one rank, with their halo exchanges."""

import time as clock

import numpy as np

from parsolid.methods.peridynamics.bond_system import BondSystem
from parsolid.methods.peridynamics.correspondence import BondedBody, relaxing_records, stresses
from parsolid.numerics import layout
from parsolid.numerics.lanes import aligned_zeros, padded
from parsolid.pairs import layout as pairs
from parsolid.pairs import passes_plane as pairs_plane
from parsolid.pairs import passes_space as pairs_space
from parsolid.pairs.layout import AlongBonds, ShearScaled

PASSES = {2: pairs_plane, 3: pairs_space}
SYMMETRIC_ROWS = {2: ((0, 0), (1, 1), (1, 0)), 3: ((0, 0), (1, 1), (2, 2), (1, 0), (2, 0), (2, 1))}


class BondForce:
    """Internal forces of a field f and a displacement u; d = 2 for bars, too.

    kinematics (rows, 8 or 12): f u X of `pairs.layout`, ghosts behind; field, displacement: views (rows, d) of it.
    force (capacity, 4) [N]: of the last evaluation, of the whole particle where it lies on a mirror plane.
    evaluations: so many of the forces so far.
    sound: whether every settled Jacobian is positive; at small strain there is none to look at.
    """

    sound = True

    def __init__(
        self,
        bond_system: BondSystem,
        stabiliser,
        stiffness_scale: np.ndarray | None,
        fixed_planes: np.ndarray | None = None,
    ):
        """stiffness_scale (owned,): coefficient times shear modulus [Pa] of `ShearScaled`, c of `AlongBonds`, else None.

        fixed_planes (owned, d) bool: normals of the fixed planes a particle lies on.
        """
        self.bond_system, self.stabiliser = bond_system, stabiliser
        self.communication_seconds, self.evaluations = 0.0, 0
        owned, d = bond_system.owned, bond_system.positions.shape[1]
        self.owned, self.dimension = owned, d
        self.space, self.passes = layout.LAYOUT[d], PASSES[d]
        rows, capacity = padded(len(bond_system.positions)) + 4, padded(owned) + 4
        self.kinematics = aligned_zeros((rows, pairs.KINEMATICS_WIDTH[d]))
        place = 4 if d == 3 else 2
        self.displacement_column = place
        self.field = self.kinematics[:, :d]
        self.displacement = self.kinematics[:, place : place + d]
        self.kinematics[: len(bond_system.positions), 2 * place : 2 * place + d] = bond_system.positions
        self.record = aligned_zeros((rows, pairs.bond_record_width(d, stabiliser)))
        self.gradient = aligned_zeros((capacity, pairs.GRADIENT_WIDTH[d]))
        self.force = aligned_zeros((capacity, 4))
        self.body = self._body(stiffness_scale, capacity)
        self.install_shape()
        self.projection = self._projection(fixed_planes)
        matrix = pairs.GRADIENT_WIDTH[d]
        changing = self.record[:, : 2 * matrix] if isinstance(stabiliser, AlongBonds) else self.record[:, :matrix]
        self.field_exchange = bond_system.halo.exchange([self.field, self.displacement])
        self.record_exchange = bond_system.halo.exchange([changing])

    def _body(self, scale, capacity) -> BondedBody:
        d, owned = self.dimension, self.owned
        inverse = aligned_zeros((layout.CORRECTION_ROWS[d], capacity))
        volume = np.ones((1, capacity))
        volume[0, :owned] = self.bond_system.volume[:owned]
        stiffness = None
        matrix = pairs.GRADIENT_WIDTH[d]
        if isinstance(self.stabiliser, ShearScaled):
            # C1 = coefficient G (tr K^-1 I + 2 K^-1) with all bonds whole
            K = self.bond_system.initial_inverse_shape
            C = scale[:, None, None] * (np.trace(K, axis1=1, axis2=2)[:, None, None] * np.eye(d) + 2.0 * K)
            stiffness = aligned_zeros((len(SYMMETRIC_ROWS[d]), capacity))
            for row, (i, j) in enumerate(SYMMETRIC_ROWS[d]):
                stiffness[row, :owned] = C[:, i, j]
            for j in range(d):
                column = matrix + j * matrix // d
                self.record[:owned, column : column + d] = C[:, :, j]
        elif isinstance(self.stabiliser, AlongBonds):
            stiffness = aligned_zeros((1, capacity))
            stiffness[0, :owned] = scale
            self.record[:owned, 2 * matrix :] = scale[:, None]
        self.bond_system.halo.update([self.record])
        return BondedBody(inverse, stiffness, volume)

    def install_shape(self) -> None:
        """Take over the shape tensors of the bond_system, as they are at the start or after bonds have broken."""
        self.body.inverse_shape[:, : self.owned] = self.bond_system.inverse_shape.reshape(self.owned, -1).T

    def accompany(self, arrays: list[np.ndarray]) -> None:
        """Send arrays (rows, ...) to the ghosts together with the field from now on; collective."""
        self.field_exchange.free()
        self.field_exchange = self.bond_system.halo.exchange([self.field, *arrays])

    def _projection(self, fixed_planes):
        """(particles, factors): what is left of M of a particle on a fixed plane, (M + Q M R)/2 with Q = -1."""
        if fixed_planes is None or not fixed_planes.any():
            return None
        particles = np.flatnonzero(fixed_planes.any(axis=1))
        factors = np.ones((len(particles), self.dimension))
        for axis in range(self.dimension):
            on = fixed_planes[particles, axis]
            others = np.arange(self.dimension) != axis
            factors[np.ix_(on, others)] = 0.0
        width = pairs.GRADIENT_WIDTH[self.dimension] // self.dimension
        return particles, np.repeat(factors, width, axis=1)

    # --- passes ------------------------------------------------------------------------------------------------

    def timed(self, communicate) -> None:
        """Send or receive, and count the seconds it takes."""
        began = clock.perf_counter()
        communicate()
        self.communication_seconds += clock.perf_counter() - began

    def _lists(self):
        """(pairs, images) of the one-sided lists."""
        bond_system = self.bond_system
        if bond_system.rim is not None:
            yield bond_system.rim, None
        if bond_system.mirror is not None:
            yield bond_system.mirror, bond_system.images

    def pass_gradient(self, column: int = 0, exchange=None, gradient: np.ndarray | None = None) -> np.ndarray:
        """sum w V V (f_b - f_a) (x) xi of the vector in a column of kinematics, into `gradient`."""
        result = self.gradient if gradient is None else gradient
        result[:] = 0.0
        self.timed((exchange or self.field_exchange).start)
        self.passes.add_gradients(0, self.owned, self.bond_system.inner, None, True, column, self.kinematics, result)
        self.timed((exchange or self.field_exchange).finish)
        for bonds, images in self._lists():
            self.passes.add_gradients(0, self.owned, bonds, images, None, column, self.kinematics, result)
        return result

    def pass_force(self, stabiliser="own") -> None:
        """Forces of the records, into `force`."""
        if self.projection is not None:
            particles, factors = self.projection
            self.record[particles, : factors.shape[1]] *= factors
        self.force[:] = 0.0
        choices = (
            self.stabiliser if stabiliser == "own" else stabiliser,
            None,
            None,
            None,
            self.kinematics,
            self.record,
            self.force,
        )
        self.timed(self.record_exchange.start)
        self.passes.add_forces(0, self.owned, self.bond_system.inner, None, True, *choices)
        self.timed(self.record_exchange.finish)
        for bonds, images in self._lists():
            self.passes.add_forces(0, self.owned, bonds, images, None, *choices)

    @property
    def linear_force(self) -> np.ndarray:
        """What of the last force (owned, d) [N] is linear in the field f: all of it."""
        return self.force[: self.owned, : self.dimension]

    def evaluate(self, laws) -> np.ndarray:
        """Force (owned, d) [N] of the field f by small-strain laws that relax alike; laws: (first, last, law) each."""
        self.evaluations += 1
        self.pass_gradient()
        for first, last, law in laws:
            relaxing_records(self.space, first, last, law, self.stabiliser, self.body, self.gradient, self.record)
        self.pass_force()
        return self.force[: self.owned, : self.dimension]

    def of_stress(self, stress: np.ndarray) -> np.ndarray:
        """Force (owned, d) [N] of given stresses (owned, d, d) [Pa], without a stabiliser; what balances a consistent load."""
        d, width = self.dimension, pairs.GRADIENT_WIDTH[self.dimension] // self.dimension
        S = stress @ self.bond_system.inverse_shape
        for j in range(d):
            self.record[: self.owned, j * width : j * width + d] = S[:, :, j]
        self.pass_force(stabiliser=None)
        return self.force[: self.owned, :d]

    # --- what the output and the reports ask -------------------------------------------------------------------

    def displacement_gradients(self) -> np.ndarray:
        """grad u (owned, d, d) with the ghosts' displacements of the last evaluation."""
        sums = aligned_zeros(self.gradient.shape)
        self.passes.add_gradients(
            0, self.owned, self.bond_system.inner, None, True, self.displacement_column, self.kinematics, sums
        )
        for bonds, images in self._lists():
            self.passes.add_gradients(
                0, self.owned, bonds, images, None, self.displacement_column, self.kinematics, sums
            )
        columns = sums[: self.owned].reshape(self.owned, self.dimension, -1)[:, :, : self.dimension].swapaxes(1, 2)
        return columns @ self.bond_system.inverse_shape / self.bond_system.volume[: self.owned, None, None]

    def cauchy_stresses(self, laws, first: int, last: int, F: np.ndarray) -> np.ndarray:
        """sigma (n, 3, 3) [Pa] of particles first..last-1 at the last evaluation's fields; F (n, 3, 3): their deformation gradients."""
        result = np.zeros((self.owned, 3, 3))
        for begin, end, law in laws:
            stresses(self.space, begin, end, law, self.body, self.gradient, result)
        return result[first:last]

    def declare(self, table) -> None:
        """No fields beside the method's own."""

    def arrays(self) -> list[np.ndarray]:
        """Work arrays and bond lists."""
        arrays = [self.kinematics, self.record, self.gradient, self.force]
        arrays += [array for array in self.body if array is not None]
        for bonds in (self.bond_system.inner, self.bond_system.rim, self.bond_system.mirror):
            arrays += list(bonds or ())
        return arrays

    def bytes_sent(self) -> int:
        """Bytes this rank sends in one evaluation."""
        return self.field_exchange.bytes_sent + self.record_exchange.bytes_sent

    def warm(self) -> None:
        """Compile the passes over lists of ghosts."""
        self.passes.add_gradients(0, 0, self.bond_system.inner, None, None, 0, self.kinematics, self.gradient)
        choices = (self.stabiliser, None, None, None, self.kinematics, self.record, self.force)
        self.passes.add_forces(0, 0, self.bond_system.inner, None, None, *choices)


def pushed_forward(P: np.ndarray, F: np.ndarray) -> np.ndarray:
    """sigma = P F^T / J (n, 3, 3) [Pa]."""
    return P @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]
