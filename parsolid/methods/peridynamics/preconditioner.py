"""The preconditioner of peridynamic equilibria: `solvers.grid_levels` over the undeformed, whole bodies."""

from collections.abc import Callable
from copy import copy
from typing import Any

import numpy as np

from decomposition.reduction import sums
from decomposition.slices import count_before
from parsolid.collective import anywhere, maximum
from parsolid.methods.peridynamics.bonds import Bonds
from parsolid.methods.peridynamics.fragments import unbalanced_fragment
from parsolid.methods.peridynamics.tangent import Operator, SmallMotion, algorithmic_law
from parsolid.solvers import GridLevels, NearlyIncompressible, moduli_of_rows, rigid_motions, unrestrained_modes

# of a rank's particles, about so many are looked at on each mirror plane
_POINTS = 500
# first Lame constant over shear modulus from which volumes are stiff, as with Poisson's ratio 0.495, and with which
# grids have them at most: what locks them takes fewer iterations here than what does not see volumes
_STIFF = 100.0
# of the shear modulus, what resists a change of volume at least
_LEAST = 1e-3
# particles whose divergences are factorised at most, by dimension: in space each has 300 to 900 neighbours there
_MOST_FACTORISED = {2: 10_000, 3: 5_000}
# iterations of grids alone over the root of first Lame constant over shear modulus, from 0.49 to 0.4999, with
# 20,000 particles and, in the plane, 100,000
_ITERATIONS = {2: 13, 3: 16}
# lengths of steps whose preconditioners are kept: jumps, the material step, a shorter one
_KEPT = 3


