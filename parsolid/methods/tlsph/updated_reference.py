"""The reference configuration of total-Lagrangian SPH where it is moved to the present one now and then.

After Refachinho de Campos, Gil, Lee, Giacomini, Bonet: A new updated reference Lagrangian smooth particle hydrodynamics
algorithm for isothermal elasticity and elasto-plasticity, Comput. Methods Appl. Mech. Eng. 392 (2022) 114680. State and
law stay those of the original configuration, so that an update changes no bit of them and no energy; what it changes
are the operators: places X_r (`smoothed_places`), volumes J V, lists, weights and corrections. The smoothing metric is
carried along, F^{-T} M F^{-1}, so that neighbours in a homogeneous deformation stay neighbours. With D_r the gradient
over the new lists, F_r = (D_r x)^{-1} F, so that F is D_r x F_r as it is D x where the reference is fixed: then P F^T,
symmetric, is what the forces turn the body with, and angular momentum is kept as well as there.

Sweeps are those of the moved configuration. With J_r = det F_r and its correction L, the lists take
F_r^T L / J_r and the original volume V, by which the gradient and the stress are those of the original configuration
without a further product:

    G = [ sum_b (v_b - v_a) (x) g_ab ] (F_r^T L / J_r)^T / V = G_r F_r,      P_r L = P (F_r^T L / J_r).

What the dissipation needs is moved in kernels: G_r = G F_r^{-1} (field `inverse`) and rho^2 Q / J_r^2 between F_r and
F_r^T (field `push`, F_r / J_r).
"""

from typing import Any

import numpy as np

from parsolid.collective import SolverError, anywhere
from parsolid.kernels import kernel
from parsolid.pairs.candidates import metrics
from parsolid.pairs.pair_list import Neighbours, distance_in_support
from parsolid.particles.declaration import Columns, Field

_POSITION, _GRADIENT = "updated_reference_position", "updated_reference_gradient"
_METRIC, _VOLUME = "updated_reference_metric", "updated_reference_volume"
# det F over J, advanced separately, where they have nothing to do with each other any more
_ASTRAY = 0.1
# passes of smoothing: after one the punch with an update in every step still breaks up; after two it does not
_PASSES = 3
# a smoothed place lies at most so many spacings from the particle's own
_MOST_SHIFT = 0.5
# the largest |D_r (x - X_r)|: bodies that bear updates stay below 0.4; beside a free corner that is sheared it passes 1
# before neighbours change sides
_MOST_CHANGE = 0.5
# neighbours farther than this many spacings, squared, do not count: the 1-2-1 of a lattice ends at its cubes' corners
_FARTHEST = 3.5


class UpdatedReference:
    """The present configuration of some steps ago.

    every: steps between updates, or None; limit: the largest Green strain since the last update, or None. updates: how
    many there were; fault: why the last update failed, the same on all ranks.
    """

    def __init__(self, system: Any, position: np.ndarray) -> None:
        """system: `system.TotalLagrangianSPH` with its fields declared; position (n, d) [m]: of the original
        configuration."""
        self.system, self.particles, self.dimension = system, system.particles, position.shape[1]
        settings = system.settings
        self.every, self.limit, self.smoothing = settings.update_every, settings.update_when, settings.smoothing
        self.steps, self.updates = 0, 0
        self.fault: str | None = None
        d, one = self.dimension, np.eye(self.dimension).ravel()
        self.particles.declare(Field(_POSITION, d, "m", checkpointed=True), position)
        self.particles.declare(Field(_GRADIENT, d * d, "1", checkpointed=True), one)
        self.particles.declare(Field(_METRIC, 6, "1/m^2", checkpointed=True))
        self.particles.declare(Field(_VOLUME, 1, "m^3", checkpointed=True))
        for name in ("push", "inverse"):
            self.particles.declare(Field(name, d * d, "1", layout=Columns(), carried=False), one)

    @property
    def original_volume(self) -> np.ndarray:
        """Volumes (owned,) [m^3] that count in the sums, in the original configuration."""
        return np.asarray(self.particles.owned_rows("volume") / self.particles.owned_rows("share"))

    @property
    def asks(self) -> bool:
        """Whether this rank's particles are distorted beyond the limit: |f^T f - 1|/2 of f = F F_r^{-1}, the Green
        strain since the reference was moved."""
        if self.limit is None:
            return False
        f = in_space(self._matrices("deformation_gradient") @ self._matrices("inverse"))
        strain = 0.5 * (f.swapaxes(1, 2) @ f - np.eye(3))
        return bool(np.sqrt((strain * strain).sum(axis=(1, 2)).max(initial=0.0)) > self.limit)

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
        ratio = np.linalg.det(F) / self.particles.owned_rows("jacobian")
        if anywhere(self.system.comm, not bool(np.all((ratio > _ASTRAY) & (ratio < 1.0 / _ASTRAY)))):
            self.fault = "det F is no longer J"
        if self.fault is not None:
            return False
        # with the original volume, so that the correction is L / J_r
        lists, free = self.system.lists, ~self.system.conditions.held
        L = self._matrices("inverse").swapaxes(1, 2) @ lists.corrections
        place = smoothed_places(lists.near, self.smoothing, rows("position"), L, lists.volume, free)
        rows(_METRIC)[:], rows(_VOLUME)[:] = self._metric(inverses(F)), rows("jacobian") * self.original_volume
        place = bounded_places(rows("position"), place, rows(_METRIC), _MOST_SHIFT / self.smoothing)
        rows(_POSITION)[:] = place
        if not self._rebuilt():
            return False
        change = gradient_of(lists.near, rows("position") - place, lists.corrections, lists.volume)
        if anywhere(self.system.comm, not bool(np.all((change * change).sum(axis=(1, 2)) <= _MOST_CHANGE**2))):
            self.fault = f"smoothed places differ from the particles' by a gradient of more than {_MOST_CHANGE:g}"
            return False
        rows(_GRADIENT)[:] = (inverses(in_space(np.eye(d) + change)) @ F)[:, :d, :d].reshape(-1, d * d)
        return True

    def _rebuilt(self) -> bool:
        """Lists, weights and corrections at the kept places; False with a `fault` when there are none. Collective."""
        rows = self.particles.owned_rows
        where = rows(_POSITION).copy(), rows("body"), rows(_METRIC).copy(), rows(_VOLUME).copy()
        try:
            self.system.find_pairs(*where)
        except SolverError:
            # what it says of settings is right at a start, not here
            self.fault = "particles have no neighbours, or one place, where it would be"
        return self.fault is None

    def _to_original(self) -> None:
        """Corrections and volumes as `moved` says."""
        rows, d, F = self.particles.owned_rows, self.dimension, self._matrices(_GRADIENT)
        push = F / (rows(_VOLUME) / self.original_volume)[:, None, None]
        lists = self.system.lists
        lists.take_corrections(push.swapaxes(1, 2) @ lists.corrections, self.original_volume)
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


