"""Specific heats C_v(T) of elastic-plastic laws: a line, or straight lines between points."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined
from parsolid.materials.law_functions import law_function

# points that a law keeps, whatever the count of those that are stated: kernels are made for this many
POINTS = 33


class HeatPoints(NamedTuple):
    """C_v [J/(kg K)] by straight lines between temperatures [K] that rise; beyond the ends it stays what it is there.

    values: C_v at the temperatures; slopes [J/(kg K^2)]: of the lines that begin there; heats [J/kg]: integrals of C_v
    from the first temperature.
    """

    temperatures: tuple[float, ...]
    values: tuple[float, ...]
    slopes: tuple[float, ...]
    heats: tuple[float, ...]

    def over(self, factor: float) -> "HeatPoints":
        """Capacities smaller by a factor."""
        return HeatPoints(self.temperatures, *(tuple(one / factor for one in row) for row in self[1:]))


def heat_points(temperatures: Any, values: Any) -> HeatPoints:
    """Of 2 to POINTS temperatures that rise [K] and C_v there [J/(kg K)]."""
    T, c = np.asarray(temperatures, float), np.asarray(values, float)
    slopes = np.append(np.diff(c) / np.diff(T), 0.0)
    heats = np.append(0.0, np.cumsum(0.5 * (c[1:] + c[:-1]) * np.diff(T)))
    filled = (np.append(row, np.full(POINTS - len(T), row[-1])) for row in (T, c, slopes, heats))
    return HeatPoints(*(tuple(map(float, row)) for row in filled))


@law_function
def capacity_at(points, law, temperature):
    """C_v [J/(kg K)] at a temperature [K]; points: `HeatPoints` of the law, or None. Numbers or arrays."""


@capacity_at.of(None)
def _on_a_line(points, law, temperature):
    return law.specific_heat + law.specific_heat_slope * (temperature - law.reference_temperature)


@capacity_at.of(HeatPoints)
def _between_points(points, law, temperature):
    result = points.values[0] + 0.0 * temperature
    for k in range(POINTS - 1):
        past, room = temperature - points.temperatures[k], points.temperatures[k + 1] - points.temperatures[k]
        result = result + points.slopes[k] * _clipped(past, room)
    return result


@law_function
def rise_by_heat(points, law, temperature, heat):
    """x [K] of int rho0 C_v dT = heat [J/m^3] from a temperature [K] on; points as in `capacity_at`."""


@rise_by_heat.of(None)
def _rise_on_a_line(points, law, temperature, heat):
    capacity, grows = law.density * capacity_at(points, law, temperature), law.density * law.specific_heat_slope
    return 2.0 * heat / (capacity + (capacity * capacity + 2.0 * grows * heat) ** 0.5)


@rise_by_heat.of(HeatPoints)
def _rise_between_points(points, law, temperature, heat):
    return temperature_of(points, heat_of(points, temperature) + heat / law.density) - temperature


@inlined
def heat_of(points, temperature):
    """int C_v dT [J/kg] from the first point to a temperature [K]."""
    past = temperature - points.temperatures[0]
    result = points.values[0] * (past - _positive(past))
    for k in range(POINTS - 1):
        past, room = temperature - points.temperatures[k], points.temperatures[k + 1] - points.temperatures[k]
        x = _clipped(past, room)
        result = result + x * (points.values[k] + 0.5 * points.slopes[k] * x)
    return result + points.values[POINTS - 1] * _positive(temperature - points.temperatures[POINTS - 1])


def entropy_of(points: HeatPoints, temperature: Any) -> Any:
    """int C_v/T dT [J/(kg K)] from the first point to temperatures [K]."""
    T, c = points.temperatures, points.values
    result = c[0] * np.log(np.minimum(temperature / T[0], 1.0)) + c[-1] * np.log(np.maximum(temperature / T[-1], 1.0))
    for k in range(POINTS - 1):
        x = np.clip(temperature, T[k], T[k + 1])
        result = result + (c[k] - points.slopes[k] * T[k]) * np.log(x / T[k]) + points.slopes[k] * (x - T[k])
    return result


@inlined
def temperature_of(points, heat):
    """The inverse of `heat_of`."""
    result = points.temperatures[0] + (heat - _positive(heat)) / points.values[0]
    for k in range(POINTS - 1):
        y, c = _clipped(heat - points.heats[k], points.heats[k + 1] - points.heats[k]), points.values[k]
        result = result + 2.0 * y / (c + (c * c + 2.0 * points.slopes[k] * y) ** 0.5)
    return result + _positive(heat - points.heats[POINTS - 1]) / points.values[POINTS - 1]


@inlined
def _positive(x):
    return 0.5 * (x + abs(x))


@inlined
def _clipped(x, room):
    """x within 0 and room."""
    return _positive(x) - _positive(x - room)
