"""Heat that comes from outside: prescribed temperatures, and the friction of bodies that meet."""

from typing import Any

import numpy as np

from parsolid.methods.ulsph.kinematics import second_vector


def prescribe_temperatures(system: Any, time: float) -> tuple[float, float]:
    """The heat [J] that prescribed temperatures supply at a time [s], and the part of it that goes into stored energy;
    system: `system.UpdatedLagrangianSPH`."""
    supplied, stored, temperature = 0.0, 0.0, system.particles.owned_rows("temperature")
    record, column = system.particles.storage("record"), 6 if system.dimension == 2 else 11
    capacity, kept = _of_bodies(system)
    for rows, values in system.boundaries.temperatures(time):
        body = system.particles.owned_rows("body")[rows]
        change = capacity[body] * (values - temperature[rows])
        supplied += float(change @ system.mass[rows])
        stored += float(change @ (system.mass[rows] * (kept[body] > 0.0)))
        if kept.any():
            system.particles.owned_rows("energy")[rows] += kept[body] * change
        temperature[rows] = record[rows, column] = values
    return supplied, stored


def take_heat(system: Any, heat: np.ndarray, rows: np.ndarray) -> float:
    """Warm rows (n,) by heat (n,) [J]; what of it their stored energy holds [J]. Deleted particles take none."""
    rows, heat = rows[system.mass[rows] > 0.0], heat[system.mass[rows] > 0.0]
    capacity, kept = (values[system.particles.owned_rows("body")[rows]] for values in _of_bodies(system))
    change = heat / system.mass[rows]
    system.particles.owned_rows("temperature")[rows] += change / capacity
    if kept.any():
        system.particles.owned_rows("energy")[rows] += kept * change
    return float(heat[kept > 0.0].sum())


def follow_kick(system: Any, before: np.ndarray, rows: np.ndarray) -> None:
    """Change the heat of the last viscous forces by what a kick between two steps has changed of rows' velocities,
    which were `before` (n, d): half of it, for of the two halves of these forces only the second one acts after it.
    """
    d, sums = system.dimension, system.particles.storage("force_sums")
    first, heat = second_vector(d), sums.shape[1] - 4 if d == 2 else 3
    change = system.particles.owned_rows("velocity")[rows] - before
    sums[rows, heat] -= 0.5 * np.sum(sums[rows, first : first + d] * change, axis=1)


def _of_bodies(system: Any) -> tuple[np.ndarray, np.ndarray]:
    """Specific heat [J/(kg K)] of each body's law, and its density [kg/m^3] where it stores heat, else 0."""
    law_of_body = system.particles.law_of_body
    capacity = np.array([law.specific_heat for law in system.laws])[law_of_body]
    kept = [law.density * storing for law, storing in zip(system.laws, system.updates.storing)]
    return capacity, np.array(kept)[law_of_body]
