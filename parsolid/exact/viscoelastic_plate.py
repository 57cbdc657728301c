"""The linear viscoelastic plate of Lee et al., section 7.1: u = T(t) g(X) on the unit square.

g = (sin(pi X/2) cos(pi Y/2), -cos(pi X/2) sin(pi Y/2)) has no divergence and Lap g = -(pi^2/2) g, so that
    rho T'' = -(pi^2/2) [mu T + sum mu_a (T - V_a)],   V_a' = (T - V_a)/tau_a,   T(0) = amplitude, T'(0) = 0, V_a(0) =
    0.
The paper's (80), (82) is not a solution: it has no memory, and (82) is not the rate of (80).
"""

from typing import Any

import numpy as np

from parsolid.exact.solution import Solution


class ViscoelasticPlate(Solution):
    """Exact velocity and stress of a material with Maxwell branches in small strain."""

    def __init__(
        self, amplitude: float, density: float, shear_modulus: float, branch_moduli: Any, relaxation_times: Any
    ) -> None:
        """amplitude [m], density [kg/m^3], moduli [Pa], times [s]."""
        self.amplitude, self.shear_modulus = amplitude, shear_modulus
        self.branch_moduli = np.asarray(branch_moduli, float)
        stiffness = 0.5 * np.pi**2 / density
        size = 2 + len(self.branch_moduli)
        self.rates = np.zeros((size, size))
        self.rates[0, 1] = 1.0
        self.rates[1, 0] = -stiffness * (shear_modulus + self.branch_moduli.sum())
        self.rates[1, 2:] = stiffness * self.branch_moduli
        for branch, time in enumerate(relaxation_times, 2):
            self.rates[branch, 0], self.rates[branch, branch] = 1.0 / time, -1.0 / time

    @classmethod
    def of_scene(cls, scene: Any) -> "ViscoelasticPlate":
        """The solution for a scene's first material and its reference's amplitude."""
        material = scene.bodies[0].material
        return cls(
            scene.reference.parameters["amplitude"],
            material.density,
            material.moduli.shear_modulus,
            material.branch_moduli,
            material.relaxation_times,
        )

    def state(self, time: float) -> np.ndarray:
        """(T, T', V_1, ...) in m and m/s at a time [s]."""
        start = np.zeros(len(self.rates))
        start[0] = self.amplitude
        # scipy takes as long to import as a small run
        from scipy.linalg import expm

        return expm(self.rates * time) @ start

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """velocity (n, 2) [m/s], displacement (n, 2) [m], first_piola_kirchhoff_stress (n, 2, 2) [Pa] at X
        (n, 2) [m].
        """
        T, rate, *viscous = self.state(time)
        a, b = 0.5 * np.pi * positions[:, 0], 0.5 * np.pi * positions[:, 1]
        g = np.stack((np.sin(a) * np.cos(b), -np.cos(a) * np.sin(b)), axis=1)
        strain = 0.5 * np.pi * np.cos(a) * np.cos(b)
        stress = np.zeros((len(positions), 2, 2))
        factor = 2.0 * self.shear_modulus * T + 2.0 * float(np.sum(self.branch_moduli * (T - np.array(viscous))))
        stress[:, 0, 0], stress[:, 1, 1] = factor * strain, -factor * strain
        return {"velocity": rate * g, "displacement": T * g, "first_piola_kirchhoff_stress": stress}
