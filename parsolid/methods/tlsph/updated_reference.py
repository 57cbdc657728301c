"""The reference configuration of total-Lagrangian SPH where it is moved to the present one now and then.

After Refachinho de Campos, Gil, Lee, Giacomini, Bonet: A new updated reference Lagrangian smooth particle hydrodynamics
algorithm for isothermal elasticity and elasto-plasticity, Comput. Methods Appl. Mech. Eng. 392 (2022) 114680. State and
law stay those of the original configuration, so that an update changes no bit of them and no energy; what it changes
are the operators: places X_r (`smoothed_places`), volumes J V, lists, weights and corrections. The smoothing metric is
carried along, F^{-T} M F^{-1}, so that neighbours in a homogeneous deformation stay neighbours. With D_r the gradient
over the new lists, F_r = (D_r x)^{-1} F, so that F is D_r x F_r as it is D x where the reference is fixed: then P F^T,
symmetric, is what the forces turn the body with, and angular momentum is kept as well as there.
"""

from typing import Any

import numpy as np

from parsolid.collective import SolverError, anywhere
from parsolid.methods.tlsph.boundaries import BoundarySet
from parsolid.methods.tlsph.moved import Moved, largest_distortion
from parsolid.methods.tlsph.smoothed_places import gradient_of, smoothed
from parsolid.pairs.candidates import metrics
from parsolid.pairs.pair_system import PairSystem
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.declaration import Columns, Field, Within

_POSITION, _GRADIENT = "updated_reference_position", "updated_reference_gradient"
# det F over J, evolved apart, where they have nothing to do with each other any more
_ASTRAY = 0.1
_METRIC, _VOLUME = "updated_reference_metric", "updated_reference_volume"


