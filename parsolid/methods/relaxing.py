"""The relaxing displacement u~ = u + sum_j gamma_j q_j: history of a linear viscoelastic body, one vector a Prony term.

q_j <- a_j q_j + A_j (u_new - u_old); gradients of u~ are relaxing strains (see `materials.prony`).
"""

import numpy as np
from numba import njit

from parsolid.materials.prony import branch_weights


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
def relax(first, last, ratios, weights, new, old, terms, field):
    """Take q_j (terms, n, d) through a step to the displacement `new`, keep it as old, and fill field = u~."""
    for a in range(first, last):
        for i in range(old.shape[1]):
            change = new[a, i] - old[a, i]
            total = new[a, i]
            for j in range(len(ratios)):
                terms[j, a, i] = weights[j, 0] * terms[j, a, i] + weights[j, 1] * change
                total += ratios[j] * terms[j, a, i]
            old[a, i] = new[a, i]
            field[a, i] = total


class Relaxation:
    """u_old (owned, d) and q_j (terms, owned, d) [m] of a rank's particles; groups share ratios gamma_j and times tau_j [s]."""

    def __init__(self, groups, owned: int, dimension: int):
        self.series = []
        for group in groups:
            ratios, times = relaxation_series(group.law)
            self.series.append((group.first, group.last, np.array(ratios), np.array(times)))
        terms = max((len(ratios) for _, _, ratios, _ in self.series), default=0)
        self.old, self.terms = np.zeros((owned, dimension)), np.zeros((terms, owned, dimension))
        self.base, self.factor = np.zeros((owned, dimension)), np.ones(owned)
        self.weights: list[np.ndarray] = []
        self.begin(0.0)

    def begin(self, step: float) -> None:
        """Weights (a_j, A_j) of a step [s], 1 + sum gamma_j A_j of each particle in `factor`, and the part of u~ already known in `base`."""
        self.weights = [np.array([branch_weights(step, t) for t in times]).reshape(-1, 2) for _, _, _, times in self.series]
        for (first, last, ratios, _), weights in zip(self.series, self.weights):
            self.factor[first:last] = 1.0 + ratios @ weights[:, 1]
            predict(first, last, ratios, weights, self.old, self.terms, self.base)

    def commit(self, displacement: np.ndarray, field: np.ndarray) -> None:
        """End the step begun at a displacement (rows, d); fills the field u~ (rows, d) of owned particles."""
        for (first, last, ratios, _), weights in zip(self.series, self.weights):
            relax(first, last, ratios, weights, displacement, self.old, self.terms, field)

    def field_of(self, displacement: np.ndarray, field: np.ndarray) -> None:
        """u~ after the step begun, at a displacement (owned, d), without ending the step."""
        field[: len(self.old)] = self.factor[:, None] * displacement + self.base


def relaxation_series(law) -> tuple:
    """gamma_j and tau_j [s] of the field that the stabiliser follows."""
    return law.ratios or (), law.relaxation_times or ()
