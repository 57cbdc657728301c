"""Relaxation functions E(t) = E_0 + sum_j E_j exp(-t/tau_j) and their exact inverses, the creep compliances."""

from itertools import pairwise
from typing import Any

import numpy as np

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
