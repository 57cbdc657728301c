"""Heat from outside and from the artificial viscosity in updated-Lagrangian SPH: temperatures that a scene prescribes,
friction of contact, and when the viscous heat of a step comes."""

from typing import Any

import numpy as np

from parsolid.of_ranks import OfRanks, own_share
from parsolid.particles.container import Particles
from parsolid.scene import Scene
from parsolid.scene.boundaries.thermal import PrescribedTemperature
from parsolid.scene.regions import selected


class ViscousHeat:
    """When laws take up the heat of the artificial viscosity, whose forces act for half of the step before their time
    and for half of that after it: in the latter.

    step: the last one [s], 0 before the first; continues: whether the first step goes on from another run's forces,
    whose last step is taken to be as long; to_come: what the viscosity took in the last closing kick from particles
    whose stored energy has it after the next step [J], of this rank.
    """

    def __init__(self) -> None:
        self.step = self.to_come = 0.0
        self.continues = False

    def mean_step(self, step: float) -> float:
        """Of the step before and this one [s]."""
        return step if self.continues else 0.5 * (self.step + step)

    def finish(self, step: float, taken: float) -> float:
        """A step [s] ends with energy [J] taken in its closing kick; by how much more is to come than before [J]."""
        change = float(taken - self.to_come)
        self.step, self.to_come = step, float(taken)
        self.continues = self.continues and step == 0.0
        return change

    def state(self) -> dict[str, Any]:
        """The step, and what is to come on each rank."""
        return {"step": self.step, "to_come": OfRanks(self.to_come)}

    def set_state(self, comm: Any, state: dict[str, Any]) -> None:
        """Take back what `state` gave; on another number of ranks the first has all."""
        self.step, self.to_come = state["step"], float(own_share(comm, state["to_come"])[0])


class Temperatures:
    """Temperatures of particles: those that a scene prescribes, and heat that comes from outside.

    supplied, stored: heat [J] that prescribed temperatures took or brought in the last step, and the part of it that
    stored energies hold.
    """

    supplied = stored = 0.0

    def __init__(self, comm: Any, scene: Scene, particle_set: Any, particles: Particles, solids: list[Any]):
        """solids: with their law, and whether its stored energy holds heat; collective."""
        self.particles = particles
        law_of_body = particles.law_of_body
        # of each body [J/(kg K)]; density [kg/m^3] of its law where it stores heat, else 0
        self._capacity = np.array([solid.law.specific_heat for solid in solids])[law_of_body]
        storing = [solid.law.density if solid.stores_heat else 0.0 for solid in solids]
        self._storing = np.array(storing)[law_of_body]
        self._prescribed = []
        for one in scene.boundaries:
            if isinstance(one, PrescribedTemperature):
                self._prescribed.append((particles.selection(selected(scene, one, particle_set, comm)), one.course))

    def prescribe(self, time: float) -> None:
        """Give particles their prescribed temperatures at a time [s]."""
        self.supplied = self.stored = 0.0
        of = self.particles.owned_rows
        for chosen, course in self._prescribed:
            rows = chosen.rows
            values = course.evaluate(np.ascontiguousarray(of("reference_position")[rows]), time)[:, 0]
            heat = self._capacity[of("body")[rows]] * (values - of("temperature")[rows]) * of("mass")[rows]
            of("temperature")[rows] = values
            self.supplied += float(heat.sum())
            self.stored += self._store(rows, heat)

    def take(self, heat: np.ndarray, rows: np.ndarray) -> float:
        """Warm rows (n,) by heat (n,) [J], but those that were deleted; what of it stored energies hold [J]."""
        of = self.particles.owned_rows
        here = of("mass")[rows] > 0.0
        rows, heat = rows[here], heat[here]
        of("temperature")[rows] += heat / (of("mass")[rows] * self._capacity[of("body")[rows]])
        return self._store(rows, heat)

    def _store(self, rows: np.ndarray, heat: np.ndarray) -> float:
        """Add heat (n,) [J] to the internal energy of those rows whose law has one; how much that is [J]."""
        of = self.particles.owned_rows
        density = self._storing[of("body")[rows]]
        if self._storing.any():
            of("energy")[rows] += heat * density / of("mass")[rows]
        return float(heat[density > 0.0].sum())
