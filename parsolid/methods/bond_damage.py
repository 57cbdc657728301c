"""Damage of a rank's bonds: pre-cracks, failing bonds, dying particles, and the state of all that for a restart.

Both ends of a bond decide alike (see `kernels.bonds`), so that nothing is sent but each particle's resistance, with its
motion. A particle whose shape tensor has nearly degenerated, or that has lost most of its family, dies: it bears no stress from
then on, and its remaining bonds break, on all ranks, at the next inspection.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import bond_damage, bond_state
from parsolid.kernels.bond_damage import Intact
from parsolid.kernels.pairs import Images, PairList
from parsolid.particles import Field
from parsolid.together import maximum

_DEAD = -1.0


class BondList(NamedTuple):
    """A pair list with what the passes want to know of it; `both` is None for one-sided lists."""

    pairs: PairList
    images: Images | None
    both: bool | None


@dataclass(frozen=True)
class Crack:
    """The part of the plane X[axis] = offset [m] within the box lower, upper (3,) [m]; bonds through it do not exist."""

    axis: int
    offset: float
    lower: np.ndarray
    upper: np.ndarray

    def distance(self, positions: np.ndarray) -> np.ndarray:
        """Distance (n,) [m] of points (n, d) from it."""
        d = positions.shape[1]
        lower, upper = self.lower[:d].copy(), self.upper[:d].copy()
        lower[self.axis] = upper[self.axis] = self.offset
        beyond = np.maximum(0.0, np.maximum(lower - positions, positions - upper))
        return np.linalg.norm(beyond, axis=1)


class Failed(NamedTuple):
    """Bonds that are to break: rows (particle, pair) for each list, and the owned particles that lose any."""

    rows: list[np.ndarray]
    particles: np.ndarray


@dataclass(frozen=True)
class Limits:
    """When a particle dies: determinant of its shape tensor over that of a whole family; part of its family lost."""

    determinant: float
    damage: float


class BondDamage:
    """Bonds of one rank. Arrays: local = owned and ghosts; d = dimension.

    resistance (local,) is the limit of the criterion, negative for the dead; exchanged with the motion by the method.
    inverse_shape (local or owned, d, d) is kept up to date for particles that lose bonds.
    """

    def __init__(self, comm, space, lists: list[BondList], kinematics, volume, identifier, body, owned, limits: Limits):
        """kinematics, volume, identifier: local rows; body (owned,). Collective."""
        self.comm, self.space, self.lists, self.kinematics = comm, space, lists, kinematics
        self.volume, self.identifier, self.owned, self.limits = volume, identifier, owned, limits
        self.dimension = d = space.dimension
        self.intact = Intact(np.zeros((owned, d, d)), np.zeros(owned))
        for pairs, images, both in lists:
            bond_damage.add_families(space, pairs, images, both, kinematics, volume, self.intact)
        self.family = self.intact.family.copy()
        self.whole = _largest_of_body(comm, np.linalg.det(self.intact.shape), body)
        self.damage = np.zeros(owned)
        self.resistance = np.zeros(len(volume))
        self.words = np.zeros((owned, self._words()), np.int64)
        self._room = [np.empty((64, 2), np.int64) for _ in lists]

    def _words(self) -> int:
        """Words of bits a particle, for the largest family on any rank."""
        count = np.zeros(self.owned, np.int64)
        slot = self._slots(np.arange(self.owned))
        for pairs, _, both in self.lists:
            bond_state.count_neighbours(pairs, both, slot, count)
        return -(-int(maximum(self.comm, int(count.max(initial=1)))) // bond_state.BITS)

    def declare(self, table) -> None:
        """Add the fields that a restart needs, and the damage."""
        d = self.dimension
        table.add(Field("damage", 1, "1", evolved=True, checkpointed=True, shown=True), self.damage)
        table.add(Field("resistance", 1, "1", evolved=True, exchanged=True, checkpointed=True), self.resistance)
        shape = self.intact.shape.reshape(self.owned, d * d)
        table.add(Field("intact_shape", d * d, f"m^{3 * d + 2 - d}", evolved=True, checkpointed=True), shape)
        table.add(Field("intact_family", 1, "m^3", evolved=True, checkpointed=True), self.intact.family)
        table.add(Field("broken_bonds", self.words.shape[1], "bits", evolved=True, checkpointed=True), self.words)

    def introduce(self, cracks: list[Crack]) -> np.ndarray:
        """Break the bonds that cross cracks; returns the owned particles that lose any."""
        touched = [np.empty(0, np.int64)]
        for crack in cracks:
            where = (crack.axis, crack.offset, crack.lower, crack.upper)
            failed = self._collect(
                lambda pairs, images, room: bond_damage.find_crossing(
                    self.space, pairs, images, self.kinematics, *where, room
                )
            )
            if failed is not None:
                self.cut(failed)
                touched.append(failed.particles)
        return np.unique(np.concatenate(touched))

    def inspect(self, criterion) -> Failed | None:
        """The bonds that fail a criterion (see `kernels.bond_damage`); None when there are none on this rank."""
        return self._collect(
            lambda pairs, images, room: bond_damage.find_failed(
                self.space, pairs, images, criterion, self.kinematics, room
            )
        )

    def _collect(self, find) -> Failed | None:
        rows, touched = [], []
        for number, (pairs, images, both) in enumerate(self.lists):
            count = find(pairs, images, self._room[number])
            if count > len(self._room[number]):
                self._room[number] = np.empty((2 * count, 2), np.int64)
                find(pairs, images, self._room[number])
            rows.append(self._room[number][:count])
            touched.append(rows[-1][:, 0])
            if both is not None:
                touched.append(pairs.neighbour[rows[-1][:, 1]].astype(np.int64))
        particles = np.unique(np.concatenate(touched))
        return Failed(rows, particles) if len(particles) else None

    def subtract(self, failed: Failed, column: int, gradient: np.ndarray) -> None:
        """Take bonds out of gradient sums of the field in columns `column`..., before they are cut."""
        for found, (pairs, images, both) in zip(failed.rows, self.lists):
            bond_damage.subtract_gradients(
                self.space, found, pairs, images, both, self.kinematics, column, gradient
            )

    def cut(self, failed: Failed) -> None:
        """Break bonds and let particles die of it."""
        for found, (pairs, images, both) in zip(failed.rows, self.lists):
            bond_damage.cut(self.space, found, pairs, images, both, self.kinematics, self.volume, self.intact)
        touched = failed.particles
        self.damage[touched] = np.clip(1.0 - self.intact.family[touched] / self.family[touched], 0.0, 1.0)
        determinant = np.linalg.det(self.intact.shape[touched])
        dies = determinant < self.limits.determinant * self.whole[touched]
        dies |= self.damage[touched] > self.limits.damage
        self.resistance[touched[dies]] = _DEAD

    def inverse_shape(self, particles: np.ndarray) -> np.ndarray:
        """K^{-1} / V (n, d, d) of owned particles over their intact bonds; 0 for the dead."""
        result = np.zeros((len(particles), self.dimension, self.dimension))
        alive = self.resistance[particles] >= 0.0
        result[alive] = np.linalg.inv(self.intact.shape[particles[alive]])
        return result

    # --- for a restart ----------------------------------------------------------------------------------------

    def damaged(self) -> np.ndarray:
        """Owned particles that have lost bonds."""
        return np.flatnonzero(self.intact.family != self.family)

    def pack(self) -> None:
        """Bring the bits of all broken bonds up to date, for a checkpoint."""
        particles = self.damaged()
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        for number, bonds in enumerate(self.lists):
            mine = source[:, 0] == number
            broken[mine] = bonds.pairs.weight[source[mine, 1]] == 0.0
        self.words[:] = 0
        words = np.zeros((len(particles), self.words.shape[1]), np.int64)
        bond_state.write_bits(start, broken, words)
        self.words[particles] = words

    def unpack(self) -> np.ndarray:
        """Break the bonds whose bits are set, after the fields were put back; returns the owned particles that have any."""
        particles = np.flatnonzero(self.words.any(axis=1))
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        bond_state.read_bits(start, self.words[particles], broken)
        for number, bonds in enumerate(self.lists):
            mine = broken & (source[:, 0] == number)
            bonds.pairs.weight[source[mine, 1]] = 0.0
        return particles

    def _slots(self, particles: np.ndarray) -> np.ndarray:
        slot = np.full(len(self.volume), -1, np.int64)
        slot[particles] = np.arange(len(particles))
        return slot

    def _neighbourhoods(self, particles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Neighbours of some particles in the order of the bits: row starts (n + 1,), sources (m, 2) list and pair."""
        slot, count = self._slots(particles), np.zeros(len(particles), np.int64)
        for pairs, _, both in self.lists:
            bond_state.count_neighbours(pairs, both, slot, count)
        start = np.concatenate(([0], np.cumsum(count)))
        key, source, cursor = np.empty(start[-1], np.int64), np.empty((start[-1], 2), np.int64), start[:-1].copy()
        for number, (pairs, images, both) in enumerate(self.lists):
            bond_state.list_neighbours(pairs, images, both, number, slot, self.identifier, cursor, key, source)
        bond_state.sort_neighbours(start, key, source)
        return start, source


def _largest_of_body(comm, values: np.ndarray, body: np.ndarray) -> np.ndarray:
    """For each particle the largest value (n,) in its body, over all ranks; collective."""
    bodies = maximum(comm, int(body.max(initial=0))) + 1
    largest = np.zeros(bodies)
    np.maximum.at(largest, body, values)
    return maximum(comm, largest)[body]
