"""Forces and history of bodies with at least one law of `tensor_history`: stress and stabiliser are evaluated apart.

The stabiliser's force is linear in the relaxing displacement, so that its energies follow as for linear bodies
(`relaxing`); those of the stress are sums over particles. It takes two gradients and two divergences where `BondForce`
takes one of each.
"""

from typing import Any

import numpy as np

from parsolid.materials.viscoelastic.prony_lanes import Prony, branch_weights
from parsolid.methods.peridynamics.bond_force import BondForce, pushed_forward
from parsolid.methods.peridynamics.correspondence import stabiliser_records
from parsolid.methods.peridynamics.tensor_history import (
    initial_state,
    is_small_strain,
    nominal_records,
    nominal_stresses,
    settle_states,
    step_weights,
    undeformed_wave_modulus,
)
from parsolid.methods.peridynamics.tensor_states import TENSOR_ROWS
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory, series_of
from parsolid.pairs.terms import matrix_columns
from parsolid.particles.declaration import Columns, Field


class HistoryForce(BondForce):
    """As `BondForce`, with the histories of all blocks. It declares

    tensor_history         see `tensor_history`: rows for as many branches as any law has
    stabiliser_force       `control` (owned, d) [N] in the last evaluation of the laws
    displacement_sums      sums of the gradient pass of u
    tributary_volume       volume [m^3] on this side of mirror planes

    stored [J]: energy of the settled states.
    """

    def __init__(
        self, particles: Any, bond_system: Any, scale: Any, fixed_planes: Any, blocks: Any, branches: int
    ) -> None:
        self.blocks = blocks
        self.stiffens = not all(is_small_strain(block.law) for block in blocks)
        super().__init__(particles, bond_system, scale, fixed_planes)
        d, declare = self.dimension, particles.declare
        rows = TENSOR_ROWS[d] * (1 + branches)
        fresh = [initial_state(block.law, d) for block in blocks]
        longest = fresh[int(np.argmax([len(state) for state in fresh]))] if fresh else np.zeros(0)
        padding = tuple(map(float, longest)) + (0.0,) * (rows - len(longest) if fresh else 0)
        declare(
            Field("tensor_history", rows, "1", checkpointed=True, mirror="tensor", layout=Columns(), padding=padding)
        )
        for block, state in zip(blocks, fresh):
            self.states[: len(state), block.first : block.last] = state[:, None]
        volume = bond_system.volume[: self.owned] * particles.owned_rows("share")
        declare(Field("tributary_volume", 1, "m^3"), volume)
        declare(Field("stabiliser_force", d, "N", mirror="vector"))
        declare(Field("displacement_sums", matrix_columns(d), "m"))
        self.stored = 0.0
        self.step: float | None = None
        self.prepare(0.0)

    def control_matrices(self, scale: np.ndarray) -> np.ndarray:
        """Of laws of finite strain a multiple of 1, that of a whole family: what a body has in its surface does not
        turn with it, and only what is along the jump of a bond has no moment.
        """
        C, d = super().control_matrices(scale), self.dimension
        for block in self.blocks:
            if not is_small_strain(block.law):
                rows = slice(block.first, block.last)
                C[rows] = np.trace(C[rows], axis1=1, axis2=2)[:, None, None] * np.eye(d) / d
        return C

    @property
    def states(self) -> np.ndarray:
        """Histories (rows, capacity)."""
        return self.particles.storage("tensor_history")

    @property
    def control(self) -> np.ndarray:
        """Force (owned, d) [N] of the stabiliser."""
        return self.particles.owned_rows("stabiliser_force")

    def prepare(self, step: float) -> None:
        """The next evaluations are of the end of a step [s] from the settled states."""
        if step != self.step:
            self.step, self.weights = step, [step_weights(block.law, step) for block in self.blocks]

    @property
    def linear_force(self) -> np.ndarray:
        """What of the last force is linear in the field f: the stabiliser's."""
        return self.control

    def evaluate(self, laws: Any) -> np.ndarray:
        """Force (owned, d) [N] of the fields f and u."""
        return self._with_stress(laws, self.evaluate_control(laws))

    def evaluate_linear(self, laws: Any) -> np.ndarray:
        """The stabiliser's force (owned, d) [N] on the field f, of the laws' particles."""
        self.evaluate_control(laws)
        return self.control

    def combine(self, laws: Any, linear: np.ndarray) -> np.ndarray:
        """The whole force (owned, d) [N] of the displacement u, from what is linear in fields."""
        self.control[:] = linear
        return self._with_stress(laws, self.stabiliser is not None)

    def _with_stress(self, laws: Any, told: bool) -> np.ndarray:
        self.evaluations += 1
        sums = self.displacement_gradient(None if told else "motion", self.particles.storage("displacement_sums"))
        for (first, last, law), weights in zip(laws, self.weights):
            nominal_records(self.space, first, last, law, weights, self.body, self.states, sums, self.record)
        force = self.divergence(None)
        force += self.control
        return force

    def evaluate_control(self, laws: Any) -> bool:
        """The stabiliser's force; whether that has told ghosts of the motion."""
        if self.stabiliser is None:
            return False
        sums = self.field_gradient()
        for first, last, _ in laws:
            stabiliser_records(self.space, first, last, self.stabiliser, self.body, sums, self.record)
        self.control[:] = self.divergence(self.stabiliser)
        return True

    def settle(self) -> float:
        """Take all histories through the step to the displacement of the last evaluation; the energy dissipated [J]."""
        self.stored, lost, self.sound, self.growth = 0.0, 0.0, True, 1.0
        for block, weights in zip(self.blocks, self.weights):
            at_rest = undeformed_wave_modulus(block.law)
            stored, loss, sound, waves = settle_states(
                self.space,
                block.first,
                block.last,
                block.law,
                at_rest,
                weights,
                self.body,
                self.states,
                self.particles.storage("displacement_sums"),
                self.particles.storage("tributary_volume"),
            )
            self.stored, lost, self.sound = self.stored + stored, lost + loss, self.sound and sound
            self.growth = max(self.growth, waves / at_rest)
        return lost

    def relax_fully(self) -> None:
        """Let all branches relax, as after an infinite time at the settled deformation."""
        rows = TENSOR_ROWS[self.dimension]
        for block in self.blocks:
            mine = self.states[:, block.first : block.last]
            mine[rows:] = 0.0 if isinstance(block.law, Prony) else np.tile(mine[:rows], (len(mine) // rows - 1, 1))

    def cauchy_stresses(self, laws: Any, first: int, last: int, F: np.ndarray) -> np.ndarray:
        """sigma (n, 3, 3) [Pa] of particles first..last-1 in the settled state; F (n, 3, 3): their deformation
        gradients.
        """
        P = self.nominal_stresses(laws)[first:last]
        small = all(is_small_strain(law) for _, _, law in laws)
        return P if small else pushed_forward(P, F)

    def nominal_stresses(self, laws: Any) -> np.ndarray:
        """First Piola-Kirchhoff stress (owned, 3, 3) [Pa] of the settled state."""
        result, sums = np.zeros((self.owned, 3, 3)), self.particles.storage("displacement_sums")
        self.prepare(0.0)
        for (first, last, law), weights in zip(laws, self.weights):
            nominal_stresses(self.space, first, last, law, weights, self.body, self.states, sums, result)
        return result


class TensorHistory(ViscoelasticHistory):
    """The relaxing displacement as the stabiliser's history, beside the histories of a `HistoryForce`."""

    def propose(self, step: float) -> None:
        """Also which step the engine's next evaluations end."""
        super().propose(step)
        self.engine.prepare(step)

    def start(self, instantaneous: bool) -> None:
        """Also the histories."""
        self.engine.prepare(0.0)
        super().start(instantaneous)
        self.engine.settle()
        if not instantaneous:
            self.engine.relax_fully()
        self.resume()

    def resume(self) -> None:
        """Also the stored energy of the histories."""
        self.engine.prepare(0.0)
        super().resume()
        self.engine.settle()

    def evaluate_anew(self) -> None:
        """Also the histories, which take what changes in the gradients as a jump."""
        self.engine.prepare(0.0)
        super().evaluate_anew()
        self.engine.settle()

    def settle(self, step: float) -> float:
        """Also of the histories."""
        return super().settle(step) + self.engine.settle()

    def stored_energy(self) -> float:
        """Also of the histories."""
        return super().stored_energy() + self.engine.stored


class ElasticControl(TensorHistory):
    """As `TensorHistory`, with a stabiliser on the displacement itself, of the equilibrium's shear modulus: what is
    remembered of a displacement does not turn with a body, so that only an elastic control has no moment.
    """

    def __init__(self, engine: HistoryForce, blocks: Any, branches: int) -> None:
        """See `ViscoelasticHistory`; the engine has the branches of the stress."""
        super().__init__(engine, blocks, 0, ((), ()))

    def begin(self, step: float) -> None:
        """Also `factor`, by which the laws of a stiffness are multiplied."""
        if step == self.step:
            return
        super().begin(step)
        for first, last, law in self.laws:
            ratios, times = series_of(law)
            self.factor[first:last] = 1.0 + sum(g * branch_weights(step, tau)[1] for g, tau in zip(ratios, times))