class UpdatedReference:
    """The present configuration of some steps ago; d = dimension.

    every: steps between updates, or None; limit: the largest Green strain since the last update, or None.
    fault: why the last update failed, the same on all ranks.
    """

    def __init__(self, pairs: PairSystem, settings: Any, position: np.ndarray, boundaries: BoundarySet):
        """position (n, d) [m]: of the original configuration.

        Declares the fields of the moved configuration.
        """
        self.pairs, self.particles, self.dimension = pairs, pairs.particles, position.shape[1]
        self.every, self.limit, self.smoothing = settings.update_every, settings.update_when, settings.smoothing
        self.boundaries = boundaries
        self.steps, self.updates = 0, 0
        self.fault: str | None = None
        self._declare(position)

    def _declare(self, position: np.ndarray) -> None:
        particles, d, one = self.particles, self.dimension, np.eye(self.dimension).ravel()
        place = Within("kinematics", KINEMATICS[d].reference)
        role: dict[str, Any] = {"ghosts": "forward", "message": "reference", "layout": place}
        particles.declare(Field(_POSITION, d, "m", **role, checkpointed=True), position)
        particles.declare(Field(_GRADIENT, d * d, "1", checkpointed=True), one)
        particles.declare(Field(_METRIC, 6, "1/m^2", checkpointed=True))
        particles.declare(Field(_VOLUME, 1, "m^3", checkpointed=True))
        for name in ("push", "inverse"):
            unmoved = tuple(one)
            particles.declare(Field(name, d * d, "1", layout=Columns(), padding=unmoved, carried=False), unmoved)

    @property
    def original_volume(self) -> np.ndarray:
        """Volumes (owned,) [m^3] that count in the sums, in the original configuration."""
        return self.particles.owned_rows("volume") / self.boundaries.share

    @property
    def moved(self) -> Moved:
        """The arrays that the kernels take."""
        return Moved(self.particles.storage("push"), self.particles.storage("inverse"))

    @property
    def asks(self) -> bool:
        """Whether this rank's particles are distorted beyond the limit."""
        if self.limit is None:
            return False
        strain, inverse = self.particles.storage("strain"), self.particles.storage("inverse")
        return bool(largest_distortion(self.pairs.space, self.particles.owned, strain, inverse) > self.limit)

    def follow(self, asked: bool) -> bool:
        """Before a step: move the reference when it is due; asked: whether any rank `asks`. False with a `fault` when
        the particles cannot be paired there. Collective."""
        due = asked if self.every is None else self.steps > 0 and self.steps % self.every == 0
        self.steps += 1
        if due and self._moves():
            self.updates += 1
            self._to_original()
        return self.fault is None

    def _moves(self) -> bool:
        """The configuration that the particles ask for now, and the lists there; collective."""
        rows, d = self.particles.owned_rows, self.dimension
        F = in_space(self._matrices("deformation_gradient"))
        if not self._follows(F):
            return False
        # with the original volume, so that the correction is L / J_r
        L = self._matrices("inverse").swapaxes(1, 2) @ self._matrices("correction")
        clamp = self.boundaries.clamp
        free = 1.0 if clamp is None else clamp[:, :d]
        place = smoothed(self.pairs, self.smoothing, rows("position"), L, rows("pair_volume"), free)
        rows(_METRIC)[:], rows(_VOLUME)[:] = self._metric(inverses(F)), rows("jacobian") * self.original_volume
        rows(_POSITION)[:] = place
        if not self._rebuilt():
            return False
        change = gradient_of(self.pairs, rows("position") - place, self._matrices("correction"), rows("pair_volume"))
        rows(_GRADIENT)[:] = (inverses(in_space(np.eye(d) + change)) @ F)[:, :d, :d].reshape(-1, d * d)
        return True

    def _follows(self, F: np.ndarray) -> bool:
        """Whether F (n, 3, 3) still is what J says, so that a metric follows it; collective."""
        ratio = np.linalg.det(F) / self.particles.owned_rows("jacobian")
        if anywhere(self.pairs.comm, not bool(np.all((ratio > _ASTRAY) & (ratio < 1.0 / _ASTRAY)))):
            self.fault = "det F is no longer J"
        return self.fault is None

    def _rebuilt(self) -> bool:
        """Lists, weights and corrections at the kept places; False with a `fault` when there are none. Collective."""
        rows = self.particles.owned_rows
        try:
            self.pairs.rebuild(rows(_POSITION).copy(), rows("body"), rows(_METRIC).copy(), rows(_VOLUME).copy())
        except SolverError as error:
            self.fault = str(error)
        return self.fault is None

    def _to_original(self) -> None:
        """Corrections and volumes as `moved` says."""
        rows, d, F = self.particles.owned_rows, self.dimension, self._matrices(_GRADIENT)
        push = F / (rows(_VOLUME) / self.original_volume)[:, None, None]
        rows("correction")[:] = (push.swapaxes(1, 2) @ self._matrices("correction")).reshape(-1, d * d)
        rows("pair_volume")[:] = self.original_volume
        rows("push")[:] = push.reshape(-1, d * d)
        rows("inverse")[:] = inverses(in_space(F))[:, :d, :d].reshape(-1, d * d)

    def _matrices(self, name: str) -> np.ndarray:
        """A field of matrices (owned, d, d)."""
        return self.particles.owned_rows(name).reshape(-1, self.dimension, self.dimension)

    def _metric(self, inverse: np.ndarray) -> np.ndarray:
        """Rows (n, 6) of F^{-T} M F^{-1} [1/m^2]; inverse (n, 3, 3)."""
        rows = self.particles.owned_rows
        axes = self._matrices("axes") if "axes" in self.particles else None
        original = metrics(rows("spacing"), axes, self.smoothing)
        M = np.zeros_like(inverse)
        M[:, (0, 1, 2), (0, 1, 2)] = original[:, :3]
        M[:, (0, 0, 1), (1, 2, 2)] = M[:, (1, 2, 2), (0, 0, 1)] = original[:, 3:]
        M = inverse.swapaxes(1, 2) @ M @ inverse
        return np.concatenate((M[:, (0, 1, 2), (0, 1, 2)], M[:, (0, 0, 1), (1, 2, 2)]), axis=1)

    def state(self) -> dict[str, int]:
        """Steps and updates so far."""
        return {"steps": self.steps, "updates": self.updates}

    def set_state(self, state: dict[str, int]) -> None:
        """Take back what `state` gave."""
        self.steps, self.updates = state["steps"], state["updates"]

    def resume(self) -> None:
        """Lists at the places that were put back; collective."""
        if self.updates and self._rebuilt():
            self._to_original()


def in_space(matrices: np.ndarray) -> np.ndarray:
    """Matrices (n, 3, 3) of deformations (n, d, d) that leave the other directions as they are."""
    result, d = np.tile(np.eye(3), (len(matrices), 1, 1)), matrices.shape[1]
    result[:, :d, :d] = matrices
    return result


def inverses(matrices: np.ndarray) -> np.ndarray:
    """Of (n, 3, 3), by their cofactors: a quarter of the time of LAPACK's for matrices this small."""
    cofactor = np.cross(matrices[:, (1, 2, 0)], matrices[:, (2, 0, 1)])
    determinant = np.einsum("nj,nj->n", matrices[:, 0], cofactor[:, 0])
    return cofactor.swapaxes(1, 2) / determinant[:, None, None]
