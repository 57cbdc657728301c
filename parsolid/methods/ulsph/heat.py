"""Heat in updated-Lagrangian SPH: temperatures that a scene prescribes, friction of contact, conduction by Fourier."""

from typing import Any

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.particles.container import Particles
from parsolid.particles.regions import selected
from parsolid.scene import Scene
from parsolid.scene.boundaries import PrescribedTemperature


@inlined
def symmetric_times(B, u):
    """B u of a symmetric tensor and a vector of three components."""
    return (B[0] * u[0] + B[3] * u[1] + B[4] * u[2], B[3] * u[0] + B[1] * u[1] + B[5] * u[2],
            B[4] * u[0] + B[5] * u[1] + B[2] * u[2])  # fmt: skip


@kernel
def advance_heat_flux(
    first, last, conductivity, in_plane, stride, slopes, mass, density, correction, heat_flux, pair_flux
):
    """Heat fluxes q = -conductivity grad T (Fourier) from the sums of the second sweep; pair_flux: q B/rho^2."""
    for a in range(first, last):
        inverse = 1.0 / (mass[0, a] * density[0, a])
        x, y, z = slopes[a, stride], slopes[a, stride + 1], 0.0
        if in_plane is None:
            z = slopes[a, stride + 2]
        B = (correction[0, a], correction[1, a], correction[2, a], correction[3, a], correction[4, a], correction[5, a])
        gradient = symmetric_times(B, (inverse * x, inverse * y, inverse * z))
        q = (-conductivity * gradient[0], -conductivity * gradient[1], -conductivity * gradient[2])
        Y = symmetric_times(B, q)
        factor = 1.0 / (density[0, a] * density[0, a])
        heat_flux[0, a], pair_flux[0, a] = q[0], factor * Y[0]
        heat_flux[1, a], pair_flux[1, a] = q[1], factor * Y[1]
        if in_plane is None:
            heat_flux[2, a], pair_flux[2, a] = q[2], factor * Y[2]


class Temperatures:
    """Temperatures of particles: those that a scene prescribes, and heat that comes from outside.

    supplied, stored: heat [J] that prescribed temperatures added in the last step, and the part of it that stored
    energies hold.
    """

    supplied = stored = 0.0

    def __init__(self, comm: Any, scene: Scene, particle_set: Any, particles: Particles, solids: list[Any]):
        """solids: with their law, and whether its stored energy holds heat; collective."""
        self.particles = particles
        law_of_body = particles.law_of_body
        self._laws, self._law_of_body = [solid.law for solid in solids], law_of_body
        # density [kg/m^3] of each body's law where it stores heat, else 0
        storing = [solid.law.density if solid.stores_heat else 0.0 for solid in solids]
        self._storing = np.array(storing)[law_of_body]
        self._prescribed = []
        for one in scene.boundaries:
            if isinstance(one, PrescribedTemperature):
                self._prescribed.append((particles.selection(selected(scene, one, particle_set, comm)), one.prescribed))

    def prescribe(self, time: float) -> None:
        """Give particles their prescribed temperatures at a time [s]."""
        self.supplied = self.stored = 0.0
        of = self.particles.owned_rows
        for chosen, temperature in self._prescribed:
            rows = chosen.rows
            values = temperature.evaluate(np.ascontiguousarray(of("reference_position")[rows]), time)[:, 0]
            before, heat = of("temperature")[rows], np.zeros(len(rows))
            for law, here in self._by_laws(rows):
                heat[here] = (law.heat(values[here]) - law.heat(before[here])) * of("mass")[rows[here]]
            of("temperature")[rows] = values
            self.supplied += float(heat.sum())
            self.stored += self._store(rows, heat)

    def take(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """Warm rows (n,) by heat (n,) [J]; the part that stored energies hold [J]."""
        of = self.particles.owned_rows
        temperature = of("temperature")
        for law, here in self._by_laws(rows):
            chosen = rows[here]
            density = heat[here] * law.density / of("mass")[chosen]
            temperature[chosen] += law.temperature_rise(temperature[chosen], density)
        return self._store(rows, heat)

    def _by_laws(self, rows: np.ndarray) -> list[tuple[Any, np.ndarray]]:
        """Each law with a heat capacity, and the indices of its particles in rows (n,)."""
        numbers = self._law_of_body[self.particles.owned_rows("body")[rows]]
        warm = [one for one in enumerate(self._laws) if hasattr(one[1], "specific_heat")]
        return [(law, np.flatnonzero(numbers == number)) for number, law in warm]

    def _store(self, rows: np.ndarray, heat: np.ndarray) -> float:
        """Add heat (n,) [J] to the internal energy of those rows whose law has one; how much that is [J]."""
        of = self.particles.owned_rows
        density = self._storing[of("body")[rows]]
        if self._storing.any():
            of("energy")[rows] += heat * density / of("mass")[rows]
        return float(heat[density > 0.0].sum())
