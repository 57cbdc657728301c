"""Linear viscoelastic solids.

Relaxation functions E(t) = E_0 + sum_j E_j exp(-t/tau_j) and their exact inverses, the creep compliances.

A bar, plate or block under uniform tension along X: creep and recovery, exact for any Prony series and load history.

Galadima et al., sections 8.1 and 8.2. With operational moduli (Laplace transform times s) the axial strain is
sigma/E = sigma (1/(9K) + 1/(3G)) and the lateral one sigma (1/(9K) - 1/(6G)); in the complete formulation Poisson's
ratio is constant and the lateral strain is -nu times the axial one. Cross-sections are free to contract (bar, plane
stress, 3-D).

Axial vibration of a viscoelastic bar, clamped at X = 0 and free at X = L, released from a uniform stretch.

Galadima et al., section 8.3. Each mode sin(k X), k = (2n - 1) pi/(2 L), moves by itself:
    rho T'' = -k^2 [E_0 T + sum_j E_j (T - V_j)],   V_j' = (T - V_j)/tau_j,
with V_j(0) = T(0) when the stretch had been held for ever ("relaxed"), 0 when it was applied just before
("instantaneous").
"""

from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from parsolid.exact.solution import Solution
from parsolid.materials.viscoelastic.interconversion import shear_relaxation


class PronySeries:
    """One modulus in small strain: equilibrium value [Pa], moduli (n,) [Pa] and relaxation times (n,) [s]
    of the terms.
    """

    def __init__(self, equilibrium: float, moduli: Any = (), times: Any = ()) -> None:
        self.equilibrium = float(equilibrium)
        moduli, times = np.atleast_1d(np.asarray(moduli, float)), np.atleast_1d(np.asarray(times, float))
        present = moduli > 0.0
        # terms of the same time are one term
        self.times = np.unique(times[present])
        self.moduli = np.array([moduli[present & (times == time)].sum() for time in self.times])

    @classmethod
    def youngs_of(cls, material: Any) -> "PronySeries":
        """E(t) of a `materials.viscoelastic.prony_stated.StatedProny` whose moduli all relax alike."""
        modulus = material.equilibrium.youngs_modulus
        factor = modulus / (material.youngs_modulus or material.shear_modulus)
        return cls(modulus, factor * np.array(material.term_moduli), material.relaxation_times)

    @classmethod
    def shear_of(cls, material: Any) -> "PronySeries":
        """G(t) of a `materials.viscoelastic.prony_stated.StatedProny` whose bulk modulus does not relax."""
        known = material.equilibrium
        if material.youngs_modulus is not None and material.conversion != "paper":
            series = shear_relaxation(
                known.bulk_modulus, known.youngs_modulus, material.term_moduli, material.relaxation_times
            )
            return cls(*series)
        factor = known.shear_modulus / (material.youngs_modulus or material.shear_modulus)
        return cls(known.shear_modulus, factor * np.array(material.term_moduli), material.relaxation_times)

    @property
    def instantaneous(self) -> float:
        """E(0) [Pa]."""
        return self.equilibrium + float(self.moduli.sum())

    def relaxation(self, time: float) -> np.ndarray:
        """E(t) [Pa] at times [s] of any shape."""
        decay = np.exp(-np.asarray(time, float)[..., None] / self.times)
        return self.equilibrium + decay @ self.moduli

    def operational(self, s: Any) -> Any:
        """s times the Laplace transform of E(t) [Pa] at s [1/s]."""
        return self.equilibrium + float(np.sum(self.moduli * s * self.times / (1.0 + s * self.times)))

    def compliance(self) -> "Compliance":
        """D(t) with (D * dE)(t) = 1: retardation rates are the zeros of `operational`, one between each two of its
        poles.
        """
        # scipy takes as long to import as a small run
        from scipy.optimize import brentq

        poles = [*(-1.0 / self.times), 0.0]
        rates, amplitudes = [], []
        for lower, upper in pairwise(poles):
            # in between, s E(s) rises from minus infinity; at 0 it is E_0, so that the last zero is 0 for a fluid
            margin = 1e-15 * abs(lower)
            end = upper if upper == 0.0 else upper - 1e-15 * abs(upper)
            s = brentq(self.operational, lower + margin, end, xtol=1e-300, rtol=1e-14)
            slope = float(np.sum(self.moduli * self.times / (1.0 + s * self.times) ** 2))
            rates.append(-s)
            amplitudes.append(-1.0 / (s * slope))
        return Compliance(1.0 / self.equilibrium, amplitudes, rates)


class Compliance:
    """D(t) = D_inf - sum_k d_k exp(-r_k t), a strain [1/Pa] over a stress that is switched on at 0 (0 before).

    final [1/Pa]; amplitudes d (n,) [1/Pa]; rates r (n,) [1/s].
    """

    def __init__(self, final: float, amplitudes: Any = (), rates: Any = ()) -> None:
        self.final = float(final)
        self.amplitudes, self.rates = np.asarray(amplitudes, float), np.asarray(rates, float)

    def __call__(self, time: float) -> float:
        """D(t) [1/Pa] at one time [s], D(0+) at 0."""
        return 0.0 if time < 0.0 else self.final - float(np.sum(self.amplitudes * np.exp(-self.rates * time)))

    def integral(self, time: float) -> float:
        """The integral of D from 0 to a time [s/Pa]."""
        if time <= 0.0:
            return 0.0
        return self.final * time + float(np.sum(self.amplitudes / self.rates * np.expm1(-self.rates * time)))

    def combined(self, constant: float, factor: float) -> "Compliance":
        """constant + factor D(t)."""
        return Compliance(constant + factor * self.final, factor * self.amplitudes, self.rates)

    def strain(self, history: Any, time: float) -> float:
        """Strain under a stress that is linear between knots, just after the jumps of that time (Boltzmann's
        superposition).

        history: rising (time [s], stress [Pa]) pairs, a repeated time is a jump; 0 before the first and constant after
        the last.
        """
        first, stress = history[0]
        result = stress * self(time - first)
        for (begin, before), (end, after) in pairwise(history):
            if end == begin:
                result += (after - before) * self(time - begin)
            else:
                rate = (after - before) / (end - begin)
                result += rate * (self.integral(time - begin) - self.integral(time - end))
        return result


