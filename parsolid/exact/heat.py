"""Conduction in a slab: a decaying mode, a heated face, a plastic layer that heats itself (Carslaw & Jaeger, chapter
III).

Positions count along X (a mode, a slab) or Y (a sheared layer); T is the absolute temperature, T0 that at the start.

Conduction with a flux that is late (Cattaneo), t_q q' + q = -kappa grad T, in an insulated slab 0 < X < L.

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


# enough that the last term is below round-off for alpha t / L^2 > 1e-4
_TERMS = 250


class _Conduction(Solution):
    """A temperature; its error is relative to the rise over T0."""

    def __init__(self, start: float, diffusivity: float) -> None:
        """start T0 [K], diffusivity alpha [m^2/s]."""
        self.start, self.diffusivity = start, diffusivity
        self.offsets = {"temperature": start}

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """temperature (n,) [K] at X (n, d) [m]."""
        return {"temperature": self.start + self.rise(positions, time)}

    def rise(self, positions: np.ndarray, time: float) -> np.ndarray:
        """T - T0 (n,) [K]."""
        raise NotImplementedError


def diffusivity_of(material: Any) -> float:
    """alpha = k / (rho0 c) [m^2/s] of a scene's material."""
    parts = material.parts
    return parts["conductivity"] / (parts["density"] * parts["specific_heat"])


class CosineMode(_Conduction):
    """T0 + A cos(pi X / L) exp(-alpha (pi / L)^2 t) in a slab with insulated faces X = 0 and X = L."""

    def __init__(self, start: float, diffusivity: float, amplitude: float, length: float) -> None:
        """amplitude A [K], length L [m]."""
        super().__init__(start, diffusivity)
        self.amplitude, self.length = amplitude, length

    @classmethod
    def of_scene(cls, scene: Any) -> "CosineMode":
        """The solution for a scene's first body, a box from X = 0, and the reference's start and amplitude [K]."""
        given, body = scene.reference.parameters, scene.bodies[0]
        return cls(given["start"], diffusivity_of(body.material), given["amplitude"], body.shape.model.upper[0])

    def rise(self, positions: np.ndarray, time: float) -> Any:
        wave = np.pi / self.length
        return self.amplitude * np.cos(wave * positions[:, 0]) * np.exp(-self.diffusivity * wave**2 * time)


class HeatedSlab(_Conduction):
    """A slab at T0 whose face X = 0 is held at T0 + rise, or takes a heat flux q, from t = 0 on; X = L is insulated."""

    def __init__(
        self, start: float, diffusivity: float, length: float, face_rise: float | None = None, gradient: Any = None
    ) -> None:
        """face_rise [K] of the face that is held, or gradient q / k [K/m] of the one that is heated."""
        super().__init__(start, diffusivity)
        self.length, self.face_rise, self.gradient = length, face_rise, gradient

    @classmethod
    def of_scene(cls, scene: Any) -> "HeatedSlab":
        """The solution for a scene's first body, a box from X = 0, and the reference's start and face_rise [K] or
        heat_flux.
        """
        given, body = scene.reference.parameters, scene.bodies[0]
        flux = given.get("heat_flux")
        gradient = None if flux is None else flux / body.material.parts["conductivity"]
        alpha = diffusivity_of(body.material)
        return cls(given["start"], alpha, body.shape.model.upper[0], given.get("face_rise"), gradient)

    def rise(self, positions: np.ndarray, time: float) -> Any:
        share, fourier = positions[:, 0] / self.length, self.diffusivity * time / self.length**2
        n = np.arange(_TERMS)[:, None]
        if self.gradient is None:
            root = (n + 0.5) * np.pi
            return self.face_rise * (
                1.0 - np.sum(2.0 / root * np.sin(root * share) * np.exp(-(root**2) * fourier), axis=0)
            )
        root, depth = (n + 1) * np.pi, 1.0 - share
        series = np.sum(2.0 / root**2 * (-1.0) ** (n + 1) * np.cos(root * depth) * np.exp(-(root**2) * fourier), axis=0)
        return self.gradient * self.length * (fourier + 0.5 * depth**2 - 1.0 / 6.0 - series)


class PlasticLayer(_Conduction):
    """A layer 0 < Y < H sheared at a constant rate: plastic work heats it, its faces stay at T0.

    Rigid until the elastic shear strain tau / mu is spent; then zeta tau rate [W/m^3], tau = yield stress / sqrt(3).
    """

    def __init__(self, start: float, diffusivity: float, height: float, heating: float, delay: float) -> None:
        """height H [m], heating [K/s] without conduction, delay [s] until the layer yields."""
        super().__init__(start, diffusivity)
        self.height, self.heating, self.delay = height, heating, delay

    @classmethod
    def of_scene(cls, scene: Any) -> "PlasticLayer":
        """The solution for a scene's first body, a box from Y = 0, and the reference's start [K] and rate [1/s].

        The flow stress does not change and neither does the shear modulus.
        """
        given, body = scene.reference.parameters, scene.bodies[0]
        parts = body.material.parts
        shear = parts["flow_stress"].yield_stress / np.sqrt(3.0)
        heating = parts["taylor_quinney"] * shear * given["rate"] / (parts["density"] * parts["specific_heat"])
        delay = shear / (parts["shear_modulus"].modulus * given["rate"])
        return cls(given["start"], diffusivity_of(body.material), body.shape.model.upper[1], heating, delay)

    def rise(self, positions: np.ndarray, time: float) -> Any:
        after = time - self.delay
        if after <= 0.0:
            return np.zeros(len(positions))
        share, fourier = positions[:, 1] / self.height, self.diffusivity * after / self.height**2
        root = (2.0 * np.arange(_TERMS)[:, None] + 1.0) * np.pi
        # the steady temperature, less what is still missing of it
        missing = np.sum(4.0 / root**3 * np.sin(root * share) * np.exp(-(root**2) * fourier), axis=0)
        return self.heating * self.height**2 / self.diffusivity * (0.5 * share * (1.0 - share) - missing)
