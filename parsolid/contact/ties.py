"""Ties of a scene: bodies of different methods that are bonded where they touch at the start.

In the reference a point p stands on the face beside each particle of the outer layer of the finer body, where both
bodies have the same colour. Each body's displacement there is that of its particles, by weights exact for linear
fields, and a spring holds the two together. So bodies strained alike, or each in its own way with a kink at the face,
feel nothing, and neither does what turns as one: momentum and angular momentum are kept.
"""

from typing import Any, NamedTuple

import numpy as np
from scipy.sparse import csr_array

from decomposition.halo import Halo
from decomposition.pair_search import ClosePairs
from parsolid.boundary.conditions import EXTERNAL_FORCE
from parsolid.boundary.forces import tributary_mass
from parsolid.collective import maximum, raise_together
from parsolid.contact import tie_points
from parsolid.contact.bodies import near_box, thickness
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
    """A body of a tie. name: in the scene; local: number in its system; spacing [m]; modulus lambda + 2 mu [Pa]; nodal:
    particles lie on its faces; box (2, d) [m] in the reference."""

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
        finer, other = self.sides
        coarse = max(finer.spacing, other.spacing)
        reach, self.rows = _RADIUS * coarse, []
        for side, opposite in (self.sides, self.sides[::-1]):
            read = side.system.particles.owned_rows
            rows = np.flatnonzero(read("body") == side.local)
            place = read("reference_position")[rows][:, : self.dimension]
            self.rows.append(rows[near_box(place, opposite.box[0], opposite.box[1], 2.0 * reach)])
        first = len(self.rows[0])
        self.owned, self.parts = first + len(self.rows[1]), (slice(first), slice(first, None))
        self.reference = np.ascontiguousarray(self._gathered("reference_position")[:, : self.dimension])
        # particles joined by a spring are within two reaches and twice their distance from the face
        halo = Halo(self.comm, self.reference, 2.0 * reach + 2.0 * coarse)
        place, identifier = halo.with_ghosts(self.reference), halo.with_ghosts(self._gathered("identifier"))
        cells = [cell_volumes(side.system.particles)[rows] for side, rows in zip(self.sides, self.rows)]
        volume, held = halo.with_ghosts(np.concatenate(cells)), halo.with_ghosts(self._gathered(self.held, 1.0))
        second = halo.with_ghosts((np.arange(self.owned) >= first).astype(np.int64)) > 0
        # particles of the finer body beside the face, and their points on the face
        source = np.flatnonzero(~second & near_box(place, other.box[0], other.box[1], reach))
        length = _NEXT * finer.spacing
        at, half = np.ascontiguousarray(place[source]), 0.5 * (reach + length)
        start, rows = self._search.across(at, np.full(len(at), half), place, np.full(len(place), half))
        points = np.zeros_like(at)
        found = tie_points.faces(source, length, start, rows, place, volume, second, 1.0 / reach, points)
        bodies = " and ".join(repr(side.name) for side in self.sides)
        apart = f"tie.{self.number}: expected bodies that touch, found {bodies} apart"
        raise_together(self.comm, apart if maximum(self.comm, float(found.sum())) == 0.0 else None)
        # on any number of ranks, and after a restart, springs are summed in one order
        order = np.flatnonzero(found)[np.argsort(identifier[source[found]], kind="stable")]
        source, points = source[order], points[order]
        weights, fault = self._weights(points, place, volume, second, identifier)
        # those that pull a particle of this rank, whose surroundings are all here
        kept = np.diff(weights[:, : self.owned].indptr) > 0
        raise_together(self.comm, fault if kept.any() else None)
        weights, self.source = weights[kept], source[kept]
        used = np.arange(len(place)) < self.owned
        used[weights.indices] = True
        self.halo, self.weights = halo.subset(used[self.owned :]), weights[:, np.flatnonzero(used)]
        self._spread = self.weights[:, : self.owned].T.tocsr()
        area = volume[self.source] / (finer.spacing * (0.5 if finer.nodal else 1.0))
        area = area * thickness(finer.system, place[self.source])
        self.springs, self.counted = self.stiffness * area * held[self.source], self.source < self.owned
        self.moved = np.zeros((self.owned + self.halo.ghosts, self.dimension))
        self.before, self.gone = np.zeros_like(self.moved), np.zeros(len(self.moved))
        self._message = self.halo.forward(self.moved, *([self.before, self.gone] if self.deletes else []))

    def _gathered(self, name: str, default: float = 0.0) -> np.ndarray:
        """A field of the owned particles; `default` (owned,) in systems without it."""
        pieces = []
        for side, rows in zip(self.sides, self.rows):
            of = side.system.particles
            pieces.append(of.owned_rows(name)[rows] if name in of else np.full(len(rows), default))
        return np.ascontiguousarray(np.concatenate(pieces))

    def _weights(
        self, points: Any, place: Any, volume: Any, second: Any, identifier: Any
    ) -> tuple[csr_array, str | None]:
        """Weights (points, particles) of the particles around points, negative for the first body, each row sorted by
        body and identifier. And a fault where a body is too thin, or where a point's surroundings are not all here."""
        pieces, fault = [], None
        for side, own, sign in zip(self.sides, (~second, second), (-1.0, 1.0)):
            here, half = np.flatnonzero(own), 0.5 * _RADIUS * side.spacing
            others = np.ascontiguousarray(place[here])
            start, found = self._search.across(points, np.full(len(points), half), others, np.full(len(here), half))
            rows, point = here[found].astype(np.int32), np.repeat(np.arange(len(points)), np.diff(start))
            rows, weight = rows[np.lexsort((identifier[rows], point))], np.zeros(len(found))
            missed = tie_points.weigh(points, start, rows, place, volume, 0.5 / half, sign, weight)
            if missed > _ROUND_OFF * side.spacing:
                expected = f"tie.{self.number}: expected bodies of at least two layers of particles beside the face"
                fault = f"{expected}, found fewer in {side.name!r}"
            pieces.append((point, rows, weight))
        point, rows, weight = (np.concatenate(arrays) for arrays in zip(*pieces))
        order = np.argsort(point, kind="stable")
        start = np.searchsorted(point[order], np.arange(len(points) + 1))
        return csr_array((weight[order], rows[order], start), (len(points), len(place))), fault

    def evaluate(self, ends: bool = True) -> None:
        """Forces and energy at the present positions; collective among neighbours. ends: whether springs of deleted
        particles end."""
        position = self._gathered("position")
        self.moved[: self.owned] = position - self.reference
        if self.deletes:
            self.before[: self.owned] = self._gathered(START) - self.reference
            self.gone[: self.owned] = self._gathered("deleted_mass") > 0.0
        self._message.now()
        if self.deletes:
            if ends:
                self._end_springs()
            for side, rows, here in zip(self.sides, self.rows, self.parts):
                side.system.particles.owned_rows(START)[rows] = position[here]
        self.force, self.energy = self.pull()

    def pull(self) -> tuple[np.ndarray, float]:
        """Forces (owned, d) [N] by the displacements `moved`, and the energy [J] of the springs that this rank counts.

        U = sum_p k_p |e_p|^2/2, e_p = sum_j w_pj u_j, the separation of the faces at p.
        """
        parted = self.weights @ self.moved
        pulled = self.springs[:, None] * parted
        return -(self._spread @ pulled), 0.5 * float((parted * pulled)[self.counted].sum())

    def _end_springs(self) -> None:
        """End the springs of particles deleted in the last step.

        Their forces act at its start only; the energy k e . e'/2 of the separations before and after it is removed."""
        ended = (np.diff(self.weights[:, np.flatnonzero(self.gone)].indptr) > 0) & (self.springs > 0.0)
        self.ended, counted = bool(ended.any()), ended & self.counted
        before, now = self.weights[counted] @ self.before, self.weights[counted] @ self.moved
        self.lost = 0.5 * float(self.springs[counted] @ (before * now).sum(axis=1))
        self.sides[0].system.particles.owned_rows(self.held)[self.rows[0][self.source[counted]]] = 0.0
        self.springs[ended] = 0.0

    def frequency(self) -> float:
        """Upper bound of the square of the frequency [1/s^2] of the owned particles."""
        masses = [tributary_mass(side.system.particles, rows) for side, rows in zip(self.sides, self.rows)]
        mass = np.concatenate(masses)
        # not abs(weights), which would sort them
        size = csr_array((np.abs(self.weights.data), self.weights.indices, self.weights.indptr), self.weights.shape)
        # row sums of M^-1 K (Gershgorin)
        sums = size[:, : self.owned].T @ (self.springs * size.sum(axis=1))
        return float((sums[mass > 0.0] / mass[mass > 0.0]).max(initial=0.0))


