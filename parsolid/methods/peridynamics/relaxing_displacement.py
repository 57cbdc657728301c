"""The relaxing displacement f = u + sum_j gamma_j q_j: the memory of particles whose moduli relax by one Prony series.

With a displacement that is linear over a step, q_j <- a_j q_j + A_j (u_new - u_old) (`branch_weights` of
`materials.viscoelastic.prony`), and the gradient of f is the relaxing strain. As the force F is linear,
F(f) = F(u) + sum_j gamma_j F(q_j), the forces F(u) and F(q_j) follow by the same recursion from F(f) alone. They give
the stored energy, that of the control included, and what the branches dissipate. When bonds break they must be
evaluated anew where these were.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from parsolid.kernels import exact
from parsolid.materials.viscoelastic.prony import branch_weights, dissipation_weights
from parsolid.pairs.lattice_convolution import aligned_zeros
from parsolid.particles.declaration import Columns, Field

# an evaluation of the force (owned, 4) [N] that is linear in the field of a memory
Evaluate = Callable[[], np.ndarray]


class RelaxingDisplacement:
    """Memory of the displacement of all particles of a rank by one series; d = dimension of the scene.

    field: name of f, that of the displacement itself where nothing relaxes; laws: (first, last, law) of the particles
    that have this series; rows (k,): these particles; force (owned, 4) [N]: F(f) in the last evaluation; factor:
    1 + sum gamma_j A_j. It declares, for restarts where there are branches,

    settled_displacement, elastic_force         u [m] and F(u) [N] of the settled state (d, n)
    branch_displacements, branch_forces         q_j [m] and F(q_j) [N], (branches d, n)
    """

    def __init__(self, particles: Any, laws: list[Any], series: tuple[Any, Any], mark: str = "") -> None:
        """series: gamma_j and tau_j [s]; mark: what names of fields end with, where there are several series."""
        self.particles, self.laws, self.mark = particles, laws, mark
        self.ratios, self.times = np.array(series[0], float), np.array(series[1], float)
        self.rows = np.concatenate([np.arange(first, last) for first, last, _ in laws] or [np.zeros(0, np.int64)])
        d, branches, declare = particles.fields["displacement"].components, len(self.ratios), particles.declare
        self.d, self.force = d, aligned_zeros(particles.owned, 4)
        kept: dict[str, Any] = {"checkpointed": branches > 0, "mirror": "vector", "layout": Columns()}
        self.field = f"relaxing_displacement{mark}" if branches else "displacement"
        if branches:
            declare(Field(self.field, d, "m", mirror="vector", layout=Columns(), ghosts="forward", message="motion"))
            declare(Field(f"branch_displacements{mark}", branches * d, "m", **kept))
            declare(Field(f"branch_forces{mark}", branches * d, "N", **kept))
        declare(Field(f"settled_displacement{mark}", d, "m", **kept))
        declare(Field(f"elastic_force{mark}", d, "N", **kept))
        self.step: float | None = None
        self.begin(0.0)

    def _array(self, name: str) -> np.ndarray:
        """The columns of a field; without branches none of theirs."""
        name += self.mark
        return self.particles.storage(name) if name in self.particles else np.zeros((0, self.particles.owned))

    def begin(self, step: float) -> None:
        """Weights of a step [s]."""
        if step != self.step:
            self.step = step
            self.weights = np.array([branch_weights(step, tau) for tau in self.times]).reshape(-1, 2)
            self.losses = np.array([dissipation_weights(step, tau) for tau in self.times]).reshape(-1, 3)
            self.factor = 1.0 + float(self.ratios @ self.weights[:, 1])

    def trial_step(self, step: float) -> None:
        """f after a step [s] to the displacement of the particles."""
        self.begin(step)
        if len(self.ratios):
            u, old = self.particles.storage("displacement"), self._array("settled_displacement")
            q = self._array("branch_displacements")
            trial_step(self.particles.owned, self.ratios, self.weights, u, old, q, self.particles.storage(self.field))

    def commit(self, step: float, share: np.ndarray) -> float:
        """End a step [s] at the displacement of the particles, where `force` is F(f); the energy dissipated over it
        [J].

        share (owned,): the part of a particle on this side of mirror planes.
        """
        self.begin(step)
        names = ("settled_displacement", "branch_displacements", "elastic_force", "branch_forces")
        arrays = map(self._array, names)
        u, series = self.particles.storage("displacement"), (self.ratios, self.weights, self.losses)
        lost: float = commit(self.factor, *series, share, u, self.force, *arrays)
        return lost

    def compose(self) -> None:
        """f of the settled state."""
        if len(self.ratios):
            u, q = self.particles.storage("displacement"), self._array("branch_displacements")
            compose(self.particles.owned, self.ratios, u, q, self.particles.storage(self.field))

    def start(self, evaluate: Evaluate, instantaneous: bool) -> None:
        """Memory of the displacement at time 0: reached in a jump, which branches take in full, or held for ever."""
        n, u = self.particles.owned, self.particles.storage("displacement")
        old, q, elastic, forces = map(
            self._array, ("settled_displacement", "branch_displacements", "elastic_force", "branch_forces")
        )
        old[:, :n] = u[:, :n]
        self.particles.storage(self.field)[:, :n] = u[:, :n]
        elastic[:, :n] = evaluate()[:, : self.d].T
        branches = len(self.ratios) if instantaneous else 0
        q[:, :n], forces[:, :n] = 0.0, 0.0
        for j in range(branches):
            part = slice(j * self.d, (j + 1) * self.d)
            q[part, :n], forces[part, :n] = u[:, :n], elastic[:, :n]
        self.compose()

    def parts(self, evaluate: Evaluate) -> np.ndarray:
        """F(u) and F(q_j) [N] of the settled state, ((1 + branches) d, owned)."""
        n, field = self.particles.owned, self.particles.storage(self.field)
        u, q, found = self._array("settled_displacement"), self._array("branch_displacements"), []
        for x in (u, *np.split(q, len(self.ratios) or 1)):
            if len(self.ratios):
                field[:, :n] = x[:, :n]
            if len(x):
                found.append(evaluate()[:, : self.d].T.copy())
        self.compose()
        return np.concatenate(found)

    def add_to_parts(self, change: np.ndarray) -> np.ndarray:
        """Add to F(u) and F(q_j) [N], as of `parts`; what that adds to F(f), (d, owned)."""
        n, d = self.particles.owned, self.d
        self._array("elastic_force")[:, :n] += change[:d]
        self._array("branch_forces")[:, :n] += change[d:]
        return np.einsum("j,jin->in", np.append(1.0, self.ratios), change.reshape(-1, d, n))

    def evaluate_anew(self, evaluate: Evaluate) -> None:
        """F(u) and F(q_j) of the settled state."""
        n, found = self.particles.owned, self.parts(evaluate)
        self._array("elastic_force")[:, :n], self._array("branch_forces")[:, :n] = found[: self.d], found[self.d :]

    def resume(self) -> None:
        """Without branches the settled state is not checkpointed: it is that of the displacement and of `force`."""
        if not len(self.ratios):
            n = self.particles.owned
            self._array("settled_displacement")[:, :n] = self.particles.storage("displacement")[:, :n]
            self._array("elastic_force")[:, :n] = self.force[:, : self.d].T

    def stored_energy(self, share: np.ndarray) -> float:
        """-1/2 u . F(u) - 1/2 sum gamma_j q_j . F(q_j) [J] of the settled state."""
        return self.energy_of(self._array("elastic_force"), self._array("branch_forces"), share)

    def energy_of(self, elastic: np.ndarray, forces: np.ndarray, share: np.ndarray) -> float:
        """The same [J] of given F(u) (d, n) and F(q_j) (branches d, n)."""
        n, d = self.particles.owned, self.d
        u, q = self._array("settled_displacement"), self._array("branch_displacements")
        work = (u[:, :n] * elastic[:, :n]).sum(axis=0)
        for j, ratio in enumerate(self.ratios):
            part = slice(j * d, (j + 1) * d)
            work += ratio * (q[part, :n] * forces[part, :n]).sum(axis=0)
        return -0.5 * float(np.einsum("n,n->", share, work))


# without contraction, so that a state that was put back goes on with the same bits
@exact
def trial_step(count, ratios, weights, new, old, q, field):
    """Fill field = f after a step to the displacement `new`, to the bits of `compose` after `settle`."""
    d = old.shape[0]
    for i in range(d):
        for a in range(count):
            change, total = new[i, a] - old[i, a], new[i, a]
            for j in range(ratios.shape[0]):
                total += ratios[j] * (weights[j, 0] * q[j * d + i, a] + weights[j, 1] * change)
            field[i, a] = total


@exact
def compose(count, ratios, displacement, q, field):
    """Fill field = u + sum gamma_j q_j."""
    d = displacement.shape[0]
    for i in range(d):
        for a in range(count):
            total = displacement[i, a]
            for j in range(ratios.shape[0]):
                total += ratios[j] * q[j * d + i, a]
            field[i, a] = total


@exact
def commit(factor, ratios, weights, losses, share, new, force, old, q, elastic, forces):
    """End a step at the displacement `new`, where F(f) = force; what the branches dissipated over it [J].

    factor: 1 + sum gamma_j A_j; weights (branches, 2) = (a, A); losses (branches, 3) of `dissipation_weights`.
    """
    d, dissipated = old.shape[0], 0.0
    for i in range(d):
        for a in range(share.shape[0]):
            known = 0.0
            for j in range(ratios.shape[0]):
                known += ratios[j] * (weights[j, 0] * forces[j * d + i, a] - weights[j, 1] * elastic[i, a])
            now = (force[a, i] - known) / factor
            change, more = new[i, a] - old[i, a], now - elastic[i, a]
            for j in range(ratios.shape[0]):
                r = j * d + i
                lost = losses[j, 0] * forces[r, a] * q[r, a] + losses[j, 1] * forces[r, a] * change
                dissipated -= share[a] * ratios[j] * (lost + losses[j, 2] * more * change)
                q[r, a] = weights[j, 0] * q[r, a] + weights[j, 1] * change
                forces[r, a] = weights[j, 0] * forces[r, a] + weights[j, 1] * more
            elastic[i, a], old[i, a] = now, new[i, a]
    return dissipated
