"""Solids with micro-inertia.

A layer 0 < Y < H with micro-inertia whose velocity is prescribed: what v^p and gamma do across it.

The micro-waves have closed forms, the sheared layer is solved by differences along Y that share no code with the
particles. Energetic length alone: no l2, l3 and conductivity.

Two equal bodies that meet at X = X_c with +v0 and -v0 in uniaxial strain, as long as they are elastic and linear.

Between the two fronts, at X_c -+ c_L t, sigma_xx = -rho c_L v0, |S| = 2 mu sqrt(2/3) v0/c_L and the velocity is 0.
"""

from functools import cached_property
from typing import Any, NamedTuple

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


class _Wave(Solution):
    """A wave of the mode n along Y in a scene's first body, a box from Y = 0 to H."""

    def __init__(self, law: Any, height: float, mode: float, rates: tuple[float, float]) -> None:
        """law: a `MicroInertia` with l1; H [m], n, a mean rate and an amplitude [1/s]."""
        self.law, self.wave_number, self.rates = law, mode * np.pi / height, rates

    @classmethod
    def of_scene(cls, scene: Any) -> "_Wave":
        """With the reference's rate, amplitude [1/s] and mode."""
        given, body = scene.reference.parameters, scene.bodies[0]
        rates = (given["rate"], given["amplitude"])
        return cls(body.material.micro_inertia_law(), body.shape.model.upper[1], given["mode"], rates)


class MicroWave(_Wave):
    """Shear at the rate r + a cos(k Y), k = n pi/H, small strains, pi = 0 (t_pi is long): v^p = v_0 + v_n cos(k Y),

    each mode v_j = D_j 2 mu/(2 mu + S0 l1^2 k_j^2) (1 - cos(w_j t)), w_j^2 = (2 mu + S0 l1^2 k_j^2)/(rho l_m^2),
    D_j = rate_j/sqrt(2), while |S| > 0 everywhere; r is the mean rate, a the amplitude.
    """

    def __init__(self, law: Any, height: float, mode: float, rates: tuple[float, float]) -> None:
        """As `_Wave`."""
        super().__init__(law, height, mode, rates)
        stiffness = 2.0 * law.shear_modulus + law.yield_stress * (law.energetic_length * self.waves) ** 2
        self.frequencies = np.sqrt(stiffness / (law.density * law.inertia_length**2))
        self.steady = np.array(rates) / np.sqrt(2.0) * 2.0 * law.shear_modulus / stiffness

    @property
    def waves(self) -> np.ndarray:
        """Wave numbers (2,) of both modes [1/m]."""
        return np.array([0.0, self.wave_number])

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """micro_rate (n,) [1/s], plastic_strain (n,) at X (n, d) [m]."""
        shapes, phase = np.cos(positions[:, 1:2] * self.waves), self.frequencies * time
        strain = time - np.sin(phase) / self.frequencies
        return {
            "micro_rate": shapes @ (self.steady * (1.0 - np.cos(phase))),
            "plastic_strain": shapes @ (self.steady * strain),
        }


class FreeMicroWave(_Wave):
    """Matter at rest, free of stress, whose micro-velocity at the start is v0 + a cos(k Y), k = n pi/H, pi = 0 (t_pi is
    long): a standing wave v^p = v0 + a cos(k Y) cos(w t), w = k l1/l_m sqrt(S0/rho), with a <= v0, the mean rate.
    """

    def __init__(self, law: Any, height: float, mode: float, rates: tuple[float, float]) -> None:
        """As `_Wave`."""
        super().__init__(law, height, mode, rates)
        speed = law.energetic_length / law.inertia_length * np.sqrt(law.yield_stress / law.density)
        self.frequency = float(self.wave_number * speed)

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """micro_rate (n,) [1/s], plastic_strain (n,) at X (n, d) [m]."""
        phase, (mean, amplitude) = self.frequency * time, self.rates
        wave = amplitude * np.cos(positions[:, 1] * self.wave_number)
        return {
            "micro_rate": mean + wave * np.cos(phase),
            "plastic_strain": mean * time + wave * np.sin(phase) / self.frequency,
        }


class _State(NamedTuple):
    """Of nodes (n,): v^p, pi, gamma, T, S11, S22, S12, and xi (n - 1,) between them."""

    rate: np.ndarray
    stress: np.ndarray
    strain: np.ndarray
    temperature: np.ndarray
    xx: np.ndarray
    yy: np.ndarray
    xy: np.ndarray
    flux: np.ndarray

    def ahead(self, step: float, change: "_State") -> "_State":
        """This and a step times a rate of change."""
        return _State(*(value + step * rate for value, rate in zip(self, change)))