class Ties(Interaction):
    """All ties of a scene, on one rank."""

    terms = TIE_TERMS

    def __init__(self, comm: Any, scene: Scene, systems: list[ParticleSystem]) -> None:
        """systems: of the scene, in their state. Collective."""
        self.comm, self.systems, self.faces = comm, systems, list[TiedFaces]()
        for number, (first, second, tie) in enumerate(tied_pairs(scene)):
            sides = sorted((self._body(scene, body) for body in (first, second)), key=lambda side: side.spacing)
            self.faces.append(TiedFaces(comm, number, tie.stiffness, sides[0], sides[1]))
            scales = [_BEGINNING * side.modulus * side.spacing**scene.dimension for side in sides]
            self.energy_scale = max(self.energy_scale, *scales)
        self._placed: tuple[int | None, ...] = ()
        self._longest, self._resumed = np.inf, False

    def _body(self, scene: Scene, body: int) -> TiedBody:
        """A body of a tie, by its number in the scene; collective."""
        system = next(system for system in self.systems if body in system.bodies)
        local, read, d = system.bodies.index(body), system.particles.owned_rows, scene.dimension
        rows = read("body") == local
        place = read("reference_position")[rows][:, :d]
        box = np.stack((-place.min(axis=0, initial=np.inf), place.max(axis=0, initial=-np.inf)))
        box = maximum(self.comm, box) * np.array([[-1.0], [1.0]])
        spacing = np.prod(read("spacing")[rows], axis=1) ** (1.0 / d)
        coarsest = maximum(self.comm, float(spacing.max(initial=0.0)))
        stated, modulus = scene.bodies[body], system.wave_modulus(local)[0]
        name, nodal = stated.name or f"bodies.{body}", stated.placed_on == "vertices"
        return TiedBody(name, system, local, coarsest, modulus, nodal, box)

    def begin(self, time: float) -> None:
        """Springs and their forces; collective. Raises SolverError on all ranks for bodies that cannot be tied."""
        self._act(ends=not self._resumed)
        self.book_stored(None, tie_energy=self._energy)

    def set_state(self, state: dict[str, Any]) -> None:
        """Springs of particles deleted in the last step before a checkpoint end in the next step, not in `begin`."""
        self._resumed = True

    def evaluate(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """Forces at the new positions; books energies."""
        self._act()
        self.book_stored(ledger, tie_energy=self._energy)
        lost = sum(face.lost for face in self.faces)
        if lost:
            ledger.add_term(DELETED_INTERNAL, lost)

    def _act(self, ends: bool = True) -> None:
        """Add the forces at the present positions to the external forces, with new springs where particles have changed
        their rows; ends: whether springs of deleted particles end. Collective."""
        placed = tuple(side.system.placements for face in self.faces for side in face.sides)
        changes = None in placed or placed != self._placed
        self._placed = placed
        for face in self.faces:
            if changes:
                face.build()
            face.evaluate(ends)
            for side, rows, here in zip(face.sides, face.rows, face.parts):
                side.system.particles.owned_rows(EXTERNAL_FORCE)[rows] += face.force[here]
        if changes or any(face.ended for face in self.faces):
            square = max(face.frequency() for face in self.faces)
            self._longest = _SAFETY * 2.0 / np.sqrt(square) if square > 0.0 else np.inf

    @property
    def _energy(self) -> float:
        return sum(face.energy for face in self.faces)

    def try_forces(self, time: float, over: float, still: bool = False, mean: bool = False) -> None:
        """See `Interaction`."""
        self._act()

    def change_along(self, change: np.ndarray, ahead: float) -> tuple[np.ndarray | float, float]:
        """See `Interaction`: springs are linear in the displacement."""
        result = np.zeros(change.shape)
        for face in self.faces:
            face.moved[: face.owned] = change[np.concatenate(face.rows)]
            face._message.now()
            force, _ = face.pull()
            for rows, here in zip(face.rows, face.parts):
                result[rows] += force[here]
        return result, 0.0

    def stable_step(self) -> float:
        """Largest step [s] that the springs on this rank allow."""
        return self._longest

    def energies(self) -> tuple[float, float]:
        """Kinetic energy, and energy stored by the springs [J]."""
        return 0.0, self._energy