class Preconditioners:
    """Makes the preconditioners of steps; all methods are collective.

    Of a stiffness that changes with the displacement it is that of the undeformed body, of a cracked one that of the
    whole body: neither changes what is found. loose (l, n, d): rigid motions that nothing holds; they have no
    stiffness, and nothing says what they should be, so that none of them is given. Without a preconditioner conjugate
    gradients have none of them by themselves.
    """

    def __init__(self, operator: Operator, planes: Any) -> None:
        """planes: the `boundary.mirror_planes.MirrorPlane`s of the scene."""
        self.operator, self.comm, self.planes = operator, operator.comm, planes
        self.places = np.ascontiguousarray(operator.particles.owned_rows("reference_position"))
        self.volume, d = operator.particles.owned_rows("volume"), self.places.shape[1]
        self.length = (self.volume / operator.share) ** (1.0 / d)
        count, length, *middle = sums(self.comm, [len(self.places), self.length.sum(), *self.places.sum(axis=0)])
        self.middle = np.array(middle) / count
        self.size = maximum(self.comm, float(np.abs(self.places - self.middle).max(initial=0.0)))
        held = [self._beside(plane)[:, None] & plane.held(d) for plane in planes]
        resisted = np.any([~operator.free, *held], axis=0)
        self.levels = GridLevels(self.comm, self.places, length / count, operator.free, resisted)
        motions = self._rigid_motions(self.places)
        self.loose = unrestrained_modes(self.comm, motions, self._restraint(motions)) * operator.free
        self.relaxes = anywhere(self.comm, bool(np.any(operator.forces.factor(0.0) != 1.0)))
        self._kept: dict[float, Any] = {}
        self._divergence: Any = None

    def _beside(self, plane: Any) -> np.ndarray:
        """Particles (n,) bool that a mirror plane is meant for, within their length of it."""
        near = np.abs(self.places[:, plane.axis] - plane.coordinate) <= self.length
        return np.asarray(plane.concerns(self.operator.particles.owned_rows("body")) & near)

    def of_step(self, step: float) -> Callable[[np.ndarray], np.ndarray]:
        """M^-1 r (n, d) of residuals (n, d) that are 0 where a component is prescribed, in a step of a length [s]."""
        # steps that differ by rounding are alike, to the bit also after a restart, and all are where nothing relaxes
        key = float(f"{step:.6e}") if self.relaxes else 0.0
        if key not in self._kept:
            if len(self._kept) == _KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = self._made(key)

        def precondition(residual: np.ndarray) -> np.ndarray:
            vector: np.ndarray = self._kept[key](residual)
            if len(self.loose):
                loose = self.loose.reshape(len(self.loose), vector.size)
                vector -= (sums(self.comm, loose @ vector.ravel()) @ loose).reshape(vector.shape)
            return vector

        return precondition

    def _made(self, step: float) -> GridLevels | NearlyIncompressible:
        """Grids, and where volumes are so stiff that these alone take long, and particles few enough, more."""
        levels, motion = copy(self.levels), SmallMotion(self.operator, step)
        lame, shear = moduli_of_rows(motion.laws, len(self.places))
        few = self.comm.allreduce(len(lame)) <= _MOST_FACTORISED.get(self.operator.dimension, 0)
        stiff = few and maximum(self.comm, float(np.max(lame / shear, initial=0.0))) > _STIFF
        lame, shear = lame * motion.factor, shear * motion.factor
        if not stiff:
            levels.of_moduli(lame, shear, self.volume, motion.diagonal(), softest=_STIFF)
            return levels
        motion = SmallMotion(self.operator, step, resists_volume=False)
        levels.of_moduli(np.zeros_like(lame), shear, self.volume, motion.diagonal(), most_nodes=np.inf)
        if self._divergence is None:
            self._divergence = divergence_of_components(self.operator.forces.bonds, self.operator.dimension)
        first, count = count_before(self.comm, len(lame))
        resisted = np.zeros(count)
        resisted[first : first + len(lame)] = np.maximum(lame, _LEAST * shear) * self.volume
        return NearlyIncompressible(levels, self._divergence, 1.0 / sums(self.comm, resisted))

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
        iterations = 10 * round(0.1 * _ITERATIONS.get(dimension, 13) * ratio**0.5)
        stiff = f"volumes are {ratio:.3g} times as stiff as shapes (Poisson's ratio {0.5 * ratio / (1.0 + ratio):.6g})"
        many = f"{count} particles are more than the {most} whose pressures are factorised"
        cost = f"{iterations} or so force evaluations a solution from rest in place of 20"
        return f"{stiff}, and {many}: {cost}; fewer particles, or a ratio of 0.49 (70), cost less"

    def _rigid_motions(self, places: np.ndarray) -> np.ndarray:
        """Translations, and where strains are small rotations, (k, n, d), at places (n, d) [m]."""
        motions = rigid_motions((places - self.middle) / max(self.size, 1e-300))
        return motions if self.operator.is_linear else motions[: places.shape[1]]

    def unbalanced_fragment(self, residual: np.ndarray, target: float) -> str:
        return unbalanced_fragment(self.operator, self._rigid_motions(self.places), self._restraint, residual, target)

    def _restraint(self, motions: np.ndarray, fragment: np.ndarray | None = None) -> np.ndarray:
        """Sums of products (k, k) of rigid motions (k, n, d) where they are prescribed and on mirror planes, of all
        ranks: what has none there has no stiffness, and no force need be evaluated to know it.

        fragment (n,) bool: the particles that move; of them those with images in a plane feel it.
        """
        parts = [motions * ~self.operator.free]
        for plane in self.planes:
            if fragment is None:
                concerned = plane.concerns(self.operator.particles.owned_rows("body"))
            else:
                concerned = self._beside(plane) & fragment
            concerned = np.flatnonzero(concerned)
            # a few points say what a plane lets move
            onto = self.places[concerned[:: len(concerned) // _POINTS + 1]]
            onto[:, plane.axis] = plane.coordinate
            parts.append(self._rigid_motions(onto) * plane.held(motions.shape[2]))
        return sums(self.comm, sum(np.tensordot(one, one, ((1, 2), (1, 2))) for one in parts))


def divergence_of_components(bonds: Bonds, dimension: int) -> Any:
    """D (particles of all ranks, owned d) [1/m] of this rank's components: (D u)_a = tr G_a.

    Particles are numbered by rank, then row. Collective.
    """
    from scipy import sparse

    comm, owned, X = bonds.comm, bonds.owned, bonds.positions[:, :dimension]
    first, count = count_before(comm, owned)
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
    whole = comm.allreduce(mine)
    return whole[:, first * dimension : (first + owned) * dimension]
