"""Damage of a rank's bonds: pre-cracks, failing bonds, dying particles, and the bits of all that for a restart.

Both ends of a bond decide alike (see `methods.peridynamics.bonds`), so that nothing is sent but each particle's
resistance, with its motion. A particle whose shape tensor has nearly degenerated, or that has lost most of its family,
dies: it bears no stress from then on, and its remaining bonds break, on all ranks, at the next inspection. Which bonds
are broken is all of the state: what else is here follows from it, to the bit.
"""

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import maximum
from parsolid.methods.peridynamics import bond_damage_kernels as bond_damage
from parsolid.methods.peridynamics import bond_state
from parsolid.methods.protocol import BrokenPairs
from parsolid.pairs.lists import images_of, mutual
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field, Rows

_DEAD = -1.0
# on a lattice a damage may be the limit itself; sums in another order must not decide then
_SLACK = 1e-9


class Failed(NamedTuple):
    """Bonds that are to break: rows (particle, pair) for each list, and the owned particles that lose any."""

    rows: list[np.ndarray]
    particles: np.ndarray


@dataclass(frozen=True)
class Limits:
    """When a damaged particle dies: determinant of K over that of a whole family, and damage."""

    determinant: float
    damage: float


class BondDamage:
    """Damage on one rank. It declares, for every particle,

    damage        share of the family's volume that it is no longer bonded to
    resistance    the limit of the criterion, negative for the dead; told to ghosts with the motion
    broken_bonds  words of bits for a restart, as of the last `pack`
    """

    def __init__(
        self, comm: Any, particles: Particles, bond_system: Any, resistance: np.ndarray, limits: Limits
    ) -> None:
        """bond_system: a `PairSystem` with all bonds whole; resistance (owned,) of particles as they are made.
        Collective.
        """
        self.comm, self.particles, self.bond_system, self.limits = comm, particles, bond_system, limits
        self.lists = [pairs for pairs, _ in bond_system.lists()]
        self.owned = particles.owned
        self.whole = _largest_of_body(comm, bond_system.weights.determinant, particles.owned_rows("body"))
        self.family = self._families(np.arange(self.owned))
        self._room = [np.empty((64, 2), np.int64) for _ in self.lists]
        particles.declare(Field("damage", 1, "1", shown=True))
        particles.declare(Field("resistance", 1, "1", ghosts="forward", message="motion"), resistance)
        words = self._word_count()
        particles.declare(Field("broken_bonds", words, "bits", checkpointed=True, whole=True, layout=Rows(words)))

    def _word_count(self) -> int:
        """Words of bits a particle, for the largest family on any rank."""
        count = np.zeros(self.owned, np.int64)
        self._count(self._slots(np.arange(self.owned)), count)
        return -(-int(maximum(self.comm, int(count.max(initial=1)))) // bond_state.BITS)

    @property
    def damage(self) -> np.ndarray:
        """Damage (owned,)."""
        return self.particles.owned_rows("damage")

    @property
    def resistance(self) -> np.ndarray:
        """Resistance (rows,), ghosts behind."""
        return self.particles["resistance"]

    @property
    def words(self) -> np.ndarray:
        """Bits (owned, words) of the broken bonds."""
        return self.particles.storage("broken_bonds")[: self.owned]

    def introduce(self, patches: list[Any]) -> None:
        """Break the bonds that cross cracks, `methods.peridynamics.bond_damage_kernels.Patch`."""
        for patch in patches:
            failed = self._collect(bond_damage.find_crossing, patch)
            if failed is not None:
                self.cut(failed)

    def inspect(self, criterion: Any) -> Failed | None:
        """The bonds that fail a criterion (see `methods.peridynamics.bond_damage_kernels`); None when there are none on
        this rank.
        """
        return self._collect(bond_damage.find_failed, criterion)

    def _collect(self, find: Any, what: Any) -> Failed | None:
        rows, touched, kinematics = [], [], self.particles.storage("kinematics")
        for number, pairs in enumerate(self.lists):
            count = find(self.bond_system.space, pairs, kinematics, what, self._room[number])
            if count > len(self._room[number]):
                self._room[number] = np.empty((2 * count, 2), np.int64)
                find(self.bond_system.space, pairs, kinematics, what, self._room[number])
            rows.append(self._room[number][:count])
            touched.append(rows[-1][:, 0])
            if mutual(pairs):
                touched.append(pairs.neighbour[rows[-1][:, 1]].astype(np.int64))
        particles = np.unique(np.concatenate(touched))
        return Failed(rows, particles) if len(particles) else None

    def cut(self, failed: Failed) -> None:
        """Break bonds, let particles die of it, and bring the shape tensors up to date."""
        for found, pairs in zip(failed.rows, self.lists):
            bond_damage.cut(found, pairs)
        self._refresh(failed.particles)

    def _refresh(self, particles: np.ndarray) -> None:
        """What follows from the bonds of some owned particles."""
        weights = self.bond_system.weights
        weights.refresh(self.bond_system, particles)
        self.damage[particles] = 1.0 - self._families(particles) / self.family[particles]
        dies = weights.determinant[particles] < (1.0 - _SLACK) * self.limits.determinant * self.whole[particles]
        dies |= self.damage[particles] > self.limits.damage + _SLACK
        self.resistance[particles[dies]] = _DEAD
        weights.inverse_shape[particles[self.resistance[particles] < 0.0]] = 0.0

    def _families(self, particles: np.ndarray) -> np.ndarray:
        """Volume [m^3] of the neighbours that owned particles are bonded to, summed in an order that never changes."""
        chosen, family = np.zeros(self._local, bool), np.zeros(self._local)
        chosen[particles] = True
        for pairs in self.lists:
            bond_damage.add_families(pairs, chosen, self.bond_system.volume, family)
        return family[particles]

    def broken_pairs(self) -> BrokenPairs:
        """Broken pairs of owned particles, without images."""
        particles = np.flatnonzero(self.damage > 0.0)
        start, source = self._neighbourhoods(particles)
        row, gone = np.repeat(particles, np.diff(start)), np.zeros(len(source), bool)
        other = np.zeros(len(source), np.int64)
        for number, pairs in enumerate(self.lists):
            mine = np.flatnonzero(source[:, 0] == number)
            if images_of(pairs) is None and len(mine):
                place = source[mine, 1]
                gone[mine] = pairs.weight[place] == 0.0
                owner = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start))[place]
                other[mine] = np.where(owner == row[mine], pairs.neighbour[place], owner)
        row, other, X = row[gone], other[gone], self.bond_system.positions
        distance = np.linalg.norm(X[row] - X[other], axis=1)
        return BrokenPairs(row, self.particles["identifier"][other], distance, self.bond_system.volume[other])

    # --- for a restart ----------------------------------------------------------------------------------------

    def pack(self) -> None:
        """Bring the bits of all broken bonds up to date, for a checkpoint."""
        particles = np.flatnonzero(self.damage > 0.0)
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        for number, pairs in enumerate(self.lists):
            mine = source[:, 0] == number
            broken[mine] = pairs.weight[source[mine, 1]] == 0.0
        words = np.zeros((len(particles), self.words.shape[1]), np.int64)
        bond_state.write_bits(start, broken, words)
        self.words[particles] = words

    def unpack(self) -> None:
        """Break the bonds whose bits are set, after the words were put back; ghosts are told with the next motion."""
        particles = np.flatnonzero(self.words.any(axis=1))
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        bond_state.read_bits(start, self.words[particles], broken)
        for number, pairs in enumerate(self.lists):
            mine = broken & (source[:, 0] == number)
            pairs.weight[source[mine, 1]] = 0.0
        self._refresh(particles)

    def take_over(self) -> bool:
        """Break the bonds of the bits of another run; whether both ends of each agree, as they do if its neighbours are
        these.
        """
        taken, of_cracks = self.words.copy(), self.words
        of_cracks[:] = 0
        self.pack()
        known = taken | of_cracks
        self.words[:] = taken
        self.unpack()
        self.pack()
        return not (self.words & ~known).any()

    @property
    def _local(self) -> int:
        """Owned particles and ghosts."""
        return len(self.bond_system.volume)

    def _slots(self, particles: np.ndarray) -> np.ndarray:
        slot = np.full(self._local, -1, np.int64)
        slot[particles] = np.arange(len(particles))
        return slot

    def _count(self, slot: np.ndarray, count: np.ndarray) -> None:
        for pairs in self.lists:
            bond_state.count_neighbours(pairs, slot, count)

    def _neighbourhoods(self, particles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Neighbours of some particles in the order of the bits: row starts (n + 1,), sources (m, 2) list and pair."""
        slot, count = self._slots(particles), np.zeros(len(particles), np.int64)
        self._count(slot, count)
        start = np.concatenate(([0], np.cumsum(count)))
        key, source, cursor = np.empty(start[-1], np.int64), np.empty((start[-1], 2), np.int64), start[:-1].copy()
        identifier = self.particles.storage("identifier")
        for number, pairs in enumerate(self.lists):
            bond_state.list_neighbours(pairs, number, slot, identifier, cursor, key, source)
        bond_state.sort_neighbours(start, key, source)
        return start, source


def _largest_of_body(comm: Any, values: np.ndarray, body: np.ndarray) -> np.ndarray:
    """For each particle the largest value (n,) in its body, over all ranks; collective."""
    bodies = maximum(comm, int(body.max(initial=0))) + 1
    largest = np.zeros(bodies)
    np.maximum.at(largest, body, values)
    return maximum(comm, largest)[body]