class UniaxialCreep(Solution):
    """Displacement and stress of a body whose face X = origin[0] only slides, and whose other fixed planes pass through
    origin.

    Of a run are judged, at every row of its history, the displacements of probes that show position and displacement.
    """

    def __init__(self, axial: Compliance, lateral: Compliance, history: Any, origin: Any) -> None:
        """axial, lateral: strains over stress; history: see `Compliance.strain`; origin (d,) [m]: the point
        that rests.
        """
        self.axial, self.lateral, self.history = axial, lateral, [tuple(map(float, knot)) for knot in history]
        self.origin = np.asarray(origin, float)
        self.probes: list[str] = []

    @classmethod
    def of_scene(cls, scene: Any) -> "UniaxialCreep":
        """The solution for a scene's first body, its traction along X, and its supports; what they leave free is
        centred.
        """
        body, dimension = scene.bodies[0], scene.dimension
        traction = next(one for one in scene.boundaries if one.kind == "traction")
        amplitude = float(traction.traction.evaluate(np.zeros((1, dimension)), 0.0)[0, 0])
        rows = traction.history.table if traction.history is not None else [[0.0, 1.0]]
        history = [(time, amplitude * factor) for time, factor in rows]
        box = body.shape.model
        origin = 0.5 * (np.array(box.lower) + np.array(box.upper))
        for one in scene.boundaries:
            if one.kind in ("fixed", "roller"):
                origin[one.plane.axis] = one.plane.offset
        if body.material.bulk == "elastic":
            known = body.material.equilibrium
            result = cls.deviatoric(PronySeries.shear_of(body.material), known.bulk_modulus, history, origin)
        else:
            series, ratio = PronySeries.youngs_of(body.material), body.material.equilibrium.poissons_ratio
            result = cls.complete(series, ratio, history, origin)
        wanted = {"position", "displacement"}
        result.probes = [probe.name for probe in scene.probes if probe.at is not None and wanted <= set(probe.fields)]
        return result

    @classmethod
    def complete(cls, modulus: PronySeries, poissons_ratio: float, history: Any, origin: Any) -> "UniaxialCreep":
        """All moduli relax alike: Young's modulus E(t) and a constant Poisson's ratio."""
        axial = modulus.compliance()
        return cls(axial, axial.combined(0.0, -poissons_ratio), history, origin)

    @classmethod
    def deviatoric(cls, shear: PronySeries, bulk_modulus: float, history: Any, origin: Any) -> "UniaxialCreep":
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

    # --- a run's history ----------------------------------------------------------------------------------------

    def _columns(self, field: str) -> list[list[str]]:
        return [[f"{name}.{field}_{axis}" for axis in "xyz"[: len(self.origin)]] for name in self.probes]

    def history_columns(self) -> list[str]:
        """Positions and displacements of the probes."""
        return [
            column for field in ("position", "displacement") for columns in self._columns(field) for column in columns
        ]

    def history_names(self) -> list[str]:
        """The displacements of the probes."""
        return [column for columns in self._columns("displacement") for column in columns]

    def history_errors(self, history: dict[str, np.ndarray]) -> dict[str, float]:
        """Largest |error| of each displacement over its largest exact value, or over that of all components where it
        vanishes, over all rows of the history.
        """
        # a row at a jump shows what was before, unless it was written after the jump's step of length 0
        jumps = {end for (begin, _), (end, _) in zip(self.history, self.history[1:]) if begin == end} | {
            self.history[0][0]
        }
        times = [
            np.nextafter(time, -np.inf) if time in jumps and (step > 0.0 or row == 0) else time
            for row, (time, step) in enumerate(zip(history["time"], history["dt"]))
        ]
        errors = {}
        for places, columns in zip(self._columns("position"), self._columns("displacement")):
            found = np.stack([history[column] for column in columns], axis=1)
            place = np.stack([history[column] for column in places], axis=1) - found
            exact = np.array([self.fields(at[None, :], time)["displacement"][0] for at, time in zip(place, times)])
            whole = np.abs(exact).max()
            for column, difference, size in zip(columns, (found - exact).T, exact.T):
                # a component that vanishes but for rounding is compared with the largest one
                largest = np.abs(size).max()
                largest = largest if largest > 1e-9 * whole else whole
                errors[column] = float(np.abs(difference).max() / (largest if largest > 0.0 else 1.0))
        return errors


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
        # the rate (modes, 2 + n, 2 + n) of (T, T', V_1, ...)
        size = 2 + len(self.modulus.times)
        matrices = np.zeros((len(self.wave_number), size, size))
        stiffness = self.wave_number**2 / self.density
        matrices[:, 0, 1] = 1.0
        matrices[:, 1, 0] = -stiffness * self.modulus.instantaneous
        matrices[:, 1, 2:] = stiffness[:, None] * self.modulus.moduli
        branch = np.arange(2, size)
        matrices[:, branch, 0], matrices[:, branch, branch] = 1.0 / self.modulus.times, -1.0 / self.modulus.times
        rates, vectors = np.linalg.eig(matrices)
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