class MicroLayer(Solution):
    """Simple shear at a constant rate; v^p = 0 at Y = 0 and Y = H (clamped) or no micro-traction there (free)."""

    nodes, step = 161, 2e-9

    def __init__(self, law: Any, height: float, shear_rate: float, clamped: bool, end: float) -> None:
        """law: a `MicroInertia` with l1, l_m and t_pi; H [m]; rate [1/s]; end [s] of what may be asked for."""
        self.law, self.height, self.shear_rate, self.clamped, self.end = law, height, shear_rate, clamped, end
        self.spacing = height / (self.nodes - 1)

    @classmethod
    def of_scene(cls, scene: Any) -> "MicroLayer":
        """For a scene's first material, the reference's height [m] and rate [1/s], and clamped walls if it has them."""
        given, clamped = scene.reference.parameters, any(one.kind == "micro-hard" for one in scene.boundaries)
        law = scene.bodies[0].material.micro_inertia_law()
        return cls(law, given["height"], given["rate"], clamped, max(scene.reference_times, default=scene.end_time))

    def fields(self, positions: np.ndarray, time: float) -> dict[str, np.ndarray]:
        """plastic_strain (n,), micro_stress (n,) [Pa] at X (n, d) [m]; in between linear in time and place."""
        times, strains, stresses = self.history
        at = np.linspace(0.0, self.height, self.nodes)

        def here(values: np.ndarray) -> np.ndarray:
            row = int(np.argmin(np.abs(times - time)))
            return np.interp(positions[:, 1], at, values[row])

        return {"plastic_strain": here(strains), "micro_stress": here(stresses)}

    @cached_property
    def history(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Times (m,), gamma and pi (m, nodes) of all steps of a fourth-order Runge-Kutta method."""
        steps = max(1, round(self.end / self.step))
        step, nothing = self.end / steps, np.zeros(self.nodes)
        start = (nothing + self.law.initial_micro_stress, nothing, nothing + self.law.reference_temperature)
        state = _State(nothing, *start, nothing, nothing, nothing, nothing[1:])
        strains, stresses = [state.strain], [state.stress]
        for _ in range(steps):
            first = self._change(state)
            second = self._change(state.ahead(0.5 * step, first))
            third = self._change(state.ahead(0.5 * step, second))
            fourth = self._change(state.ahead(step, third))
            mean = _State(*((a + 2.0 * b + 2.0 * c + d) / 6.0 for a, b, c, d in zip(first, second, third, fourth)))
            state = state.ahead(step, mean)
            # no flow runs backwards
            state = state._replace(rate=np.maximum(state.rate, 0.0))
            strains.append(state.strain)
            stresses.append(state.stress)
        return np.linspace(0.0, self.end, steps + 1), np.array(strains), np.array(stresses)

    def _change(self, now: _State) -> _State:
        """Time derivatives, L12 being the only velocity gradient."""
        law, r = self.law, self.shear_rate
        tau = np.sqrt(now.xx**2 + now.yy**2 + (now.xx + now.yy) ** 2 + 2.0 * now.xy**2)
        scale = 1.0 / np.maximum(tau, 1e-30)
        along = np.where(tau > 0.0, now.xy * scale, np.sqrt(0.5))
        rate = np.maximum(now.rate, 0.0)
        divergence = np.diff(now.flux, prepend=0.0, append=0.0) / self.spacing
        divergence[[0, -1]] *= 2.0
        force = (divergence + tau - now.stress) / (law.density * law.inertia_length**2)
        force = np.where((now.rate <= 0.0) & (force < 0.0), 0.0, force)
        if self.clamped:
            force[[0, -1]] = 0.0
        mu = law.shear_modulus
        return _State(
            force,
            (self._driving(now, rate) - now.stress) / law.stress_relaxation_time,
            rate,
            now.stress * rate / (law.density * law.specific_heat),
            r * now.xy - 2.0 * mu * rate * now.xx * scale,
            -r * now.xy - 2.0 * mu * rate * now.yy * scale,
            mu * r - 2.0 * mu * rate * along - 0.5 * r * (now.xx - now.yy),
            law.yield_stress * law.energetic_length**2 * np.diff(rate) / self.spacing,
        )

    def _driving(self, now: _State, rate: np.ndarray) -> np.ndarray:
        """G = S0 f R1 R2 v^p/d^p (n,) [Pa]."""
        law = self.law
        warm = (now.temperature - law.reference_temperature) / (law.melting_temperature - law.reference_temperature)
        hardened = 1.0 + law.hardening / law.yield_stress * now.strain**law.exponent
        softened = 1.0 - np.clip(warm, 0.0, 1.0) ** law.thermal_exponent
        least = np.sqrt(rate**2 + law.regularisation**2)
        speed = (least / law.reference_rate) ** law.rate_exponent
        return np.asarray(law.yield_stress * hardened * softened * speed * rate / least)
