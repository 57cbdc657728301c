"""A bar, plate or block under uniform tension along X: creep and recovery, exact for any Prony series and load history.

Galadima et al., sections 8.1 and 8.2. With operational moduli (Laplace transform times s) the axial strain is
sigma/E = sigma (1/(9K) + 1/(3G)) and the lateral one sigma (1/(9K) - 1/(6G)); in the complete formulation Poisson's ratio is
constant and the lateral strain is -nu times the axial one. Cross-sections are free to contract (bar, plane stress, 3-D).
"""

import numpy as np

from parsolid.exact.prony import Compliance, PronySeries


class UniaxialCreep:
    """Displacement and stress of a body whose face X = origin[0] only slides, and whose other fixed planes pass through origin."""

    def __init__(self, axial: Compliance, lateral: Compliance, history, origin):
        """axial, lateral: strains over stress; history: see `Compliance.strain`; origin (d,) [m]: the point that rests."""
        self.axial, self.lateral, self.history = axial, lateral, [tuple(map(float, knot)) for knot in history]
        self.origin = np.asarray(origin, float)

    @classmethod
    def complete(cls, modulus: PronySeries, poissons_ratio: float, history, origin) -> "UniaxialCreep":
        """All moduli relax alike: Young's modulus E(t) and a constant Poisson's ratio."""
        axial = modulus.compliance()
        return cls(axial, axial.combined(0.0, -poissons_ratio), history, origin)

    @classmethod
    def deviatoric(cls, shear: PronySeries, bulk_modulus: float, history, origin) -> "UniaxialCreep":
        """Only the shear modulus G(t) relaxes; bulk modulus [Pa]."""
        inverse, volumetric = shear.compliance(), 1.0 / (9.0 * bulk_modulus)
        return cls(inverse.combined(volumetric, 1.0 / 3.0), inverse.combined(volumetric, -1.0 / 6.0), history, origin)

    def stress(self, time: float) -> float:
        """The stress [Pa] just after a time [s]."""
        passed = [knot for knot in self.history if knot[0] <= time]
        coming = [knot for knot in self.history if knot[0] > time]
        if not passed:
            return 0.0
        (begin, before), (end, after) = passed[-1], coming[0] if coming else (np.inf, passed[-1][1])
        return before + (after - before) * (time - begin) / (end - begin)

    def strains(self, time: float) -> tuple[float, float]:
        """(axial, lateral) strain just after a time [s]."""
        return self.axial.strain(self.history, time), self.lateral.strain(self.history, time)

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """displacement (n, d) [m] and stress (n, d, d) [Pa] at X (n, d) [m], just after a time [s]."""
        n, d = positions.shape
        axial, lateral = self.strains(time)
        displacement = (positions - self.origin[:d]) * np.array([axial, lateral, lateral])[:d]
        stress = np.zeros((n, d, d))
        stress[:, 0, 0] = self.stress(time)
        return {"displacement": displacement, "stress": stress}
