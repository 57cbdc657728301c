"""The preconditioner of quasi-static steps: `solvers.two_level` with the bodies' moduli and supports."""

from copy import copy
from itertools import combinations
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import maximum
from parsolid.materials.damage.bond_based import BondBased
from parsolid.methods.peridynamics.operator import Operator, algorithmic_law
from parsolid.solvers import Grid, TwoLevel, start_vector

# width of the grid's cells over the particles' spacing: more than the horizon, within which stiffness is nearly flat
_WIDTH = 4.0
# of a rank's particles, about so many are looked at on each mirror plane
_POINTS = 500


class CoarseGrid:
    """Makes the preconditioners of steps; all methods are collective.

    Of a stiffness that changes with the displacement it is that of the undeformed body, of a cracked one that of the
    whole body: neither changes what is found.
    """

    def __init__(self, operator: Operator, planes: Any) -> None:
        """planes: the `boundary.mirror_planes.MirrorPlane`s of the scene."""
        self.operator, self.comm, self.planes = operator, operator.comm, planes
        particles = operator.engine.particles
        places = np.ascontiguousarray(particles.owned_rows("reference_position"))
        self.volume, d = particles.owned_rows("volume"), places.shape[1]
        self.length = (self.volume / operator.share) ** (1.0 / d)
        ends = places[:1].repeat(len(planes) if len(places) else 0, axis=0)
        for row, plane in zip(ends, planes):
            row[plane.axis] = plane.coordinate
        width = _WIDTH * maximum(self.comm, float(self.length.max(initial=0.0)))
        self.grid = Grid.over(self.comm, np.concatenate((places, ends)), width)
        self.bare = TwoLevel(self.comm, self.grid, places, operator.free, self._held(planes))

    def _held(self, planes: Any) -> np.ndarray:
        """Components (nodes, d) of the grid's nodes that mirror planes hold."""
        grid = self.grid
        shape = tuple(grid.cells + 1)
        result = np.zeros((grid.nodes, len(shape)), bool)
        numbers = np.indices(shape).reshape(len(shape), -1).T
        for plane in planes:
            at = grid.lower[plane.axis] + numbers[:, plane.axis] * grid.width[plane.axis]
            near = np.abs(at - plane.coordinate) < 0.5 * grid.width[plane.axis]
            result[near] |= plane.held(len(shape))
        return result

    def preconditioner(self, step: float) -> TwoLevel:
        """The preconditioner of a step of a length [s]."""
        solver = copy(self.bare)
        operator, history = self.operator, self.operator.history
        history.begin(step)
        lame, shear = np.zeros(len(self.volume)), np.zeros(len(self.volume))
        for first, last, law in history.laws:
            elastic = algorithmic_law(law, step)
            lame[first:last], shear[first:last] = elastic.first_lame, elastic.shear_modulus
        lame, shear = lame * history.factor, shear * history.factor
        weight = (self.volume * (lame + 2.0 * shear) / self.length**2)[:, None] * np.ones(operator.free.shape)
        # the stiffness is nearly a multiple of the weight: the mean of its eigenvalues, from one product
        trial = np.sign(start_vector(operator.identifier, operator.dimension)) * operator.free
        image = np.empty_like(trial)
        operator.stiffness(trial, image, step)
        power, measure = sums(self.comm, [np.vdot(trial, image), np.vdot(trial, weight * trial)])
        solver.of_moduli(lame, shear, self.volume, weight * float(power / measure) if measure > 0.0 else weight)
        motions = self._rigid_motions(operator.engine.particles.owned_rows("reference_position"))
        solver.leave_out(motions, self._restraint(motions))
        return solver

    def _rigid_motions(self, places: np.ndarray) -> np.ndarray:
        """Translations, and where strains are small rotations, (k, n, d), at places (n, d) [m]."""
        n, d = places.shape
        motions = [np.broadcast_to(np.eye(d)[i], (n, d)) for i in range(d)]
        if self.operator.is_linear:
            middle = self.grid.lower + 0.5 * self.grid.width * self.grid.cells
            arm = (places - middle) / np.max(self.grid.width * self.grid.cells)
            for i, j in combinations(range(d), 2):
                spin = np.zeros((n, d))
                spin[:, i], spin[:, j] = -arm[:, j], arm[:, i]
                motions.append(spin)
        return np.array(motions)

    def _restraint(self, motions: np.ndarray) -> np.ndarray:
        """Sums of products (k, k) of rigid motions (k, n, d) where they are prescribed and on mirror planes, of all
        ranks: what has none there has no stiffness, and no force need be evaluated to know it.
        """
        particles = self.operator.engine.particles
        parts = [motions * ~self.operator.free]
        for plane in self.planes:
            concerned = np.flatnonzero(plane.concerns(particles.owned_rows("body")))
            # a few points say what a plane lets move
            onto = particles.owned_rows("reference_position")[concerned[:: len(concerned) // _POINTS + 1]]
            onto[:, plane.axis] = plane.coordinate
            parts.append(self._rigid_motions(onto) * plane.held(motions.shape[2]))
        return sums(self.comm, sum(np.tensordot(one, one, ((1, 2), (1, 2))) for one in parts))


def coarse_grid(operator: Any, planes: Any) -> CoarseGrid | None:
    """The preconditioner's maker, None for bond-based laws, whose moduli it does not know."""
    bond_based = any(isinstance(law, BondBased) for _, _, law in operator.history.laws)
    return None if maximum(operator.comm, bond_based) else CoarseGrid(operator, planes)