# --- places without what the gradient cannot see -----------------------------------------------------------------

# A displacement that alternates from particle to particle has no gradient, hence no strain and no restoring force. A
# reference that took it over would push it on under stress (the tensile instability of moving particles): in the punch
# of 33 x 33 particles most of the energy is gone after 12 ms. So every particle is moved to the mean of what its
# neighbours' places and gradients say of its own place, 1-2-1 along each axis of a lattice, where an alternating field
# leaves nothing and a linear one all; what is taken from smooth fields is of fourth order in the spacing.


def gradient_of(near: Neighbours, displacement: np.ndarray, correction: np.ndarray, volume: np.ndarray) -> np.ndarray:
    """G (owned, d, d) of a displacement (owned, d) [m]; correction L (owned, d, d) and volume (owned,) go with the
    weights. Collective."""
    values = near.with_ghosts_and_images(displacement, "vector")
    sums = np.zeros((*values.shape, values.shape[1]))
    for pairs in near.lists:
        add_differences(pairs, values, sums)
    return np.asarray(sums[: near.owned] @ correction.swapaxes(1, 2) / volume[:, None, None])


def smoothed_places(
    near: Neighbours, smoothing: float, position: np.ndarray, correction: np.ndarray, volume: np.ndarray, free: Any
) -> np.ndarray:
    """Smoothed places (owned, d) [m] of particles at `position`, by the lists of where they were; collective.

    smoothing: h over the spacing; free (owned, d): which components are not held.
    """
    place, listed, owned = position.copy(), near.positions[: near.owned], near.owned
    for _ in range(_PASSES):
        displacement = np.ascontiguousarray(place - listed)
        gradient = gradient_of(near, displacement, correction, volume)
        images = near.images
        gradients = images.of_tensors(near.halo.with_ghosts(gradient), images.signs, images.reflection)
        values = near.with_ghosts_and_images(displacement, "vector")
        deviation, weight = np.zeros_like(values), np.zeros(len(values))
        for pairs in near.lists:
            add_deviations(pairs, near.positions, near.metric, smoothing, values, gradients, deviation, weight)
        place += free * deviation[:owned] / (1.0 + weight[:owned, None])
    return place


def bounded_places(position: np.ndarray, place: np.ndarray, metric: np.ndarray, most: float) -> np.ndarray:
    """Smoothed places (n, d) [m] at most so many supports from the positions, lengths by metric (n, 6) [1/m^2]: where
    neighbours are few, at a free corner that is sheared, gradients say nothing of the place any more."""
    shift = np.zeros((len(place), 3))
    shift[:, : place.shape[1]] = place - position
    straight = (metric[:, :3] * shift * shift).sum(axis=1)
    oblique = (metric[:, 3:] * shift[:, (0, 0, 1)] * shift[:, (1, 2, 2)]).sum(axis=1)
    length = np.sqrt(np.maximum(straight + 2.0 * oblique, 0.0))
    factor = np.minimum(1.0, most / np.maximum(length, 1e-300))
    return np.asarray(position + factor[:, None] * (place - position))


@kernel
def add_differences(pairs, values, sums):
    """Add sum_b (u_b - u_a) (x) g_ab to sums (rows, d, d) of both particles; values u (rows, d)."""
    d = values.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            for i in range(d):
                for j in range(d):
                    term = (values[b, i] - values[a, i]) * pairs.weight[k, j]
                    sums[a, i, j] += term
                    sums[b, i, j] += term


@kernel
def add_deviations(pairs, positions, metric, smoothing, values, gradient, deviation, weight):
    """Add 2^(-s^2) times u_b - u_a - 1/2 (G_a + G_b) (X_b - X_a) to deviation (rows, d), and 2^(-s^2) to weight.

    s: the distance in spacings, smoothing (h over the spacing) times that in supports.
    """
    d = values.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            square = (smoothing * distance_in_support(positions, metric, a, b)) ** 2
            if square < _FARTHEST:
                w = 2.0**-square
                weight[a] += w
                weight[b] += w
                for i in range(d):
                    jump = values[b, i] - values[a, i]
                    for j in range(d):
                        jump -= 0.5 * (gradient[a, i, j] + gradient[b, i, j]) * (positions[b, j] - positions[a, j])
                    deviation[a, i] += w * jump
                    deviation[b, i] -= w * jump
