"""Elastic-plastic solids in correspondence peridynamics (`materials.plastic.total_lagrangian`), and what damps them.

The stress follows from F = 1 + G at both ends of a step and from what particles carry (`methods.plastic_particles`). An
evaluation finds the state at the end of a step in arrays of its own, which the particles take when the step ends.

A control that stores energy would be far stiffer than matter that flows. That of elastic-plastic bodies acts on
velocities, D = divergence of C and of -C L with L = grad v: it bears nothing of a state, and no homogeneous motion.
With C = c 1 it takes c sum_b w_ab |v_b - v_a - L_a xi|^2 of each particle a, which is its heat. The viscous pressure of
shocks is of the same force.
"""

from typing import Any

import numpy as np

from parsolid.kernels import aligned_zeros, kernel
from parsolid.materials.blocks import MaterialBlock
from parsolid.materials.failure.failure import count_of
from parsolid.materials.plastic import plastic_evaluation
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.plastic.functions import cold_pressure, grueneisen_coefficient, isentropic_bulk_modulus
from parsolid.materials.plastic.tile_update import (
    DEFORMATION,
    NEW_JACOBIAN,
    STRESS,
    VELOCITY_GRADIENT,
    WAVES,
    fill_idle,
    new_tile,
)
from parsolid.materials.plastic.total_lagrangian import advance_tile
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.solids import largest_principal_value, undeformed_wave_modulus
from parsolid.methods.peridynamics.sweeps import bond_vectors, gradient_at, inverse_at, matmul_in, store_rows
from parsolid.methods.plastic_fields import BACK_STRESS, PLASTIC_STATE, VOLUME_FLOW
from parsolid.methods.plastic_particles import (
    ACTING,
    METRIC_FIELD,
    ROOM_LEFT,
    STRESS_PLACES,
    TOTALS,
    PlasticFields,
    add_totals,
    book,
    declare_plastic,
    fields_of,
    load_particles,
    store_particles,
    take_heat_of_dissipation,
)
from parsolid.particles.declaration import Columns, Field
from parsolid.tensors import IDENTITY, cofactor, combine, contract, plus
from parsolid.tiles import TILE, load, load_placed, load_symmetric, store, store_placed

CONTROL_HEAT = "control_heat"
_GRADIENT = "deformation_gradient"
_GRADIENT_PLACES = {2: np.array([0, 1, 3, 4]), 3: np.arange(9)}


def flows(law: Any) -> bool:
    """Whether a law is elastic-plastic."""
    return isinstance(law, ElasticPlastic)


