"""Small motions of undeformed peridynamic bodies, with what `tlsph.tangent.Tangent` offers."""

from typing import Any

import numpy as np

from parsolid.methods.peridynamics.tangent import algorithmic_law
from parsolid.solvers import scaled_diagonal, start_vector

# a step [s] so long that what relaxes has relaxed
_LONG = 1e30


class SmallMotion:
    """K = -dF/du of one rank's particles at rest, the control's included; all methods are collective.

    Vectors are (owned, d); forces are those on the parts of particles on this side of mirror planes. free (owned, d)
    bool, mass (owned,) [kg]: as of the tangent.
    """

    def __init__(self, system: Any) -> None:
        """system: `system.Peridynamics` with laws whose moduli are known, set up."""
        self.operator = system.operator
        self.free, self.mass = self.operator.free, self.operator.mass

    def linearise(self) -> None:
        """Nothing: the state is that of rest."""

    def share_moves(self, change: np.ndarray) -> None:
        """Nothing: no particles move as one."""

    @property
    def laws(self) -> list[tuple[int, int, float, float, float]]:
        """First and last row of those that share a law, its shear and Lame's first modulus [Pa], density [kg/m^3]."""
        found = [(first, last, algorithmic_law(law, _LONG)) for first, last, law in self.operator.forces.laws]
        return [(*rows, law.shear_modulus, law.first_lame, law.density) for *rows, law in found]

    def product(self, change: np.ndarray) -> np.ndarray:
        """K du (owned, d) [N] of a change du (owned, d) [m]."""
        result = np.empty_like(change)
        self.operator.stiffness(change, result, _LONG)
        return result

    def diagonal(self) -> np.ndarray:
        """D (owned, d) [N/m] of about the size of the diagonal: V modulus/dx^2, as one product scales it."""
        operator, d = self.operator, self.free.shape[1]
        volume = operator.particles.owned_rows("volume")
        estimate = np.ones(self.free.shape) * (volume ** (1.0 - 2.0 / d) * operator.share)[:, None]
        for first, last, shear, lame, _ in self.laws:
            estimate[first:last] *= lame + 2.0 * shear
        trial = np.sign(start_vector(operator.identifier, d)) * self.free
        return scaled_diagonal(operator.comm, estimate, trial, self.product(trial))
