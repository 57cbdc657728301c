"""The internal force of a material step as a function of the displacement, its tangent, and what a step has done."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.conditions import Conditions
from parsolid.collective import anywhere, maximum, minimum
from parsolid.materials.damage.bond_based import BondBased
from parsolid.materials.hyperelastic.functions import elastic_moduli
from parsolid.materials.viscoelastic.prony import Prony, algorithmic_factor
from parsolid.methods.peridynamics.solids import is_small_strain, series_of
from parsolid.solvers import scaled_diagonal, start_vector

# of the spacing, by how much a difference quotient displaces a particle at most
_SHIFT = 1e-6
# a step [s] so long that what relaxes has relaxed
_LONG = 1e30


def algorithmic_law(law: Any, step: float) -> Prony:
    """The elastic law of a step [s] over 1 + sum gamma_j A_j, the factor by which the displacement is multiplied.

    Of a hyperelastic solid that of small strain, of which the shear alone relaxes; of a bond-based one that with
    Poisson's ratio 1/4.
    """
    if isinstance(law, BondBased):
        modulus = 0.4 * law.youngs_modulus
        return Prony(law.density, modulus, modulus, None, None, None, None, None)
    if not isinstance(law, Prony):
        shear, lame = elastic_moduli(law)
        ratios, times = series_of(law)
        solid = Prony(law.density, shear, 0.0, None, None, None, ratios or None, times or None)
        first = lame / algorithmic_factor(solid, step)
        return solid._replace(first_lame=first, ratios=None, relaxation_times=None)
    factor = algorithmic_factor(law, step)
    lame = law.first_lame
    if law.bulk_modulus is not None:
        G, K = law.shear_modulus * factor, law.bulk_modulus
        # the free directions of plane stress (1) and of a bar (2) condensed
        full = K - 2.0 / 3.0 * G
        condensed = {None: full, 1.0: 2.0 * G * full / (full + 2.0 * G), 2.0: 9.0 * K * G / (3.0 * K + G) - 2.0 * G}
        lame = condensed[law.free_directions] / factor
    return law._replace(first_lame=lame, bulk_modulus=None, ratios=None, relaxation_times=None, finite_strain=None)


def instantaneous_wave_modulus(law: Any) -> float:
    """lambda + 2 mu [Pa] of a step of length 0."""
    at_once = algorithmic_law(law, 0.0)
    factor = 1.0 + float(sum(series_of(law)[0]))
    return factor * float((at_once.first_lame or 0.0) + 2.0 * at_once.shear_modulus)


class Settled(NamedTuple):
    """Displacement (owned, d) [m] and internal force (owned, d) [N] of a committed state, the energy [J] stored in
    it."""

    displacement: np.ndarray
    force: np.ndarray
    stored: float


class Work(NamedTuple):
    """What a step has done [J]: work of loads and of what guides, work against internal forces, the most that forces
    out of balance at its end can have done, sum |F| |du|, and what stored energy has gained."""

    external: float
    internal: float
    residual: float
    stored: float


class Operator:
    """F(u) of one rank's particles over a step whose memory is frozen, and its tangent K = -dF/du.

    Vectors are (owned, d), d the dimension of the scene; forces [N] are those on the part of a particle on this side of
    mirror planes, so that K is symmetric in the plain inner product. All calls are collective; `step` [s] is the length
    of the material step that starts at the last committed state, 0 of a jump.
    """

    def __init__(self, forces: Any, conditions: Conditions) -> None:
        """forces: of `forces.build_forces`; `free` (owned, d) are their components that are not prescribed."""
        self.forces, self.conditions, self.particles = forces, conditions, forces.particles
        self.dimension, self.comm = forces.d, forces.bonds.comm
        constrained = conditions.constrained
        self.free = np.ones((forces.owned, forces.d), bool) if constrained is None else ~constrained
        linear = all(is_small_strain(law) for _, _, law in forces.laws)
        self.is_linear = not anywhere(self.comm, not linear)
        least = minimum(self.comm, float(np.min(forces.bonds.volume[: forces.owned], initial=np.inf)))
        self.length = least ** (1.0 / self.dimension)

    @property
    def share(self) -> np.ndarray:
        """The part (owned,) of a particle on this side of mirror planes."""
        return self.forces.share

    @property
    def mass(self) -> np.ndarray:
        """Mass (owned,) [kg] of this side's part."""
        return self.particles.owned_rows("mass") * self.share

    @property
    def identifier(self) -> np.ndarray:
        """Identifiers (owned,)."""
        return self.particles.owned_rows("identifier")

    @property
    def displacement(self) -> np.ndarray:
        """Displacement (owned, d) [m] of the particles, a view."""
        return self.particles.owned_rows("displacement")

    def force(self, displacement: np.ndarray, out: np.ndarray, step: float) -> None:
        """Internal force [N] at a displacement [m] at the end of a step into out, the control's included."""
        self.displacement[:] = displacement
        np.multiply(self.forces.internal_force(step), self.share[:, None], out=out)

    def linear(self, displacement: np.ndarray, change: np.ndarray, out: np.ndarray, step: float) -> None:
        """K du [N] at a displacement at the end of a step: symmetric and positive semi-definite."""
        if self.is_linear:
            self.stiffness(change, out, step)
            return
        largest = maximum(self.comm, float(np.abs(change).max(initial=0.0)))
        if largest == 0.0:
            out[:] = 0.0
            return
        # a difference quotient over a small fraction of the spacing
        shift = _SHIFT * self.length / largest
        ahead = np.empty_like(out)
        self.force(displacement + shift * change, ahead, step)
        self.force(displacement - shift * change, out, step)
        out -= ahead
        out *= 0.5 / shift

    def stiffness(self, change: np.ndarray, out: np.ndarray, step: float, laws: Any = None) -> None:
        """K du [N] of the undeformed body over a step of a given length; laws: others than those of the step."""
        if laws is None:
            laws = [(first, last, algorithmic_law(law, step)) for first, last, law in self.forces.laws]
        force = self.forces.stiffness_force(laws, change, step)
        np.multiply(force[:, : self.dimension], -self.share[:, None], out=out)

    def damping(self, velocity: np.ndarray, out: np.ndarray) -> None:
        """Minus the force [N] of the control on velocities (owned, d) [m/s] into out."""
        np.multiply(self.forces.damping_force(velocity)[:, : self.dimension], -self.share[:, None], out=out)

    def external(self, time: float, before_jump: bool = False) -> np.ndarray:
        """Forces (owned, d) [N] of all loads at a time [s], at a jump after or before it."""
        found = self.conditions.find_loads(time, before_jump)
        return np.zeros(self.free.shape) if found is None else np.array(found.T, order="C")

    def settled_force(self) -> np.ndarray:
        """Internal force (owned, d) [N] of the last committed state."""
        return np.asarray(self.forces.force * self.share[:, None])

    def work_since(self, start: Settled, before: np.ndarray, after: np.ndarray) -> Work:
        """What a step has done, by the trapezoidal rule, under loads (owned, d) [N] at its start and at its end."""
        change, force = self.displacement - start.displacement, self.settled_force()
        internal = -0.5 * (start.force + force) * change
        external = np.where(self.free, 0.5 * (before + after) * change, internal)
        left = np.linalg.norm((force + after) * self.free, axis=1)
        residual = float(left @ np.linalg.norm(change, axis=1))
        stored = self.forces.stored_energy() - start.stored
        return Work(float(external.sum()), float(internal.sum()), residual, stored)

    def commit(self, displacement: np.ndarray, step: float) -> float:
        """End a step at a displacement [m], whose force is evaluated once more: memory takes it in; the energy
        dissipated [J]."""
        self.displacement[:] = displacement
        self.forces.internal_force(step)
        return float(self.forces.commit(step))


