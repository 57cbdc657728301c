"""The relaxing displacement u~ = u + sum_j gamma_j q_j: history of a linear viscoelastic body, one vector a Prony term.

q_j <- a_j q_j + A_j (u_new - u_old), and gradients of u~ are relaxing strains (see `materials.viscoelastic.prony`). As
the force is linear, f(u~) = f(u) + sum_j gamma_j f(q_j), the forces f(u) and f(q_j) follow by the same recursion from
f(u~) alone; they give the stored energy, stabiliser included, and what the branches dissipate. When bonds break they
must be evaluated anew.
"""

import numpy as np

from decomposition.compiled import compiled
from decomposition.recalled import RecalledEach
from parsolid.materials.hyperelastic.law import elastic_moduli
from parsolid.materials.viscoelastic.hyperelastic_series import HyperelasticSeries
from parsolid.materials.viscoelastic.prony_lanes import Prony, branch_weights, dissipation_weights
from parsolid.particles.declaration import Field


@compiled
def propose(first, last, ratios, weights, new, old, terms, field):
    """Fill field = u~ after a step to the displacement `new`, to the bits of `compose` after `settle`."""
    d = old.shape[1]
    for a in range(first, last):
        for i in range(d):
            change, total = new[a, i] - old[a, i], new[a, i]
            for j in range(len(ratios)):
                total += ratios[j] * (weights[j, 0] * terms[a, j * d + i] + weights[j, 1] * change)
            field[a, i] = total


@compiled
def compose(first, last, ratios, new, terms, field):
    """Fill field = u + sum gamma_j q_j."""
    d = new.shape[1]
    for a in range(first, last):
        for i in range(d):
            total = new[a, i]
            for j in range(len(ratios)):
                total += ratios[j] * terms[a, j * d + i]
            field[a, i] = total


@compiled
def settle(first, last, ratios, weights, shares, share, new, old, terms, force, elastic, forces):
    """End a step at the displacement `new`, where f(u~) = force; returns what the branches dissipated over it [J].

    weights (terms, 2) = (a, A), shares (terms, 3) of `dissipation_weights`; elastic = f(u), forces = f(q_j).
    """
    d, dissipated, factor = old.shape[1], 0.0, 1.0
    for j in range(len(ratios)):
        factor += ratios[j] * weights[j, 1]
    for a in range(first, last):
        for i in range(d):
            known = 0.0
            for j in range(len(ratios)):
                known += ratios[j] * (weights[j, 0] * forces[a, j * d + i] - weights[j, 1] * elastic[a, i])
            now = (force[a, i] - known) / factor
            change, more = new[a, i] - old[a, i], now - elastic[a, i]
            for j in range(len(ratios)):
                q, f = terms[a, j * d + i], forces[a, j * d + i]
                lost = shares[j, 0] * f * q + shares[j, 1] * f * change + shares[j, 2] * more * change
                dissipated -= share[a] * ratios[j] * lost
                terms[a, j * d + i] = weights[j, 0] * q + weights[j, 1] * change
                forces[a, j * d + i] = weights[j, 0] * f + weights[j, 1] * more
            elastic[a, i] = now
            old[a, i] = new[a, i]
    return dissipated


@compiled
def scale_rows(sign, factors, values, result):
    """Fill result (n, d) with sign times factors (n,) times values (n, d); either may have more columns or rows."""
    for a in range(factors.shape[0]):
        for i in range(min(values.shape[1], result.shape[1])):
            result[a, i] = sign * factors[a] * values[a, i]


def series_of(law) -> tuple:
    """gamma_j and tau_j [s] of a law's branches, of Maxwell solids relative to the equilibrium shear modulus."""
    times = law.relaxation_times or ()
    if isinstance(law, Prony | HyperelasticSeries):
        return law.ratios or (), times
    if not law.branch_moduli:
        return (), times
    shear = elastic_moduli(law)[0]
    return tuple(modulus / shear for modulus in law.branch_moduli), times


