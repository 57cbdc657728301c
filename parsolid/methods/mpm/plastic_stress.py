"""Elastic-plastic material points after a step: kinematics and artificial viscosity around `plastic.tile_update`.

The deviator is kept in unrotated axes (rate of Green and Naghdi).
"""

from typing import NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.functions import specific_heat
from parsolid.materials.plastic.tile_update import (
    DAMAGE,
    DEFORMATION,
    DEVIATOR,
    HEAT,
    JACOBIAN,
    MIDDLE_JACOBIAN,
    NEW_JACOBIAN,
    PLASTIC_WORK,
    PRESSURE,
    RELEASED,
    ROOM,
    ROTATION,
    SPEED,
    TEMPERATURE,
    VELOCITY_GRADIENT,
    VOLUME_RATE,
    advance_deformation,
    fill_idle,
    finish_step,
    flow,
    load_state,
    new_tile,
    start_step,
    store_state,
)
from parsolid.tensors import congruence
from parsolid.tiles import TILE, load, load_placed, load_symmetric, store_placed

# components of nine that F has in two and three dimensions; the first ones of six that the deviator has
TENSOR_ROWS = {2: np.array([0, 1, 3, 4, 8]), 3: np.arange(9)}
SYMMETRIC_ROWS = {2: 4, 3: 6}


class PlasticState(NamedTuple):
    """What particles of elastic-plastic laws carry from step to step, arrays (rows, capacity).

    deformation: F, 9 rows in space (11, 12, 13, 21...), 5 in the plane (11, 12, 21, 22, 33); deviator: unrotated s
    [Pa], 6 rows (11, 22, 33, 12, 13, 23) or 4 (11, 22, 33, 12); one row each: plastic_strain (equivalent), energy E
    [J/m^3] per reference volume, temperature [K]. Of laws that fail, else None: damage, that of each criterion (a row
    each), the factor of the strength (None: 1) and the mass that was deleted [kg] (None: nothing is).
    """

    deformation: np.ndarray
    deviator: np.ndarray
    plastic_strain: np.ndarray
    energy: np.ndarray
    temperature: np.ndarray
    damage: np.ndarray | None = None
    criterion_damage: np.ndarray | None = None
    strength_factor: np.ndarray | None = None
    deleted_mass: np.ndarray | None = None


class BulkViscosity(NamedTuple):
    """q = rho h |tr d| (quadratic h |tr d| + linear c) of compression, h the spacing of the grid [m].

    centred: whether the work of both q and the change of pressure since the last forces is heat, as it is where forces
    of a time act for half of the steps before and after it (`external_forces`); else that of q.
    """

    linear: float
    quadratic: float
    spacing: float
    centred: bool = False


@inlined
def load_rates(tile, rate, deleted, i, count):
    """Velocity gradients [1/s] of particles i..i+count-1; deleted particles do not deform any more."""
    for p in range(count):
        q = np.uintp(i + p)
        for a in range(3):
            for b in range(3):
                gradient = rate[q, 4 * a + b]
                if deleted is not None:
                    gradient = 0.0 if deleted[0, q] > 0.0 else gradient
                tile[(VELOCITY_GRADIENT + 3 * a + b) * TILE + p] = gradient


@inlined
def add_viscous_heat(law, failure, viscosity, motion, stress, i, count, tile, q):
    """Viscous pressure q (TILE,) [Pa] of the step, whose work goes to HEAT; after `start_step`.

    stress (capacity, 8): V sigma before the step. Failed matter resists under pressure alone.
    """
    linear, quadratic, spacing, centred = viscosity
    for p in range(TILE):
        jump = max(-tile[VOLUME_RATE * TILE + p], 0.0) * spacing
        density = law.density / tile[MIDDLE_JACOBIAN * TILE + p]
        q[p] = density * jump * (quadratic * jump + linear * tile[SPEED * TILE + p])
        if failure is not None:
            intact = tile[DAMAGE * TILE + p] < 1.0 or tile[PRESSURE * TILE + p] > 0.0
            q[p] = q[p] if intact else 0.0
        tile[HEAT * TILE + p] = -q[p] * (tile[NEW_JACOBIAN * TILE + p] - tile[JACOBIAN * TILE + p])
    if centred:
        for p in range(count):
            volume = motion[i + p, 7] * tile[JACOBIAN * TILE + p]
            before = (stress[i + p, 0] + stress[i + p, 1] + stress[i + p, 2]) / 3.0 / max(volume, 1e-300)
            change = tile[NEW_JACOBIAN * TILE + p] - tile[JACOBIAN * TILE + p]
            tile[HEAT * TILE + p] = -0.5 * (q[p] - tile[PRESSURE * TILE + p] - before) * change