class PlasticStates:
    """The elastic-plastic particles of a rank, with what `tensor_histories.TensorHistories` offers.

    sound: whether no particle is compressed beyond its equation of state, and all are numbers, at the last evaluation;
    mean_step [s]: halves of the steps before and of the present one.
    """

    growth = 1.0

    def __init__(self, bonds: Bonds, laws: list[tuple[int, int, Any]], distinct: list[Any], viscosity: Any) -> None:
        """laws: (first, last, law) of the rank's particles; distinct: the laws of the scene, as particles are sorted by
        them; viscosity: `method_settings.ArtificialViscosity`."""
        self.bonds, self.particles, self.plane = bonds, bonds.particles, True if bonds.d == 2 else None
        self.blocks = [MaterialBlock(*one) for one in laws if flows(one[2])]
        self.tiles = [new_tile(count_of(block.law.failure)) for block in self.blocks]
        self.totals = [aligned_zeros(TOTALS) for _ in self.blocks]
        self.sound, self.mean_step = True, 0.0
        # of each particle: stiffness over that at rest, and kinematic viscosity over c_p^2 at rest [s]
        self.growths, self.viscosities = np.ones(bonds.owned), np.zeros(bonds.owned)
        self.factors = float(viscosity.linear), float(viscosity.quadratic)
        self.spacing = self.particles.owned_rows("spacing").max(axis=1)
        d, declare = bonds.d, self.particles.declare
        kept: dict[str, Any] = {"checkpointed": True, "layout": Columns()}
        declare(Field(_GRADIENT, d * d, "1", mirror="tensor", **kept), np.eye(d).ravel())
        declare(Field("jacobian", 1, "1", **kept), 1.0)
        declare(Field("dissipative_force", d, "N", mirror="vector", **kept))
        declare_plastic(self.particles, d, distinct, CONTROL_HEAT)
        names = (METRIC_FIELD, *(field.name for field in PLASTIC_STATE), ACTING, _GRADIENT, "jacobian")
        of_some = (BACK_STRESS, VOLUME_FLOW, "damage", "criterion_damage")
        names += tuple(name for name in of_some if name in self.particles)
        self._ends = {name: aligned_zeros(self.particles.storage(name).shape) for name in names}

    def _fields(self, number: int, step: float) -> tuple[PlasticFields, PlasticFields]:
        """Fields of a block at the start of a step [s], and where those of its end go; nothing heats in a step of 0."""
        block, ends, mean_step = self.blocks[number], self._ends, self.mean_step if step > 0.0 else 0.0
        names, room = ("internal_force", CONTROL_HEAT), (self.totals[number], self.tiles[number])
        start = fields_of(self.particles, block.law, self.bonds.d, names, mean_step, *room)
        failing = None
        if start.failing is not None:
            failing = ends["damage"], ends["criterion_damage"][: len(start.failing[1])]
        end = start._replace(
            metric=ends[METRIC_FIELD],
            numbers=tuple(ends[field.name] for field in PLASTIC_STATE),
            stress=ends[ACTING],
            jacobian=ends["jacobian"][0],
            failing=failing,
            back_stress=None if start.back_stress is None else ends[BACK_STRESS],
            volume_flow=None if start.volume_flow is None else ends[VOLUME_FLOW],
        )
        return start, end

    def store_stresses(self, step: float, sums: np.ndarray, M: np.ndarray) -> None:
        """M = P K^-1 of all particles after a step [s], from the sums of the gradient of u."""
        inverse, volume, places = self.particles.storage("inverse_shape"), self.bonds.volume, _GRADIENT_PLACES
        gradients = self.particles.storage(_GRADIENT), self._ends[_GRADIENT], places[self.bonds.d]
        self.sound = True
        for number, block in enumerate(self.blocks):
            fields = self._fields(number, step)
            given = block.first, block.last, block.law, step
            modulus = undeformed_wave_modulus(block.law)
            advance_states(self.plane, *given, *fields, *gradients, inverse, volume, sums, M, modulus, self.growths)
            self.sound = self.sound and bool(self.totals[number][ROOM_LEFT] > 0.0)

    def commit(self, step: float, sums: np.ndarray) -> float:
        """Take the state of the last evaluation; what flow takes stays as internal energy: 0 [J]."""
        for block in self.blocks:
            for name, end in self._ends.items():
                self.particles.storage(name)[:, block.first : block.last] = end[:, block.first : block.last]
        return 0.0

    def start(self, sums: np.ndarray, instantaneous: bool) -> None:
        """Stresses of the energies at time 0."""
        self.store_stresses(0.0, sums, self.particles.storage("bond_stress"))
        self.commit(0.0, sums)

    def resume(self, sums: np.ndarray) -> None:
        """What particles carry was put back to the bit."""

    def damped_growth(self, stiffness: float, damping: float) -> float:
        """By how much the largest eigenvalue [1/s^2] of the stiffness would have to grow so that it bounds the step as
        stiffness and viscosity of the particles do, beside the largest one [1/s] of the control."""
        arrays = self.growths, self.viscosities
        found = (largest_growth(one.first, one.last, stiffness, damping, *arrays) for one in self.blocks)
        return float(max(found, default=1.0))

    @property
    def stored(self) -> float:
        """Internal energy [J] on this side of mirror planes."""
        of = self.particles.owned_rows
        energy, volume = of("internal_energy"), of("volume")
        return float(sum(energy[one.first : one.last] @ volume[one.first : one.last] for one in self.blocks))

    def nominal_stresses(self, sums: np.ndarray, result: np.ndarray) -> None:
        """First Piola-Kirchhoff stress (owned, 9) [Pa] that acts."""
        for one in self.blocks:
            mine = self.particles.owned_rows(ACTING)[one.first : one.last]
            result[one.first : one.last, STRESS_PLACES[self.bonds.d]] = mine

    def book(self, ledger: Any) -> None:
        """Enter into a ledger what the last step did."""
        for block, totals in zip(self.blocks, self.totals):
            book(block.law, totals, CONTROL_HEAT, ledger)

    def room(self) -> np.ndarray:
        """Room (owned,) that equations of state leave to compress particles."""
        result, jacobian = np.full(self.bonds.owned, np.inf), self.particles.owned_rows("jacobian")
        for one in self.blocks:
            mine = slice(one.first, one.last)
            result[mine] = plastic_evaluation.room_to_compress(one.law, jacobian[mine])
        return result

    def dampen(self, control: np.ndarray) -> None:
        """Fill the rows of M with those of D, of rows of C; ghosts have their velocities."""
        bonds, stored = self.bonds, self.particles.storage
        sums, M, heat = bonds.gradients("velocity"), stored("bond_stress"), stored(CONTROL_HEAT)[0]
        squares = np.zeros(len(bonds.positions))
        for pairs, images, mutual in bonds.lists:
            add_square_jumps(pairs, images, mutual, self.plane, bonds.motion_of("velocity"), squares)
        M[: bonds.owned] = 0.0
        places, F, E = _GRADIENT_PLACES[bonds.d], self._ends[_GRADIENT], self._ends["internal_energy"][0]
        shared = squares, stored("inverse_shape"), bonds.volume, self.spacing, sums, M, heat
        for block in self.blocks:
            given = self.plane, block.first, block.last, block.law, self.factors, F, places, E, control
            speed = np.sqrt(undeformed_wave_modulus(block.law) / block.law.density)
            store_damping(*given, *shared, speed, self.viscosities)


