"""One tool and the particles of one system on this rank: forces, and the time of the next evaluation."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.boundary.forces import tributary_mass
from parsolid.contact.bodies import share_of, thickness
from parsolid.contact.tools.forces import RESULTANT, Particles, RigidShape, press
from parsolid.contact.tools.shapes import distance
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.declaration import Field
from parsolid.particles.generated import cell_volumes
from parsolid.scene import Scene

# fields of particles that any tool may touch
RADIUS, STIFFNESS = "tool_radius", "tool_stiffness"
# share of the time to contact, with the speed of sound added, after which particles are checked again
_CHECK_AFTER = 0.5
# radius [m] of deleted particles, which no tool touches
_OUT_OF_REACH = -1e9


def axisymmetric(scene: Scene) -> bool:
    """Whether masses and forces are those of a radian about the axis X = 0."""
    return any(getattr(one.settings, "geometry", None) == "axisymmetric" for one in scene.systems)


def declare_tool_fields(scene: Scene, system: ParticleSystem) -> None:
    """Declare the fields that the tools of a scene need on a system's particles, before its state is set."""
    touching = [tool for tool in scene.tools if touchable_by(tool, scene, system).any()]
    if not touching:
        return
    system.take_external_forces(keep_rows=False)
    particles, bodies = system.particles, system.particles.owned_rows("body")
    in_cells = np.array([scene.bodies[number].placed_on == "cells" for number in system.bodies])[bodies]
    moduli = np.array([system.wave_modulus(body)[0] for body in range(len(system.bodies))])[bodies]
    # width: spacing along the normal of the particle's surface; within a body the mean over all directions
    spacing, area = particles.owned_rows("spacing"), particles.owned_rows("area")
    count, d = spacing.shape
    normal = area
    if "axes" in particles:
        normal = np.einsum("nij,nj->ni", particles.owned_rows("axes").reshape(count, d, d), area)
    size, width = np.linalg.norm(normal, axis=1), np.prod(spacing, axis=1) ** (1.0 / d)
    here = size > 0.0
    width[here] = np.linalg.norm(spacing[here] * normal[here], axis=1) / size[here]
    # radius: from a particle to the face of its cell, 0 for nodes
    particles.declare(Field(RADIUS, 1, "m"), np.where(in_cells, 0.5 * width, 0.0))
    # M A/h, A = V/h, for nodes on a face their part of the face
    face = np.abs(area).max(axis=1)
    area = np.where(in_cells | (face == 0.0), cell_volumes(particles) / width, face)
    area = area * thickness(system, particles.owned_rows("reference_position"))
    particles.declare(Field(STIFFNESS, 1, "N/m"), moduli * area / width)
    for tool in touching:
        particles.declare(Field(f"level_{tool.name}", 1, "m"))
        if tool.friction > 0.0:
            particles.declare(Field(f"stick_{tool.name}", 1 + 2 * d, "m", checkpointed=True))


def touchable_by(tool: Any, scene: Scene, system: ParticleSystem) -> np.ndarray:
    """Which bodies (bodies,) of a system a tool may touch; tool: `scene.tools.Tool`."""
    wanted = tool.bodies
    return np.array([wanted is None or scene.bodies[number].name in wanted for number in system.bodies])


