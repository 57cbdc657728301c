"""Axial vibration of a viscoelastic bar, clamped at X = 0 and free at X = L, released from a uniform stretch.

Galadima et al., section 8.3. Each mode sin(k X), k = (2n - 1) pi/(2 L), moves by itself:
    rho T'' = -k^2 [E_0 T + sum_j E_j (T - V_j)],   V_j' = (T - V_j)/tau_j,
with V_j(0) = T(0) when the stretch had been held for ever ("relaxed"), 0 when it was applied just before
("instantaneous").
"""

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from parsolid.exact.prony import PronySeries
from parsolid.exact.solution import Solution

# the probe, with the weight sin(pi X/(2 L)), from which a run is judged
MODE_PROBE = "mode_1"


class Oscillation(NamedTuple):
    """A mode's roots: angular frequency [rad/s], decay rate [1/s] of the oscillation, real roots (n,) [1/s] of the
    creep.
    """

    frequency: float
    decay: float
    creep: np.ndarray

    @property
    def period(self) -> float:
        """Period [s]."""
        return 2.0 * np.pi / self.frequency


class BarVibration(Solution):
    """The modal solution: points of a run lag behind kinks, so that runs are judged by the projection on mode 1."""

    def __init__(
        self, modulus: PronySeries, density: float, length: float, stretch: float, relaxed: bool, modes: int = 2000
    ) -> None:
        """length [m], density [kg/m^3], stretch of the start; relaxed: whether it had been held for ever."""
        self.length, self.stretch, self.relaxed = length, stretch, relaxed
        self.modulus, self.density, self.modes = modulus, density, modes
        number = np.arange(1, modes + 1)
        self.wave_number = (number - 0.5) * np.pi / length
        sign = np.where(number % 2 == 1, 1.0, -1.0)
        # stretch * X = sum of amplitude * sin(k X)
        self.amplitude = 2.0 * stretch * sign / (length * self.wave_number**2)
        rates, vectors = np.linalg.eig(self._matrices(self.wave_number))
        start = np.zeros(rates.shape[1])
        start[0] = 1.0
        start[2:] = relaxed
        weights = np.linalg.solve(vectors, np.broadcast_to(start, rates.shape)[..., None])[..., 0]
        self.rates, self.weights = rates, weights * vectors[:, 0, :]

    @classmethod
    def of_scene(cls, scene: Any) -> "BarVibration":
        """The solution for a scene's first body, a bar from X = 0, and its reference's stretch."""
        body = scene.bodies[0]
        modulus, relaxed = PronySeries.youngs_of(body.material), scene.systems[0].settings.initial_state == "relaxed"
        return cls(
            modulus, body.material.density, body.shape.model.upper[0], scene.reference.parameters["stretch"], relaxed
        )

    def _matrices(self, wave_number: np.ndarray) -> np.ndarray:
        """The rate (modes, 2 + n, 2 + n) of (T, T', V_1, ...)."""
        size = 2 + len(self.modulus.times)
        matrices = np.zeros((len(wave_number), size, size))
        stiffness = wave_number**2 / self.density
        matrices[:, 0, 1] = 1.0
        matrices[:, 1, 0] = -stiffness * self.modulus.instantaneous
        matrices[:, 1, 2:] = stiffness[:, None] * self.modulus.moduli
        branch = np.arange(2, size)
        matrices[:, branch, 0], matrices[:, branch, branch] = 1.0 / self.modulus.times, -1.0 / self.modulus.times
        return matrices

    def oscillation(self, mode: int = 1) -> Oscillation:
        """Frequency, decay and creep roots of a mode, counted from 1."""
        roots = self.rates[mode - 1]
        # the oscillating pair is the one farthest from the real axis
        pair = roots[np.argmax(roots.imag)]
        creep = np.sort(-roots[np.abs(roots.imag) < 1e-9 * abs(pair)].real)
        return Oscillation(float(pair.imag), float(-pair.real), creep)

    def modal(self, time: ArrayLike, mode: int = 1) -> np.ndarray:
        """T(t)/T(0) of a mode at times [s] of any shape."""
        phases = np.exp(np.asarray(time, float)[..., None] * self.rates[mode - 1])
        return (phases @ self.weights[mode - 1]).real

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """displacement (n, d) [m] and velocity (n, d) [m/s], along the first axis, at X (n, d) [m].

        The series converges like 1/modes; kinks and jumps of the velocity travel along the bar.
        """
        evolved = self.weights * np.exp(self.rates * time)
        shapes = np.sin(positions[:, :1] * self.wave_number)
        result = {}
        for name, factor in (("displacement", evolved.sum(axis=1)), ("velocity", (evolved * self.rates).sum(axis=1))):
            result[name] = np.zeros(positions.shape)
            result[name][:, 0] = shapes @ (self.amplitude * factor.real)
        return result

    # --- a run's history ----------------------------------------------------------------------------------------

    def history_columns(self) -> list[str]:
        """The projection of the displacement on mode 1."""
        return [f"{MODE_PROBE}.displacement_x"]

    def history_names(self) -> list[str]:
        """Errors of the period and the decay rate, relative, and of the mode over its start."""
        return ["period", "decay_rate", "amplitude"]

    def history_errors(self, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Relative errors of period and decay rate of mode 1, of a fit to all rows, and the largest |error| over the
        start.

        The decay rate's is over 0.001 of the frequency where the exact one is 0.
        """
        time, exact = history["time"], self.oscillation()
        values = history[self.history_columns()[0]] / self.amplitude[0]
        found = fitted_oscillation(time, values, exact)
        return {
            "period": abs(found.period / exact.period - 1.0),
            "decay_rate": abs(found.decay - exact.decay) / max(exact.decay, 1e-3 * exact.frequency),
            "amplitude": float(np.abs(values - self.modal(time)).max()),
        }


def fitted_oscillation(time: np.ndarray, values: np.ndarray, guess: Oscillation) -> Oscillation:
    """Frequency and decay of the oscillation that fits values (n,) at times (n,) [s] best, beside creep with the
    guess's roots.

    Amplitudes follow linearly, so that two numbers are sought: first of a few periods, then of twice as many each time,
    so that the phase is never off by half a turn.
    """

    # scipy takes as long to import as a small run
    from scipy.optimize import least_squares

    def remainder(parameters: Any, time: float, values: np.ndarray) -> Any:
        frequency, decay = parameters[0] * guess.frequency, parameters[1] * guess.frequency
        wave = np.exp((1j * frequency - decay) * time)
        basis = np.column_stack((wave.real, wave.imag, np.exp(-np.outer(time, guess.creep))))
        return values - basis @ np.linalg.lstsq(basis, values)[0]

    found, end = np.array([1.0, guess.decay / guess.frequency]), 4.0 * guess.period
    while True:
        early = time <= end
        window = (time[early], values[early])
        found = least_squares(remainder, found, x_scale=[1e-4, 1e-4], xtol=1e-14, ftol=1e-14, gtol=1e-14, args=window).x
        if end >= time[-1]:
            return Oscillation(float(found[0] * guess.frequency), float(found[1] * guess.frequency), guess.creep)
        end *= 2.0
