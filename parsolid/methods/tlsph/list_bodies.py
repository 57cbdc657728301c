"""Bodies whose particles find their neighbours in pair lists: the sweeps of a step with the messages between ranks."""

from typing import Any

import numpy as np

from parsolid.kernels import aligned_zeros, kernel
from parsolid.materials.hyperelastic.functions import elastic_moduli, isotropic_shear_modulus
from parsolid.methods.tlsph.leapfrog import StepBound
from parsolid.methods.tlsph.list_stages import advance_stage
from parsolid.methods.tlsph.list_update import add_forces, advance_step, find_forces
from parsolid.methods.tlsph.plastic import RIEMANN_HEAT
from parsolid.methods.tlsph.pressures import FIELDS
from parsolid.methods.tlsph.tangent import change_records
from parsolid.pairs.list_sweeps import ROWS, gradient_in_plane, gradient_in_space
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.pair_list import Neighbours
from parsolid.pairs.rows_of_four import store_row
from parsolid.solvers.runge_kutta import Stage


class ListBodies(StepBound):
    """The particles of a rank that find their neighbours in lists, and what their sweeps read and write.

    waves: what impedances depend on, 0: there is no dissipation, 1: mean impedances, 2: pressure waves by direction, 3:
    both waves by direction. near: lists of pairs; volume (owned,) [m^3]: of particles in gradients. motion, record,
    fast, slow, force, operator: rows of particles, of ghosts and of mirror images, see `list_sweeps`.
    """

    near: Neighbours
    # the field of a second Piola-Kirchhoff stress [Pa] that adds to that of laws, where there is one
    added_stress = "initial_stress"

    def __init__(self, system: Any, blocks: list[Any], weights: ListWeights, waves: int, unbonded: Any) -> None:
        """system: `system.TotalLagrangianSPH` with its fields declared; blocks: the `state.LawBlock` of these
        particles, which are the first ones; unbonded: see `Neighbours`."""
        self.system, self.blocks, self.weights, self.waves, self.unbonded = system, blocks, weights, waves, unbonded
        self.last = max((block.last for block in blocks), default=0)
        self.particles, self.dimension, self.codes = system.particles, system.dimension, system.conditions.codes
        self.columns = ROWS[self.dimension]
        self._gradient_sweep = gradient_in_space if self.dimension == 3 else gradient_in_plane
        self.half = 0.5 if system.settings.reconstruction else 0.0
        # half of rho c_s, where shear waves have one speed in a law
        moduli = {one: isotropic_shear_modulus(one.law) or 0.0 for one in blocks}
        self.isotropic = {one: 0.5 * float(np.sqrt(one.law.density * modulus)) for one, modulus in moduli.items()}
        self._exchanges: list[Any] = []

    def rebuild(self, positions: np.ndarray, body: np.ndarray, metric: np.ndarray, volume: np.ndarray) -> None:
        """Find pairs, their weights and corrections. Arguments as in `Neighbours`; collective."""
        for exchange in self._exchanges:
            exchange.free()
        self.particles.detach()
        near = Neighbours(
            self.system.comm, self.codes, self.weights.support, positions, body, metric, volume, self.unbonded
        )
        self.particles.attach(near.halo)
        correction = self.weights.fill(near)
        self._make_rows(near)
        self.take_corrections(correction, volume)

    def _make_rows(self, near: Any) -> None:
        """Rows of particles, ghosts and images, and their messages; collective."""
        self.near = near
        at, room = self.columns, (max(near.rows, 1),)
        self.motion, self.record = aligned_zeros((*room, at.motion)), aligned_zeros((*room, at.record))
        self.force, self.operator = aligned_zeros((*room, at.force)), aligned_zeros((*room, at.operator))
        self.fast = aligned_zeros((*room, at.tensor)) if self.waves >= 2 else None
        self.slow = aligned_zeros((*room, at.tensor)) if self.waves == 3 else None
        self.heat = aligned_zeros(room) if RIEMANN_HEAT in self.particles else None
        self.motion[: near.rows, at.reference : at.reference + self.dimension] = near.positions
        told = [self.record if self.waves else self.record[:, at.stress :]]
        told += [one for one in (self.fast, self.slow) if one is not None]
        self._motion = near.halo.forward(self.motion[:, : at.reference])
        self._record = near.halo.forward(*told)
        self._exchanges = [self._motion, self._record]

    def take_corrections(self, correction: np.ndarray, volume: np.ndarray) -> None:
        """L (owned, d, d) and V (owned,) [m^3] of gradients and stresses, see `list_sweeps`."""
        self.corrections[:], self.volume = correction, volume
        self.operator[: self.near.owned, 3 if self.dimension == 3 else 4] = 1.0 / volume

    @property
    def corrections(self) -> np.ndarray:
        """L (owned, d, d), a view of the rows."""
        d, stride = self.dimension, self.columns.vector
        return self.operator[: self.near.owned, : d * stride].reshape(self.near.owned, d, stride)[:, :, :d]

    @property
    def ghosts(self) -> int:
        """Particles of other ranks that this one knows."""
        return int(self.near.halo.ghosts)

    @property
    def directed_pairs(self) -> int:
        return 2 * len(self.near.inner.neighbour) + len(self.near.outer.neighbour)

    def arrays(self) -> list[np.ndarray]:
        lists = [*self.near.inner, *self.near.outer]
        rows = [*lists, self.motion, self.operator, self.record, self.force, self.heat, self.fast, self.slow]
        return [one for one in rows if one is not None]

    def bytes_a_step(self) -> int:
        return self._motion.bytes_sent + self._record.bytes_sent

    def advance_step(self, step: float, relaxing: float | None = None) -> tuple[bool, float, float]:
        """Deformation and stress after a step [s] of leapfrog: (whether all Jacobians are positive, energy [J] that
        branches have dissipated, the stable step [s] of the new state). relaxing [s]: for which branches relax, if that
        is another time."""
        self._begin_gradients()
        sound, dissipated, stable = True, 0.0, np.inf
        time = step if relaxing is None else relaxing
        for block, fields, pressures in self._kept_fields():
            block.branches(time)
            positive, lost, signal = advance_step(
                block.solid, step, self.dimension, self.signals, block.of_branches, self.half,
                block.first, block.last, block.places, *fields, tuple(self.near.inner), self.motion,
                self.operator, self.record, block.tiles, block.A, block.branch_sum, block.push if self._moved else None,
                block.carried_fields(step, self.last_step), *pressures,
            )  # fmt: skip
            sound, dissipated = sound and positive and block.sound, dissipated + lost
            stable = min(stable, self.step_of(block, signal))
        return sound, dissipated, stable

    def advance_stage(self, stage: Stage, step: float) -> tuple[bool, float, float]:
        """Deformation after a stage of SSP-RK3 and stress before it: (whether all Jacobians are positive, dissipation
        rate [W] of branches, after the last stage the stable step [s])."""
        self._begin_gradients()
        staged, sound, dissipated, stable = self.system.staged_step, True, 0.0, np.inf
        stored = self.particles.storage
        start = [stored(f"{name}_at_start") for name in ("deformation_gradient", "jacobian")]
        cofactors = (stored("cofactor"), stored("cofactor_at_start")) if self.dimension == 3 else (None, None)
        for block in self.blocks:
            gradient, jacobian, *fields = self._fields(block)
            positive, rate, modulus = advance_stage(
                block.solid, stage.keep, stage.take, step, stage.first, stage.last, self.dimension,
                block.branches_at_stage(stage.time, step), self.half, self.isotropic[block],
                block.first, block.last, block.places, gradient, cofactors[0], jacobian,
                start[0], cofactors[1], start[1][0], *fields, self.near.inner, self.motion,
                self.operator, self.record, self.fast, self.slow, block.tiles, block.A, block.branch_sum,
                block.push if self._moved else None, block.values,
            )  # fmt: skip
            sound, dissipated = sound and positive, dissipated + rate
            stable = min(stable, staged.step_of(block.law, modulus))
        return sound, dissipated, stable

    def _kept_fields(self) -> list[tuple[Any, tuple[Any, ...], tuple[Any, Any]]]:
        """Every block with its fields and pressures, found once for as long as there are no other arrays."""
        found: list[tuple[Any, tuple[Any, ...], tuple[Any, Any]]] = self.particles.kept(
            ("fields of blocks", self),
            lambda: [(block, self._fields(block), self._pressures) for block in self.blocks],
        )
        return found

    def _fields(self, block: Any) -> tuple[Any, ...]:
        """Deformation gradient, Jacobian, branches, volumes, updated reference, initial stress."""
        stored = self.particles.storage
        return (
            *(stored("deformation_gradient"), stored("jacobian")[0], block.branch_field, stored("volume")[0]),
            *((stored("push"), stored("inverse")) if self._moved else (None, None)),
            stored(self.added_stress) if self.added_stress in self.particles else None,
        )

    @property
    def _pressures(self) -> tuple[Any, Any]:
        """Fields of pressures beside those of the laws (`pressures`), None without."""
        found: Any = [self.particles.storage(name) if name in self.particles else None for name in FIELDS]
        return found[0], found[1]

    @property
    def _moved(self) -> bool:
        """Whether the reference moves."""
        return "push" in self.particles

    def find_forces(self) -> None:
        """T and D [N] of the records, in the fields stress_force and dissipative_force."""
        stored = self.particles.storage
        W = None if self.heat is None else stored(RIEMANN_HEAT)
        fields = stored("stress_force"), stored("dissipative_force"), W
        self._add_up(self.motion if self.waves else None, self.heat, self.columns.position, fields)

    def change_forces(
        self,
        change: np.ndarray,
        index: Any,
        moduli: Any,
        fields: tuple[Any, Any],
        given: np.ndarray | None = None,
        volumes: Any = None,
    ) -> None:
        """Changes of T [N] for a small change (owned, d) [m] of the displacement, and T of stresses given (d d, owned)
        [Pa], into the first of two fields (d, n), the second is scratch; index, moduli, volumes: see `tangent`.
        Collective."""
        self.motion[: self.last, : self.dimension] = change[: self.last]
        self._begin_sums()
        for block in self.blocks:
            change_records(
                self.dimension, block.first, block.last, block.places.tensor, index, moduli, given, volumes,
                self.near.inner, self.motion, self.operator, self.record, block.tiles,
            )  # fmt: skip
        self._add_up(None, None, 0, (*fields, None))

    def _add_up(self, motion: Any, heat: Any, stretched: int, fields: tuple[Any, Any, Any]) -> None:
        """T, D and heat of the records into fields; motion: None where nothing dissipates; stretched: column of the
        motion of which `_add_own_forces` takes the differences."""
        near, at = self.near, self.columns
        self._record.start()
        self._record.finish()
        if len(near.images.source):
            mirror_records(near.local, near.images, self.record, at.stress)
            for waves in (self.fast, self.slow):
                if waves is not None:
                    mirror_waves(near.local, near.images, waves)
        rows = motion, self.record, self.fast, self.slow, self.force, heat
        if len(near.outer.neighbour):
            add_forces(self.dimension, near.outer, 0, near.owned, *rows)
            clear_rows(near.owned, near.rows, self.force)
            if heat is not None:
                heat[near.owned :] = 0.0
        self._add_own_forces(stretched)
        for block in self.blocks:
            find_forces(self.dimension, tuple(near.inner), block.first, block.last, *rows, *fields)

    def add_stiffness(self, result: np.ndarray) -> None:
        """Add to a field (d, n) [N/m] about what the diagonal of the tangent is at rest; collective."""
        volume = self.particles.storage("volume")[0]
        for block in self.blocks:
            own, (shear, lame) = slice(block.first, block.last), elastic_moduli(block.law)
            result[:, own] += (lame + 2.0 * shear) * volume[own] ** (1.0 - 2.0 / self.dimension)

    def displacement_gradient(self, result: np.ndarray) -> None:
        """Fill grad u of these particles into result (owned, d, d) by the scheme's own operator; collective."""
        at, d, of, last = self.columns, self.dimension, self.particles.owned_rows, self.last
        self.motion[:last, :d] = of("position")[:last] - of("reference_position")[:last]
        self.motion[:last, at.position : at.position + d] = of("position")[:last]
        sums = self._sum_gradients()
        result[:last] = sums @ self.corrections.swapaxes(1, 2) / self.volume[:, None, None]

    def _sum_gradients(self) -> np.ndarray:
        """Sums (owned, d, d) over all pairs for the gradient of the first vector of the motion; collective."""
        near, at, d = self.near, self.columns, self.dimension
        self._begin_sums()
        self._gradient_sweep(near.inner, 0, near.owned, self.motion, self.record)
        columns = self.record[: near.owned, : at.vector * d]
        sums = columns.reshape(near.owned, d, at.vector)[:, :, :d].swapaxes(1, 2).copy()
        columns[:] = 0.0
        return sums

    def _begin_gradients(self) -> None:
        """Motion in rows, and what ghosts and images add to the sums of gradients."""
        velocity, position = self.particles.storage("velocity"), self.particles.storage("position")
        for block in self.blocks:
            gather_motion(self.dimension, block.first, block.last, velocity, position, self.motion)
        self._begin_sums()

    def _begin_sums(self) -> None:
        near, at = self.near, self.columns
        self._motion.start()
        self._motion.finish()
        if len(near.images.source):
            mirror_motion(near.local, near.images, self.motion, at.position, at.reference)
        if len(near.outer.neighbour):
            clear_rows(near.owned, near.rows, self.record)
            self._gradient_sweep(near.outer, 0, near.owned, self.motion, self.record)
        self._add_own_sums()

    def _add_own_sums(self) -> None:
        """Add to the sums of gradients what other pair lists do not have."""

    def _add_own_forces(self, stretched: int) -> None:
        """Add to the forces what other pair lists do not have; see `_add_up`."""