class SmallMotion:
    """K = -dF/du of one rank's particles at rest over a step [s], the control's included, with what
    `tlsph.tangent.Tangent` offers; all methods are collective.

    Vectors are (owned, d); forces are those on the parts of particles on this side of mirror planes. free (owned, d)
    bool, mass (owned,) [kg]: as of the tangent; factor (owned,): of all moduli, which relax together.
    """

    def __init__(self, operator: Operator, step: float = _LONG, resists_volume: bool = True) -> None:
        """resists_volume: whether first Lame constants count."""
        self.operator, self.step, self.resists_volume = operator, step, resists_volume
        self.free, self.mass, self.factor = operator.free, operator.mass, operator.forces.factor(step)

    def linearise(self) -> None:
        """Nothing: the state is that of rest."""

    def share_moves(self, change: np.ndarray) -> None:
        """Nothing: no particles move as one."""

    def _elastic_laws(self) -> list[tuple[int, int, Any]]:
        found = [(first, last, algorithmic_law(law, self.step)) for first, last, law in self.operator.forces.laws]
        return found if self.resists_volume else [(*rows, law._replace(first_lame=0.0)) for *rows, law in found]

    @property
    def laws(self) -> list[tuple[int, int, float, float, float]]:
        """First and last row of those that share a law, its shear and Lame's first modulus [Pa], to be multiplied by
        the factor, and density [kg/m^3]."""
        return [(*rows, law.shear_modulus, law.first_lame, law.density) for *rows, law in self._elastic_laws()]

    def product(self, change: np.ndarray) -> np.ndarray:
        """K du (owned, d) [N] of a change du (owned, d) [m]."""
        result = np.empty_like(change)
        self.operator.stiffness(change, result, self.step, self._elastic_laws())
        return result

    def diagonal(self) -> np.ndarray:
        """D (owned, d) [N/m] of about the size of the diagonal: V modulus/dx^2, as one product scales it."""
        operator, d = self.operator, self.free.shape[1]
        volume = operator.particles.owned_rows("volume")
        estimate = np.ones(self.free.shape) * (volume * self.factor / (volume / operator.share) ** (2.0 / d))[:, None]
        for first, last, shear, lame, _ in self.laws:
            estimate[first:last] *= lame + 2.0 * shear
        trial = np.sign(start_vector(operator.identifier, d)) * self.free
        return scaled_diagonal(operator.comm, estimate, trial, self.product(trial))