class Touch:
    """The contact of a tool with a system.

    resultant (1,): see `forces.RESULTANT`, of this rank, for the parts of particles on this side of mirror planes;
    clearance [m]: of the nearest particle; greatest_square [1/s^2]: of the angular frequencies of near particles on the
    springs of the contact; quiet_until [s]: time before which nothing is touched; deleted [J]: contact energy removed
    with particles deleted in the last step.
    """

    def __init__(self, tool: Any, system: ParticleSystem, touchable: np.ndarray, signal: float) -> None:
        """tool: `contact.Tool`; touchable (bodies,): bodies of the system that it may touch; signal: speed [m/s] that
        particles may gain before the next check."""
        self.tool, self.system, self.touchable, self.signal = tool, system, touchable, signal
        self.level = f"level_{tool.name}"
        self.record = f"stick_{tool.name}" if tool.friction > 0.0 else None
        self.resultant = np.zeros(1, RESULTANT)
        self.clearance, self.greatest_square, self.deleted = np.inf, 0.0, 0.0
        # dissipation of each particle [J] in the last step
        self._lost = np.zeros(0)
        # whether `level` is of the last step
        self._followed = False
        self._layout, self._squares, self.quiet_until = -1, np.zeros(0), -np.inf

    @property
    def rows(self) -> np.ndarray:
        """Rows (n,) of the particles in the tool, as of the last evaluation that was not left out."""
        return np.flatnonzero(self.system.particles.owned_rows(self.level) > 0.0)

    def evaluate(self, time: float, follows: bool, step: float) -> None:
        """Add the forces at a time [s], and the corrections over a step [s], to the external forces and impulses;
        follows: whether friction follows the motion, or keeps its record."""
        particles, tool, self.deleted = self.system.particles, self.tool, 0.0
        if time < tool.quiet_until or (time < self.quiet_until and self._layout == particles.layout):
            self.resultant = np.zeros(1, RESULTANT)
            self.greatest_square, self._followed = 0.0, False
            return
        self._leave_out_deleted()
        speed = tool.speed()
        self.greatest_square = self._press(tool.longest, speed, follows, self._followed, 0.5 * step)
        self._followed, self.quiet_until = True, -np.inf
        # checked at every step while a particle bounds the step
        if self.greatest_square == 0.0:
            velocity = particles.owned_rows("velocity")
            speed += self.signal + float(np.sqrt((velocity * velocity).sum(axis=1).max(initial=0.0)))
            self.quiet_until = time + _CHECK_AFTER * self.clearance / speed

    def _press(
        self, longest: float, speed: float, follows: bool, known: bool, half_step: float, deeper: float = 0.0
    ) -> float:
        """`forces.press` at the present positions on particles wider by `deeper` [m]; returns the greatest square."""
        particles, tool = self.system.particles, self.tool
        if self._layout != particles.layout or len(self._lost) < particles.owned:
            self._layout, self._lost = particles.layout, np.zeros(particles.capacity)
            mass = tributary_mass(particles, slice(particles.owned))
            springs = tool.stiffness * particles.owned_rows(STIFFNESS)
            self._squares = np.divide(springs, mass, out=np.zeros(particles.owned), where=mass > 0.0)
        seen = Particles(
            particles.owned,
            particles["body"],
            self.touchable,
            particles["position"],
            particles["velocity"],
            particles[RADIUS] + deeper if deeper else particles[RADIUS],
            particles[STIFFNESS],
            self._squares,
            particles.storage(self.level),
            np.zeros((0, 0)) if self.record is None else particles.storage(self.record),
            particles[EXTERNAL_FORCE],
            particles[EXTERNAL_IMPULSE],
            self._lost,
        )
        pose, self.resultant = tool.body.pose, np.zeros(1, RESULTANT)
        rigid = RigidShape(tool.shape, pose.place, pose.matrix, tool.stiffness, tool.friction, speed, longest)
        self.clearance, square = press(rigid, seen, self.signal, known, follows, half_step, self.resultant)
        return float(square)

    def memory(self) -> list[np.ndarray]:
        """The depths and the records of friction."""
        names = [self.level] + ([] if self.record is None else [self.record])
        return [self.system.particles.storage(name) for name in names]

    def try_forces(self, follows: bool, over: float, mean: bool, deeper: float) -> None:
        """Add the forces of a trial at the present positions; mean: with corrections of the impulse over a step `over`
        [s]; deeper [m]: added to all depths."""
        # explicit steps that follow start from these depths
        self._followed, self.quiet_until, self.greatest_square = True, -np.inf, 0.0
        self._press(0.0, 0.0, follows, mean, 0.5 * over, deeper)

    def _leave_out_deleted(self) -> None:
        """Take deleted particles out of contact.

        In the step of the deletion the force acts at the start only: where a depth goes from d to e, the energy k d e/2
        is removed."""
        particles, tool = self.system.particles, self.tool
        if "deleted_mass" not in particles:
            return
        rows, pose = particles.owned_rows, tool.body.pose
        gone, level = rows("deleted_mass") > 0.0, rows(self.level)
        for i in np.flatnonzero(gone & (level > 0.0)):
            if self._followed:
                place = np.append(rows("position")[i], np.zeros(3 - self.system.dimension))
                deeper = rows(RADIUS)[i] - distance(tool.shape, *((place - pose.place) @ pose.matrix), np.inf)[0]
                self.deleted += 0.5 * tool.stiffness * rows(STIFFNESS)[i] * level[i] * deeper
            level[i] = _OUT_OF_REACH
        rows(RADIUS)[gone] = _OUT_OF_REACH

    def warm(self) -> float:
        """Heat the particles with half the dissipation of friction; the other half goes to the tool, which has no
        temperature. Returns the heat that is part of the stored energy [J]."""
        if not (self.system.takes_heat and self.resultant["lost"][0] > 0.0):
            return 0.0
        rows = np.flatnonzero(self._lost[: self.system.particles.owned])
        # of whole particles
        return self.system.take_heat(0.5 * self._lost[rows] / share_of(self.system.particles, rows), rows)
