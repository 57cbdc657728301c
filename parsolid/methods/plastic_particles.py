"""Particles of elastic-plastic solids in methods that have deformation gradients (`plastic.total_lagrangian`).

They carry C_p^-1, the equivalent plastic strain, internal energy and temperature, back stresses and plastic volumes of
laws that have them, and the stress that acts, whose work the internal energy takes. What dissipative forces between
particles take is heat of these.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined
from parsolid.materials.failure.failure import count_of
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic, full_tensor
from parsolid.materials.plastic.tile_update import (
    BACK_STRESS_ENERGY,
    HEAT,
    JACOBIAN,
    METRIC,
    PLASTIC_VOLUME,
    PLASTIC_WORK,
    REFERENTIAL_BACK_STRESS,
    RELEASED,
    ROOM,
    STRESS,
    load_if_any,
    load_state,
    store_if_any,
    store_state,
)
from parsolid.materials.registry import laws_of
from parsolid.methods import failed_matter, plastic_fields
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.plastic_fields import PLASTIC_STATE
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.initial_fields import (
    initial_plastic_strain,
    initial_temperature,
    initial_zero_energy_temperature,
)
from parsolid.tiles import TILE, load_placed, load_rows, store_placed, store_rows

METRIC_FIELD, ACTING = "plastic_metric_inverse", "acting_stress"
PLASTIC_WORK_TERM = "plastic_work"
_METRIC_AT_REST = (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)
# components of the stress in space: those of the plane are 11 12 21 22 33
STRESS_PLACES = {2: np.array([0, 1, 3, 4, 8]), 3: np.arange(9)}
# of particles that share a law in a step: plastic work, what failure released, heat of the dissipation [J], least room
# to compress, what of the plastic work back stresses have stored [J]
WORK, RELEASED_HEAT, DISSIPATED, ROOM_LEFT, STORED, TOTALS = range(6)


def declare_plastic(particles: Particles, dimension: int, laws: list[Any], heat: str | None) -> None:
    """What particles carry where any law flows; heat: name of the field of what dissipative forces take, None without
    such forces."""
    if not any(isinstance(law, ElasticPlastic) for law in laws):
        return
    columns: dict[str, Any] = {"checkpointed": True, "layout": Columns()}
    particles.declare(Field(METRIC_FIELD, 6, "1", **columns), _METRIC_AT_REST)
    for field in PLASTIC_STATE:
        particles.declare(field)
    particles.declare(Field(ACTING, len(STRESS_PLACES[dimension]), "Pa", **columns))
    if heat is not None:
        particles.declare(Field(heat, 1, "W", **columns))
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

    numbers, failing, strength: see `tile_update.load_state`; jacobian (n,): of the start of a step; heat: what
    dissipative forces take [W]; mean_step [s]: for which these have acted, halves of the steps before and of this one.
    totals (TOTALS,): see above; tile: of `tile_update`.
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
    # unsigned indices, see `tiles.load_rows`
    start, at, heat = np.uintp(first), np.uintp(JACOBIAN * TILE), np.uintp(HEAT * TILE)
    for p in range(np.uintp(count)):
        tile[at + p], tile[heat + p] = fields.jacobian[start + p], 0.0


@inlined
def take_heat_of_dissipation(fields, heat, first, count, tile):
    """HEAT [J/m^3], 0 before, of the dissipation D, which has acted in the kicks around its time.

    The powers q are of velocities half a step before; in mean_step (h) all forces F change these by h F/m on the mean,
    and -D.dv of both halves is h q - h^2 D.F/2m.
    """
    step, start, at = fields.mean_step, np.uintp(first), np.uintp(HEAT * TILE)
    for c in range(fields.stress_force.shape[0]):
        for p in range(np.uintp(count)):
            damping = fields.dissipative_force[c, start + p]
            tile[at + p] += damping * (fields.stress_force[c, start + p] + damping)
    for p in range(np.uintp(count)):
        lost = step * (heat[0, start + p] - 0.5 * step / fields.mass[start + p] * tile[at + p])
        tile[at + p] = lost * fields.share[start + p] / fields.volume[start + p]


@inlined
def store_particles(fields, first, count, tile):
    """What particles first .. first + count - 1 carry after a step, without that of the dissipation."""
    store_rows(fields.metric, first, count, tile, METRIC)
    store_placed(fields.stress, fields.stress_places, first, count, tile, STRESS)
    store_state(fields.numbers, fields.failing, first, count, tile)
    store_if_any(fields.back_stress, first, count, tile, REFERENTIAL_BACK_STRESS)
    store_if_any(fields.volume_flow, first, count, tile, PLASTIC_VOLUME)


@inlined
def add_totals(fields, first, count, tile):
    """Add what a step has done with particles of a tile to the totals."""
    totals, start = fields.totals, np.uintp(first)
    work, stored, released, taken, least = 0.0, 0.0, 0.0, 0.0, totals[ROOM_LEFT]
    for p in range(np.uintp(count)):
        volume = fields.volume[start + p]
        work += volume * tile[np.uintp(PLASTIC_WORK * TILE) + p]
        stored += volume * tile[np.uintp(BACK_STRESS_ENERGY * TILE) + p]
        released += volume * tile[np.uintp(RELEASED * TILE) + p]
        taken += volume * tile[np.uintp(HEAT * TILE) + p]
        room = tile[np.uintp(ROOM * TILE) + p]
        # what is not a number stays
        least = room if (room < least) | np.isnan(room) else least
    totals[WORK] += work
    totals[STORED] += stored
    totals[RELEASED_HEAT] += released
    totals[DISSIPATED] += taken
    totals[ROOM_LEFT] = least


def fields_of(
    particles: Particles, law: Any, dimension: int, names: tuple[str, str], mean_step: float, *room: np.ndarray
) -> PlasticFields:
    """The fields of particles of a law as kernels take them; mean_step [s]: see `PlasticFields`.

    names: of the fields of forces without dissipation, and of what dissipation takes; room: totals, which begin anew,
    and tile.
    """
    stored, (force, heat), (totals, tile) = particles.storage, names, room

    def if_any(name: str) -> np.ndarray | None:
        return stored(name) if name in particles else None

    totals[:] = 0.0
    totals[ROOM_LEFT] = np.inf
    failing = None
    if law.failure is not None:
        failing = stored("damage"), stored("criterion_damage")[: count_of(law.failure)]
    back_stress, volume_flow = plastic_fields.flow_state(particles, law)
    return PlasticFields(
        metric=stored(METRIC_FIELD),
        numbers=tuple(stored(field.name) for field in PLASTIC_STATE),
        stress=stored(ACTING),
        jacobian=stored("jacobian")[0],
        volume=stored("volume").ravel(),
        share=stored("share").ravel(),
        mass=stored("mass").ravel(),
        stress_force=stored(force),
        dissipative_force=stored("dissipative_force"),
        heat=if_any(heat),
        failing=failing,
        strength=None if failing is None else if_any("strength_factor"),
        back_stress=back_stress,
        volume_flow=volume_flow,
        stress_places=STRESS_PLACES[dimension],
        mean_step=mean_step,
        totals=totals,
        tile=tile,
    )


def shown_flow(particles: Particles, name: str, first: int, last: int, gradients: np.ndarray) -> np.ndarray:
    """See `plastic_fields.shown_flow`; gradients: F (n, 3, 3) of these particles."""

    def present(back: np.ndarray) -> np.ndarray:
        # V^-1 F B F^T V^-1 with the elastic stretch V, as `total_lagrangian.find_back_stress`
        metric = full_tensor(particles.owned_rows(METRIC_FIELD)[first:last].T).transpose(2, 0, 1)
        squares, axes = np.linalg.eigh(gradients @ metric @ gradients.swapaxes(1, 2))
        pushed = (axes / np.sqrt(squares)[:, None]) @ axes.swapaxes(1, 2) @ gradients
        back = pushed @ back @ pushed.swapaxes(1, 2)
        return np.asarray(back - np.trace(back, axis1=1, axis2=2)[:, None, None] / 3.0 * np.eye(3))

    return plastic_fields.shown_flow(particles, name, first, last, present)


def book(law: Any, totals: np.ndarray, heat: str, ledger: Any) -> None:
    """Enter into a ledger what a step did with particles of a law: heat of the dissipation, a term of that name, is in
    the stored energy."""
    ledger.add(1.0, 0.0, -totals[DISSIPATED], 0.0)
    ledger.add_term(heat, totals[DISSIPATED])
    ledger.add_term(PLASTIC_WORK_TERM, totals[WORK])
    if plastic_fields.has_back_stress(law):
        ledger.add_term(plastic_fields.BACK_STRESS_ENERGY, totals[STORED])
    if law.failure is not None:
        ledger.add_term(FAILURE_DISSIPATION, totals[RELEASED_HEAT])


def measure_flow(particles: Particles, mass: np.ndarray, name: str) -> tuple[str, np.ndarray]:
    """This rank's part of a quantity of plastic flow or failure, see `ParticleSystem.measure`; mass (owned,) [kg]."""
    failed = failed_matter.measure(particles, mass, name)
    if failed is not None:
        return failed
    field = name.removeprefix("maximum_")
    values = particles.owned_rows(field) if field in particles else np.zeros(0)
    return "maximum", np.array([values.max(initial=0.0)])


def take_heat(particles: Particles, blocks: list[Any], heat: np.ndarray, rows: np.ndarray) -> float:
    """Warm the particles of blocks (first, last, law) among rows (n,), see `ParticleSystem.take_heat`; others take
    nothing."""
    of, taken = particles.owned_rows, 0.0
    temperature, energy = of("temperature"), of("internal_energy")
    for block in blocks:
        chosen = (rows >= block.first) & (rows < block.last)
        here = rows[chosen]
        # E is that of the part on this side of mirror planes, as the volume is
        own = heat[chosen] * of("share")[here]
        density = own / of("volume")[here]
        temperature[here] += block.law.temperature_rise(temperature[here], density)
        energy[here] += density
        taken += float(own.sum())
    return taken