@kernel
def clear_rows(first, last, rows):
    """Set rows first .. last - 1 to zero."""
    for a in range(first, last):
        for c in range(rows.shape[1]):
            rows[a, c] = 0.0


@kernel
def gather_motion(d, first, last, v, x, motion):
    """Copy v and x (d, n) of particles first .. last - 1 into their rows."""
    for a in range(np.uintp(first), np.uintp(last)):
        if d == 3:
            store_row(motion, a, 0, (v[0, a], v[1, a], v[2, a], 0.0))
            store_row(motion, a, 4, (x[0, a], x[1, a], x[2, a], 0.0))
        else:
            store_row(motion, a, 0, (v[0, a], v[1, a], x[0, a], x[1, a]))


@kernel
def mirror_motion(local, images, motion, at_position, at_reference):
    """v and x of images, in rows from `local` on."""
    for k in range(images.source.size):
        a, b = local + k, images.source[k]
        for i in range(images.signs.shape[1]):
            Q = images.signs[k, i]
            motion[a, i] = Q * motion[b, i]
            displacement = motion[b, at_position + i] - motion[b, at_reference + i]
            motion[a, at_position + i] = motion[a, at_reference + i] + Q * displacement


@kernel
def mirror_records(local, images, record, at_stress):
    """Stresses, gradients and impedances of images, in rows from `local` on."""
    d = images.signs.shape[1]
    stride = 4 if d == 3 else 2
    for k in range(images.source.size):
        a, b, s = local + k, images.source[k], images.stress_sign[k]
        for c in range(record.shape[1]):
            record[a, c] = record[b, c]
        for j in range(d):
            for i in range(d):
                record[a, at_stress + stride * j + i] *= s * images.signs[k, i] * images.signs[k, j]
                record[a, stride * j + i] *= images.signs[k, i] * images.reflection[k, j]


@kernel
def mirror_waves(local, images, waves):
    """Wave tensors of images, in rows from `local` on: R S R."""
    for k in range(images.source.size):
        a, b, R = local + k, images.source[k], images.reflection[k]
        for c in range(waves.shape[1]):
            waves[a, c] = waves[b, c]
        if R.size == 3:
            waves[a, 4] *= R[0] * R[1]
            waves[a, 5] *= R[0] * R[2]
            waves[a, 6] *= R[1] * R[2]
        else:
            waves[a, 2] *= R[0] * R[1]
