"""Ties of a scene: bodies of different methods that are bonded where they touch at the start.

In the reference a point p stands on the face beside each particle of the outer layer of the finer body, where both
bodies have the same colour. Each body's displacement there is that of its particles, by weights exact for linear
fields, and a spring holds the two together. So bodies strained alike, or each in its own way with a kink at the face,
feel nothing, and neither does what turns as one: momentum and angular momentum are kept.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.boundary.conditions import EXTERNAL_FORCE
from parsolid.boundary.forces import tributary_mass
from parsolid.collective import maximum, raise_together
from parsolid.contact import tie_springs
from parsolid.contact.search import sort_rows
from parsolid.methods.failure_fields import DELETED_INTERNAL
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import EnergyLedger, ParticleSystem
from parsolid.particles.declaration import Field
from parsolid.particles.generated import cell_volumes
from parsolid.scene import Scene
from parsolid.scene.contact import TIE_TERMS, tied_pairs

# step over its limit by the frequency of the springs
_SAFETY = 0.8
# of M V of one particle, the energy scale of the balance
_BEGINNING = 2.5e4
# radius of the kernels over the spacing, as in contact
_RADIUS = 2.7
# in spacings, greatest distance of particles of the first layer from the face; cells: layers are at .5 and 1.5
_NEXT = 0.75
# in spacings, greatest error of the weighted mean position of a point
_ROUND_OFF = 1e-6
# field of the positions [m] at the start of a step
START = "tie_start"


def declare_tie_fields(scene: Scene, system: ParticleSystem) -> None:
    """Declare the fields that the ties of a scene need on a system's particles, before its state is set."""
    here = [
        (number, first, second)
        for number, (first, second, _) in enumerate(tied_pairs(scene))
        if {first, second} & set(system.bodies)
    ]
    if not here:
        return
    system.take_external_forces(keep_rows=True)
    failures = [getattr(body.material, "failure", None) for body in scene.bodies]
    deletes = [failure is not None and failure.after == "delete" for failure in failures]
    ending = [number for number, first, second in here if deletes[first] or deletes[second]]
    if ending:
        system.particles.declare(Field(START, system.dimension, "m", mirror="vector"))
        for number in ending:
            system.particles.declare(Field(held_field(number), 1, "1", checkpointed=True), 1.0)


def held_field(number: int) -> str:
    """Name of the field that is 1 while the spring of a particle in a tie holds, then 0."""
    return f"tie_{number}_held"


class TiedBody(NamedTuple):
    """A body of a tie. body, name: in the scene; local: number in its system; spacing [m]; modulus lambda + 2 mu [Pa];
    nodal: particles lie on its faces; box (2, d) [m] in the reference."""

    body: int
    name: str
    system: ParticleSystem
    local: int
    spacing: float
    modulus: float
    nodal: bool
    box: np.ndarray


