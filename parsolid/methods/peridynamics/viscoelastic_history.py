"""The relaxing displacement u~ = u + sum_j gamma_j q_j: history of a linear viscoelastic body, one vector a Prony term.

q_j <- a_j q_j + A_j (u_new - u_old), and gradients of u~ are relaxing strains (see `materials.viscoelastic.prony`). As the force is linear,
f(u~) = f(u) + sum_j gamma_j f(q_j), the forces f(u) and f(q_j) follow by the same recursion from f(u~) alone; they give the stored
energy, stabiliser included, and what the branches dissipate. When bonds break they must be evaluated anew.
"""

import numpy as np

from decomposition.compiled import compiled
from parsolid.materials.viscoelastic.prony import Prony, branch_weights, dissipation_weights


@compiled
def propose(first, last, ratios, weights, new, old, terms, field):
    """Fill field = u~ after a step to the displacement `new`, to the bits of `compose` after `settle`."""
    for a in range(first, last):
        for i in range(old.shape[1]):
            change, total = new[a, i] - old[a, i], new[a, i]
            for j in range(len(ratios)):
                total += ratios[j] * (weights[j, 0] * terms[j, a, i] + weights[j, 1] * change)
            field[a, i] = total


@compiled
def compose(first, last, ratios, new, terms, field):
    """Fill field = u + sum gamma_j q_j."""
    for a in range(first, last):
        for i in range(new.shape[1]):
            total = new[a, i]
            for j in range(len(ratios)):
                total += ratios[j] * terms[j, a, i]
            field[a, i] = total


@compiled
def settle(first, last, ratios, weights, shares, share, new, old, terms, force, elastic, forces):
    """End a step at the displacement `new`, where f(u~) = force; returns what the branches dissipated over it [J].

    weights (terms, 2) = (a, A), shares (terms, 3) of `dissipation_weights`; elastic = f(u), forces = f(q_j).
    """
    dissipated, factor = 0.0, 1.0
    for j in range(len(ratios)):
        factor += ratios[j] * weights[j, 1]
    for a in range(first, last):
        for i in range(old.shape[1]):
            known = 0.0
            for j in range(len(ratios)):
                known += ratios[j] * (weights[j, 0] * forces[j, a, i] - weights[j, 1] * elastic[a, i])
            now = (force[a, i] - known) / factor
            change, more = new[a, i] - old[a, i], now - elastic[a, i]
            for j in range(len(ratios)):
                q, f = terms[j, a, i], forces[j, a, i]
                lost = shares[j, 0] * f * q + shares[j, 1] * f * change + shares[j, 2] * more * change
                dissipated -= share[a] * ratios[j] * lost
                terms[j, a, i] = weights[j, 0] * q + weights[j, 1] * change
                forces[j, a, i] = weights[j, 0] * f + weights[j, 1] * more
            elastic[a, i] = now
            old[a, i] = new[a, i]
    return dissipated


def series_of(law) -> tuple:
    """gamma_j and tau_j [s] of a law's branches, of Maxwell solids relative to the equilibrium shear modulus."""
    times = law.relaxation_times or ()
    if isinstance(law, Prony):
        return law.ratios or (), times
    return tuple(modulus / (2.0 * (law.xi + (law.zeta or 0.0))) for modulus in law.branch_moduli or ()), times


class ViscoelasticHistory:
    """History of a rank's particles: old (owned, d) = u [m] and elastic (owned, d) = f(u) [N] of the last settled state,
    terms (terms, owned, d) = q_j [m] and forces = f(q_j) [N]."""

    def __init__(self, engine, blocks, terms: int, share: np.ndarray):
        """engine: `BondForce`, whose fields are filled; blocks: their laws give the series of `terms` branches; share (owned,), on
        this side of mirror planes."""
        self.engine, self.share, self.series = engine, share, []
        self.laws = [(block.first, block.last, block.law) for block in blocks]
        for block in blocks:
            ratios, times = series_of(block.law)
            self.series.append((block.first, block.last, np.array(ratios, float), np.array(times, float)))
        owned, d = engine.owned, engine.dimension
        self.old, self.elastic = np.zeros((owned, d)), np.zeros((owned, d))
        self.terms, self.forces = np.zeros((terms, owned, d)), np.zeros((terms, owned, d))
        self.factor = np.ones(owned)
        self.step: float | None = None
        self.begin(0.0)

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
        engine = self.engine
        for (first, last, ratios, _), weights in zip(self.series, self.weights):
            propose(first, last, ratios, weights, engine.displacement, self.old, self.terms, engine.field)

    def evaluate(self, step: float) -> np.ndarray:
        """Force (owned, d) [N] after a step [s] from the settled state to the engine's displacement."""
        self.propose(step)
        return self.engine.evaluate(self.laws)

    def settle(self, step: float) -> float:
        """End a step [s] at the engine's displacement, where it has evaluated the proposed field; the energy dissipated over it [J]."""
        self.begin(step)
        engine, dissipated = self.engine, 0.0
        for (first, last, ratios, _), weights, shares in zip(self.series, self.weights, self.shares):
            dissipated += settle(
                first,
                last,
                ratios,
                weights,
                shares,
                self.share,
                engine.displacement,
                self.old,
                self.terms,
                engine.linear_force,
                self.elastic,
                self.forces,
            )
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
            self.terms[:], self.forces[:] = u, self.elastic
        self._compose()

    def resume(self) -> None:
        """Forces of a settled state that was put back."""
        self._compose()
        if not len(self.terms):
            self.old[:], self.elastic[:] = self.engine.displacement[: self.engine.owned], self.engine.linear_force

    def evaluate_anew(self) -> None:
        """Forces of the settled state and of each part of its history, after bonds were broken."""
        engine = self.engine
        for field, force in zip((self.old, *self.terms), (self.elastic, *self.forces)):
            engine.field[: engine.owned] = field
            engine.evaluate(self.laws)
            force[:] = engine.linear_force
        self._compose()

    def _compose(self) -> None:
        engine = self.engine
        for first, last, ratios, _ in self.series:
            compose(first, last, ratios, engine.displacement[: engine.owned], self.terms, engine.field)
        engine.evaluate(self.laws)

    def stored_energy(self) -> float:
        """-1/2 u.f(u) - 1/2 sum gamma_j q_j.f(q_j) [J] of the settled state."""
        energy = -0.5 * np.einsum("n,ni,ni->", self.share, self.old, self.elastic)
        for first, last, ratios, _ in self.series:
            for ratio, q, f in zip(ratios, self.terms, self.forces):
                energy -= 0.5 * ratio * np.einsum("n,ni,ni->", self.share[first:last], q[first:last], f[first:last])
        return float(energy)
