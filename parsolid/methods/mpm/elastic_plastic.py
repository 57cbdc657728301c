"""Elastic-plastic material points after a step: kinematics and artificial viscosity around `plastic.tile_update`.

The deviator is kept in unrotated axes (rate of Green and Naghdi).
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.failure.failure import count_of
from parsolid.materials.plastic import tile_update as update
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.plastic_evaluation import pressure_wave_modulus
from parsolid.methods import plastic_fields
from parsolid.methods.failure_fields import FAILURE_DISSIPATION
from parsolid.methods.hyperelastic_particles import TENSOR_ROWS
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.tensors import (
    ROTATION_SETTLED,
    add_spherical,
    combine,
    congruence,
    contract,
    determinant,
    inverse,
    matmul,
    plane_rotation,
    plus,
    rotation_near,
    rotation_step,
    symmetric_part,
    times_symmetric,
    transpose,
)
from parsolid.tiles import (
    TILE,
    load,
    load_placed,
    load_rows,
    load_symmetric,
    store,
    store_placed,
    store_rows,
    store_symmetric,
)


class State(NamedTuple):
    """Fields (rows, capacity) of all elastic-plastic laws.

    F: 9 rows in space (11, 12, 13, 21...), 5 in the plane (11, 12, 21, 22, 33); unrotated deviator s [Pa]: 6 rows (11,
    22, 33, 12, 13, 23) or 4 (11, 22, 33, 12); one row each: equivalent plastic strain, energy E [J/m^3] per reference
    volume, temperature [K]. Back stress [Pa] as the deviator, and plastic volume strains (2),
    None where the law has none.
    """

    deformation_gradient: np.ndarray
    unrotated_deviator: np.ndarray
    plastic_strain: np.ndarray
    internal_energy: np.ndarray
    temperature: np.ndarray
    back_stress: np.ndarray | None = None
    volume_flow: np.ndarray | None = None


class BulkViscosity(NamedTuple):
    """q = rho h |tr d| (quadratic h |tr d| + linear c) of compression, h the spacing of the grid [m]."""

    linear: float
    quadratic: float
    spacing: float


@kernel
def advance_deformation(step, plane, tile):
    """F, its Jacobians and rotation after a step [s] with the VELOCITY_GRADIENT l, and the strain increment in it.

    F+ = (1 + dt l) F = R U. The stretching D is that of half the step in unrotated axes: from l (1 + dt l/2)^-1, which
    has no symmetric part for a rotation, however large the step. VOLUME_RATE: tr D [1/s]. plane: not None in plane
    strain and axial symmetry.
    """
    for p in range(TILE):
        F, rate = load(tile, update.DEFORMATION * TILE + p), load(tile, update.VELOCITY_GRADIENT * TILE + p)
        new = combine(1.0, F, step, matmul(rate, F))
        J, new_J = determinant(F), determinant(new)
        tile[update.JACOBIAN * TILE + p], tile[update.NEW_JACOBIAN * TILE + p] = J, new_J
        tile[update.MIDDLE_JACOBIAN * TILE + p] = 0.5 * (J + new_J)
        # the rotation of the middle of the step needs F + F+; both are made from F+ and l again
        store(tile, update.ROTATION * TILE + p, new)
    if plane is not None:
        for p in range(TILE):
            store(tile, update.ROTATION * TILE + p, plane_rotation(load(tile, update.ROTATION * TILE + p)))
    else:
        rotate(tile)
    for p in range(TILE):
        F, rate = load(tile, update.DEFORMATION * TILE + p), load(tile, update.VELOCITY_GRADIENT * TILE + p)
        R = load(tile, update.ROTATION * TILE + p)
        new = combine(1.0, F, step, matmul(rate, F))
        half = (1.0 + 0.5 * step * rate[0], 0.5 * step * rate[1], 0.5 * step * rate[2],
                0.5 * step * rate[3], 1.0 + 0.5 * step * rate[4], 0.5 * step * rate[5],
                0.5 * step * rate[6], 0.5 * step * rate[7], 1.0 + 0.5 * step * rate[8])  # fmt: skip
        D = symmetric_part(matmul(rate, inverse(half)))
        half_R = plane_rotation(plus(F, new)) if plane is not None else rotation_near(R, plus(F, new))
        D = congruence(transpose(half_R), D)
        volume_rate = D[0] + D[1] + D[2]
        tile[update.VOLUME_RATE * TILE + p] = volume_rate
        store_symmetric(tile, update.STRAIN * TILE + p, times_symmetric(step, add_spherical(D, -volume_rate / 3.0)))
        store(tile, update.DEFORMATION * TILE + p, new)


@kernel
def rotate(tile):
    """R of the tensors in the rows ROTATION, in their place, by Newton's method until none moves."""
    for p in range(TILE):
        tile[update.MOVES * TILE + p] = 1.0
    for _ in range(30):
        moving = 0
        for p in range(TILE):
            X = load(tile, update.ROTATION * TILE + p)
            new = rotation_step(X)
            change = combine(1.0, new, -1.0, X)
            # a particle that has settled is not changed again, whatever its neighbours do
            moves = tile[update.MOVES * TILE + p]
            store(tile, update.ROTATION * TILE + p, combine(moves, change, 1.0, X))
            settled = contract(change, change) <= ROTATION_SETTLED
            moves = 0.0 if settled else moves
            tile[update.MOVES * TILE + p] = moves
            moving += 1 if moves > 0.0 else 0
        if moving == 0:
            break


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
                tile[(update.VELOCITY_GRADIENT + 3 * a + b) * TILE + p] = gradient