@kernel
def forget_shape(plane, tile):
    """Give F of failed matter no shape: the same stretch in all directions (in the plane for plane strain)."""
    for p in range(TILE):
        if tile[DAMAGE * TILE + p] >= 1.0:
            J, first = tile[NEW_JACOBIAN * TILE + p], DEFORMATION * TILE + p
            stretch = max(J, 0.0) ** (1.0 / 3.0)
            if plane is not None:
                stretch = max(J / tile[first + 8 * TILE], 0.0) ** 0.5
            for c in range(8):
                tile[first + c * TILE] = stretch if c % 4 == 0 else 0.0
            if plane is None:
                tile[first + 8 * TILE] = stretch


@kernel
def advance_tiles(
    law, failure, plane, places, first, last, step, viscosity, carried, failing, strength, deleted, rise, motion, rate,
    stress, tile,
):  # fmt: skip
    """See `advance_stress`. places: TENSOR_ROWS of the dimension; carried: F, deviator, plastic
    strain, energy and temperature (rows, capacity); failing: damage and criterion damage, or None."""
    sound, fastest, plastic, viscous, released = True, 0.0, 0.0, 0.0, 0.0
    q = np.zeros(TILE)
    deformation, deviator, plastic_strain, energy, temperature = carried
    numbers = (plastic_strain, energy, temperature)
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_placed(deformation, places, i, count, tile, DEFORMATION)
        load_state(deviator, numbers, failing, strength, i, count, tile)
        load_rates(tile, rate, deleted, i, count)
        if count < TILE:
            fill_idle(law, tile, count)
        advance_deformation(step, plane, tile)
        start_step(law, failure, tile)
        add_viscous_heat(law, failure, viscosity, motion, stress, i, count, tile, q)
        flow(law, failure, step, tile)
        finish_step(law, failure, step, tile)
        if failing is not None:
            forget_shape(plane, tile)
        store_placed(deformation, places, i, count, tile, DEFORMATION)
        store_state(deviator, numbers, failing, i, count, tile)
        for p in range(count):
            r = np.uintp(i + p)
            volume = motion[r, 7]
            s = congruence(load(tile, ROTATION * TILE + p), load_symmetric(tile, DEVIATOR * TILE + p))
            V, pressure = volume * tile[NEW_JACOBIAN * TILE + p], tile[PRESSURE * TILE + p] + q[p]
            stress[r, 0], stress[r, 1], stress[r, 2] = (
                V * (s[0] - pressure),
                V * (s[1] - pressure),
                V * (s[2] - pressure),
            )
            stress[r, 3], stress[r, 4], stress[r, 5], stress[r, 6] = 0.0, V * s[5], V * s[4], V * s[3]
            speed = tile[SPEED * TILE + p] + (motion[r, 4] ** 2 + motion[r, 5] ** 2 + motion[r, 6] ** 2) ** 0.5
            stress[r, 7] = speed
            if deleted is not None and deleted[0, r] > 0.0:
                continue
            fastest = max(fastest, speed)
            plastic += volume * tile[PLASTIC_WORK * TILE + p]
            viscous += volume * tile[HEAT * TILE + p]
            released += volume * tile[RELEASED * TILE + p]
            if rise is not None:
                capacity = law.density * specific_heat(law, tile[TEMPERATURE * TILE + p])
                rise[0, r] += law.taylor_quinney * tile[PLASTIC_WORK * TILE + p] / capacity
            # not so for numbers that are none
            if not (tile[ROOM * TILE + p] > 0.0 and speed > 0.0):
                sound = False
    return sound, fastest, plastic, viscous, released


def advance_stress(
    dimension: int,
    first: int,
    last: int,
    law: ElasticPlastic,
    step: float,
    viscosity: BulkViscosity | None,
    state: PlasticState,
    motion: np.ndarray,
    rate: np.ndarray,
    stress: np.ndarray,
    rise: np.ndarray | None = None,
) -> tuple[bool, float, float, float, float]:
    """Advance F, s, ep, E and T of particles first..last-1 by one step [s] with the velocity gradients `rate`.

    motion, rate, stress: see `transfer`; V sigma is written, artificial viscosity included, and c + |v| in the last
    column; rise (1, capacity) [K]: to which plastic warming is added, or None. Returns (sound, largest c + |v| [m/s],
    plastic work, viscous work, what failure released [J]); sound is False where J <= 0, beyond the equation of state,
    or not a number.
    """
    tile = new_tile(0 if state.criterion_damage is None else len(state.criterion_damage))
    places, plane = TENSOR_ROWS[dimension], True if dimension == 2 else None
    failing = None
    if law.failure is not None:
        failing = state.damage, state.criterion_damage
    viscous = (0.0, 0.0, 0.0, False) if viscosity is None else tuple(viscosity)
    more = failing, state.strength_factor, state.deleted_mass, rise
    return advance_tiles(
        law, law.failure, plane, places, first, last, step, viscous, tuple(state[:5]), *more, motion, rate, stress, tile
    )  # fmt: skip
