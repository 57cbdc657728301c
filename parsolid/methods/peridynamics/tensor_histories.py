"""Histories of laws whose stress follows from the gradient of u, see `solids`: their arrays, and kernels over them."""

from typing import Any

import numpy as np

from parsolid.kernels import exact
from parsolid.materials.hyperelastic.at_particles import after_step, at_particle, keep_state
from parsolid.materials.hyperelastic.functions import dissipated_energy
from parsolid.materials.viscoelastic.prony import Prony
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.solids import (
    end_of_step,
    initial_history,
    kernel_law,
    step_weights,
    stress_after,
    undeformed_wave_modulus,
)
from parsolid.methods.peridynamics.sweeps import gradient_at, inverse_at, matmul_in, store_rows
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.law_values import flat_values
from parsolid.tensors import IDENTITY, cofactor, determinant, plus


class TensorHistories:
    """Histories of laws whose stress follows from the gradient of u, see `solids`. It declares

    tensor_history    (6 + 6 terms, n), with rows for as many branches as any law has

    stored [J]: energy of the settled states, without the control's; softened [J]: what state variables of laws have
    dissipated in the last step; sound, growth: see `CorrespondenceForces`.
    """

    def __init__(
        self, bonds: Bonds, laws: list[Any], terms: int, share: np.ndarray, rows_of_values: dict[Any, slice]
    ) -> None:
        """laws: (first, last, law) of the rank's particles; terms: most branches of any law of the scene;
        rows_of_values: of `particles.law_values`."""
        self._rows_of_values = rows_of_values
        self.bonds, self.particles, self.plane = bonds, bonds.particles, True if bonds.d == 2 else None
        self.laws = laws
        self.every = np.arange(bonds.owned)
        self.tributary_volume = bonds.volume[: bonds.owned] * share
        self.stored, self.softened, self.sound, self.growth = 0.0, 0.0, True, 1.0
        columns = Field("tensor_history", 6 * (1 + terms), "1", checkpointed=True, mirror="tensor", layout=Columns())
        self.particles.declare(columns)
        for first, last, law in laws:
            fresh = initial_history(law)
            self.history[: len(fresh), first:last] = fresh[:, None]

    @property
    def history(self) -> np.ndarray:
        """The histories (rows, n)."""
        return self.particles.storage("tensor_history")

    def _values(self, law: Any) -> tuple[np.ndarray, int] | None:
        """What a law has of each particle, see `flat_values`."""
        return flat_values(self.particles, self._rows_of_values.get(law))

    def store_stresses(self, step: float, sums: np.ndarray, M: np.ndarray, chosen: np.ndarray | None = None) -> None:
        """M = P K^-1 after a step [s] of chosen (k,) particles or all, from the sums of the gradient of u."""
        inverse, volume = self.particles.storage("inverse_shape"), self.bonds.volume
        chosen = self.every if chosen is None else chosen
        for first, last, law in self.laws:
            given = rows_between(chosen, first, last), kernel_law(law), self._values(law), step_weights(law, step)
            store_stresses(self.plane, *given, inverse, volume, self.history, sums, M)

    def commit(self, step: float, sums: np.ndarray, chosen: np.ndarray | None = None) -> float:
        """Take the histories of chosen (k,) particles or all through a step [s] to the displacement whose gradient has
        these sums; the energy dissipated [J]. What is told of states is then that of these particles."""
        chosen = self.every if chosen is None else chosen
        self.stored, lost, self.softened, self.sound, self.growth = 0.0, 0.0, 0.0, True, 1.0
        inverse, volume = self.particles.storage("inverse_shape"), self.bonds.volume
        for first, last, law in self.laws:
            given = rows_between(chosen, first, last), kernel_law(law), self._values(law), step_weights(law, step)
            stored, loss, softened, sound, waves = commit_histories(
                self.plane, *given, inverse, volume, self.tributary_volume, self.history, sums
            )
            self.stored, lost, self.sound = self.stored + stored, lost + loss, self.sound and sound
            self.softened += softened
            self.growth = max(self.growth, waves / undeformed_wave_modulus(law))
        return lost

    def start(self, sums: np.ndarray, instantaneous: bool) -> None:
        """Histories of the displacement at time 0, whose gradient has these sums: reached in a jump, or held for ever,
        so that all branches are relaxed."""
        self.commit(0.0, sums)
        if instantaneous:
            return
        for first, last, law in self.laws:
            mine = self.history[:, first:last]
            mine[6:] = 0.0 if isinstance(law, Prony) else np.tile(mine[:6], (len(mine) // 6 - 1, 1))

    def resume(self, sums: np.ndarray) -> None:
        """Energy and stiffness of a settled state that was put back, and of its gradient's sums."""
        self.commit(0.0, sums)

    def nominal_stresses(self, sums: np.ndarray, result: np.ndarray) -> None:
        """First Piola-Kirchhoff stress (owned, 9) [Pa] of the settled state from the sums of the gradient of u."""
        inverse, volume = self.particles.storage("inverse_shape"), self.bonds.volume
        for first, last, law in self.laws:
            given = first, last, kernel_law(law), self._values(law), step_weights(law, 0.0)
            nominal_stresses(self.plane, *given, inverse, volume, self.history, sums, result)


def rows_between(particles: np.ndarray, first: int, last: int) -> np.ndarray:
    """Of ascending particles (k,) those in first .. last - 1."""
    begin, end = np.searchsorted(particles, (first, last))
    return particles[begin:end]


# without contraction, so that stresses before and after a restart have the same bits: one of these kernels stores the
# histories, and others read them
@exact
def law_after_step(law, values, a, G):
    """The law at a particle after a step to the displacement gradient G; values: see `flat_values`."""
    if values is None:
        return law
    F = plus(IDENTITY, G)
    return after_step(at_particle(law, values[0], values[1], a), F, cofactor(F), determinant(F))


@exact
def store_stresses(plane, rows, law, values, weights, inverse, volume, history, sums, M):
    """M = P K^-1 of some particles after a step with the weights of `step_weights`."""
    for a in rows:
        G = gradient_at(plane, sums, inverse, volume, a)
        P = stress_after(law_after_step(law, values, a, G), weights, history, a, G)
        store_rows(plane, M, a, matmul_in(plane, P, inverse_at(inverse, a)))


@exact
def commit_histories(plane, rows, law, values, weights, inverse, volume, tributary_volume, history, sums):
    """Take histories of some particles through a step.

    tributary_volume (owned,) [m^3]: on this side of mirror planes. Returns (stored energy after it, dissipated over it
    in branches and by state variables [J], are all Jacobians positive, the bound of rho c^2 [Pa] of waves to come: that
    after the step times (J_old/J)^4 where a particle has shrunk, for what shrinks goes on shrinking).
    """
    stored, lost, softened, sound, largest = 0.0, 0.0, 0.0, True, 0.0
    for a in rows:
        G = gradient_at(plane, sums, inverse, volume, a)
        here = law_after_step(law, values, a, G)
        if values is not None:
            before = dissipated_energy(at_particle(law, values[0], values[1], a))
            softened += tributary_volume[a] * (dissipated_energy(here) - before)
            keep_state(here, values[0], values[1], a)
        energy, loss, waves, ratio = end_of_step(here, weights, history, a, G, plane)
        stored += tributary_volume[a] * energy
        lost += tributary_volume[a] * loss
        # of each particle: greatest of both apart would depend on which rank has which
        largest = max(largest, waves * max(ratio, 1.0) ** 2)
        if not determinant(plus(IDENTITY, G)) > 0.0:
            sound = False
    return stored, lost, softened, sound, largest


@exact
def nominal_stresses(plane, first, last, law, values, weights, inverse, volume, history, sums, result):
    """First Piola-Kirchhoff stress (n, 9) [Pa] of particles first..last-1."""
    for a in range(first, last):
        G = gradient_at(plane, sums, inverse, volume, a)
        P = stress_after(law_after_step(law, values, a, G), weights, history, a, G)
        for c in range(9):
            result[a, c] = P[c]