@inlined
def add_viscous_heat(law, failure, viscosity, motion, stress, i, count, tile, q):
    """Viscous pressure q (TILE,) [Pa] of the step; after `start_step`.

    stress (capacity, 8): V sigma before the step. Forces of a time act for half of the steps before and after it: HEAT
    is the work of the mean of q and of its last value, with what the pressure has changed since the last forces. Failed
    matter resists under pressure alone.
    """
    linear, quadratic, spacing = viscosity
    for p in range(TILE):
        jump = max(-tile[update.VOLUME_RATE * TILE + p], 0.0) * spacing
        density = law.density / tile[update.MIDDLE_JACOBIAN * TILE + p]
        q[p] = density * jump * (quadratic * jump + linear * tile[update.SPEED * TILE + p])
        if failure is not None:
            intact = tile[update.DAMAGE * TILE + p] < 1.0 or tile[update.PRESSURE * TILE + p] > 0.0
            q[p] = q[p] if intact else 0.0
        tile[update.HEAT * TILE + p] = 0.0
    for p in range(count):
        volume = motion[i + p, 7] * tile[update.JACOBIAN * TILE + p]
        before = (stress[i + p, 0] + stress[i + p, 1] + stress[i + p, 2]) / 3.0 / max(volume, 1e-300)
        change = tile[update.NEW_JACOBIAN * TILE + p] - tile[update.JACOBIAN * TILE + p]
        tile[update.HEAT * TILE + p] = -0.5 * (q[p] - tile[update.PRESSURE * TILE + p] - before) * change


@kernel
def forget_shape(plane, tile):
    """Give F of failed matter no shape: the same stretch in all directions (in the plane for plane strain)."""
    for p in range(TILE):
        if tile[update.DAMAGE * TILE + p] >= 1.0:
            J, first = tile[update.NEW_JACOBIAN * TILE + p], update.DEFORMATION * TILE + p
            stretch = max(J, 0.0) ** (1.0 / 3.0)
            if plane is not None:
                stretch = max(J / tile[first + 8 * TILE], 0.0) ** 0.5
            for c in range(8):
                tile[first + c * TILE] = stretch if c % 4 == 0 else 0.0
            if plane is None:
                tile[first + 8 * TILE] = stretch


