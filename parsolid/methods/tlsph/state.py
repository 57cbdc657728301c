"""The fields of total-Lagrangian SPH, and what a law needs at hand on its range of particles."""

from typing import Any

import numpy as np

from parsolid.kernels import aligned_zeros
from parsolid.materials.declaration import SOFTENING
from parsolid.materials.hyperelastic.at_particles import state_count, values_at_rest
from parsolid.materials.viscoelastic.maxwell import dissipation_factor, loss_weights, relaxation_weights
from parsolid.methods.tlsph.point_update import TILE, Branches, ParticleValues, make_tile
from parsolid.methods.tlsph.tangent import find_moduli
from parsolid.methods.tlsph.tile_fields import (
    PLACES,
    make_branch_tiles,
    make_tiles,
    settle_states,
    stored_energy,
    stresses,
    wave_speeds,
)
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Within
from parsolid.particles.generated import declare_generated
from parsolid.particles.law_values import RECORD

_BRANCH_AT_REST = {2: (1.0, 1.0, 0.0), 3: (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}


def declare_fields(particles: Particles, particle_set: Any, branches: int, staged: bool) -> None:
    """Declare the state at rest: v, x, F, J and A of each branch; a law with fewer branches than another has A = 1 in
    the rest.

    staged: whether the step has stages (SSP-RK3). Then H is advanced, too, in space, and the start of a step is kept;
    else a step begins with the forces that the last one ended with.
    """
    position, columns = particle_set.position, Columns()
    d = position.shape[1]
    declare_generated(particles, particle_set, reference_position=columns, volume=columns)
    vector: dict[str, Any] = {"checkpointed": True, "shown": True, "mirror": "vector", "layout": columns}
    particles.declare(Field("velocity", d, "m/s", **vector))
    particles.declare(Field("position", d, "m", **vector), position)
    tensor: dict[str, Any] = {"checkpointed": True, "mirror": "tensor", "layout": columns}
    one = np.eye(d).ravel()
    particles.declare(Field("deformation_gradient", d * d, "1", **tensor), one)
    if staged and d == 3:
        particles.declare(Field("cofactor", 9, "1", **tensor), one)
    particles.declare(Field("jacobian", 1, "1", checkpointed=True, shown=True, layout=columns), 1.0)
    if branches:
        rest = _BRANCH_AT_REST[d]
        particles.declare(Field("branches", branches * len(rest), "1", layout=columns), rest * branches)
        for alpha in range(branches):
            place = {**tensor, "layout": Within("branches", alpha * len(rest))}
            particles.declare(Field(f"viscous_strain_inverse_{alpha + 1}", len(rest), "1", **place), rest)
    if staged:
        names = ("velocity", "position", "deformation_gradient", "cofactor", "jacobian")
        for name in (name for name in names if name in particles):
            field = particles.fields[name]
            start = Field(f"{name}_at_start", field.components, field.unit, layout=columns, carried=False)
            particles.declare(start)
    for name in ("stress_force", "dissipative_force"):
        particles.declare(Field(name, d, "N", checkpointed=not staged, mirror="vector", layout=columns))


class LawBlock:
    """Particles first .. last - 1 of a rank, which share one law; its branches, and tiles for its kernels.

    law: with all its parts; solid: without branches, as kernels take it. A, branch_sum: tiles, None without branches;
    of_branches: what `update_tile` takes of them, None without, filled by `branches`;
    push: a tile of an updated reference; sound: whether the law holds in all states of the last step.
    """

    sound = True

    def __init__(
        self, particles: Particles, first: int, last: int, law: Any, rows_of_values: slice | None = None
    ) -> None:
        """rows_of_values: of what the law has of each particle, see `particles.law_values`."""
        self.particles, self.first, self.last, self.law = particles, first, last, law
        self._rows_of_values = rows_of_values
        if rows_of_values is not None:
            self._value_tile = np.repeat(values_at_rest(law), TILE)
            self._lost, self._dissipated = aligned_zeros(TILE), aligned_zeros(TILE)
        self.solid = law if law.branch_moduli is None else law._replace(branch_moduli=None, relaxation_times=None)
        self.moduli = np.array(law.branch_moduli or (), float)
        self.times = np.array(law.relaxation_times or (), float)
        self._relaxation_times = self.times.tolist()
        self.dimension = particles.owned_rows("position").shape[1]
        self.tiles, self.places = make_tiles(), PLACES[self.dimension]
        self.A, self.branch_sum = make_branch_tiles(len(self.moduli))
        self.push = make_tile(9)
        over, losses = np.zeros((2, len(self.times), 3))
        self._of_step = Branches(self.moduli, self.times, over, losses, over)
        self.of_branches = tuple(self._of_step[:4]) if len(self.moduli) else None

    def carried_fields(self, step: float, last_step: float) -> Any:
        """What `update_tile` takes of what particles have besides, in a step [s] after one of another length; what
        state variables dissipate is summed anew."""
        if self._rows_of_values is not None:
            self._dissipated[:] = 0.0
        return self.values

    @property
    def values(self) -> ParticleValues | None:
        """What the law has of each particle, or None."""
        if self._rows_of_values is None:
            return None
        stored = self.particles.storage
        fields = stored(RECORD)[self._rows_of_values], state_count(self.law), stored("volume")[0]
        return ParticleValues(*fields, self._value_tile, self._lost, self._dissipated)

    def settle(self) -> None:
        """State variables at time 0, which the deformation may have changed."""
        if self._rows_of_values is not None:
            gradient = self.particles.storage("deformation_gradient")
            settle_states(self.solid, self.first, self.last, self.places, gradient, self.tiles, self.values)

    def book(self, ledger: Any) -> None:
        """Enter into a ledger what state variables have dissipated in the last step."""
        if self._rows_of_values is not None and state_count(self.law):
            ledger.add_term(SOFTENING, float(self._dissipated.sum()))

    def branches(self, step: float) -> Branches:
        """Over a step [s] of leapfrog, in arrays that the next call fills anew."""
        over, losses = self._of_step.weights, self._of_step.losses
        # number by number: arrays of lists of tuples take three times as long
        for k, time in enumerate(self._relaxation_times):
            over[k, 0], over[k, 1], over[k, 2] = relaxation_weights(step, time)
            start, mixed, end = loss_weights(step, time)
            losses[k, 0], losses[k, 1], losses[k, 2] = start * time, mixed * time, end * time
        return self._of_step

    def branches_at_stage(self, time: float, step: float) -> Branches:
        """At a stage of SSP-RK3, time: 0, 1/2 or 1 of the step [s]."""
        factors = [[dissipation_factor(time, step, tau), 0.0, 0.0] for tau in self.times]
        over, until = ([relaxation_weights(part * step, tau) for tau in self.times] for part in (1.0, time))
        return self._branches(over, factors, until)

    def _branches(self, *weights: Any) -> Branches:
        over, losses, until = (np.array(one, float).reshape(-1, 3) for one in weights)
        return Branches(self.moduli, self.times, over, losses, until)

    @property
    def branch_field(self) -> np.ndarray | None:
        """A of all branches, (3 or 6 a branch, n), None without."""
        return self.particles.storage("branches") if len(self.moduli) else None

    def _state(self) -> tuple[Any, ...]:
        """Deformation gradient, its cofactor and Jacobian where they are advanced separately, and A."""
        staged, stored = "deformation_gradient_at_start" in self.particles, self.particles.storage
        cofactors = stored("cofactor") if "cofactor" in self.particles else None
        return stored("deformation_gradient"), cofactors, stored("jacobian")[0] if staged else None, self.branch_field

    def energy(self) -> float:
        """Stored energy [J] on this side of mirror planes."""
        state, volume = self._state(), self.particles.storage("volume")[0]
        rows = (self.first, self.last, self.places)
        tiles = self.tiles, self.A, self.values
        return float(stored_energy(self.solid, self.branches(0.0), *rows, *state, volume, *tiles))

    def stresses(self, first: int, last: int) -> np.ndarray:
        """First Piola-Kirchhoff stresses (last - first, 3, 3) [Pa] of some of the particles."""
        result, tiles = np.zeros((last - first, 3, 3)), (self.tiles, self.A, self.branch_sum)
        stresses(self.solid, self.branches(0.0), first, last, self.places, *self._state(), *tiles, self.values, result)
        return result

    def stresses_of(self, rows: np.ndarray, gradients: np.ndarray, branches: np.ndarray | None) -> np.ndarray:
        """First Piola-Kirchhoff stresses (k, 3, 3) [Pa] of some rows (k,) under other deformation gradients (k, 3, 3)
        and inner variables of the branches (components, k), None without."""
        d, count, values = self.dimension, len(rows), self.values
        if values is not None:
            field = np.ascontiguousarray(values.field[:, rows])
            values = values._replace(field=field, volume=values.volume[rows])
        F = np.ascontiguousarray(gradients[:, :d, :d].reshape(count, d * d).T)
        result, tiles = np.zeros((count, 3, 3)), (self.tiles, self.A, self.branch_sum)
        state = F, None, None, branches
        stresses(self.solid, self.branches(0.0), 0, count, self.places, *state, *tiles, values, result)
        return result

    def find_moduli(self, index: np.ndarray, moduli: np.ndarray, history: Any) -> None:
        """dP/dF [Pa] of the present deformation into columns of moduli, see `tangent`; without branches where there is
        no history."""
        gradient = self.particles.storage("deformation_gradient")
        rows = self.first, self.last, self.places.tensor
        find_moduli(self.solid, *rows, index, gradient, self.tiles, moduli, self.values)
        if history is not None and len(self.moduli):
            self._add_branches(index, moduli, history.relaxing)

    def _add_branches(self, index: np.ndarray, moduli: np.ndarray, time: float) -> None:
        """Of F B - m F^-T, which is the stress of branches after a time [s] from a state: of their A the part w C^-1
        follows the deformation, B is the sum of mu times the rest, m that of mu (1 - w)."""
        d, own = self.dimension, slice(self.first, self.last)
        F = deformation_gradients(self.particles, self.first, self.last)[:, :d, :d]
        inverse, following = np.linalg.inv(F), self.branches(time).weights[:, 2]
        field: Any = self.branch_field
        A = field[:, own].reshape(len(self.moduli), -1, self.last - self.first)
        S = np.einsum("k,kcn->cn", self.moduli, A)
        first, second = np.triu_indices(d)
        # components of symmetric tensors: those of the diagonal first
        order = np.argsort(first != second, kind="stable")
        B = np.empty_like(F)
        B[:, first[order], second[order]] = B[:, second[order], first[order]] = S.T
        B -= float(self.moduli @ following) * inverse @ inverse.swapaxes(1, 2)
        left = float(self.moduli @ (1.0 - following))
        change = np.einsum("ik,nJL->niJkL", np.eye(d), B) + left * np.einsum("nJk,nLi->niJkL", inverse, inverse)
        change = change.reshape(len(F), d * d, d * d)
        rows, columns = np.triu_indices(d * d)
        moduli[index[rows, columns], own] += change[:, rows, columns].T

    def wave_speeds(self, signals: tuple[float, ...]) -> tuple[float, float]:
        """Greatest rho c_p^2 [Pa] and greatest signal [sqrt(Pa)] now, see `tile_fields.wave_speeds`."""
        rows, tiles = (self.first, self.last, self.places), (self.tiles, self.A, self.branch_sum)
        arguments = (self.dimension == 2, signals, self.branches(0.0), *rows, *self._state(), *tiles)
        largest, greatest = wave_speeds(self.solid, *arguments, self.values)
        return float(largest), float(greatest)


def deformation_gradients(particles: Particles, first: int, last: int) -> np.ndarray:
    """F (last - first, 3, 3) of particles, with F33 = 1 in the plane."""
    F = particles.owned_rows("deformation_gradient")[first:last]
    d = particles.owned_rows("position").shape[1]
    result = np.zeros((last - first, 3, 3))
    result[:, range(3), range(3)] = 1.0
    result[:, :d, :d] = F.reshape(-1, d, d)
    return result
