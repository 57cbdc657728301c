"""Heat that comes from outside: prescribed temperatures, and the friction of bodies that meet."""

from typing import Any

import numpy as np

from parsolid.methods.ulsph.kinematics import second_vector


class HalfSteps:
    """Viscous forces act for half of the step before their time and half of that after it, and warm in the latter.

    step: the last one [s], 0 before the first; goes_on: whether the first step goes on from another run's forces, whose
    last step is taken to be as long; to_come: what they took in its second kick, which stored energies have
    after the next step [J], of this rank.
    """

    def __init__(self) -> None:
        self.step = self.to_come = 0.0
        self.goes_on = False

    def mean(self, step: float) -> float:
        """Of the step before and this one [s]."""
        return step if self.goes_on else 0.5 * (self.step + step)

    def follow(self, taken: float) -> float:
        """The second kick of a step has taken energy [J]; by how much more is to come than before [J]."""
        change = float(taken - self.to_come)
        self.to_come = float(taken)
        return change

    def state(self, comm: Any) -> dict[str, Any]:
        """The step, and what is to come on each rank; collective."""
        return {"step": self.step, "to_come": comm.allgather(self.to_come)}

    def set_state(self, comm: Any, state: dict[str, Any]) -> None:
        """Take back what `state` gave; on another number of ranks the first has all."""
        self.step, heat = state["step"], state["to_come"]
        self.to_come = heat[comm.rank] if len(heat) == comm.size else sum(heat) * (comm.rank == 0)


def heat_to_come(system: Any, step: float, taken: float) -> float:
    """What the viscosity took [J] in the second kick of a step [s] from particles whose stored energies have it after
    the next one; taken: from all. Beside others their part is that of their forces, loads left aside.
    """
    if all(system.updates.storing):
        return taken
    d, sums, found = system.dimension, system.particles.storage("force_sums"), 0.0
    for update, block, _ in system.updates.each():
        if update.stores_heat:
            rows = slice(block.first, block.last)
            change = 0.5 * step * sums[rows, :d] / system.mass[rows, None]
            velocity = system.particles.owned_rows("velocity")[rows]
            viscous = sums[rows, second_vector(d) : second_vector(d) + d]
            found -= 0.25 * step * float(np.sum(viscous * (2.0 * velocity - change)))
    return found


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
    """Add what a kick between two steps has changed of rows' velocities, which were `before` (n, d), times the viscous
    forces [W], to a column of the sums that the passes leave zero: of the two halves of these forces only the second
    one acts after it, see `viscous_heat.centred_heat`.
    """
    d, sums = system.dimension, system.particles.storage("force_sums")
    first, column = second_vector(d), sums.shape[1] - 3 if d == 2 else 7
    change = system.particles.owned_rows("velocity")[rows] - before
    sums[rows, column] += np.sum(sums[rows, first : first + d] * change, axis=1)


def _of_bodies(system: Any) -> tuple[np.ndarray, np.ndarray]:
    """Specific heat [J/(kg K)] of each body's law, and its density [kg/m^3] where it stores heat, else 0."""
    law_of_body = system.particles.law_of_body
    capacity = np.array([law.specific_heat for law in system.laws])[law_of_body]
    kept = [law.density * storing for law, storing in zip(system.laws, system.updates.storing)]
    return capacity, np.array(kept)[law_of_body]
