"""Rigid walls that particles run into: a particle is caught where its half spacing reaches the wall, and parts
freely."""

from typing import Any

import numpy as np

from parsolid.boundary.declarations import RigidWall
from parsolid.boundary.reactions import Told
from parsolid.collective import raise_together
from parsolid.methods.ulsph.kinematics import second_vector
from parsolid.particles.container import Particles

# of a spacing: a particle in the middle of a cell on the wall touches it
_TOUCHING = 1e-6


class Walls:
    """The walls of a scene; `work` of moving ones and `lost` to particles that they caught [J] since `taken`."""

    def __init__(self, comm: Any, walls: list[RigidWall], particles: Particles):
        """Raises SolverError on all ranks where a particle stands beyond a wall. Collective."""
        self.particles, self.walls, self.work, self.lost = particles, walls, 0.0, 0.0
        d = particles.owned_rows("position").shape[1]
        self._told = {wall.key: Told(wall, d) for wall in walls if wall.where.reports is not None}
        self.told = list(self._told.values())
        for wall in walls:
            beyond = self._gap(wall, 0.0) < -_TOUCHING * particles.owned_rows("spacing")[:, wall.plane.axis]
            fault = f"{wall.key}: expected all bodies {wall.side} the wall, found particles that it cuts"
            raise_together(comm, fault if beyond.any() else None)

    def _gap(self, wall: RigidWall, time: float) -> np.ndarray:
        """From the wall to the faces of the particles' cells (n,) [m]."""
        axis, sign = wall.plane.axis, 1.0 if wall.side == "above" else -1.0
        speed = 0.0 if wall.velocity is None else wall.velocity[axis]
        distance = self.particles.owned_rows("position")[:, axis] - (wall.plane.offset + speed * time)
        return np.asarray(sign * distance - 0.5 * self.particles.owned_rows("spacing")[:, axis])

    def catch(self, time: float, step: float, before: np.ndarray) -> tuple[float, float, float]:
        """Let particles that a wall has reached at a time [s] move with it, after a kick of a step [s] from velocities
        `before` (n, d).

        The work of any force is that on the mean of the velocities before and after. Returns what that takes from the
        work of loads, from that of the viscosity, and from leapfrog's oscillation [J].
        """
        velocity, mass = self.particles.owned_rows("velocity"), self.particles.storage("mass")[0]
        forces, d = self.particles.storage("force_sums"), velocity.shape[1]
        loads = viscous = swing = 0.0
        for wall in self.walls:
            axis, sign = wall.plane.axis, 1.0 if wall.side == "above" else -1.0
            own = np.zeros(d) if wall.velocity is None else np.asarray(wall.velocity, float)
            reach = _TOUCHING * self.particles.owned_rows("spacing")[:, axis]
            pressed = sign * (velocity[:, axis] - own[axis]) < 0.0
            rows = np.flatnonzero((self._gap(wall, time) <= reach) & pressed)
            change = np.zeros((len(rows), d))
            components = slice(None) if wall.sticking else slice(axis, axis + 1)
            change[:, components] = own[components] - velocity[rows][:, components]
            impulse, first = mass[rows, None] * change, second_vector(d)
            loaded = mass[rows, None] * (velocity[rows] - before[rows]) - step * forces[rows, :d]
            loads += float(0.5 * (loaded * change).sum())
            of_viscosity = forces[rows, first : first + d]
            viscous += float(0.5 * step * (of_viscosity * change).sum())
            swing += float(0.5 * step * ((forces[rows, :d] - of_viscosity) * change).sum())
            velocity[rows] += change
            self.work += float((impulse @ own).sum())
            if wall.key in self._told:
                places = self.particles.owned_rows("position")[rows]
                self._told[wall.key].add(places, impulse, np.broadcast_to(own, impulse.shape))
            self.lost -= float(0.5 * (impulse * (before[rows] - own)).sum())
        return loads, viscous, swing

    def taken(self) -> tuple[float, float]:
        """Work and loss [J], forgotten."""
        result = self.work, self.lost
        self.work = self.lost = 0.0
        return result
