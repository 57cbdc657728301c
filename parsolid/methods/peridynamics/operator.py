"""The internal force of a material step as an operator on displacements, for solvers."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import anywhere, maximum, minimum
from parsolid.materials.damage.bond_based import BondBased
from parsolid.materials.hyperelastic.law import elastic_moduli
from parsolid.materials.viscoelastic.hyperelastic_series import HyperelasticSeries
from parsolid.materials.viscoelastic.prony_lanes import Prony, algorithmic_factor
from parsolid.methods.peridynamics.bond_force import BondForce
from parsolid.methods.peridynamics.loads import PeridynamicLoads
from parsolid.methods.peridynamics.tensor_history import is_small_strain
from parsolid.methods.peridynamics.unlike_series import UnlikeSeries
from parsolid.methods.peridynamics.viscoelastic_history import ViscoelasticHistory, scale_rows, series_of

_SHIFT = 1e-6


def algorithmic_law(law: Prony, step: float) -> Prony:
    """The elastic law of a step [s] over 1 + sum gamma_j A_j, the factor by which `Operator.linear` multiplies the
    field.
    """
    if isinstance(law, BondBased):
        # its engine needs no constants to be linear
        return Prony(law.density, 0.0, 0.0, None, None, None, None, None)
    if isinstance(law, HyperelasticSeries):
        return Prony(law.density, *elastic_moduli(law.solid), None, None, None, None, None)
    if not isinstance(law, Prony):
        return _undeformed(law, step)
    factor = algorithmic_factor(law, step)
    lame = law.first_lame
    if law.bulk_modulus is not None:
        G, K = law.shear_modulus * factor, law.bulk_modulus
        # the free directions of plane stress (1) and of a bar (2) condensed
        full = K - 2.0 / 3.0 * G
        condensed = {None: full, 1.0: 2.0 * G * full / (full + 2.0 * G), 2.0: 9.0 * K * G / (3.0 * K + G) - 2.0 * G}
        lame = condensed[law.free_directions] / factor
    return law._replace(first_lame=lame, bulk_modulus=None, ratios=None, relaxation_times=None, finite_strain=None)


def _undeformed(law: Any, step: float) -> Prony:
    """As `algorithmic_law`, of a hyperelastic solid near its undeformed state; only its shear relaxes."""
    shear, lame = elastic_moduli(law)
    solid = Prony(law.density, shear, 0.0, None, None, None, *(series or None for series in series_of(law)))
    lame = lame / algorithmic_factor(solid, step)
    return solid._replace(first_lame=lame, ratios=None, relaxation_times=None)


def instantaneous_wave_modulus(law: Any) -> float:
    """lambda + 2 mu [Pa] of a step of length 0."""
    at_once, factor = algorithmic_law(law, 0.0), 1.0
    if series_of(law)[0]:
        factor += float(sum(series_of(law)[0]))
    return factor * float((at_once.first_lame or 0.0) + 2.0 * at_once.shear_modulus)


class Settled(NamedTuple):
    """Displacement (owned, d) [m] and internal force (owned, d) [N] of a committed state, and the energy [J] stored in
    it.
    """

    displacement: np.ndarray
    force: np.ndarray
    stored: float


class Work(NamedTuple):
    """What a step has done [J]: work of loads and of what guides, work against internal forces, the most that forces
    out of balance at its end can have done, sum |F| |du|, and what stored energy has gained.
    """

    external: float
    internal: float
    residual: float
    stored: float


class Operator:
    """F(u) of one rank's particles over a step whose history is frozen, and its tangent K = -dF/du.

    Vectors are (owned, d), d the scene's dimension; forces [N] are those on the part of a particle on this side of
    mirror planes, so that K is symmetric in the plain inner product. All calls are collective; `step`
    [s] is the length of the material step that starts at the last committed state, 0.0 a jump.
    """

    def __init__(self, engine: BondForce, history: ViscoelasticHistory | UnlikeSeries, loads: PeridynamicLoads) -> None:
        self.engine, self.history, self.loads = engine, history, loads
        self.dimension, self.comm = loads.free.shape[1], engine.bond_system.comm
        linear = all(is_small_strain(law) for _, _, law in history.laws)
        self.is_linear = not anywhere(self.comm, not linear)
        least = minimum(self.comm, float(np.min(engine.bond_system.volume[: engine.owned], initial=np.inf)))
        self.length = least ** (1.0 / self.dimension)
        self.step: float | None = None

    @property
    def free(self) -> np.ndarray:
        """Components (owned, d) bool that are not prescribed."""
        return self.loads.free

    @property
    def share(self) -> np.ndarray:
        """The part (owned,) of a particle on this side of mirror planes."""
        return self.engine.particles.owned_rows("share")

    @property
    def mass(self) -> np.ndarray:
        """Mass (owned,) [kg] of this side's part."""
        return self.engine.particles.owned_rows("mass") * self.share

    @property
    def identifier(self) -> np.ndarray:
        """Identifiers (owned,)."""
        return self.engine.particles.owned_rows("identifier")

    def force(self, displacement: np.ndarray, out: np.ndarray, step: float) -> None:
        """Internal force [N] at a displacement [m] at the end of a step, stabiliser included, into out."""
        d, engine = self.dimension, self.engine
        engine.displacement[: engine.owned, :d] = displacement
        np.multiply(self.history.internal_force(step)[:, :d], self.share[:, None], out=out)

    def linear(self, displacement: np.ndarray, change: np.ndarray, out: np.ndarray, step: float) -> None:
        """K du [N] at a displacement at the end of a step: symmetric, positive semi-definite with a self-adjoint
        stabiliser.
        """
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
        if step != self.step:
            self.step = step
            self.tangents = [(first, last, algorithmic_law(law, step)) for first, last, law in self.history.laws]
        self.history.begin(step)
        force = self.history.stiffness_force(self.tangents if laws is None else laws, change)
        scale_rows(-1.0, self.share, force, out)

    @property
    def displacement(self) -> np.ndarray:
        """Displacement (owned, d) [m] of the last evaluation, a view."""
        return self.engine.displacement[: self.engine.owned, : self.dimension]

    def settled_force(self) -> np.ndarray:
        """Internal force (owned, d) [N] of the last committed state."""
        return self.engine.force[: self.engine.owned, : self.dimension] * self.share[:, None]

    def settled_state(self) -> Settled:
        """The last committed state, as a copy."""
        return Settled(self.displacement.copy(), self.settled_force(), self.history.stored_energy())

    def work_since(self, start: Settled, before: np.ndarray, after: np.ndarray) -> "Work":
        """What a step has done, by the trapezoidal rule, under loads (owned, d) [N] at its start and at its end."""
        change, force = self.displacement - start.displacement, self.settled_force()
        internal = -0.5 * (start.force + force) * change
        external = np.where(self.free, 0.5 * (before + after) * change, internal)
        left = np.linalg.norm((force + after) * self.free, axis=1)
        residual = float(left @ np.linalg.norm(change, axis=1))
        stored = self.history.stored_energy() - start.stored
        return Work(float(external.sum()), float(internal.sum()), residual, stored)

    def commit(self, displacement: np.ndarray, step: float) -> float:
        """End a step at a displacement [m], whose force is evaluated once more: history takes it in; the energy
        dissipated [J].
        """
        engine, d = self.engine, self.dimension
        engine.displacement[: engine.owned, :d] = displacement
        self.history.internal_force(step)
        return self.history.settle(step)
