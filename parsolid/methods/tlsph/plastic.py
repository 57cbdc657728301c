"""Elastic-plastic solids in total-Lagrangian SPH (`materials.plastic.total_lagrangian`).

What particles carry is in `methods.plastic_particles`. What the Riemann dissipation takes is heat: half of each pair's
loss for each particle.
"""

from typing import Any

import numpy as np

from parsolid.kernels import aligned_zeros, inlined, kernel
from parsolid.materials.failure.failure import count_of
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.tile_update import (
    DAMAGE,
    DEFORMATION,
    LOGARITHMS,
    NEW_JACOBIAN,
    SHEAR_MODULUS,
    STRESS,
    VELOCITY_GRADIENT,
    WAVES,
    fill_idle,
    new_tile,
)
from parsolid.materials.plastic.total_lagrangian import advance_tile
from parsolid.methods.plastic_particles import (
    ROOM_LEFT,
    TOTALS,
    PlasticFields,
    add_totals,
    book,
    fields_of,
    load_particles,
    store_particles,
    take_heat_of_dissipation,
)
from parsolid.methods.tlsph.point_update import TILE, in_directions, speeds, update_tile
from parsolid.methods.tlsph.state import LawBlock
from parsolid.methods.tlsph.tangent import isotropic_moduli
from parsolid.particles.container import Particles
from parsolid.tensors import cofactor, gram, largest_eigenvalue, largest_eigenvalue_bound, times_symmetric
from parsolid.tiles import TILE as PART
from parsolid.tiles import load, load_placed, load_symmetric, store_vector

RIEMANN_HEAT = "riemann_heat"
# of F in differences of the stress, little beside the strain of a load step
_STEP = 1e-6
# rows of a tile that are free after a step: signal and half impedances
_SPEEDS = LOGARITHMS


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
    tile = fields.tile
    for start in range(0, n, PART):
        count, first = min(PART, n - start), row + start
        load_particles(fields, first, count, tile)
        if heat is not None:
            take_heat_of_dissipation(fields, heat, first, count, tile)
        fill_idle(law, tile, count)
        for c in range(9):
            at = np.uintp(c * TILE + start)
            to, by = np.uintp((DEFORMATION + c) * PART), np.uintp((VELOCITY_GRADIENT + c) * PART)
            for p in range(np.uintp(count)):
                change = step * G[at + p]
                F[at + p] += change
                tile[to + p], tile[by + p] = F[at + p], change
        advance_tile(law, law.failure, step, tile)
        store_particles(fields, first, count, tile)
        add_totals(fields, first, count, tile)
        _find_speeds(law.density, third, signals, push, start, tile)
        for c in range(9):
            _copy_row(P, c * TILE + start, tile, STRESS + c, count)
        _copy_row(J, start, tile, NEW_JACOBIAN, count)
        _copy_row(signal, start, tile, _SPEEDS, count)
        for c in range(2):
            _copy_row(impedance, c * TILE + start, tile, _SPEEDS + 1 + c, count)


@inlined
def _copy_row(out, at, tile, row, count):
    to, of = np.uintp(at), np.uintp(row * PART)
    for p in range(np.uintp(count)):
        out[to + p] = tile[of + p]


@kernel
def _find_speeds(density, third, signals, push, start, tile):
    # into the tile itself: LLVM does not vectorise loops that write to several arrays
    for p in range(PART):
        fast, slow = wave_tensors(tile, p)
        found = speeds(density, third, signals, push, start + p, fast, slow)
        store_vector(tile, _SPEEDS * PART + p, found)


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


