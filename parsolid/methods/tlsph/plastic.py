"""Elastic-plastic solids in total-Lagrangian SPH (`materials.plastic.total_lagrangian`).

Particles carry C_p^-1, the equivalent plastic strain, internal energy and temperature, and the stress that acts, whose
work the internal energy takes. What the Riemann dissipation takes is heat: half of each pair's loss for each particle.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel
from parsolid.materials.failure.failure import count_of
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.tile_update import (
    BACK_STRESS_ENERGY,
    DAMAGE,
    DEFORMATION,
    HEAT,
    JACOBIAN,
    METRIC,
    NEW_JACOBIAN,
    PLASTIC_VOLUME,
    PLASTIC_WORK,
    REFERENTIAL_BACK_STRESS,
    RELEASED,
    ROOM,
    SHEAR_MODULUS,
    STRESS,
    VELOCITY_GRADIENT,
    WAVES,
    fill_idle,
    load_if_any,
    load_state,
    new_tile,
    store_if_any,
    store_state,
)
from parsolid.materials.plastic.total_lagrangian import advance_tile
from parsolid.materials.registry import laws_of
from parsolid.methods import failed_matter, plastic_fields
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.plastic_fields import PLASTIC_STATE
from parsolid.methods.tlsph.point_update import TILE, in_directions, store_speeds, update_tile
from parsolid.methods.tlsph.point_update import store as store_into_wide
from parsolid.methods.tlsph.state import LawBlock
from parsolid.methods.tlsph.tangent import isotropic_moduli
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.initial_fields import (
    initial_plastic_strain,
    initial_temperature,
    initial_zero_energy_temperature,
)
from parsolid.tensors import cofactor, gram, largest_eigenvalue, largest_eigenvalue_bound, times_symmetric
from parsolid.tiles import TILE as PART
from parsolid.tiles import load, load_placed, load_rows, load_symmetric, store_placed, store_rows

METRIC_FIELD, ACTING, RIEMANN_HEAT = "plastic_metric_inverse", "acting_stress", "riemann_heat"
PLASTIC_WORK_TERM = "plastic_work"
_METRIC_AT_REST = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
# components of the stress in space: those of the plane are 11 12 21 22 33
_STRESS_PLACES = {2: np.array([0, 1, 3, 4, 8]), 3: np.arange(9)}
# of a block in a step: plastic work, what of it back stresses have stored, what failure released, heat of the
# dissipation [J], least room to compress
_WORK, _STORED, _RELEASED, _HEAT, _ROOM = range(5)


def declare_plastic(particles: Particles, dimension: int, laws: list[Any], dissipates: bool) -> None:
    """What particles carry where any law flows; dissipates: whether there is a Riemann dissipation."""
    if not any(isinstance(law, ElasticPlastic) for law in laws):
        return
    columns: dict[str, Any] = {"checkpointed": True, "layout": Columns()}
    particles.declare(Field(METRIC_FIELD, 6, "1", **columns), _METRIC_AT_REST)
    for field in PLASTIC_STATE:
        particles.declare(field)
    particles.declare(Field(ACTING, len(_STRESS_PLACES[dimension]), "Pa", **columns))
    if dissipates:
        particles.declare(Field(RIEMANN_HEAT, 1, "W", **columns))
    plastic_fields.declare_flow_state(particles, laws, 6)
    failed_matter.declare_failure(particles, laws)


def begin_plastic(scene: Any, particles: Particles, particle_set: Any, blocks: list[Any]) -> None:
    """Temperature, plastic strain and internal energy at time 0."""
    if METRIC_FIELD not in particles:
        return
    rows, place = particles.owned_rows, (scene, particle_set.body, particle_set.position)
    usual = np.array([getattr(law, "reference_temperature", 0.0) for law in laws_of(scene)])
    rows("temperature")[:] = initial_temperature(*place, usual, particle_set.regions)
    rows("plastic_strain")[:] = initial_plastic_strain(*place, particle_set.regions)
    for block in blocks:
        own = slice(block.first, block.last)
        warm, law = rows("temperature")[own], block.law
        cold = initial_zero_energy_temperature(scene, particle_set.body[own], warm, law.reference_temperature)
        rows("internal_energy")[own] = law.internal_energy(warm, cold)


class PlasticFields(NamedTuple):
    """Fields (components, n) of particles that flow, and of all; None where there is no such thing.

    numbers, failing, strength: see `tile_update.load_state`; jacobian (n,): of the start of a step; heat: what the
    Riemann dissipation takes [W]; mean_step [s]: for which it has acted, halves of the steps before and of this one.
    totals (5,): see above; tile: of `tile_update`.
    """

    metric: np.ndarray
    numbers: tuple[np.ndarray, ...]
    stress: np.ndarray
    jacobian: np.ndarray
    volume: np.ndarray
    share: np.ndarray
    mass: np.ndarray
    stress_force: np.ndarray
    dissipative_force: np.ndarray
    heat: np.ndarray | None
    failing: tuple[np.ndarray, np.ndarray] | None
    strength: np.ndarray | None
    back_stress: np.ndarray | None
    volume_flow: np.ndarray | None
    stress_places: np.ndarray
    mean_step: float
    totals: np.ndarray
    tile: np.ndarray


@inlined
def load_particles(fields, first, count, tile):
    """What particles first .. first + count - 1 carry, and no HEAT."""
    load_rows(fields.metric, first, count, tile, METRIC)
    load_placed(fields.stress, fields.stress_places, first, count, tile, STRESS)
    load_state(fields.numbers, fields.failing, fields.strength, first, count, tile)
    load_if_any(fields.back_stress, first, count, tile, REFERENTIAL_BACK_STRESS)
    load_if_any(fields.volume_flow, first, count, tile, PLASTIC_VOLUME)
    for p in range(count):
        tile[JACOBIAN * PART + p], tile[HEAT * PART + p] = fields.jacobian[first + p], 0.0


@inlined
def take_riemann_heat(fields, heat, first, count, tile):
    """HEAT [J/m^3] of the dissipation D, which has acted in the kicks around its time.

    The powers q are of velocities half a step before; in mean_step (h) all forces F change these by h F/m on the mean,
    and -D.dv of both halves is h q - h^2 D.F/2m.
    """
    step = fields.mean_step
    for p in range(count):
        a = first + p
        power = 0.0
        for c in range(fields.stress_force.shape[0]):
            damping = fields.dissipative_force[c, a]
            power += damping * (fields.stress_force[c, a] + damping)
        lost = step * (heat[0, a] - 0.5 * step / fields.mass[a] * power)
        tile[HEAT * PART + p] = lost * fields.share[a] / fields.volume[a]


@inlined
def wave_tensors(tile, p):
    """Of pressure and of shear waves [Pa] of particle p of a tile; failed matter bears no shear."""
    H, J = cofactor(load(tile, DEFORMATION * PART + p)), tile[NEW_JACOBIAN * PART + p]
    mu = tile[SHEAR_MODULUS * PART + p] if tile[DAMAGE * PART + p] < 1.0 else 0.0
    return load_symmetric(tile, WAVES * PART + p), times_symmetric(mu / J, gram(H))


@update_tile.of(ElasticPlastic)
def _update_plastic(
    law, step, third, signals, branches, F, G, A, branch_sum, push, J, P, impedance, signal, lost, carried, row, n
):
    # a function of its own, compiled once for lists and boxes
    _advance(law, carried, carried.heat, row, n, step, third, signals, F, G, push, J, P, impedance, signal)


@kernel
def _advance(law, fields, heat, row, n, step, third, signals, F, G, push, J, P, impedance, signal):
    """See `point_update.update_tile`; heat: that of the fields, which may be None."""
    tile, totals = fields.tile, fields.totals
    for start in range(0, n, PART):
        count, first = min(PART, n - start), row + start
        load_particles(fields, first, count, tile)
        if heat is not None:
            take_riemann_heat(fields, heat, first, count, tile)
        fill_idle(law, tile, count)
        for c in range(9):
            for p in range(count):
                at = c * TILE + start + p
                change = step * G[at]
                F[at] += change
                tile[(DEFORMATION + c) * PART + p], tile[(VELOCITY_GRADIENT + c) * PART + p] = F[at], change
        advance_tile(law, law.failure, step, tile)
        store_rows(fields.metric, first, count, tile, METRIC)
        store_placed(fields.stress, fields.stress_places, first, count, tile, STRESS)
        store_state(fields.numbers, fields.failing, first, count, tile)
        store_if_any(fields.back_stress, first, count, tile, REFERENTIAL_BACK_STRESS)
        store_if_any(fields.volume_flow, first, count, tile, PLASTIC_VOLUME)
        for p in range(count):
            volume, q = fields.volume[first + p], start + p
            totals[_WORK] += volume * tile[PLASTIC_WORK * PART + p]
            totals[_STORED] += volume * tile[BACK_STRESS_ENERGY * PART + p]
            totals[_RELEASED] += volume * tile[RELEASED * PART + p]
            totals[_HEAT] += volume * tile[HEAT * PART + p]
            room = tile[ROOM * PART + p]
            # also where it is not a number
            if not room >= totals[_ROOM]:
                totals[_ROOM] = room
            store_into_wide(P, q, load(tile, STRESS * PART + p))
            J[q] = tile[NEW_JACOBIAN * PART + p]
            fast, slow = wave_tensors(tile, p)
            store_speeds(law.density, third, signals, push, q, fast, slow, signal, impedance)


@kernel
def find_states(law, fields, gradient, places, first, last, third, stress, waves):
    """First Piola-Kirchhoff stresses (last - first, 9) [Pa] of the present state, and of its waves (last - first, 3)
    [Pa]: the greatest rho c_p^2, and bounds of those of both waves. gradient: field of F, components at `places`."""
    tile = fields.tile
    for i in range(first, last, PART):
        count = min(PART, last - i)
        load_particles(fields, i, count, tile)
        tile[VELOCITY_GRADIENT * PART : (VELOCITY_GRADIENT + 9) * PART] = 0.0
        fill_idle(law, tile, count)
        for c in range(9):
            tile[(DEFORMATION + c) * PART : (DEFORMATION + c + 1) * PART] = 1.0 if c % 4 == 0 else 0.0
        load_placed(gradient, places, i, count, tile, DEFORMATION)
        advance_tile(law, law.failure, 0.0, tile)
        for p in range(count):
            for c in range(9):
                stress[i - first + p, c] = tile[(STRESS + c) * PART + p]
            fast, slow = wave_tensors(tile, p)
            fast, slow = in_directions(third, fast), in_directions(third, slow)
            waves[i - first + p, 0] = largest_eigenvalue(fast)
            waves[i - first + p, 1] = largest_eigenvalue_bound(fast)
            waves[i - first + p, 2] = largest_eigenvalue_bound(slow)


class PlasticBlock(LawBlock):
    """Particles of a rank that share an elastic-plastic law, with what `state.LawBlock` offers."""

    def __init__(
        self, particles: Particles, first: int, last: int, law: Any, rows_of_values: slice | None = None
    ) -> None:
        super().__init__(particles, first, last, law, rows_of_values)
        self.totals, self._tile = aligned_zeros(5), new_tile(count_of(law.failure))

    def carried_fields(self, step: float, last_step: float) -> PlasticFields:
        """The fields as kernels take them in a step [s] after one of another length; their totals begin anew."""
        stored, law = self.particles.storage, self.law

        def if_any(name: str) -> np.ndarray | None:
            return stored(name) if name in self.particles else None

        self.totals[:] = 0.0
        self.totals[_ROOM] = np.inf
        failing = None
        if law.failure is not None:
            failing = stored("damage"), stored("criterion_damage")[: count_of(law.failure)]
        return PlasticFields(
            metric=stored(METRIC_FIELD),
            numbers=tuple(stored(field.name) for field in PLASTIC_STATE),
            stress=stored(ACTING),
            jacobian=stored("jacobian")[0],
            volume=stored("volume")[0],
            share=stored("share").ravel(),
            mass=stored("mass").ravel(),
            stress_force=stored("stress_force"),
            dissipative_force=stored("dissipative_force"),
            heat=if_any(RIEMANN_HEAT),
            failing=failing,
            strength=None if failing is None else if_any("strength_factor"),
            back_stress=stored(plastic_fields.BACK_STRESS) if plastic_fields.has_back_stress(law) else None,
            volume_flow=stored(plastic_fields.VOLUME_FLOW) if plastic_fields.flows_in_volume(law) else None,
            stress_places=_STRESS_PLACES[self.dimension],
            mean_step=0.5 * (step + last_step) if step > 0.0 else 0.0,
            totals=self.totals,
            tile=self._tile,
        )

    def find_moduli(self, index: np.ndarray, moduli: np.ndarray) -> None:
        """Those of elasticity at rest, whatever has flowed."""
        shear, lame = elastic_moduli(self.law)
        moduli[:, self.first : self.last] = isotropic_moduli(shear, lame, self.dimension)[:, None]

    @property
    def sound(self) -> bool:  # type: ignore[override]
        """Whether no particle is compressed beyond its equation of state, and all are numbers, after the last step."""
        return bool(self.totals[_ROOM] > 0.0)

    def book(self, ledger: Any) -> None:
        """Enter into a ledger what the last step did: heat of the dissipation is in the stored energy."""
        work, released, heat = self.totals[_WORK], self.totals[_RELEASED], self.totals[_HEAT]
        ledger.add(1.0, 0.0, -heat, 0.0)
        ledger.add_term(RIEMANN_HEAT, heat)
        ledger.add_term(PLASTIC_WORK_TERM, work)
        if self.law.kinematic_hardening is not None:
            ledger.add_term(plastic_fields.BACK_STRESS_ENERGY, self.totals[_STORED])
        if self.law.failure is not None:
            ledger.add_term(FAILURE_DISSIPATION, released)

    def energy(self) -> float:
        """Internal energy [J] on this side of mirror planes."""
        of, own = self.particles.owned_rows, slice(self.first, self.last)
        return float(of("internal_energy")[own] @ of("volume")[own])

    def _states(self, first: int, last: int) -> tuple[np.ndarray, np.ndarray]:
        gradient, third = self.particles.storage("deformation_gradient"), 0.0 if self.dimension == 2 else 1.0
        stress, waves = np.zeros((last - first, 9)), np.zeros((last - first, 3))
        fields, places = self.carried_fields(0.0, 0.0), self.places.tensor
        find_states(self.law, fields, gradient, places, first, last, third, stress, waves)
        return stress, waves

    def stresses(self, first: int, last: int) -> np.ndarray:
        """See `LawBlock.stresses`."""
        return self._states(first, last)[0].reshape(-1, 3, 3)

    def wave_speeds(self, signals: tuple[float, ...]) -> tuple[float, float]:
        """See `LawBlock.wave_speeds`."""
        largest, fast, slow = self._states(self.first, self.last)[1].T
        pairs = zip(signals[::2], signals[1::2])
        sums = [a * np.sqrt(fast) + b * np.sqrt(slow) for a, b in pairs]
        return float(largest.max()), float(np.max(sums))

    def room(self) -> np.ndarray:
        """Room (n,) that the equation of state leaves to compress particles, see `room_to_compress`."""
        jacobian = self.particles.owned_rows("jacobian")[self.first : self.last]
        return plastic_evaluation.room_to_compress(self.law, jacobian)
