"""The preconditioner of quasi-static steps: `solvers.two_level` with the bodies' moduli and supports."""

from copy import copy
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.collective import maximum
from parsolid.materials.damage.bond_based import BondBased
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.fragments import unbalanced_fragment
from parsolid.methods.peridynamics.tangent import Operator, algorithmic_law
from parsolid.solvers import Grid, NearlyIncompressible, TwoLevel, rigid_motions, scaled_diagonal, start_vector

# width of the grid's cells over the particles' spacing: more than the horizon, within which stiffness is nearly flat
_WIDTH = 4.0
# of a rank's particles, about so many are looked at on each mirror plane
_POINTS = 500
# first Lame constant over shear modulus from which volumes are stiff, as with Poisson's ratio 0.495
_STIFF = 100.0
# of the shear modulus, what resists a change of volume at least
_LEAST = 1e-3
# particles whose divergences are factorised at most, by dimension: in space each has 300 to 900 neighbours there
_MOST_FACTORISED = {2: 10_000, 3: 5_000}
# iterations of two levels alone over the root of first Lame constant over shear modulus, from 0.49 to 0.4999, with
# 20,000 particles and, in the plane, 100,000
_ITERATIONS = {2: 11, 3: 16}


class CoarseSpace:
    """Makes the preconditioners of steps; all methods are collective.

    Of a stiffness that changes with the displacement it is that of the undeformed body, of a cracked one that of the
    whole body: neither changes what is found.
    """

    def __init__(self, operator: Operator, planes: Any) -> None:
        """planes: the `boundary.mirror_planes.MirrorPlane`s of the scene."""
        self.operator, self.comm, self.planes = operator, operator.comm, planes
        particles = operator.particles
        places = np.ascontiguousarray(particles.owned_rows("reference_position"))
        self.volume, d = particles.owned_rows("volume"), places.shape[1]
        self.length = (self.volume / operator.share) ** (1.0 / d)
        ends = places[:1].repeat(len(planes) if len(places) else 0, axis=0)
        for row, plane in zip(ends, planes):
            row[plane.axis] = plane.coordinate
        width = _WIDTH * maximum(self.comm, float(self.length.max(initial=0.0)))
        self.grid = Grid.over(self.comm, np.concatenate((places, ends)), width)
        self.divergence: Any = None
        self.bare = TwoLevel(self.comm, self.grid, places, operator.free, self._held(planes))

    def _held(self, planes: Any) -> np.ndarray:
        """Components (nodes, d) of the grid's nodes that mirror planes hold."""
        grid, numbers = self.grid, self.grid.numbers
        result = np.zeros(numbers.shape, bool)
        for plane in planes:
            at = grid.lower[plane.axis] + numbers[:, plane.axis] * grid.width[plane.axis]
            near = np.abs(at - plane.coordinate) < 0.5 * grid.width[plane.axis]
            result[near] |= plane.held(numbers.shape[1])
        return result

    def preconditioner(self, step: float) -> TwoLevel | NearlyIncompressible:
        """The preconditioner of a step of a length [s]."""
        solver, forces = copy(self.bare), self.operator.forces
        lame, shear, laws = np.zeros(len(self.volume)), np.zeros(len(self.volume)), []
        for first, last, law in forces.laws:
            elastic = algorithmic_law(law, step)
            lame[first:last], shear[first:last] = elastic.first_lame, elastic.shear_modulus
            laws.append((first, last, elastic._replace(first_lame=0.0)))
        stiff = self._is_nearly_incompressible(lame, shear)
        factor = forces.factor(step)
        lame, shear = lame * factor, shear * factor
        resisted = np.maximum(lame, _LEAST * shear) * self.volume
        if stiff:
            lame = np.zeros_like(lame)
        solver.of_moduli(lame, shear, self.volume, self._diagonal(lame + 2.0 * shear, laws if stiff else None, step))
        motions = self._rigid_motions(self.operator.particles.owned_rows("reference_position"))
        solver.project_out(motions, self._restraint(motions))
        if not stiff:
            return solver
        if self.divergence is None:
            self.divergence = divergence_of_components(forces.bonds, self.operator.dimension)
        return NearlyIncompressible(solver, self.divergence, 1.0 / np.concatenate(self.comm.allgather(resisted)))

    def _is_nearly_incompressible(self, lame: np.ndarray, shear: np.ndarray) -> bool:
        """Whether volumes are so stiff that two levels alone take long, and particles few enough for more."""
        few = self.comm.allreduce(len(lame)) <= _MOST_FACTORISED.get(self.operator.dimension, 0)
        return few and maximum(self.comm, float(np.max(lame / shear, initial=0.0))) > _STIFF

    def near_incompressibility_note(self, steps: tuple[float, ...]) -> str:
        """What volumes cost that are stiff in a body too large to factorise their pressures, in words; nothing where
        they are not. steps [s]: lengths of steps. Collective.
        """
        laws = [algorithmic_law(law, step) for _, _, law in self.operator.forces.laws for step in steps]
        ratios = [(law.first_lame or 0.0) / law.shear_modulus for law in laws]
        ratio = maximum(self.comm, max(ratios, default=0.0))
        count, dimension = self.comm.allreduce(len(self.volume)), self.operator.dimension
        most = _MOST_FACTORISED.get(dimension, 0)
        if ratio <= _STIFF or count <= most:
            return ""
        iterations = 10 * round(0.1 * _ITERATIONS.get(dimension, 11) * ratio**0.5)
        stiff = f"volumes are {ratio:.3g} times as stiff as shapes (Poisson's ratio {0.5 * ratio / (1.0 + ratio):.6g})"
        many = f"{count} particles are more than the {most} whose pressures are factorised"
        cost = f"{iterations} or so force evaluations a solution from rest in place of 20"
        return f"{stiff}, and {many}: {cost}; fewer particles, or a ratio of 0.49 (70), cost less"

    def _diagonal(self, modulus: np.ndarray, laws: Any, step: float) -> np.ndarray:
        """D (n, d) [N/m] of the step's stiffness, or of that of other laws: it is nearly a multiple of V modulus/dx^2,
        by the mean of its eigenvalues, from one product.
        """
        operator = self.operator
        weight = (self.volume * modulus / self.length**2)[:, None] * np.ones(operator.free.shape)
        trial = np.sign(start_vector(operator.identifier, operator.dimension)) * operator.free
        image = np.empty_like(trial)
        operator.stiffness(trial, image, step, laws)
        return scaled_diagonal(self.comm, weight, trial, image)

    def _rigid_motions(self, places: np.ndarray) -> np.ndarray:
        """Translations, and where strains are small rotations, (k, n, d), at places (n, d) [m]."""
        size = self.grid.width * self.grid.cells
        motions = rigid_motions((places - (self.grid.lower + 0.5 * size)) / np.max(size))
        return motions if self.operator.is_linear else motions[: places.shape[1]]

    def unbalanced_fragment(self, residual: np.ndarray, target: float) -> str:
        """See `fragments.unbalanced_fragment`."""
        motions = self._rigid_motions(self.operator.particles.owned_rows("reference_position"))
        return unbalanced_fragment(self.operator, motions, self._restraint, residual, target)

    def _restraint(self, motions: np.ndarray, fragment: np.ndarray | None = None) -> np.ndarray:
        """Sums of products (k, k) of rigid motions (k, n, d) where they are prescribed and on mirror planes, of all
        ranks: what has none there has no stiffness, and no force need be evaluated to know it.

        fragment (n,) bool: the particles that move; of them those with images in a plane feel it.
        """
        particles = self.operator.particles
        parts = [motions * ~self.operator.free]
        for plane in self.planes:
            concerned = plane.concerns(particles.owned_rows("body"))
            if fragment is not None:
                near = np.abs(particles.owned_rows("reference_position")[:, plane.axis] - plane.coordinate)
                concerned = concerned & fragment & (near <= self.length)
            concerned = np.flatnonzero(concerned)
            # a few points say what a plane lets move
            onto = particles.owned_rows("reference_position")[concerned[:: len(concerned) // _POINTS + 1]]
            onto[:, plane.axis] = plane.coordinate
            parts.append(self._rigid_motions(onto) * plane.held(motions.shape[2]))
        return sums(self.comm, sum(np.tensordot(one, one, ((1, 2), (1, 2))) for one in parts))


def coarse_space(operator: Any, planes: Any) -> CoarseSpace | None:
    """The preconditioner's maker, None for bond-based laws, whose moduli it does not know."""
    bond_based = any(isinstance(law, BondBased) for _, _, law in operator.forces.laws)
    return None if maximum(operator.comm, bond_based) else CoarseSpace(operator, planes)


def divergence_of_components(bonds: Bonds, dimension: int) -> Any:
    """D (particles of all ranks, owned d) [1/m] of this rank's components: (D u)_a = tr G_a.

    Particles are numbered by rank, then row. Collective.
    """
    from scipy import sparse

    comm, owned, X = bonds.comm, bonds.owned, bonds.positions[:, :dimension]
    counts = np.array(comm.allgather(owned))
    first, count = int(counts[: comm.rank].sum()), int(counts.sum())
    numbers = bonds.halo.with_ghosts(first + np.arange(owned, dtype=np.int64))
    inverse = bonds.inverse_shapes()[:, :dimension, :dimension] / bonds.volume[:owned, None, None]
    parts = []
    for pairs, images, mutual in bonds.lists:
        a, b = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start)), pairs.neighbour.astype(np.int64)
        end, Q = X[b], np.ones((len(b), dimension))
        if images is not None:
            R, T, Q = (array[images.code, :dimension] for array in (images.reflections, images.shifts, images.signs))
            end = R * end + T
        g = pairs.weight[:, None] * (end - X[a])
        parts.append((a, b, np.einsum("kij,kj->ki", inverse[a], g), Q))
        if mutual:
            parts.append((b, a, np.einsum("kij,kj->ki", inverse[b], -g), Q))
    a, b, g, Q = (np.concatenate(arrays) for arrays in zip(*parts))
    rows, across = np.repeat(first + a, dimension), np.arange(dimension)
    there, here = numbers[b][:, None] * dimension + across, (first + a)[:, None] * dimension + across
    entries = np.concatenate(((Q * g).ravel(), -g.ravel()))
    places_of = (np.concatenate((rows, rows)), np.concatenate((there.ravel(), here.ravel())))
    mine = sparse.coo_array((entries, places_of), (count, count * dimension)).tocsr()
    whole = sum(comm.allgather(mine), start=sparse.csr_array(mine.shape))
    return whole[:, first * dimension : (first + owned) * dimension]