@kernel
def find_moduli_of_flow(law, start, gradient, gradient_at_start, first, last, places, index, step, moduli):
    """Moduli [Pa] (entries, particles), see `tangent.packed`, of particles first .. last - 1 whose F become `gradient`
    in a step [s] from those of a start, of which the fields are; both are fields (d d, n)."""
    tile = start.tile
    for i in range(first, last, PART):
        count = min(PART, last - i)
        for c in range(moduli.shape[0]):
            for p in range(i, i + count):
                moduli[c, p] = 0.0
        for j in range(places.size):
            for sign in (1.0, -1.0):
                load_particles(start, i, count, tile)
                for c in range(9):
                    for p in range(PART):
                        tile[(DEFORMATION + c) * PART + p] = 1.0 if c % 4 == 0 else 0.0
                        tile[(VELOCITY_GRADIENT + c) * PART + p] = 0.0
                fill_idle(law, tile, count)
                for k in range(places.size):
                    change = sign * _STEP if k == j else 0.0
                    to, back = (DEFORMATION + places[k]) * PART, (VELOCITY_GRADIENT + places[k]) * PART
                    for p in range(count):
                        F = gradient[k, i + p] + change
                        tile[to + p], tile[back + p] = F, F - gradient_at_start[k, i + p]
                advance_tile(law, law.failure, step, tile)
                for k in range(places.size):
                    # the symmetric part: entries beside the diagonal are met twice
                    part = sign * (1.0 if j == k else 0.5) / (2.0 * _STEP)
                    for p in range(count):
                        moduli[index[j, k], i + p] += part * tile[(STRESS + places[k]) * PART + p]


class PlasticBlock(LawBlock):
    """Particles of a rank that share an elastic-plastic law, with what `state.LawBlock` offers."""

    def __init__(
        self, particles: Particles, first: int, last: int, law: Any, rows_of_values: slice | None = None
    ) -> None:
        super().__init__(particles, first, last, law, rows_of_values)
        self.totals, self._tile = aligned_zeros(TOTALS), new_tile(count_of(law.failure))

    def carried_fields(self, step: float, last_step: float) -> PlasticFields:
        """The fields as kernels take them in a step [s] after one of another length; their totals begin anew."""
        mean_step, names = 0.5 * (step + last_step) if step > 0.0 else 0.0, ("stress_force", RIEMANN_HEAT)
        return fields_of(self.particles, self.law, self.dimension, names, mean_step, self.totals, self._tile)

    def find_moduli(self, index: np.ndarray, moduli: np.ndarray, history: Any) -> None:
        """See `LawBlock.find_moduli`: of the return to the flow stress; those of elasticity at rest where there is no
        history."""
        if history is None:
            shear, lame = elastic_moduli(self.law)
            moduli[:, self.first : self.last] = isotropic_moduli(shear, lame, self.dimension)[:, None]
            return
        names, scratch = ("stress_force", RIEMANN_HEAT), (np.zeros(TOTALS), self._tile)
        start = fields_of(history, self.law, self.dimension, names, 0.0, *scratch)
        gradients = self.particles.storage("deformation_gradient"), history.storage("deformation_gradient")
        rows = self.first, self.last, self.places.tensor, index
        find_moduli_of_flow(self.law, start, *gradients, *rows, history.step, moduli)

    @property
    def sound(self) -> bool:  # type: ignore[override]
        """Whether no particle is compressed beyond its equation of state, and all are numbers, after the last step."""
        return bool(self.totals[ROOM_LEFT] > 0.0)

    def book(self, ledger: Any) -> None:
        """Enter into a ledger what the last step did."""
        book(self.law, self.totals, RIEMANN_HEAT, ledger)

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
        return self._states(first, last)[0].reshape(-1, 3, 3)

    def wave_speeds(self, signals: tuple[float, ...]) -> tuple[float, float]:
        largest, fast, slow = self._states(self.first, self.last)[1].T
        pairs = zip(signals[::2], signals[1::2])
        sums = [a * np.sqrt(fast) + b * np.sqrt(slow) for a, b in pairs]
        return float(largest.max()), float(np.max(sums))

    def room(self) -> np.ndarray:
        """Room (n,) that the equation of state leaves to compress particles, see `room_to_compress`."""
        jacobian = self.particles.owned_rows("jacobian")[self.first : self.last]
        return plastic_evaluation.room_to_compress(self.law, jacobian)