@kernel
def advance_state(
    first, last, law, failure, plane, places, step, viscosity, state, failing, strength, deleted, motion, rate,
    stress, tile,
):  # fmt: skip
    """State of particles first..last-1 after a step [s] with the velocity gradients `rate`.

    plane: not None in two dimensions; places: TENSOR_ROWS of the dimension. None where there is no such thing: failing,
    damage and that of each criterion (rows, capacity); strength, its factors; deleted, masses [kg]. motion, rate,
    stress: see `transfer`; V sigma is written, artificial viscosity included, and c + |v| in the last column. tile: of
    `tile_update`. Returns (sound, largest c + |v| [m/s], plastic work, viscous work, what failure released, what of the
    plastic work back stresses store [J]); sound is False where J <= 0, beyond the equation of state, or not a number.
    """
    sound, fastest, plastic, stored, viscous, released = True, 0.0, 0.0, 0.0, 0.0, 0.0
    q, deformation, deviator = np.zeros(TILE), state.deformation_gradient, state.unrotated_deviator
    numbers = (state.plastic_strain, state.internal_energy, state.temperature)
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_placed(deformation, places, i, count, tile, update.DEFORMATION)
        load_rows(deviator, i, count, tile, update.DEVIATOR)
        update.load_state(numbers, failing, strength, i, count, tile)
        update.load_if_any(state.back_stress, i, count, tile, update.BACK_STRESS)
        update.load_if_any(state.volume_flow, i, count, tile, update.PLASTIC_VOLUME)
        load_rates(tile, rate, deleted, i, count)
        if count < TILE:
            update.fill_idle(law, tile, count)
        advance_deformation(step, plane, tile)
        update.start_step(law, failure, tile)
        add_viscous_heat(law, failure, viscosity, motion, stress, i, count, tile, q)
        update.flow(law, failure, step, tile)
        update.finish_step(law, failure, step, tile)
        if failing is not None:
            forget_shape(plane, tile)
        store_placed(deformation, places, i, count, tile, update.DEFORMATION)
        store_rows(deviator, i, count, tile, update.DEVIATOR)
        update.store_state(numbers, failing, i, count, tile)
        update.store_if_any(state.back_stress, i, count, tile, update.BACK_STRESS)
        update.store_if_any(state.volume_flow, i, count, tile, update.PLASTIC_VOLUME)
        for p in range(count):
            r = np.uintp(i + p)
            volume = motion[r, 7]
            s = congruence(load(tile, update.ROTATION * TILE + p), load_symmetric(tile, update.DEVIATOR * TILE + p))
            V, pressure = volume * tile[update.NEW_JACOBIAN * TILE + p], tile[update.PRESSURE * TILE + p] + q[p]
            stress[r, 0], stress[r, 1] = V * (s[0] - pressure), V * (s[1] - pressure)
            stress[r, 2], stress[r, 3] = V * (s[2] - pressure), 0.0
            stress[r, 4], stress[r, 5], stress[r, 6] = V * s[5], V * s[4], V * s[3]
            speed = tile[update.SPEED * TILE + p] + (motion[r, 4] ** 2 + motion[r, 5] ** 2 + motion[r, 6] ** 2) ** 0.5
            stress[r, 7] = speed
            if deleted is not None and deleted[0, r] > 0.0:
                continue
            fastest = max(fastest, speed)
            plastic += volume * tile[update.PLASTIC_WORK * TILE + p]
            stored += volume * tile[update.BACK_STRESS_ENERGY * TILE + p]
            viscous += volume * tile[update.HEAT * TILE + p]
            released += volume * tile[update.RELEASED * TILE + p]
            # True for NaN, too
            if not (tile[update.ROOM * TILE + p] > 0.0 and speed > 0.0):
                sound = False
    return sound, fastest, plastic, viscous, released, stored


class ElasticPlasticSolid:
    """Particles of one law with an equation of state, plastic flow and heat; see `hyperelastic.HyperelasticSolid`."""

    def __init__(self, law: ElasticPlastic, points: MaterialPoints, settings: Any) -> None:
        self.law, self.points, viscosity = law, points, settings.viscosity
        self.viscosity = BulkViscosity(float(viscosity.linear), float(viscosity.quadratic), float(settings.cell))
        self._tile = update.new_tile(count_of(law.failure))

    def advance(self, block: MaterialBlock, step: float) -> tuple[bool, float, dict[str, float]]:
        points, law, of = self.points, self.law, self.points.storage
        state = State._make([*map(of, State._fields[:-2]), *plastic_fields.flow_state(points, law)])
        failing = strength = deleted = None
        if law.failure is not None:
            failing = of("damage"), of("criterion_damage")[: count_of(law.failure)]
            strength, deleted = points.find("strength_factor"), points.find("deleted_mass")
        plane, places = True if points.dimension == 2 else None, TENSOR_ROWS[points.dimension]
        arrays = points.motion, of("velocity_gradient"), of("stress_and_volume")
        sound, fastest, plastic, viscous, released, stored = advance_state(
            block.first, block.last, law, law.failure, plane, places, step, self.viscosity,
            state, failing, strength, deleted, *arrays, self._tile,
        )  # fmt: skip
        terms = {"plastic_work": plastic, "viscous_work": viscous}
        if law.kinematic_hardening is not None:
            terms[plastic_fields.BACK_STRESS_ENERGY] = stored
        if law.failure is not None:
            terms[FAILURE_DISSIPATION] = released
        return sound, fastest, terms

    def stored_energy(self, block: MaterialBlock) -> float:
        """E V0 [J] of the law's particles."""
        here = slice(block.first, block.last)
        return float(self.points["internal_energy"][here] @ self.points.motion[here, 7])

    def wave_modulus(self) -> float:
        return pressure_wave_modulus(self.law)
