"""One tool and the particles of one system on this rank: forces, and the time of the next evaluation."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.boundary.forces import tributary_mass
from parsolid.contact.bodies import share_of
from parsolid.contact.tools.forces import (
    Approach,
    Frame,
    Friction,
    Particles,
    Resultant,
    Touched,
    fastest,
    press,
)
from parsolid.contact.tools.shapes import distance
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.declaration import Field
from parsolid.particles.generated import cell_volumes
from parsolid.scene import Scene

# fields of particles that any tool may touch
RADIUS, STIFFNESS = "tool_radius", "tool_stiffness"
# share of the time to contact, with the speed of sound added, after which particles are checked again
_CHECK_AFTER = 0.5
# number of the longest steps within which particles that may be touched bound the step
_NEAR = 2.0
# radius [m] of deleted particles, which no tool touches
_OUT_OF_REACH = -1e9


def record_of(tool: str) -> str:
    """Name of the field of a tool's `forces.Friction.record`."""
    return f"stick_{tool}"


def level_of(tool: str) -> str:
    """Name of the field of the depth of particles in a tool, negative outside."""
    return f"level_{tool}"


def axisymmetric(scene: Scene) -> bool:
    """Whether masses and forces are those of a radian about the axis X = 0."""
    return any(getattr(one.settings, "geometry", None) == "axisymmetric" for one in scene.systems)


def declare_tool_fields(scene: Scene, system: ParticleSystem) -> None:
    """Declare the fields that the tools of a scene need on a system's particles, before its state is set."""
    touching = [tool for tool in scene.tools if touchable_by(tool, scene, system).any()]
    if not touching:
        return
    system.take_external_forces(keep_rows=False)
    particles = system.particles
    in_cells = np.array([scene.bodies[number].placed_on == "cells" for number in system.bodies])
    moduli = np.array([system.wave_modulus(body)[0] for body in range(len(system.bodies))])
    radius, width = radii(particles, in_cells)
    particles.declare(Field(RADIUS, 1, "m"), radius)
    particles.declare(Field(STIFFNESS, 1, "N/m"), stiffnesses(particles, radius, width, moduli, axisymmetric(scene)))
    for tool in touching:
        particles.declare(Field(level_of(tool.name), 1, "m"))
        if tool.friction > 0.0:
            particles.declare(Field(record_of(tool.name), 1 + 2 * system.dimension, "m", checkpointed=True))


