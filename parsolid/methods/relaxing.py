"""The relaxing displacement u~ = u + sum_j gamma_j q_j: history of a linear viscoelastic body, one vector a Prony term.

q_j <- a_j q_j + A_j (u_new - u_old), and gradients of u~ are relaxing strains (see `materials.prony`). As the force is linear,
f(u~) = f(u) + sum_j gamma_j f(q_j), the forces f(u) and f(q_j) follow by the same recursion from f(u~) alone; they give the stored
energy, stabiliser included, and what the branches dissipate. When bonds break they must be evaluated anew.
"""

import numpy as np
from numba import njit

from parsolid.materials.prony import branch_weights, dissipation_weights


@njit(cache=True)
def predict(first, last, ratios, weights, old, terms, base):
    """Fill base (n, d) = sum gamma_j (a_j q_j - A_j u_old), so that u~ = (1 + sum gamma_j A_j) u + base after the step."""
    for a in range(first, last):
        for i in range(base.shape[1]):
            total = 0.0
            for j in range(len(ratios)):
                total += ratios[j] * (weights[j, 0] * terms[j, a, i] - weights[j, 1] * old[a, i])
            base[a, i] = total


@njit(cache=True)
def propose(first, last, ratios, weights, new, old, terms, field):
    """Fill field = u~ after a step to the displacement `new`, to the bits of `compose` after `settle`."""
    for a in range(first, last):
        for i in range(old.shape[1]):
            change, total = new[a, i] - old[a, i], new[a, i]
            for j in range(len(ratios)):
                total += ratios[j] * (weights[j, 0] * terms[j, a, i] + weights[j, 1] * change)
            field[a, i] = total


@njit(cache=True)
def compose(first, last, ratios, new, terms, field):
    """Fill field = u + sum gamma_j q_j."""
    for a in range(first, last):
        for i in range(new.shape[1]):
            total = new[a, i]
            for j in range(len(ratios)):
                total += ratios[j] * terms[j, a, i]
            field[a, i] = total


@njit(cache=True)
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


class Relaxation:
    """History of a rank's particles: old (owned, d) = u [m] and elastic (owned, d) = f(u) [N] of the last settled state,
    terms (terms, owned, d) = q_j [m] and forces = f(q_j) [N]."""

    def __init__(self, groups, owned: int, dimension: int, share: np.ndarray):
        """groups: their laws give ratios gamma_j and relaxation times tau_j [s]; share (owned,), on this side of mirror planes."""
        self.share, self.series = share, []
        for group in groups:
            ratios, times = group.law.ratios or (), group.law.relaxation_times or ()
            self.series.append((group.first, group.last, np.array(ratios, float), np.array(times, float)))
        terms = max((len(ratios) for _, _, ratios, _ in self.series), default=0)
        self.old, self.elastic = np.zeros((owned, dimension)), np.zeros((owned, dimension))
        self.terms, self.forces = np.zeros((terms, owned, dimension)), np.zeros((terms, owned, dimension))
        self.base, self.factor = np.zeros((owned, dimension)), np.ones(owned)
        self.step: float | None = None
        self._begin(0.0)

    def _begin(self, step: float) -> None:
        """Weights of a step [s], unless they are those of the last call."""
        if step == self.step:
            return
        self.step, self.weights, self.shares = step, [], []
        for first, last, ratios, times in self.series:
            self.weights.append(np.array([branch_weights(step, time) for time in times]).reshape(-1, 2))
            self.shares.append(np.array([dissipation_weights(step, time) for time in times]).reshape(-1, 3))
            self.factor[first:last] = 1.0 + ratios @ self.weights[-1][:, 1]

    def prepare(self, step: float) -> None:
        """`factor` = 1 + sum gamma_j A_j of each particle and `base`, with u~ = factor u + base after a step [s]."""
        self._begin(step)
        for (first, last, ratios, _), weights in zip(self.series, self.weights):
            predict(first, last, ratios, weights, self.old, self.terms, self.base)

    def propose(self, step: float, displacement: np.ndarray, field: np.ndarray) -> None:
        """Fill the field u~ after a step [s] to a displacement (rows, d) [m]."""
        self._begin(step)
        for (first, last, ratios, _), weights in zip(self.series, self.weights):
            propose(first, last, ratios, weights, displacement, self.old, self.terms, field)

    def compose(self, displacement: np.ndarray, field: np.ndarray) -> None:
        """Fill the field u~ of the settled history at a displacement (rows, d) [m]."""
        for first, last, ratios, _ in self.series:
            compose(first, last, ratios, displacement[: len(self.old)], self.terms, field)

    def settle(self, step: float, displacement: np.ndarray, force: np.ndarray) -> float:
        """End a step [s] at a displacement (rows, d) with the force (rows, d) [N] there; the energy dissipated over it [J]."""
        self._begin(step)
        dissipated = 0.0
        for (first, last, ratios, _), weights, shares in zip(self.series, self.weights, self.shares):
            dissipated += settle(
                first, last, ratios, weights, shares, self.share, displacement, self.old, self.terms, force, self.elastic, self.forces
            )
        return dissipated

    def stored_energy(self) -> float:
        """-1/2 u.f(u) - 1/2 sum gamma_j q_j.f(q_j) [J] of the settled state."""
        energy = -0.5 * np.einsum("n,ni,ni->", self.share, self.old, self.elastic)
        for first, last, ratios, _ in self.series:
            for ratio, q, f in zip(ratios, self.terms, self.forces):
                energy -= 0.5 * ratio * np.einsum("n,ni,ni->", self.share[first:last], q[first:last], f[first:last])
        return float(energy)
