"""Ties of a scene as one interaction: springs between the faces of bodies of different methods."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import EXTERNAL_FORCE
from parsolid.collective import maximum
from parsolid.contact.tie.tied_faces import TiedBody, TiedFaces
from parsolid.methods.failure_fields import DELETED_STORED
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.tie import TIE_TERMS, tied_pairs

# of the limit of the springs' frequency
_SAFETY = 0.8
# of M V of one particle, see `contact.tools.contact`: before so much has happened the balance is no measure of anything
_BEGINNING = 2.5e4


class Ties(Interaction):
    """All ties of a scene, on one rank."""

    terms = TIE_TERMS

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """systems: of the scene, in their state. Collective."""
        self.comm, self.systems = comm, systems
        self.faces = []
        for number, (first, second, tie) in enumerate(tied_pairs(scene)):
            sides = sorted((self._body(scene, body) for body in (first, second)), key=lambda side: side.spacing)
            self.faces.append(TiedFaces(comm, number, tie.stiffness, sides[0], sides[1]))
        sides = [side for face in self.faces for side in face.sides]
        self.energy_scale = _BEGINNING * max(side.modulus * side.spacing**scene.dimension for side in sides)
        self._placed: tuple[int | None, ...] = ()
        self._longest, self._resumed = np.inf, False

    def _body(self, scene: Scene, body: int) -> TiedBody:
        """Facts of a body; collective."""
        system = next(system for system in self.systems if body in system.bodies)
        local, read, d = system.bodies.index(body), system.particles.owned_rows, scene.dimension
        rows = read("body") == local
        place = read("reference_position")[rows][:, :d]
        box = np.stack((-place.min(axis=0, initial=np.inf), place.max(axis=0, initial=-np.inf)))
        box = maximum(self.comm, box)
        box[0] *= -1.0
        spacing = np.prod(read("spacing")[rows], axis=1) ** (1.0 / d)
        coarsest = maximum(self.comm, float(spacing.max(initial=0.0)))
        nodal, name = scene.bodies[body].placed_on == "nodes", scene.bodies[body].name or f"bodies.{body}"
        return TiedBody(body, name, system, local, coarsest, system.wave_modulus(local)[0], nodal, box)

    def begin(self, time: float) -> None:
        """Springs and their forces; collective. Raises SolverError on all ranks for bodies that cannot be tied."""
        self._build()
        for face in self.faces:
            face.evaluate(ends=not self._resumed)
        self._find_step()
        self._give()

    def set_state(self, state: dict[str, Any]) -> None:
        """Of a checkpoint springs hold of what was deleted in its last step: that is for the next one."""
        self._resumed = True

    def _build(self) -> None:
        self._placed = self.placements
        for face in self.faces:
            face.build()

    def _find_step(self) -> None:
        square = max(face.frequency() for face in self.faces)
        self._longest = _SAFETY * 2.0 / np.sqrt(square) if square > 0.0 else np.inf

    @property
    def placements(self) -> tuple[int | None, ...]:
        """Of the systems that are tied."""
        return tuple(side.system.placements for face in self.faces for side in face.sides)

    @property
    def _energy(self) -> float:
        return sum(face.energy for face in self.faces)

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces in the new places, and what went into the ledger."""
        energy, placed = self._energy, self.placements
        changes = None in placed or placed != self._placed
        if changes:
            self._build()
        for face in self.faces:
            face.evaluate()
        ledger.add_term("tie_energy", self._energy - energy)
        lost = sum(face.lost for face in self.faces)
        if lost:
            ledger.add_term(DELETED_STORED, lost)
        if changes or any(face.ended for face in self.faces):
            self._find_step()
        self._give()

    def _give(self) -> None:
        """Add the forces to those on the particles."""
        for face in self.faces:
            for side, rows, force in face.pulled():
                side.system.particles.owned_rows(EXTERNAL_FORCE)[rows] += force

    def stable_step(self) -> float:
        """Of the springs on this rank, alone."""
        return self._longest

    def energies(self) -> tuple[float, float]:
        """What the springs store."""
        return 0.0, self._energy