@kernel
def advance_states(
    plane, first, last, law, step, start, end, gradient, new_gradient, places, inverse, volume, sums, M, modulus, growth
):  # fmt: skip
    """State and M = P K^-1 of particles first..last-1 after a step [s], from `start` into `end`, both `PlasticFields`.

    gradient, new_gradient (d d, n): F at both ends, components at `places`. A particle without bonds that span space
    stays as it is. modulus [Pa]: rho c^2 at rest; growth (n,): bound of that of waves to come over it, that after the
    step times (J_old/J)^4 where a particle has shrunk, for what shrinks goes on shrinking.
    """
    tile = start.tile
    for i in range(first, last, TILE):
        count = min(TILE, last - i)
        load_particles(start, i, count, tile)
        take_heat_of_dissipation(start, start.heat, i, count, tile)
        fill_idle(law, tile, count)
        for c in range(9):
            tile[(DEFORMATION + c) * TILE : (DEFORMATION + c + 1) * TILE] = 1.0 if c % 4 == 0 else 0.0
        load_placed(gradient, places, i, count, tile, DEFORMATION)
        for p in range(count):
            a, old = i + p, load(tile, DEFORMATION * TILE + p)
            new = plus(IDENTITY, gradient_at(plane, sums, inverse, volume, a)) if inverse[0, a] > 0.0 else old
            store(tile, DEFORMATION * TILE + p, new)
            store(tile, VELOCITY_GRADIENT * TILE + p, combine(1.0, new, -1.0, old))
        advance_tile(law, law.failure, step, tile)
        store_particles(end, i, count, tile)
        store_placed(new_gradient, places, i, count, tile, DEFORMATION)
        add_totals(end, i, count, tile)
        for p in range(count):
            a, J = i + p, tile[NEW_JACOBIAN * TILE + p]
            waves = largest_principal_value(load_symmetric(tile, WAVES * TILE + p), plane)
            growth[a] = waves / modulus * max(start.jacobian[a] / J, 1.0) ** 4
            end.jacobian[a] = J
            store_rows(plane, M, a, matmul_in(plane, load(tile, STRESS * TILE + p), inverse_at(inverse, a)))


