"""Two equal bodies that meet at X = X_c with +v0 and -v0 in uniaxial strain, as long as they are elastic and linear.

Between the two fronts, at X_c -+ c_L t, sigma_xx = -rho c_L v0, |S| = 2 mu sqrt(2/3) v0/c_L and the velocity is 0.
"""

from typing import Any

import numpy as np

from parsolid.exact.solution import Solution, View


class ElasticImpact(Solution):
    """Compared are means over the particles between `behind` of the way from the contact to the front."""

    behind = (0.2, 0.8)

    def __init__(self, law: Any, contact: float, speed: float) -> None:
        """law with density, shear_modulus, bulk_modulus; contact X_c [m]; speed v0 [m/s] of each."""
        modulus = law.bulk_modulus + 4.0 / 3.0 * law.shear_modulus
        self.contact, self.speed, self.wave_speed = contact, speed, float(np.sqrt(modulus / law.density))
        self.stress = -law.density * self.wave_speed * speed
        self.deviator = 2.0 * law.shear_modulus * float(np.sqrt(2.0 / 3.0)) * speed / self.wave_speed

    @classmethod
    def of_scene(cls, scene: Any) -> "ElasticImpact":
        """For a scene's first body, a box that ends at the contact, and the reference's speed [m/s]."""
        body = scene.bodies[0]
        law = body.material.micro_inertia_law()
        return cls(law, body.shape.model.upper[0], scene.reference.parameters["speed"])

    def error_names(self, dimension: int) -> tuple[str, ...]:
        return ("stress", "deviator", "velocity")

    def errors(self, view: View, time: float) -> dict[str, float]:
        """Relative errors of the means of stress along X and of |S|, and the mean velocity over v0. Collective."""
        share = np.abs(view.positions[:, 0] - self.contact) / (self.wave_speed * time)
        behind = ((share > self.behind[0]) & (share < self.behind[1])).astype(float)
        deviator = np.sqrt(2.0 / 3.0) * view.field("von_mises_stress")
        found = (view.field("stress")[:, 0, 0], deviator, np.abs(view.field("velocity")[:, 0]))
        count, *sums = view.sums(behind, *(behind * values for values in found))
        stress, tau, speed = np.array(sums) / count
        return {
            "stress": float(abs(stress / self.stress - 1.0)),
            "deviator": float(abs(tau / self.deviator - 1.0)),
            "velocity": float(speed / self.speed),
        }
