"""Manufactured solutions for the material point method: motions given in closed form, and the body forces that they
need.

Both are plane strain in a neo-Hookean solid, P = mu (F - F^-T) + U'(J) J F^-T with U'(J) J = lambda (J - 1) J, where
Wallstedt & Guilkey, J. Comput. Phys. 227 (2008) 9628, have lambda ln J.
"""

from typing import Any

import numpy as np

from parsolid.exact.solution import Solution


class Solid:
    """Density [kg/m^3], Lame constants [Pa] and the volumetric part of a compressible neo-Hookean solid."""

    def __init__(self, density: float, shear_modulus: float, first_lame: float) -> None:
        self.density, self.mu, self.first_lame = density, shear_modulus, first_lame

    @classmethod
    def of_scene(cls, scene: Any) -> "Solid":
        """The first body's material; it must be neo-Hookean."""
        material = scene.bodies[0].material
        return cls(float(material.density), material.moduli.shear_modulus, material.moduli.lambda_hat)

    def volumetric(self, J: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """U'(J) J and its derivative by J [Pa]."""
        return self.first_lame * (J - 1.0) * J, self.first_lame * (2.0 * J - 1.0)


class AxisAligned(Solution):
    """u_i = A sin(pi X_i) sin(c pi t + phase_i) on the unit square, phases 0 and pi; nothing moves normally on its
    sides.

    c is the speed of waves in a bar, sqrt(E / rho); the period is 2 / c.
    """

    def __init__(self, amplitude: float, solid: Solid) -> None:
        """amplitude A [m]."""
        self.solid = solid
        # the second phase of pi is a change of sign
        self.amplitudes = amplitude * np.array([1.0, -1.0])
        mu, lame = solid.mu, solid.first_lame
        youngs_modulus = mu * (3.0 * lame + 2.0 * mu) / (lame + mu)
        self.frequency = np.pi * np.sqrt(youngs_modulus / solid.density)
        self.scales = {"displacement": amplitude, "velocity": amplitude * self.frequency}

    @classmethod
    def of_scene(cls, scene: Any) -> "AxisAligned":
        """The solution for a scene's first material and its reference's amplitude."""
        return cls(scene.reference.parameters["amplitude"], Solid.of_scene(scene))

    def stretches(self, positions: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """F_ii and its derivative by X_i [1/m], both (n, 2)."""
        size = self.amplitudes * np.sin(self.frequency * time)
        angle = np.pi * positions
        return 1.0 + np.pi * size * np.cos(angle), -(np.pi**2) * size * np.sin(angle)

    def displacement(self, positions: np.ndarray, time: float) -> np.ndarray:
        """u (n, 2) [m] at X (n, 2) [m]."""
        return np.sin(np.pi * positions) * self.amplitudes * np.sin(self.frequency * time)

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """displacement [m], velocity [m/s] (n, 2) and Cauchy stress [Pa] (n, 3, 3) at X (n, 2) [m]."""
        shape = np.sin(np.pi * positions) * self.amplitudes
        stretch, _ = self.stretches(positions, time)
        J = stretch.prod(axis=1)
        volumetric, _ = self.solid.volumetric(J)
        stress = np.zeros((len(positions), 3, 3))
        for i, squared in enumerate((stretch[:, 0] ** 2, stretch[:, 1] ** 2, np.ones(len(J)))):
            stress[:, i, i] = (volumetric + self.solid.mu * (squared - 1.0)) / J
        return {
            "displacement": self.displacement(positions, time),
            "velocity": shape * self.frequency * np.cos(self.frequency * time),
            "stress": stress,
        }

    def body_force(self, positions: np.ndarray, time: float) -> np.ndarray:
        """b (n, 2) [m/s^2] of rho0 u'' = Div P + rho0 b at X (n, 2) [m]."""
        acceleration = -(self.frequency**2) * self.displacement(positions, time)
        stretch, bend = self.stretches(positions, time)
        J = stretch.prod(axis=1)
        volumetric, slope = self.solid.volumetric(J)
        # P_ii = mu (F_ii - 1/F_ii) + U'J / F_ii, and J changes along X_i by J F_ii' / F_ii
        tangent = self.solid.mu * (1.0 + stretch**-2) + ((J * slope - volumetric)[:, None]) * stretch**-2
        return acceleration - tangent * bend / self.solid.density


class GeneralisedVortex(Solution):
    """Circles of a ring turn rigidly by A sin(pi t) h(R), h = 1 - 32 (R - 1)^2 + 256 (R - 1)^4, R from 0.75 to 1.25 m.

    Neither surface moves or bears traction; J = 1 throughout. Kamojjala et al., Eng. Comput. 31 (2015) 1.
    """

    def __init__(self, amplitude: float, solid: Solid) -> None:
        """amplitude A [rad]."""
        self.amplitude, self.solid = amplitude, solid
        self.scales = {"displacement": 1.0, "velocity": np.pi * amplitude}

    @classmethod
    def of_scene(cls, scene: Any) -> "GeneralisedVortex":
        """The solution for a scene's first material and its reference's amplitude."""
        return cls(scene.reference.parameters["amplitude"], Solid.of_scene(scene))

    def _motion(self, positions: np.ndarray, time: float) -> tuple[np.ndarray, ...]:
        """R, h, h', h'' and the present angle of each particle."""
        R = np.hypot(positions[:, 0], positions[:, 1])
        s = R - 1.0
        h = 1.0 - 32.0 * s**2 + 256.0 * s**4
        angle = np.arctan2(positions[:, 1], positions[:, 0]) + self.amplitude * np.sin(np.pi * time) * h
        return R, h, -64.0 * s + 1024.0 * s**3, -64.0 + 3072.0 * s**2, angle

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """displacement [m], velocity [m/s] (n, 2) and Cauchy stress [Pa] (n, 3, 3) at X (n, 2) [m]."""
        R, h, slope, _, angle = self._motion(positions, time)
        radial = np.stack((np.cos(angle), np.sin(angle)), axis=1)
        hoop = np.stack((-radial[:, 1], radial[:, 0]), axis=1)
        shear, tension = self._stresses(R, slope, time)
        stress = np.zeros((len(R), 3, 3))
        mixed = radial[:, :, None] * hoop[:, None, :]
        stress[:, :2, :2] = shear[:, None, None] * (mixed + mixed.swapaxes(1, 2))
        stress[:, :2, :2] += tension[:, None, None] * hoop[:, :, None] * hoop[:, None, :]
        rate = self.amplitude * np.pi * np.cos(np.pi * time) * h
        return {
            "displacement": R[:, None] * radial - positions,
            "velocity": (R * rate)[:, None] * hoop,
            "stress": stress,
        }

    def _stresses(self, R: np.ndarray, slope: np.ndarray, time: float) -> tuple[np.ndarray, np.ndarray]:
        """Shear stress of circles and tension along them [Pa]; the shear strain is R d(angle)/dR."""
        shear = R * self.amplitude * np.sin(np.pi * time) * slope
        return self.solid.mu * shear, self.solid.mu * shear**2

    def body_force(self, positions: np.ndarray, time: float) -> np.ndarray:
        """b (n, 2) [m/s^2] of rho a = div sigma + rho b at X (n, 2) [m]."""
        R, h, slope, bend, angle = self._motion(positions, time)
        size, speed = self.amplitude * np.sin(np.pi * time), self.amplitude * np.pi * np.cos(np.pi * time)
        stiffness = self.solid.mu / self.solid.density
        radial = -R * (speed * h) ** 2 + stiffness * R * (size * slope) ** 2
        hoop = -R * np.pi**2 * size * h - stiffness * size * (3.0 * slope + R * bend)
        cosine, sine = np.cos(angle), np.sin(angle)
        return np.stack((radial * cosine - hoop * sine, radial * sine + hoop * cosine), axis=1)
