"""Detection of bodies that meet in a run without a contact or a tie in the scene."""

from collections.abc import Callable, Sequence
from itertools import combinations
from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.contact.broad_phase import SPEED_GAIN, body_motions
from parsolid.methods.interaction import Interaction, Meeting
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.particles.touching import ClosePairs, close_pairs, systems_of_bodies, touch, within_touch
from parsolid.scene import Scene
from parsolid.scene.contact import BodyPairs, tied_pairs

# steps between two checks: of bodies that are far apart, and at most of near ones
_FAR_STEPS, _NEAR_STEPS = 64, 8
# share of the distance of contact by which bodies may approach between two checks
_CLOSED = 0.25
# scenes of more bodies are always checked, even where all pairs are declared
_FEW = 64


def undeclared_contact(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> "UndeclaredContact | None":
    """The detection of undeclared contact of a scene; None where all pairs of bodies are declared. Collective."""
    count = len(scene.bodies)
    if count == 1:
        return None
    undeclared = UndeclaredContact(comm, scene, systems)
    if count <= _FEW and all(undeclared.is_declared(i, j) for i, j in combinations(range(count), 2)):
        return None
    return undeclared


class UndeclaredContact(Interaction):
    """Finds bodies that meet and are neither in contact nor tied; it adds no forces.

    Bodies meet where their particles are within a spacing of one another, or within the reach of a method that finds
    new neighbours. The time between checks depends on the speeds of bodies; all ranks check together.

    met: meetings found since the loop last emptied this, the same on all ranks.
    """

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """Collective."""
        self.comm, self.scene, self.systems = comm, scene, systems
        self.home, self._contact = systems_of_bodies(scene), scene.in_contact
        self._tied = BodyPairs(pair[:2] for pair in tied_pairs(scene))
        self.met: Sequence[Meeting] = []
        self.due: float | None = None
        self._known, self._touching = set[tuple[int, int]](), set[tuple[int, int]]()
        moduli = [system.wave_modulus(k) for system in systems for k in range(len(system.bodies))]
        self._faster = SPEED_GAIN * max((modulus / density) ** 0.5 for modulus, density in moduli)
        spacing = np.zeros((len(self.home), scene.dimension))
        for system in systems:
            rows = system.particles.owned_rows
            np.maximum.at(spacing, np.array(system.bodies)[rows("body")], rows("spacing"))
        self._spacing = maximum(comm, spacing)
        settings = [scene.systems[k].settings for k in self.home]
        self._reach = np.array([of.contact_distance(one) for of, one in zip(settings, self._spacing)])
        # pairs that touch in the reference
        boxes = np.stack(body_motions(comm, len(self.home), systems, "reference_position")[:2], axis=1)
        close = self._undeclared(within_touch(scene, boxes, self._spacing))
        touching, _ = touch(comm, close, self._places("reference_position"))
        self._touching = set(map(tuple, close.bodies[touching].tolist()))

    def is_declared(self, i: int, j: int) -> bool:
        """Whether two bodies, i < j, are in contact, tied, or touched in the reference."""
        in_contact = self._contact is not None and self._contact.has(i, j)
        return in_contact or self._tied.has(i, j) or (i, j) in self._touching

    def _undeclared(self, close: ClosePairs) -> ClosePairs:
        """The pairs that are not declared and have not been found before."""
        free = [not self.is_declared(i, j) and (i, j) not in self._known for i, j in close.bodies.tolist()]
        return close.where(np.array(free, bool))

    def begin(self, time: float) -> None:
        """A new run checks after its first step; a restarted one at the time in its checkpoint."""
        self.due = time if self.due is None else self.due

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Check where this is due; collective then."""
        if step > 0.0 and self.due is not None and time >= self.due:
            self.due = time + self._check(step)

    def _check(self, step: float) -> float:
        """Find bodies that have met; returns the time [s] until the next check. Collective."""
        lower, upper, velocity, _ = body_motions(self.comm, len(self.home), self.systems)
        boxes, mean = np.stack((lower, upper), axis=1), velocity.mean(axis=0)
        speeds = [np.abs(system.particles.owned_rows("velocity") - mean).max(initial=0.0) for system in self.systems]
        # greatest speed of approach of two particles along an axis
        fastest = 2.0 * (maximum(self.comm, max(speeds)) + self._faster)
        later = _FAR_STEPS * step
        if not self._within(boxes, fastest * later):
            return later
        self.met = [*self.met, *self._within(boxes, 0.0)]
        self._known.update((i, j) for i, j, _ in self.met)
        # bodies at rest, without waves
        soon = _CLOSED * self._reach.min() / fastest if fastest else np.inf
        return float(np.clip(soon, step, _NEAR_STEPS * step))

    def _within(self, boxes: np.ndarray, room: float) -> list[Meeting]:
        """Undeclared pairs of bodies in boxes (bodies, 2, d) [m] whose particles are within their distance of contact
        plus `room` [m]; collective."""
        close = self._undeclared(close_pairs(boxes, self.home, self._reach + room, self._spacing + room))
        if not len(close.bodies):
            return []
        found, places = touch(self.comm, close, self._places("position"))
        return [(int(i), int(j), place) for (i, j), place in zip(close.bodies[found], places[found])]

    def _places(self, field: str) -> Callable[[int], np.ndarray]:
        """Function: body -> positions (n, d) [m], by a field, of this rank's particles that are not deleted."""
        pieces: dict[int, np.ndarray] = {}
        for system in self.systems:
            rows = system.particles.owned_rows
            body, place = rows("body"), rows(field)[:, : self.scene.dimension]
            if "deleted_mass" in system.particles:
                left = rows("deleted_mass") == 0.0
                body, place = body[left], place[left]
            order = np.argsort(body, kind="stable")
            ends = np.searchsorted(body[order], np.arange(len(system.bodies) + 1))
            place = np.ascontiguousarray(place[order])
            pieces |= {number: place[ends[k] : ends[k + 1]] for k, number in enumerate(system.bodies)}
        return pieces.__getitem__

    def state(self) -> dict[str, Any]:
        """Time of the next check [s], and pairs that have been found."""
        return {"due": self.due, "met": sorted(self._known)}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back `state`; where meetings end the run, they are found again."""
        self.due = state["due"]
        if self.scene.undeclared_contact == "warn":
            self._known = {(i, j) for i, j in state["met"]}