@kernel
def largest_growth(first, last, stiffness, damping, growth, viscosity):
    """See `PlasticStates.damped_growth`; of each particle, as greatest of both apart would depend on ranks.

    With the eigenvalue s g and damping b = damping + s viscosity, s g dt^2 + 2 b dt = 4 has dt = 4/rate.
    """
    largest = 0.0
    for a in range(first, last):
        b = damping + stiffness * viscosity[a]
        rate = b + (b * b + 4.0 * stiffness * growth[a]) ** 0.5
        largest = max(largest, rate * (rate - 2.0 * damping) / (4.0 * stiffness))
    return largest


@kernel
def add_square_jumps(bonds, images, mutual, plane, motion, result):
    """Add sum_b w_ab |f_b - f_a|^2 of a field in rows of `sweeps` to result (n,)."""
    for a in range(bonds.start.shape[0] - 1):
        total = 0.0
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            _, jump = bond_vectors(plane, motion, images, k, a, b)
            square = bonds.weight[k] * (jump[0] * jump[0] + jump[1] * jump[1] + jump[2] * jump[2])
            total += square
            if mutual is not None:
                result[b] += square
        result[a] += total


@kernel
def store_damping(
    plane, first, last, law, factors, gradient, places, E, control, squares, inverse, volume, spacing, sums, M, heat,
    at_rest, viscosities
):  # fmt: skip
    """M = -C L - q cof F K^-1 of particles first..last-1, with the viscous pressure q of
    `method_settings.ArtificialViscosity`, and what it takes [W].

    factors: linear and quadratic one of q; gradient (d d, n): F, components at `places`; E (n,) [J/m^3]; control: rows
    of C; squares: of `add_square_jumps`; spacing (n,) [m]; sums: of the gradient of velocities; at_rest: c_p [m/s];
    viscosities (n,): kinematic viscosity over c_p^2 [s].
    """
    d = 3 if plane is None else 2
    width, gamma = sums.shape[1] // d, grueneisen_coefficient(law.equation_of_state)
    whole = np.zeros(9)
    for a in range(first, last):
        L, along = gradient_at(plane, sums, inverse, volume, a), 0.0
        for j in range(d):
            for i in range(d):
                along += sums[a, width * j + i] * L[3 * i + j]
        whole[8] = 1.0
        for c in range(places.size):
            whole[places[c]] = gradient[c, a]
        F = (whole[0], whole[1], whole[2], whole[3], whole[4], whole[5], whole[6], whole[7], whole[8])
        H = cofactor(F)
        J, rate = F[0] * H[0] + F[1] * H[1] + F[2] * H[2], contract(H, L)
        bulk = isentropic_bulk_modulus(law.equation_of_state, J, cold_pressure(law.equation_of_state, J) + gamma * E[a])
        speed = (max(bulk, 0.0) * J / law.density) ** 0.5
        approach = spacing[a] * max(-rate / J, 0.0)
        viscosity = spacing[a] * (factors[1] * approach + factors[0] * speed) if approach > 0.0 else 0.0
        q = law.density / J * viscosity * approach / spacing[a]
        viscosities[a] = viscosity / (at_rest * at_rest)
        heat[a] = control[a, 0] * (squares[a] - along) - volume[a] * q * rate
        store_rows(plane, M, a, combine(-control[a, 0], L, -q, matmul_in(plane, H, inverse_at(inverse, a))))
