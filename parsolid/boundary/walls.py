"""Rigid walls that bodies run into: planes that move with a constant velocity, with all bodies on one side."""

import numpy as np
from mpi4py import MPI

from parsolid.boundary.loads import Loads
from parsolid.boundary.reactions import Reaction
from parsolid.collective import raise_together
from parsolid.particles.generated import cell_widths
from parsolid.scene.boundaries import Wall

# of a spacing: a particle in the middle of a cell on the wall touches it
_TOUCHING = 1e-6


class RigidWall:
    """One wall. normal (d,): towards the bodies; velocity (d,) [m/s]; sticking: whether it holds what reaches it in all
    directions, else along its normal alone."""

    def __init__(self, wall: Wall, dimension: int):
        self.condition, self.axis, self.sticking = wall, wall.plane.axis, wall.contact == "sticking"
        self.sign = 1.0 if wall.side == "above" else -1.0
        self.normal = self.sign * np.eye(dimension)[self.axis]
        self.velocity = np.zeros(dimension) if wall.velocity is None else np.asarray(wall.velocity, float)
        self.reaction = None if wall.reports is None else Reaction(wall, dimension)

    def offset(self, time: float) -> float:
        """Where the plane is along its axis at a time [s], in m."""
        assert self.condition.plane is not None
        return float(self.condition.plane.offset + self.velocity[self.axis] * time)

    def distance(self, coordinate: np.ndarray, time: float) -> np.ndarray:
        """From the wall to places with this coordinate (n,) [m] along its axis; negative beyond it."""
        return np.asarray(self.sign * (coordinate - self.offset(time)))


class Walls:
    """All walls of a scene, as particles meet them: one is caught where half of its spacing reaches the wall, and
    leaves freely."""

    def __init__(self, comm: MPI.Comm, conditions: Loads):
        """conditions: those of the scene, which report the forces of walls. Raises SolverError on all ranks where a
        particle stands beyond a wall. Collective."""
        self.particles = particles = conditions.particles
        walls = conditions.of(Wall)
        self.all = [RigidWall(wall, conditions.dimension) for _, wall in walls]
        for (key, wall), rigid in zip(walls, self.all):
            rigid.reaction = conditions.reaction_of(wall)
            beyond = self._gap(rigid, 0.0) < -_TOUCHING * cell_widths(particles)[:, rigid.axis]
            fault = f"{key}: expected all bodies {wall.side} the wall, found particles that it cuts"
            raise_together(comm, fault if beyond.any() else None)

    def _gap(self, wall: RigidWall, time: float) -> np.ndarray:
        """From a wall to the faces of the particles' cells (n,) [m]."""
        half = 0.5 * cell_widths(self.particles)[:, wall.axis]
        return wall.distance(self.particles.owned_rows("position")[:, wall.axis], time) - half

    def catch(
        self,
        time: float,
        half: float,
        opening: bool,
        before: np.ndarray,
        acting: tuple[np.ndarray, np.ndarray, np.ndarray | None],
    ) -> np.ndarray:
        """Let particles that have reached a wall at a time [s] move with it, after a half kick of a step.

        before (d, n): velocities before the kick over `half` [s]; acting: internal and dissipative forces and loads
        (d, n) [N] of the kick. Returns what to add to the kick's energies [J]: external work, with the wall's on the
        bodies; loss to dissipative forces, on the mean of the velocities before and after; kinetic offset of all other
        forces; and the loss to particles that are caught.
        """
        velocity, mass = self.particles.owned_rows("velocity").T, self.particles.owned_rows("mass")
        force, damping, loads = acting
        energies = np.zeros(4)
        for wall in self.all:
            reach = _TOUCHING * cell_widths(self.particles)[:, wall.axis]
            approaching = wall.sign * (velocity[wall.axis] - wall.velocity[wall.axis]) < 0.0
            rows = np.flatnonzero((self._gap(wall, time) <= reach) & approaching)
            change = wall.velocity[:, None] - velocity[:, rows]
            if not wall.sticking:
                change *= np.abs(wall.normal)[:, None]
            impulse = mass[rows] * change
            of_loads = np.zeros_like(change) if loads is None else loads[:, rows]
            work = np.sum(impulse, axis=1) @ wall.velocity
            if opening:
                # the work of loads is that on the velocity in the middle of the step, which the wall has changed
                work += half * np.sum(of_loads * change)
            dissipated = -0.5 * half * np.sum(damping[:, rows] * change)
            offset = 0.5 * half * np.sum((force[:, rows] + of_loads) * change)
            lost = -0.5 * np.sum(impulse * (before[:, rows] - wall.velocity[:, None]))
            energies += work, dissipated, offset, lost
            velocity[:, rows] += change
            if wall.reaction is not None:
                places = self.particles.owned_rows("position").T[:, rows]
                wall.reaction.add(places, impulse, float(impulse.sum(axis=1) @ wall.velocity))
        return energies
