"""One tool on the particles of one system on this rank: forces, and when to look again."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.boundary.forces import tributary_mass
from parsolid.contact.bodies import share_of
from parsolid.contact.tools.forces import (
    Approach,
    Frame,
    Friction,
    Nearby,
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
# of the time in which particle and tool would meet, should both gain the speed of sound
_LOOK_AFTER = 0.5
# particles that may be touched in so many of the longest steps limit the step
_NEAR = 2.0
# radius [m] of particles that no tool touches
_OUT_OF_REACH = -1e9


def record_of(tool: str) -> str:
    """Name of the field in which a tool's friction keeps what particles hold."""
    return f"stick_{tool}"


def level_of(tool: str) -> str:
    """Name of the field of how deep in a tool particles are, below zero outside."""
    return f"level_{tool}"


def axisymmetric(scene: Scene) -> bool:
    """Whether masses and forces are those of a radian about the axis X = 0."""
    return any(getattr(one.settings, "geometry", None) == "axisymmetric" for one in scene.systems)


def declare_tool_fields(scene: Scene, system: ParticleSystem) -> None:
    """What a system's particles need to be touched by a scene's tools; nothing where there are none."""
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
    """Radius (owned,) [m], from a particle to the face of its cell, 0 of nodes, and spacing (owned,) [m] that way.

    in_cells (bodies,): whether a body's particles are in the middles of cells. The way is that of the particle's own
    surface where it has one; inside a body the mean of all ways.
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
    """M A/h (owned,) [N/m]; A = V/h, of nodes on a face the part of the face that is theirs.

    moduli (bodies,) [Pa]; polar: per radian about the axis X = 0.
    """
    face = np.abs(particles.owned_rows("area")).max(axis=1)
    area = np.where((radius > 0.0) | (face == 0.0), cell_volumes(particles) / width, face)
    if polar:
        area = area * particles.owned_rows("reference_position")[:, 0]
    return np.asarray(moduli[particles.owned_rows("body")] * area / width)


def touchable_by(tool: Any, scene: Scene, system: ParticleSystem) -> np.ndarray:
    """Which bodies (bodies,) of a system a tool is for; tool: `scene.tools.Tool`."""
    wanted = tool.bodies
    return np.array([wanted is None or scene.bodies[number].name in wanted for number in system.bodies])


class Touch:
    """A tool on a system.

    touched: the particles on which it acts, on their parts on this side of mirror planes; resultant: of this rank;
    clearance [m]: of the nearest particle; greatest_square [1/s^2]: of an angular frequency that the contact adds to
    that of a particle, where one is near; quiet_until [s]: nothing can be touched before; deleted [J]: energy of
    contact that went with deleted particles in the last step.
    """

    def __init__(self, tool: Any, system: ParticleSystem, touchable: np.ndarray, signal: float) -> None:
        """tool: `contact.Tool`; touchable (bodies,): which bodies of the system it is for; signal: the speed [m/s] that
        particles may gain before they are looked at again."""
        self.tool, self.system, self.touchable, self.signal = tool, system, touchable, signal
        self.record = record_of(tool.name) if tool.friction > 0.0 else None
        self._room = Touched.of_size(0)
        self.touched, self.resultant = self._room, Resultant.none()
        self.clearance, self.greatest_square, self.deleted = np.inf, 0.0, 0.0
        # whether places of the last step were looked at
        self._followed = False
        self._layout, self._squares, self.quiet_until = -1, np.zeros(0), -np.inf

    @property
    def rows(self) -> np.ndarray:
        """Rows (n,) of particles on which it acts."""
        return self.touched.row

    def evaluate(self, time: float, slipping: bool) -> None:
        """Forces at a time [s]; slipping: friction follows the motion, or what is recorded is asked for again."""
        particles, tool, self.deleted = self.system.particles, self.tool, 0.0
        if time < tool.quiet_until or (time < self.quiet_until and self._layout == particles.layout):
            self.touched, self.resultant = self._room.first(0), Resultant.none()
            self.greatest_square, self._followed = 0.0, False
            return
        self._leave_out_deleted()
        near = Approach(tool.longest, tool.speed(time), _NEAR * tool.longest, self.signal + tool.speed(time))
        nearby = self._press(slipping, near, self._followed)
        self._followed, self.greatest_square = True, nearby.square
        self._look_ahead(time)

    def _press(self, slipping: bool, approach: Approach, known: bool, deeper: float = 0.0) -> Nearby:
        """Forces in the present places, of particles wider by `deeper` [m]; see `forces.press`."""
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
        count, *near = press(
            tool.shape,
            Frame(tool.body.pose.place, tool.body.pose.matrix),
            friction,
            tool.stiffness,
            seen,
            approach,
            known,
            self._room,
        )
        self.touched, nearby = self._room.first(count), Nearby(*near)
        self.resultant, self.clearance = Resultant.of(self.touched, nearby), nearby.clearance
        return nearby

    def remember(self) -> None:
        """Take what friction holds and how deep particles are for what trials begin with."""
        names = [level_of(self.tool.name)] + ([] if self.record is None else [self.record])
        self._kept = {name: self.system.particles.storage(name).copy() for name in names}

    def try_forces(self, slipping: bool, mean: bool, deeper: float) -> None:
        """Forces in the present places from what was remembered; mean: with what makes them those of all of a step."""
        for name, values in self._kept.items():
            self.system.particles.storage(name)[:] = values
        # steps that are not solved for look anew, and go on from these depths
        self._followed, self.quiet_until, self.greatest_square = True, -np.inf, 0.0
        self._press(slipping, Approach(0.0, 0.0, 0.0, 0.0), mean, deeper)

    def _leave_out_deleted(self) -> None:
        """Particles that have failed and were deleted, which have no mass, are not touched any more.

        In the last step the force that they were pressed with acts at its start alone: from k d^2/2 at a depth d to a
        depth e the energy becomes k d e/2."""
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

    def _look_ahead(self, time: float) -> None:
        """When to look again: at once while a particle limits the step."""
        self.quiet_until = -np.inf
        if self.greatest_square == 0.0:
            particles = self.system.particles
            speed = self.signal + self.tool.speed(time) + fastest(particles.owned, particles["velocity"])
            self.quiet_until = time + _LOOK_AFTER * self.clearance / speed

    def _squares_of_particles(self) -> np.ndarray:
        """Squares (owned,) [1/s^2] of the angular frequencies that the contact may add to those of particles."""
        particles = self.system.particles
        if self._layout != particles.layout:
            self._layout = particles.layout
            mass = tributary_mass(particles, slice(particles.owned))
            springs = self.tool.stiffness * particles.owned_rows(STIFFNESS)
            self._squares = np.divide(springs, mass, out=np.zeros(particles.owned), where=mass > 0.0)
        return self._squares

    def warm(self) -> float:
        """Give the particles half of what friction took of each, for the tool has no temperature; what of it their
        stored energy holds [J]."""
        if self.record is None or not self.system.takes_heat:
            return 0.0
        warmed = self.touched.lost > 0.0
        rows = self.rows[warmed]
        # of whole particles
        heat = 0.5 * self.touched.lost[warmed] / share_of(self.system.particles, rows)
        return self.system.take_heat(heat, rows)

    def give(self, step: float) -> None:
        """Add the forces to those on the particles, and the impulse that a step [s] has besides."""
        if len(self.rows):
            owned, d = self.system.particles.owned_rows, self.system.dimension
            owned(EXTERNAL_FORCE)[self.rows] += self.touched.force[:, :d]
            owned(EXTERNAL_IMPULSE)[self.rows] += 0.5 * step * self.touched.correction[:, :d]
