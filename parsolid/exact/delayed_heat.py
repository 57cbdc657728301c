"""Conduction with a flux that is late (Cattaneo), t_q q' + q = -kappa grad T, in an insulated slab 0 < X < L.

A mode cos(k X) that starts without a flux goes on as exp(-t/(2 t_q)) [cos(w t) + sin(w t)/(2 t_q w)] with
w^2 = alpha k^2/t_q - 1/(4 t_q^2), alpha = kappa/(rho C_v); below 0 cosh and sinh for cos, sin.
"""

from typing import Any

import numpy as np

from parsolid.exact.solution import Solution


class DelayedHeat(Solution):
    """A sum of modes; the error of the temperature is relative to the rise over T0."""

    def __init__(self, start: float, law: Any, length: float, modes: np.ndarray, amplitudes: np.ndarray) -> None:
        """start T0 [K]; law: a `MicroInertia` with t_q; L [m]; modes n (m,) of cos(n pi X/L), their amplitudes [K]."""
        self.start, self.offsets = start, {"temperature": start}
        self.diffusivity = law.conductivity / (law.density * law.specific_heat)
        self.delay = law.heat_relaxation_time
        self.wave_numbers, self.amplitudes = np.pi * np.asarray(modes) / length, np.asarray(amplitudes)

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """temperature (n,) [K] at X (n, d) [m]."""
        shapes = np.cos(positions[:, :1] * self.wave_numbers)
        return {"temperature": self.start + shapes @ (self.amplitudes * self.decay(time))}

    def decay(self, time: float) -> np.ndarray:
        """What is left of each mode (m,) at a time [s], of 1 at the start."""
        rate = 0.5 / self.delay
        frequency = np.sqrt((self.diffusivity * self.wave_numbers**2 / self.delay - rate**2).astype(complex))
        # a mode that is critically damped has the limit of both
        frequency = np.where(frequency == 0.0, 1e-8 * rate, frequency)
        swing = np.cos(frequency * time) + rate / frequency * np.sin(frequency * time)
        return np.exp(-rate * time) * swing.real


class DelayedMode(DelayedHeat):
    """T0 + A cos(n pi X/L) at the start."""

    @classmethod
    def of_scene(cls, scene: Any) -> "DelayedMode":
        """For a scene's first body, a box from X = 0, and the reference's start, amplitude [K] and mode n."""
        given, body = scene.reference.parameters, scene.bodies[0]
        law, length = body.material.micro_inertia_law(), body.shape.model.upper[0]
        return cls(given["start"], law, length, np.array([given["mode"]]), np.array([given["amplitude"]]))


class DelayedPulse(DelayedHeat):
    """T0 + A exp(-((X - centre)/width)^2) at the start, several widths from both faces."""

    _MODES = 400

    @classmethod
    def of_scene(cls, scene: Any) -> "DelayedPulse":
        """For a scene's first body, a box from X = 0, and the reference's start, amplitude [K], centre, width [m]."""
        given, body = scene.reference.parameters, scene.bodies[0]
        law, length = body.material.micro_inertia_law(), body.shape.model.upper[0]
        modes = np.arange(cls._MODES)
        wave, width = np.pi * modes / length, given["width"]
        share = np.sqrt(np.pi) * width / length * np.exp(-0.25 * (wave * width) ** 2) * np.cos(wave * given["centre"])
        share[1:] *= 2.0
        return cls(given["start"], law, length, modes, given["amplitude"] * share)