class TiedFaces:
    """The springs of one tie; the first body is the finer one. owned: number of this rank's particles near the face.

    energy, lost [J]: stored, and removed in the last step with springs that ended, of the springs counted by this rank;
    ended: whether any has; force (owned, d) [N]; parts: rows of both bodies among the owned ones.

    A spring ends when a particle that it joins is deleted; the field `held` of the particle beside its point says so.
    """

    def __init__(self, comm: Any, number: int, stiffness: float, first: TiedBody, second: TiedBody):
        self.comm, self.number, self.sides = comm, number, (first, second)
        least = min(side.modulus / side.spacing for side in self.sides)
        self.stiffness, self.energy, self.lost, self.ended = stiffness * least, 0.0, 0.0, False
        self.held, self.dimension = held_field(number), first.system.dimension
        self.deletes = any(self.held in side.system.particles for side in self.sides)
        self._search = ClosePairs()

    def build(self) -> None:
        """Make the springs that pull this rank's particles; collective.

        Raises SolverError on all ranks where the bodies do not touch, or are too thin.
        """
        coarse = max(side.spacing for side in self.sides)
        reach = _RADIUS * coarse
        self.rows = [self._near(side, other, 2.0 * reach) for side, other in (self.sides, self.sides[::-1])]
        self.first = len(self.rows[0])
        self.owned = self.first + len(self.rows[1])
        self.parts = slice(self.first), slice(self.first, None)
        place = self._gathered("reference_position")[:, : self.dimension]
        # particles joined by a spring are within two reaches and twice their distance from the face
        halo = Halo(self.comm, place, 2.0 * reach + 2.0 * coarse)
        whole = [cell_volumes(side.system.particles)[rows] for side, rows in zip(self.sides, self.rows)]
        columns = halo.with_ghosts(np.column_stack((place, np.concatenate(whole))))
        identifier = halo.with_ghosts(self._gathered("identifier").astype(np.int64))
        second = halo.with_ghosts((np.arange(self.owned) >= self.first).astype(np.int64)) > 0
        place, volume = np.ascontiguousarray(columns[:, :-1]), np.ascontiguousarray(columns[:, -1])
        source, points = self._points(place, volume, second, reach)
        bodies = " and ".join(repr(side.name) for side in self.sides)
        apart = f"tie.{self.number}: expected bodies that touch, found {bodies} apart"
        raise_together(self.comm, apart if maximum(self.comm, float(len(source))) == 0.0 else None)
        # on any number of ranks springs are summed in one order
        order = np.argsort(identifier[source], kind="stable")
        source, points = source[order], points[order]
        start, rows, weight, fault = self._weights(points, place, volume, second, identifier)
        held = halo.with_ghosts(self._field(self.held, 1.0))
        self._keep(halo, start, rows, weight, source, volume, held, fault)

    def _near(self, side: TiedBody, other: TiedBody, reach: float) -> np.ndarray:
        """Rows of a body's particles near the other's box in the reference."""
        read = side.system.particles.owned_rows
        rows = np.flatnonzero(read("body") == side.local)
        place = read("reference_position")[rows][:, : self.dimension]
        gap = np.maximum(np.maximum(other.box[0] - place, place - other.box[1]), 0.0)
        return np.asarray(rows[(gap * gap).sum(axis=1) < reach * reach])

    def _gathered(self, name: str) -> np.ndarray:
        """A field of the owned particles."""
        pieces = [side.system.particles.owned_rows(name)[rows] for side, rows in zip(self.sides, self.rows)]
        return np.ascontiguousarray(np.concatenate(pieces))

    def _field(self, name: str, default: float) -> np.ndarray:
        """A field (owned,) of the owned particles; `default` in systems without it."""
        pieces = []
        for side, rows in zip(self.sides, self.rows):
            of = side.system.particles
            pieces.append(of.owned_rows(name)[rows] if name in of else np.full(len(rows), default))
        return np.concatenate(pieces)

    def _points(self, place: Any, volume: Any, second: Any, reach: float) -> tuple[np.ndarray, np.ndarray]:
        """Particles of the first body beside the face, and their points on the face."""
        box, length = self.sides[1].box, _NEXT * self.sides[0].spacing
        gap = np.maximum(np.maximum(box[0] - place, place - box[1]), 0.0)
        source = np.flatnonzero(~second & ((gap * gap).sum(axis=1) < reach * reach))
        at, half = np.ascontiguousarray(place[source]), 0.5 * (reach + length)
        start, rows = self._search.across(at, np.full(len(at), half), place, np.full(len(place), half))
        points = np.zeros_like(at)
        found = tie_springs.faces(source, length, start, rows, place, volume, second, 1.0 / reach, points)
        return source[found], points[found]

    def _weights(self, points: Any, place: Any, volume: Any, second: Any, identifier: Any) -> tuple[Any, ...]:
        """Particles of both bodies around points, sorted by identifier, and their weights: start, rows, weight. And a
        fault where a body is too thin, or where a point's surroundings are not all on this rank."""
        pieces, fault = [], None
        for side, own, sign in zip(self.sides, (~second, second), (-1.0, 1.0)):
            reach, here = _RADIUS * side.spacing, np.flatnonzero(own)
            half, others = np.full(len(points), 0.5 * reach), np.ascontiguousarray(place[here])
            start, found = self._search.across(points, half, others, np.full(len(here), 0.5 * reach))
            rows = here[found].astype(np.int32)
            sort_rows(start, rows, np.zeros(len(rows), np.int8), identifier)
            weight = np.zeros(len(rows))
            missed = tie_springs.weigh(points, start, rows, place, volume, 1.0 / reach, sign, weight)
            if missed > _ROUND_OFF * side.spacing:
                expected = f"tie.{self.number}: expected bodies of at least two layers of particles beside the face"
                fault = f"{expected}, found fewer in {side.name!r}"
            pieces.append((start, rows, weight))
        # merge the lists of both bodies, the first before the second in each row
        point = np.concatenate([np.repeat(np.arange(len(points)), np.diff(start)) for start, _, _ in pieces])
        order = np.argsort(point, kind="stable")
        start = np.concatenate(([0], np.cumsum(np.bincount(point, minlength=len(points))))).astype(np.int64)
        rows, weight = (np.concatenate([piece[k] for piece in pieces])[order] for k in (1, 2))
        return start, rows, weight, fault

    def _keep(
        self, halo: Halo, start: Any, rows: Any, weight: Any, source: Any, volume: Any, held: Any, fault: str | None
    ) -> None:
        """Keep the springs that pull a particle of this rank, and the ghosts that they join; collective."""
        pulls = np.append(rows < self.owned, False)
        kept = np.add.reduceat(pulls, start[:-1], dtype=int) > 0 if len(source) else np.zeros(0, bool)
        inside = np.repeat(kept, np.diff(start))
        self.rows_of, self.weight = rows[inside], np.ascontiguousarray(weight[inside])
        self.start = np.concatenate(([0], np.cumsum(np.diff(start)[kept]))).astype(np.int64)
        raise_together(self.comm, fault if kept.any() else None)
        used = np.zeros(halo.ghosts, bool)
        used[self.rows_of[self.rows_of >= self.owned] - self.owned] = True
        self.halo = halo.subset(used)
        number = np.concatenate((np.arange(self.owned), self.owned + np.cumsum(used) - 1)).astype(np.int32)
        self.rows_of = number[self.rows_of]
        source = source[kept]
        finer = self.sides[0]
        area = volume[source] / (finer.spacing * (0.5 if finer.nodal else 1.0))
        self.springs, self.counted, self.source = self.stiffness * area * held[source], source < self.owned, source
        self.moved = np.zeros((self.owned + self.halo.ghosts, self.dimension))
        self.before, self.gone = np.zeros_like(self.moved), np.zeros(len(self.moved))
        self.force = np.zeros((self.owned, self.dimension))
        self.reference = self._gathered("reference_position")[:, : self.dimension]
        self._message = self.halo.forward(self.moved, *([self.before, self.gone] if self.deletes else []))

    def lists(self) -> tuple[Any, ...]:
        """Starts, rows, weights and stiffness [N/m] of the springs."""
        return self.start, self.rows_of, self.weight, self.springs

    def evaluate(self, ends: bool = True) -> None:
        """Forces and energy at the present positions; collective among neighbours. ends: whether springs of deleted
        particles end."""
        position = self._gathered("position")
        self.moved[: self.owned] = position - self.reference
        if self.deletes:
            self.before[: self.owned] = self._gathered(START) - self.reference
            self.gone[: self.owned] = self._field("deleted_mass", 0.0) > 0.0
        self._message.now()
        if self.deletes:
            if ends:
                self._end_springs()
            for side, rows, here in zip(self.sides, self.rows, self.parts):
                side.system.particles.owned_rows(START)[rows] = position[here]
        self.energy = tie_springs.pull(*self.lists(), self.counted, self.moved, self.owned, self.force)

    def forces_of(self, displacement: np.ndarray) -> list[tuple[np.ndarray, np.ndarray]]:
        """Rows of the particles of both bodies and the forces [N] on them by a displacement (owned, d) [m] of their
        system; collective among neighbours."""
        self.moved[: self.owned] = displacement[np.concatenate(self.rows)]
        self._message.now()
        force = np.zeros_like(self.force)
        tie_springs.pull(*self.lists(), self.counted, self.moved, self.owned, force)
        return [(rows, force[here]) for rows, here in zip(self.rows, self.parts)]

    def _end_springs(self) -> None:
        """End the springs of particles deleted in the last step.

        Their forces act at its start only; the energy k e . e'/2 of the separations before and after it is removed."""
        self.lost = 0.0
        joins = np.append(self.gone[self.rows_of] > 0.0, False)
        ends = np.add.reduceat(joins, self.start[:-1], dtype=int) > 0 if len(self.springs) else np.zeros(0, bool)
        ends &= self.springs > 0.0
        for p in np.flatnonzero(ends):
            here = slice(self.start[p], self.start[p + 1])
            rows, weight = self.rows_of[here], self.weight[here]
            if self.counted[p]:
                self.lost += 0.5 * float(self.springs[p] * (weight @ self.before[rows]) @ (weight @ self.moved[rows]))
        self.springs[ends], self.ended = 0.0, bool(ends.any())
        source = self.source[ends & self.counted]
        first = self.sides[0].system.particles
        if len(source):
            first.owned_rows(self.held)[self.rows[0][source]] = 0.0

    def frequency(self) -> float:
        """Upper bound of the square of the frequency [1/s^2] of the owned particles."""
        mass = [tributary_mass(side.system.particles, rows) for side, rows in zip(self.sides, self.rows)]
        return float(tie_springs.frequency(*self.lists(), np.concatenate(mass), self.owned))


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
        # energy booked so far [J]
        self._booked = 0.0

    def _body(self, scene: Scene, body: int) -> TiedBody:
        """A body of a tie, by its number in the scene; collective."""
        system = next(system for system in self.systems if body in system.bodies)
        local, read, d = system.bodies.index(body), system.particles.owned_rows, scene.dimension
        rows = read("body") == local
        place = read("reference_position")[rows][:, :d]
        box = np.stack((-place.min(axis=0, initial=np.inf), place.max(axis=0, initial=-np.inf)))
        box = maximum(self.comm, box)
        box[0] *= -1.0
        spacing = np.prod(read("spacing")[rows], axis=1) ** (1.0 / d)
        coarsest = maximum(self.comm, float(spacing.max(initial=0.0)))
        nodal, name = scene.bodies[body].placed_on == "vertices", scene.bodies[body].name or f"bodies.{body}"
        return TiedBody(body, name, system, local, coarsest, system.wave_modulus(local)[0], nodal, box)

    def begin(self, time: float) -> None:
        """Springs and their forces; collective. Raises SolverError on all ranks for bodies that cannot be tied."""
        self._build()
        for face in self.faces:
            face.evaluate(ends=not self._resumed)
        self._booked = self._energy
        self._find_step()
        self._give()

    def set_state(self, state: dict[str, Any]) -> None:
        """Springs of particles deleted in the last step before a checkpoint end in the next step, not in `begin`."""
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
        """`ParticleSystem.placements` of the tied systems."""
        return tuple(side.system.placements for face in self.faces for side in face.sides)

    @property
    def _energy(self) -> float:
        return sum(face.energy for face in self.faces)

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces at the new positions; books energies."""
        placed = self.placements
        changes = None in placed or placed != self._placed
        if changes:
            self._build()
        for face in self.faces:
            face.evaluate()
        ledger.add_term("tie_energy", self._energy - self._booked)
        self._booked = self._energy
        lost = sum(face.lost for face in self.faces)
        if lost:
            ledger.add_term(DELETED_INTERNAL, lost)
        if changes or any(face.ended for face in self.faces):
            self._find_step()
        self._give()

    def _give(self) -> None:
        """Add the forces to the external forces on the particles."""
        for face in self.faces:
            for side, rows, here in zip(face.sides, face.rows, face.parts):
                side.system.particles.owned_rows(EXTERNAL_FORCE)[rows] += face.force[here]

    def try_forces(self, time: float, over: float, still: bool = False, mean: bool = False) -> None:
        """See `Interaction`."""
        for face in self.faces:
            face.evaluate()
        self._give()

    def change_along(self, change: np.ndarray, ahead: float) -> tuple[np.ndarray | float, float]:
        """See `Interaction`: springs are linear in the displacement."""
        result = np.zeros(change.shape)
        for face in self.faces:
            for rows, force in face.forces_of(change):
                result[rows] += force
        return result, 0.0

    def stable_step(self) -> float:
        """Largest step [s] that the springs on this rank allow."""
        return self._longest

    def energies(self) -> tuple[float, float]:
        """Kinetic energy, and energy stored by the springs [J]."""
        return 0.0, self._energy
