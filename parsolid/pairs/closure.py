"""Pair weights of irregular particles, changed so that the force of a constant stress vanishes inside the body.

The force of a constant stress P is P sum_b (L_a + L_b) g_ab. Between irregular particles the sum is not zero, and a
body under pressure tears itself apart. Exact weights give minus the particle's area vector, zero inside: the discrete
divergence theorem, as in meshless finite volumes (Chiu, Wang, Hu, Jameson: A conservative mesh-free scheme and
generalized framework for conservation laws, SIAM J. Sci. Comput. 34 (2012)). With L_a held, weights near g_ab that do
so are
    g_ab + w_ab (L_a + L_b)^{-1} (p_a - p_b),   sum_b w_ab (p_a - p_b) = -A_a - sum_b (L_a + L_b) g_ab,
with potentials p_a by a graph Laplacian. They remain antisymmetric, so that forces stay pairwise; L_a follows them, so
that gradients of linear fields stay exact; and both are repeated. What is left after the passes comes from the volumes,
where they are not those of a tiling.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import raise_together
from parsolid.kernels import kernel

# passes over L_a, and iterations of conjugate gradients in each; they need not converge, as L_a corrects smooth errors
PASSES, ITERATIONS = 10, 10
# largest error of a particle, |A_a + sum_b (L_a + L_b) g_ab| / V_a^((d-1)/d)
LEFT_OVER = 0.5
# smallest part of a pass that is tried where the whole pass increases the error
LEAST_PART = 1.0 / 16.0


def surface_area(comm: Any, particle_set: Any, planes: Any, closed: np.ndarray) -> np.ndarray:
    """Area vectors A_a (n, d) [m^2] of particles with their halves beyond mirror planes; particle_set:
    `particles.particle_set.ParticleSet`; closed (n,): particles whose weights are to be closed; collective.

    Raises SolverError on all ranks when their areas are not where the particles are.
    """
    raise_together(comm, _surface_fault(comm, particle_set, closed))
    area = particle_set.area.copy()
    for plane in planes:
        on = plane.contains(particle_set)
        area[on] *= 2.0
        area[on, plane.axis] = 0.0
    return area


def _surface_fault(comm: Any, particle_set: Any, closed: np.ndarray) -> str | None:
    """sum_a A_a . X_a is d times the volume for particles on the surface, and less by half a spacing for cells beside
    it."""
    area, position = particle_set.area[closed], particle_set.position[closed]
    depth = 0.5 * np.linalg.norm(area, axis=1) * particle_set.spacing[closed].min(axis=1)
    moment = position.shape[1] * particle_set.volume[closed].sum() - np.sum(area * position)
    missing, between = sums(comm, np.array([moment, depth.sum()]))
    if missing <= 0.2 * between:
        return None
    return (
        'method.weights: expected particles on the surface of the bodies (placement = "vertices") for "closure", '
        "found cells"
    )


class Closure:
    """The discrete divergence theorem on pair lists; arrays of particles have this rank's owned rows."""

    def __init__(self, near: Any, area: Any, share: Any, closed: Any = None) -> None:
        """near: `pair_list.Neighbours`, whose weights are rows (g_ab, stiffness w_ab); area (owned, d): `surface_area`.

        share (owned,): the part of each particle on this side of mirror planes; closed (owned,) bool: particles whose
        weights are to be closed, all unless given; no other has a pair with one of them.
        """
        self.near, self.area, self.share = near, area, share[:, None]
        self.closed = np.ones((near.owned, 1), bool) if closed is None else closed[:, None]
        # of all rows
        self.potential = np.zeros_like(near.positions)

    def fluxes(self, correction: np.ndarray) -> np.ndarray:
        """sum_b (L_a + L_b) g_ab (owned, d) [m^2]; correction (rows, d, d)."""
        total = np.zeros_like(self.near.positions)
        for pairs in self.near.lists:
            add_fluxes(pairs, correction, total)
        return total[: self.near.owned]

    def left_over(self, correction: np.ndarray) -> np.ndarray:
        """A_a + sum_b (L_a + L_b) g_ab (owned, d) [m^2], zero for closed weights and those that are not to be."""
        return self.closed * (self.area + self.fluxes(correction))

    def improve(self, correction: np.ndarray) -> None:
        """Change the weights of all lists towards closure, with the corrections held; collective."""
        diagonal = np.zeros(self.near.rows)
        for pairs in self.near.lists:
            stiffen(pairs, self.near.positions, diagonal)
        solution = self._solve(-self.left_over(correction), diagonal[: self.near.owned, None])
        self._set_potential(solution)
        for pairs in self.near.lists:
            add_potential(pairs, correction, self.potential)

    def take_back(self, correction: np.ndarray, share: float) -> None:
        """Undo a share of what `improve` did with the same corrections."""
        self.potential *= share
        for pairs in self.near.lists:
            add_potential(pairs, correction, -self.potential)
        self.potential *= (1.0 - share) / share

    def distance(self, correction: np.ndarray) -> float:
        """Distance of all weights from closed ones: the root of a sum of squares [m^2]; collective."""
        return self._sum(self.left_over(correction) ** 2) ** 0.5

    def _set_potential(self, owned: np.ndarray) -> None:
        self.potential = self.near.with_ghosts_and_images(owned, "normal")

    def _solve(self, residual: np.ndarray, diagonal: np.ndarray) -> np.ndarray:
        """Potentials (owned, d) by conjugate gradients; the Laplacian is symmetric in the sums weighted with the
        share."""
        result = np.zeros_like(residual)
        z = residual / diagonal
        direction, norm = z.copy(), self._sum(residual * z)
        for _ in range(ITERATIONS):
            if norm == 0.0:
                break
            image = self._laplacian(direction)
            step = norm / self._sum(direction * image)
            result += step * direction
            residual = residual - step * image
            z = residual / diagonal
            before, norm = norm, self._sum(residual * z)
            direction = z + (norm / before) * direction
        return result

    def _laplacian(self, direction: np.ndarray) -> np.ndarray:
        self._set_potential(direction)
        total = np.zeros_like(self.potential)
        for pairs in self.near.lists:
            add_laplacian(pairs, self.potential, total)
        return total[: self.near.owned]

    def _sum(self, values: np.ndarray) -> float:
        return float(sums(self.near.comm, np.array([np.sum(self.share * values)]))[0])


