"""The steady plane shock of a solid with a linear shock velocity, U_s = C0 + S u_p, into the body at rest.

P_H(x) = rho0 C0^2 x / (1 - S x)^2 with x = 1 - J; E_H = P_H x / 2 per reference volume; the temperature follows from
T dS = dE + P dJ = rho0 Cv (dT + gamma0 T dJ) along the Hugoniot, for a Mie-Grueneisen solid with P = P_H + gamma0 (E -
E_H).
"""

from typing import Any

import numpy as np

from parsolid.exact.solution import Solution, View


class Hugoniot:
    """The state behind a shock that brings matter from rest to the particle speed u_p."""

    def __init__(
        self,
        density: float,
        sound_speed: float,
        slope: float,
        gamma: float,
        specific_heat: float,
        start: np.ndarray,
        particle_speed: float,
    ) -> None:
        """rho0 [kg/m^3], C0 [m/s], S, gamma0 (the full Grueneisen gamma), Cv [J/(kg K)], T0 [K], u_p [m/s]."""
        self.density, self.start, self.particle_speed = density, start, particle_speed
        self.shock_speed = sound_speed + slope * particle_speed
        self.jacobian = 1.0 - particle_speed / self.shock_speed
        self.pressure = density * self.shock_speed * particle_speed
        self.energy = 0.5 * density * particle_speed**2
        # T = e^(gamma x) [T0 + integral of e^(-gamma x) (P_H' x - P_H) / (2 rho0 Cv) dx] [K]
        nodes, weights = np.polynomial.legendre.leggauss(24)
        end = 1.0 - self.jacobian
        x = 0.5 * end * (nodes + 1.0)
        excess = self.density * sound_speed**2 * 2.0 * slope * x**2 / (1.0 - slope * x) ** 3
        heat = 0.5 * end * np.sum(weights * np.exp(-gamma * x) * excess) / (2.0 * self.density * specific_heat)
        self.temperature = float(np.exp(gamma * end) * (self.start + heat))


class SteadyShock(Solution):
    """A bar that flies with -u_p along X against a wall at X = 0, where a shock starts at t = 0.

    Compared are means over the particles behind the shock: between `behind` of its way, in reference positions; and the
    shock speed, from the momentum that the wall has taken.
    """

    behind = (0.3, 0.85)

    def __init__(self, state: Hugoniot, length: float) -> None:
        """length [m] of the bar along X."""
        self.state, self.length = state, length

    @classmethod
    def of_scene(cls, scene: Any) -> "SteadyShock":
        """The shock in a scene's first body, a box from X = 0, at the reference's particle_speed [m/s] and
        start [K].
        """
        given, body = scene.reference.parameters, scene.bodies[0]
        parts = body.material.parts
        equation = parts["equation_of_state"]
        state = Hugoniot(
            parts["density"],
            equation.sound_speed,
            equation.slope,
            equation.gamma,
            parts["specific_heat"],
            given["start"],
            given["particle_speed"],
        )
        return cls(state, body.shape.model.upper[0])

    def error_names(self, dimension: int) -> tuple[str, ...]:
        return ("stress", "density", "internal_energy", "temperature_kelvin", "stress_rms", "shock_speed")

    def errors(self, view: View, time: float) -> dict[str, float]:
        """Relative errors of means behind the shock and of the shock speed; of the stress also the rms about the exact
        one.

        stress along X, density, internal_energy per reference volume, temperature_kelvin (absolute [K]). Collective.
        """
        state, behind = self.state, self.region(view.positions, time).astype(float)
        stress = view.field("stress")[:, 0, 0]
        found = {"stress": stress, "density": view.field("density"), "internal_energy": view.field("internal_energy")}
        wanted = {"stress": -state.pressure, "density": state.density / state.jacobian, "internal_energy": state.energy}
        count, *sums = view.sums(
            behind,
            behind * view.field("temperature"),
            behind * (stress + state.pressure) ** 2,
            *(behind * values for values in found.values()),
        )
        means = dict(zip(found, np.array(sums[2:]) / count))
        result = {name: float(abs(means[name] / exact - 1.0)) for name, exact in wanted.items()}
        result["temperature_kelvin"] = float(abs(sums[0] / count - state.temperature))
        result["stress_rms"] = float(np.sqrt(sums[1] / count)) / state.pressure
        # moments per volume: densities at rest are one for the whole bar
        volume, momentum = view.sums(np.ones(len(behind)), view.field("velocity")[:, 0])
        speed = self.shock_speed(volume, momentum, time)
        return result | {"shock_speed": abs(speed / state.shock_speed - 1.0)}

    def region(self, positions: np.ndarray, time: float) -> np.ndarray:
        """Which particles (n,) are behind the shock, and neither in its front nor beside the wall."""
        share = positions[:, 0] / (self.state.shock_speed * time)
        return (share > self.behind[0]) & (share < self.behind[1])

    def shock_speed(self, mass: float, momentum: float, time: float) -> float:
        """U_s [m/s] from the bar's mass and its momentum along X, both over its density: what is behind the shock has
        none.
        """
        share = 1.0 + momentum / (mass * self.state.particle_speed)
        return share * self.length / time
