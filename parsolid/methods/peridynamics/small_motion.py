"""Small motions of undeformed peridynamic bodies, with what `tlsph.tangent.Tangent` offers."""

from typing import Any

import numpy as np

from parsolid.methods.peridynamics.tangent import algorithmic_law
from parsolid.solvers import scaled_diagonal, start_vector

# a step [s] so long that what relaxes has relaxed
_LONG = 1e30


class SmallMotion:
    """K = -dF/du of one rank's particles at rest over a step [s], the control's included; all methods are collective.

    Vectors are (owned, d); forces are those on the parts of particles on this side of mirror planes. free (owned, d)
    bool, mass (owned,) [kg]: as of the tangent; factor (owned,): of all moduli, which relax together.
    """

    def __init__(self, operator: Any, step: float = _LONG, resists_volume: bool = True) -> None:
        """operator: `tangent.Operator`; resists_volume: whether first Lame constants count."""
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