def close(near: Any, correction: np.ndarray, surface: Any, correct: Any) -> np.ndarray:
    """Close the weights of `pair_list.Neighbours`; the corrections (owned, d, d) that go with them, which correct()
    finds anew. Collective.

    surface: area, share and closed of `Closure`. Raises SolverError on all ranks when a particle's volume and its
    neighbours fit so badly that the passes diverge.
    """

    def with_all(owned: np.ndarray) -> np.ndarray:
        return np.asarray(near.with_ghosts_and_images(owned, "tensor"))

    theorem, everywhere = Closure(near, *surface), with_all(correction)
    distance = theorem.distance(everywhere)
    for _ in range(PASSES):
        held, part = everywhere, 1.0
        theorem.improve(held)
        correction = correct()
        everywhere = with_all(correction)
        # where particles are very uneven a whole pass may lead away
        while theorem.distance(everywhere) >= distance and part > LEAST_PART:
            part *= 0.5
            theorem.take_back(held, 0.5 if part > LEAST_PART else 1.0)
            correction = correct()
            everywhere = with_all(correction)
        if part <= LEAST_PART:
            break
        distance = theorem.distance(everywhere)
    d, owned = near.positions.shape[1], near.owned
    left_over = np.abs(theorem.left_over(everywhere)).max(axis=1) / near.volume[:owned] ** (1 - 1 / d)
    raise_together(near.comm, _fault(left_over, near.positions))
    return correction


@kernel
def add_fluxes(pairs, correction, total):
    """Add sum_b (L_a + L_b) g_ab [m^2] to total (rows, d): the pair force of a stress of 1 Pa everywhere."""
    d = total.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            for i in range(d):
                flux = 0.0
                for j in range(d):
                    flux += (correction[a, i, j] + correction[b, i, j]) * pairs.weight[k, j]
                total[a, i] += flux
                total[b, i] -= flux


@kernel
def stiffen(pairs, positions, diagonal):
    """Fill w_ab = |g_ab| |X_b - X_a| beside g and add it to diagonal (rows,)."""
    d = positions.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, squares, length = pairs.neighbour[k], 0.0, 0.0
            for i in range(d):
                length += (positions[b, i] - positions[a, i]) ** 2
                squares += pairs.weight[k, i] ** 2
            pairs.weight[k, d] = (squares * length) ** 0.5
            diagonal[a] += pairs.weight[k, d]
            diagonal[b] += pairs.weight[k, d]


@kernel
def add_laplacian(pairs, potential, total):
    """Add sum_b w_ab (p_a - p_b) to total (rows, d)."""
    d = potential.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b = pairs.neighbour[k]
            for i in range(d):
                term = pairs.weight[k, d] * (potential[a, i] - potential[b, i])
                total[a, i] += term
                total[b, i] -= term


@kernel
def add_potential(pairs, correction, potential):
    """Add to g_ab what changes (L_a + L_b) g_ab by about w_ab (p_a - p_b): exactly where L_a + L_b is a multiple of
    1."""
    d = potential.shape[1]
    for a in range(pairs.start.size - 1):
        for k in range(pairs.start[a], pairs.start[a + 1]):
            b, trace = pairs.neighbour[k], 0.0
            for i in range(d):
                trace += correction[a, i, i] + correction[b, i, i]
            for i in range(d):
                pairs.weight[k, i] += pairs.weight[k, d] * (potential[a, i] - potential[b, i]) * d / trace


def _fault(left_over: np.ndarray, positions: np.ndarray) -> str | None:
    if np.all(left_over <= LEFT_OVER):
        return None
    place = ", ".join(f"{x:.6g}" for x in positions[np.argmax(left_over)])
    return (
        "method.weights: expected particles whose volumes fit their distances, found one at "
        f"({place}) of which {left_over.max():.2g} of a face is left over, and {np.sum(left_over > LEFT_OVER)} like it "
        '(a mesh without elements much smaller or flatter than their neighbours, or method.weights = "kernel")'
    )
