"""Forces and history of bodies with at least one law of `tensor_history`: stress and stabiliser are evaluated apart.

The stabiliser's force is linear in the relaxing displacement, so that its energies follow as for linear bodies (`relaxing`); those of
the stress are sums over particles. It takes two gradients and two divergences where `BondForce` takes one of each.
"""

import numpy as np

from parsolid.materials.viscoelastic.prony import Prony
from parsolid.methods.peridynamics.bond_force import BondForce, pushed_forward
from parsolid.methods.peridynamics.correspondence import stabiliser_records
from parsolid.methods.peridynamics.tensor_history import (
    TENSOR_ROWS,
    has_tensor_history,
    initial_state,
    nominal_records,
    nominal_stresses,
    settle_states,
    step_weights,
)
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory
from parsolid.numerics.lanes import aligned_zeros
from parsolid.particles.fields import Field


class HistoryForce(BondForce):
    """As `BondForce`, with the histories of all blocks.

    control (owned, d) [N]: force of the stabiliser in the last evaluation of the laws; stored [J]: energy of the settled states.
    """

    def __init__(self, bond_system, stabiliser, stiffness_scale, fixed_planes, blocks, terms: int, share: np.ndarray):
        super().__init__(bond_system, stabiliser, stiffness_scale, fixed_planes)
        capacity = self.body.inverse_shape.shape[1]
        # one row for all, for all laws have as many branches
        self.states = aligned_zeros((TENSOR_ROWS[self.dimension] * (1 + terms), capacity))
        for block in blocks:
            self.states[:, block.first :] = initial_state(block.law, self.dimension)[:, None]
        self.tributary = np.zeros(capacity)
        self.tributary[: self.owned] = bond_system.volume[: self.owned] * share
        self.control = np.zeros((self.owned, self.dimension))
        self.displacement_gradient = aligned_zeros(self.gradient.shape)
        self.stored = 0.0
        self.step: float | None = None
        self.blocks = blocks
        self.prepare(0.0)

    def prepare(self, step: float) -> None:
        """The next evaluations are of the end of a step [s] from the settled states."""
        if step != self.step:
            self.step, self.weights = step, [step_weights(block.law, step) for block in self.blocks]

    @property
    def linear_force(self) -> np.ndarray:
        """What of the last force is linear in the field f: the stabiliser's."""
        return self.control

    def evaluate(self, laws) -> np.ndarray:
        """Force (owned, d) [N] of the fields f and u."""
        if not any(has_tensor_history(law) for _, _, law in laws):
            return super().evaluate(laws)
        self.evaluations += 1
        self._evaluate_control(laws)
        self.pass_gradient(self.displacement_column, gradient=self.displacement_gradient)
        for (first, last, law), weights in zip(laws, self.weights):
            nominal_records(
                self.space, first, last, law, weights, self.body, self.states, self.displacement_gradient, self.record
            )
        self.pass_force(stabiliser=None)
        self.force[: self.owned, : self.dimension] += self.control
        return self.force[: self.owned, : self.dimension]

    def _evaluate_control(self, laws) -> None:
        if self.stabiliser is None:
            return
        self.pass_gradient()
        for first, last, _ in laws:
            stabiliser_records(self.space, first, last, self.stabiliser, self.body, self.gradient, self.record)
        self.pass_force()
        self.control[:] = self.force[: self.owned, : self.dimension]

    def settle(self) -> float:
        """Take all histories through the step to the displacement of the last evaluation; the energy dissipated [J]."""
        self.stored, lost, self.sound = 0.0, 0.0, True
        for block, weights in zip(self.blocks, self.weights):
            stored, loss, sound = settle_states(
                self.space,
                block.first,
                block.last,
                block.law,
                weights,
                self.body,
                self.states,
                self.displacement_gradient,
                self.tributary,
            )
            self.stored, lost, self.sound = self.stored + stored, lost + loss, self.sound and sound
        return lost

    def relax_fully(self) -> None:
        """Let all branches relax, as after an infinite time at the settled deformation."""
        rows = TENSOR_ROWS[self.dimension]
        for block in self.blocks:
            mine = self.states[:, block.first : block.last]
            mine[rows:] = 0.0 if isinstance(block.law, Prony) else np.tile(mine[:rows], (len(mine) // rows - 1, 1))

    def cauchy_stresses(self, laws, first: int, last: int, F: np.ndarray) -> np.ndarray:
        """sigma (n, 3, 3) [Pa] of particles first..last-1 in the settled state; F (n, 3, 3): their deformation gradients."""
        P = self.nominal_stresses(laws)[first:last]
        small = all(isinstance(law, Prony) and law.finite_strain is None for _, _, law in laws)
        return P if small else pushed_forward(P, F)

    def nominal_stresses(self, laws) -> np.ndarray:
        """First Piola-Kirchhoff stress (owned, 3, 3) [Pa] of the settled state."""
        result = np.zeros((self.owned, 3, 3))
        self.prepare(0.0)
        for (first, last, law), weights in zip(laws, self.weights):
            nominal_stresses(
                self.space, first, last, law, weights, self.body, self.states, self.displacement_gradient, result
            )
        return result

    def declare(self, table) -> None:
        """The histories as fields."""
        rows = TENSOR_ROWS[self.dimension]
        for number in range(len(self.states) // rows):
            name = f"branch_tensor_{number}" if number else "settled_tensor"
            table.add(
                Field(name, rows, "1", evolved=True, checkpointed=True),
                self.states[number * rows : (number + 1) * rows].T,
            )

    def arrays(self) -> list[np.ndarray]:
        """Work arrays, bond lists and histories."""
        return [*super().arrays(), self.control, self.displacement_gradient, self.states]


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