def radii(particles: Any, in_cells: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Radius (owned,) [m], from a particle to the face of its cell, 0 for nodes, and spacing (owned,) [m] in the same
    direction: along the normal of the particle's surface; within a body the mean over all directions.

    in_cells (bodies,): whether a body's particles are in the middles of cells.
    """
    spacing, area = particles.owned_rows("spacing"), particles.owned_rows("area")
    count, d = spacing.shape
    along = area
    if "axes" in particles:
        along = np.einsum("nij,nj->ni", particles.owned_rows("axes").reshape(count, d, d), area)
    size = np.linalg.norm(along, axis=1)
    width = np.prod(spacing, axis=1) ** (1.0 / d)
    here = size > 0.0
    width[here] = np.linalg.norm(spacing[here] * along[here], axis=1) / size[here]
    return np.where(in_cells[particles.owned_rows("body")], 0.5 * width, 0.0), width


def stiffnesses(particles: Any, radius: np.ndarray, width: np.ndarray, moduli: np.ndarray, polar: bool) -> np.ndarray:
    """M A/h (owned,) [N/m]; A = V/h, for nodes on a face their part of the face.

    moduli (bodies,) [Pa]; polar: per radian about the axis X = 0.
    """
    face = np.abs(particles.owned_rows("area")).max(axis=1)
    area = np.where((radius > 0.0) | (face == 0.0), cell_volumes(particles) / width, face)
    if polar:
        area = area * particles.owned_rows("reference_position")[:, 0]
    return np.asarray(moduli[particles.owned_rows("body")] * area / width)


def touchable_by(tool: Any, scene: Scene, system: ParticleSystem) -> np.ndarray:
    """Which bodies (bodies,) of a system a tool may touch; tool: `scene.tools.Tool`."""
    wanted = tool.bodies
    return np.array([wanted is None or scene.bodies[number].name in wanted for number in system.bodies])


class Touch:
    """The contact of a tool with a system.

    touched: particles on which the tool acts, and forces on their parts on this side of mirror planes; resultant: of
    this rank; clearance [m]: of the nearest particle; greatest_square [1/s^2]: of the angular frequencies of near
    particles on the springs of the contact; quiet_until [s]: time before which nothing is touched; deleted [J]: contact
    energy removed with particles deleted in the last step.
    """

    def __init__(self, tool: Any, system: ParticleSystem, touchable: np.ndarray, signal: float) -> None:
        """tool: `contact.Tool`; touchable (bodies,): bodies of the system that it may touch; signal: speed [m/s] that
        particles may gain before the next check."""
        self.tool, self.system, self.touchable, self.signal = tool, system, touchable, signal
        self.record = record_of(tool.name) if tool.friction > 0.0 else None
        self._room = Touched.of_size(0)
        self.touched, self.resultant = self._room, Resultant.none()
        self.clearance, self.greatest_square, self.deleted = np.inf, 0.0, 0.0
        # whether `level` is of the last step
        self._followed = False
        self._layout, self._squares, self.quiet_until = -1, np.zeros(0), -np.inf

    @property
    def rows(self) -> np.ndarray:
        """Rows (n,) of the touched particles."""
        return self.touched.row

    def evaluate(self, time: float, slipping: bool) -> None:
        """Forces at a time [s]; slipping: whether friction follows the motion, or keeps its record."""
        particles, tool, self.deleted = self.system.particles, self.tool, 0.0
        if time < tool.quiet_until or (time < self.quiet_until and self._layout == particles.layout):
            self.touched, self.resultant = self._room.first(0), Resultant.none()
            self.greatest_square, self._followed = 0.0, False
            return
        self._leave_out_deleted()
        speed = tool.speed()
        approach = Approach(tool.longest, speed, _NEAR * tool.longest, self.signal + speed)
        self.greatest_square = self._press(slipping, approach, self._followed)
        self._followed, self.quiet_until = True, -np.inf
        # checked at every step while a particle bounds the step
        if self.greatest_square == 0.0:
            speed += self.signal + fastest(particles.owned, particles["velocity"])
            self.quiet_until = time + _CHECK_AFTER * self.clearance / speed

    def _press(self, slipping: bool, approach: Approach, known: bool, deeper: float = 0.0) -> float:
        """Forces at the present positions on particles wider by `deeper` [m]; returns the greatest square [1/s^2] of
        `forces.press`."""
        particles, tool, friction = self.system.particles, self.tool, None
        if len(self._room.row) < particles.owned:
            self._room = Touched.of_size(particles.capacity)
        if self.record is not None:
            friction = Friction(tool.friction, particles.storage(self.record), slipping)
        seen = Particles(
            particles.owned,
            particles["position"],
            particles["velocity"],
            particles["body"],
            self.touchable,
            particles[RADIUS] + deeper if deeper else particles[RADIUS],
            particles[STIFFNESS],
            particles.storage(level_of(tool.name)),
            self._squares_of_particles(),
        )
        count, stiffness, turning, self.clearance, square = press(
            tool.shape,
            Frame(tool.body.pose.place, tool.body.pose.matrix),
            friction,
            tool.stiffness,
            seen,
            approach,
            known,
            self._room,
        )
        self.touched = self._room.first(count)
        self.resultant = Resultant.of(self.touched, stiffness, turning)
        return float(square)

    def remember(self) -> None:
        """Keep the records of friction and the depths, from which trials start."""
        names = [level_of(self.tool.name)] + ([] if self.record is None else [self.record])
        self._kept = {name: self.system.particles.storage(name).copy() for name in names}

    def try_forces(self, slipping: bool, mean: bool, deeper: float) -> None:
        """Forces at the present positions from the kept records and depths; mean: with corrections of the impulse."""
        for name, values in self._kept.items():
            self.system.particles.storage(name)[:] = values
        # explicit steps that follow start from these depths
        self._followed, self.quiet_until, self.greatest_square = True, -np.inf, 0.0
        self._press(slipping, Approach(0.0, 0.0, 0.0, 0.0), mean, deeper)

    def _leave_out_deleted(self) -> None:
        """Take deleted particles out of contact.

        In the step of the deletion the force acts at the start only: where a depth goes from d to e, the energy k d e/2
        is removed."""
        particles, tool = self.system.particles, self.tool
        if "deleted_mass" not in particles:
            return
        rows, pose = particles.owned_rows, tool.body.pose
        gone, level = rows("deleted_mass") > 0.0, rows(level_of(tool.name))
        for i in np.flatnonzero(gone & (level > 0.0)):
            if self._followed:
                place = np.append(rows("position")[i], np.zeros(3 - self.system.dimension))
                deeper = rows(RADIUS)[i] - distance(tool.shape, *((place - pose.place) @ pose.matrix), np.inf)[0]
                self.deleted += 0.5 * tool.stiffness * rows(STIFFNESS)[i] * level[i] * deeper
            level[i] = _OUT_OF_REACH
        rows(RADIUS)[gone] = _OUT_OF_REACH

    def _squares_of_particles(self) -> np.ndarray:
        """Squares (owned,) [1/s^2] of the angular frequencies of particles on the springs of the contact."""
        particles = self.system.particles
        if self._layout != particles.layout:
            self._layout = particles.layout
            mass = tributary_mass(particles, slice(particles.owned))
            springs = self.tool.stiffness * particles.owned_rows(STIFFNESS)
            self._squares = np.divide(springs, mass, out=np.zeros(particles.owned), where=mass > 0.0)
        return self._squares

    def warm(self) -> float:
        """Heat the particles with half the dissipation of friction; the other half goes to the tool, which has no
        temperature. Returns the heat that is part of the stored energy [J]."""
        if self.record is None or not self.system.takes_heat:
            return 0.0
        warmed = self.touched.lost > 0.0
        rows = self.rows[warmed]
        # of whole particles
        heat = 0.5 * self.touched.lost[warmed] / share_of(self.system.particles, rows)
        return self.system.take_heat(heat, rows)

    def give(self, step: float) -> None:
        """Add the forces and the corrections over a step [s] to the external forces and impulses."""
        if len(self.rows):
            owned, d = self.system.particles.owned_rows, self.system.dimension
            owned(EXTERNAL_FORCE)[self.rows] += self.touched.force[:, :d]
            owned(EXTERNAL_IMPULSE)[self.rows] += 0.5 * step * self.touched.correction[:, :d]