class ViscoelasticHistory:
    """History of a rank's particles, d = 2 for bars, too. It declares, for restarts where there are branches,

    settled_displacement, elastic_force   old (owned, d) = u [m], elastic (owned, d) = f(u) [N] of the settled state
    branch_displacements, branch_forces   terms (owned, branches d) = q_j [m], forces = f(q_j) [N], branch after branch
    """

    def __init__(self, engine, blocks, branches: int, series=None, mark: str = ""):
        """engine: `BondForce`, whose fields are filled; blocks: their laws give the series of so many branches, alike
        for all particles, unless `series` (ratios, times) is that of all; mark: what fields' names end with.
        """
        self.engine, self.particles, self.branches, self.series = engine, engine.particles, branches, []
        self.laws = [(block.first, block.last, block.law) for block in blocks]
        stated = [(first, last, *series_of(law)) for first, last, law in self.laws]
        for first, last, ratios, times in stated if series is None else [(0, engine.owned, *series)]:
            self.series.append((first, last, np.array(ratios, float), np.array(times, float)))
        d, declare, kept = engine.dimension, self.particles.declare, {"checkpointed": branches > 0, "mirror": "vector"}
        self.mark = mark
        declare(Field(f"settled_displacement{mark}", d, "m", **kept))
        declare(Field(f"elastic_force{mark}", d, "N", **kept))
        if branches:
            declare(Field(f"branch_displacements{mark}", branches * d, "m", **kept))
            declare(Field(f"branch_forces{mark}", branches * d, "N", **kept))
        # weights are those of a step, all else stays what it is
        self._propose, self._settle = RecalledEach(propose, free=(3,)), RecalledEach(settle, free=(3, 4))
        self.factor = np.ones(engine.owned)
        self.step: float | None = None
        self.begin(0.0)

    @property
    def old(self) -> np.ndarray:
        """Displacement (owned, d) [m] of the last settled state."""
        return self.particles.owned_rows(f"settled_displacement{self.mark}")

    @property
    def elastic(self) -> np.ndarray:
        """f(u) (owned, d) [N] there."""
        return self.particles.owned_rows(f"elastic_force{self.mark}")

    @property
    def terms(self) -> np.ndarray:
        """q_j (owned, branches d) [m]."""
        return self._of_branches("branch_displacements")

    @property
    def forces(self) -> np.ndarray:
        """f(q_j) (owned, branches d) [N]."""
        return self._of_branches("branch_forces")

    def _of_branches(self, name: str) -> np.ndarray:
        if self.branches:
            return self.particles.owned_rows(name + self.mark)
        return self.particles.kept(("no branches", self.mark), lambda: np.zeros((self.engine.owned, 0)))

    def _branch(self, values: np.ndarray, number: int) -> np.ndarray:
        """The columns (owned, d) of a branch in `terms` or `forces`."""
        d = self.engine.dimension
        return values[:, number * d : (number + 1) * d]

    def begin(self, step: float) -> None:
        """Weights of a step [s], unless they are those of the last call; `factor` (owned,) = 1 + sum gamma_j A_j."""
        if step == self.step:
            return
        self.step, self.weights, self.shares = step, [], []
        for first, last, ratios, times in self.series:
            self.weights.append(np.array([branch_weights(step, time) for time in times]).reshape(-1, 2))
            self.shares.append(np.array([dissipation_weights(step, time) for time in times]).reshape(-1, 3))
            self.factor[first:last] = 1.0 + ratios @ self.weights[-1][:, 1]

    def propose(self, step: float) -> None:
        """Fill the engine's field with u~ after a step [s] to its displacement."""
        self.begin(step)
        arrays = self.particles.kept(("history", self.mark), self._arrays)[:4]
        for (first, last, ratios, _), weights in zip(self.series, self.weights):
            self._propose(first, first, last, ratios, weights, *arrays)

    def _arrays(self) -> tuple[np.ndarray, ...]:
        """What `propose` takes, and what `settle` takes besides its first two."""
        engine = self.engine
        moved = (engine.displacement, self.old, self.terms)
        return *moved, engine.field, self.particles.storage("share"), engine.linear_force, self.elastic, self.forces

    def internal_force(self, step: float) -> np.ndarray:
        """Force (owned, d) [N] after a step [s] from the settled state to the engine's displacement."""
        self.propose(step)
        return self.engine.evaluate(self.laws)

    def stiffness_force(self, tangents, change: np.ndarray) -> np.ndarray:
        """-K du [N] (owned, d) of a displacement du (owned, d) over the step begun, see `Operator.stiffness`."""
        engine = self.engine
        scale_rows(1.0, self.factor, change, engine.field)
        return engine.evaluate_stiffness(tangents)

    def settle(self, step: float) -> float:
        """End a step [s] at the engine's displacement, where it has evaluated the proposed field; the energy dissipated
        over it [J].
        """
        self.begin(step)
        new, old, terms, _, share, *forces = self.particles.kept(("history", self.mark), self._arrays)
        dissipated = 0.0
        for (first, last, ratios, _), weights, shares in zip(self.series, self.weights, self.shares):
            dissipated += self._settle(first, first, last, ratios, weights, shares, share, new, old, terms, *forces)
        return dissipated

    def start(self, instantaneous: bool) -> None:
        """History and forces of the engine's displacement at time 0: reached in a jump, or held for ever."""
        engine = self.engine
        u = engine.displacement[: engine.owned]
        self.old[:], self.terms[:], engine.field[: engine.owned] = u, 0.0, u
        engine.evaluate(self.laws)
        self.elastic[:], self.forces[:] = engine.linear_force, 0.0
        if instantaneous:
            # branches take a jump in full
            self.terms[:], self.forces[:] = np.tile(u, self.branches), np.tile(self.elastic, self.branches)
        self._compose()

    def resume(self) -> None:
        """Forces of a settled state that was put back."""
        self._compose()
        if not self.branches:
            self.old[:], self.elastic[:] = self.engine.displacement[: self.engine.owned], self.engine.linear_force

    def evaluate_anew(self) -> None:
        """Forces of the settled state and of each part of its history, after bonds were broken."""
        branches = [(self._branch(self.terms, j), self._branch(self.forces, j)) for j in range(self.branches)]
        for field, force in [(self.old, self.elastic), *branches]:
            self.engine.field[: self.engine.owned] = field
            self.engine.evaluate(self.laws)
            force[:] = self.engine.linear_force
        self._compose()

    def _compose(self) -> None:
        engine = self.engine
        for first, last, ratios, _ in self.series:
            compose(first, last, ratios, engine.displacement[: engine.owned], self.terms, engine.field)
        engine.evaluate(self.laws)

    def stored_energy(self) -> float:
        """-1/2 u.f(u) - 1/2 sum gamma_j q_j.f(q_j) [J] of the settled state."""
        share = self.particles.owned_rows("share")
        energy = -0.5 * np.einsum("n,ni,ni->", share, self.old, self.elastic)
        for first, last, ratios, _ in self.series:
            rows = slice(first, last)
            for j, ratio in enumerate(ratios):
                q, f = self._branch(self.terms, j)[rows], self._branch(self.forces, j)[rows]
                energy -= 0.5 * ratio * np.einsum("n,ni,ni->", share[rows], q, f)
        return float(energy)
