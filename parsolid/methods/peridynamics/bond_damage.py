"""Damage of a rank's bonds: pre-cracks, failing bonds, dying particles, and the bits of all that for a restart.

Both ends of a bond decide alike (see `methods.peridynamics.bonds`), so that nothing is sent but each particle's resistance, with its
motion. A particle whose shape tensor has nearly degenerated, or that has lost most of its family, dies: it bears no stress from
then on, and its remaining bonds break, on all ranks, at the next inspection. Which bonds are broken is all of the state:
what else is here follows from it, to the bit.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from parsolid.collective import maximum
from parsolid.methods.peridynamics import bond_damage_kernels as bond_damage
from parsolid.methods.peridynamics import bond_state
from parsolid.pairs.layout import Images, PairList
from parsolid.particles.fields import Field

_DEAD = -1.0
# on a lattice a damage may be the limit itself; sums in another order must not decide then
_SLACK = 1e-9


class BondList(NamedTuple):
    """A pair list with what the passes want to know of it; `both` is None for one-sided lists."""

    pairs: PairList
    images: Images | None
    both: bool | None


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
    """Damage on one rank; local = owned and ghosts.

    resistance (local,): the limit of the criterion, negative for the dead; to be exchanged with the motion.
    damage (owned,): share of the family's volume that a particle is no longer bonded to.
    """

    def __init__(self, comm, space, bond_system, kinematics, body, resistance, limits: Limits):
        """bond_system: `bond_system.BondSystem`; body (owned,); resistance (owned,) of particles as they are made. Collective."""
        self.comm, self.space, self.bond_system, self.kinematics, self.limits = (
            comm,
            space,
            bond_system,
            kinematics,
            limits,
        )
        self.lists = [
            BondList(pairs, images, True if both else None) for pairs, images, both, *_ in bond_system.lists()
        ]
        self.owned, local = bond_system.owned, len(bond_system.volume)
        self.whole = _largest_of_body(comm, bond_system.determinant, body)
        self.damage, self.resistance = np.zeros(self.owned), np.zeros(local)
        self.resistance[: self.owned] = resistance
        bond_system.halo.update([self.resistance])
        self.family = self._families(np.arange(self.owned))
        self.words = np.zeros((self.owned, self._word_count()), np.int64)
        self._room = [np.empty((64, 2), np.int64) for _ in self.lists]

    def _word_count(self) -> int:
        """Words of bits a particle, for the largest family on any rank."""
        count = np.zeros(self.owned, np.int64)
        self._count(self._slots(np.arange(self.owned)), count)
        return -(-int(maximum(self.comm, int(count.max(initial=1)))) // bond_state.BITS)

    def declare(self, table) -> None:
        """Add the fields that a restart needs, and the damage."""
        table.add(Field("damage", 1, "1", evolved=True, shown=True), self.damage)
        table.add(Field("resistance", 1, "1", evolved=True, exchanged=True), self.resistance)
        table.add(Field("broken_bonds", self.words.shape[1], "bits", evolved=True, checkpointed=True), self.words)

    def introduce(self, patches: list) -> None:
        """Break the bonds that cross cracks, `methods.peridynamics.bond_damage_kernels.Patch`."""
        for patch in patches:
            failed = self._collect(bond_damage.find_crossing, patch)
            if failed is not None:
                self.cut(failed)

    def inspect(self, criterion) -> Failed | None:
        """The bonds that fail a criterion (see `methods.peridynamics.bond_damage_kernels`); None when there are none on this rank."""
        return self._collect(bond_damage.find_failed, criterion)

    def _collect(self, find, what) -> Failed | None:
        rows, touched = [], []
        for number, (pairs, images, both) in enumerate(self.lists):
            count = find(self.space, pairs, images, self.kinematics, what, self._room[number])
            if count > len(self._room[number]):
                self._room[number] = np.empty((2 * count, 2), np.int64)
                find(self.space, pairs, images, self.kinematics, what, self._room[number])
            rows.append(self._room[number][:count])
            touched.append(rows[-1][:, 0])
            if both is not None:
                touched.append(pairs.neighbour[rows[-1][:, 1]].astype(np.int64))
        particles = np.unique(np.concatenate(touched))
        return Failed(rows, particles) if len(particles) else None

    def cut(self, failed: Failed) -> None:
        """Break bonds, let particles die of it, and bring the shape tensors up to date."""
        for found, bonds in zip(failed.rows, self.lists):
            bond_damage.cut(found, bonds.pairs)
        self._refresh(failed.particles)

    def _refresh(self, particles: np.ndarray) -> None:
        """What follows from the bonds of some owned particles."""
        self.bond_system.refresh_shape(particles)
        self.damage[particles] = 1.0 - self._families(particles) / self.family[particles]
        dies = (
            self.bond_system.determinant[particles] < (1.0 - _SLACK) * self.limits.determinant * self.whole[particles]
        )
        dies |= self.damage[particles] > self.limits.damage + _SLACK
        self.resistance[particles[dies]] = _DEAD
        self.bond_system.inverse_shape[particles[self.resistance[particles] < 0.0]] = 0.0

    def _families(self, particles: np.ndarray) -> np.ndarray:
        """Volume [m^3] of the neighbours that owned particles are bonded to, summed in an order that never changes."""
        chosen, family = np.zeros(len(self.resistance), bool), np.zeros(len(self.resistance))
        chosen[particles] = True
        for pairs, _, both in self.lists:
            bond_damage.add_families(pairs, both, chosen, self.bond_system.volume, family)
        return family[particles]

    # --- for a restart ----------------------------------------------------------------------------------------

    def pack(self) -> None:
        """Bring the bits of all broken bonds up to date, for a checkpoint."""
        particles = np.flatnonzero(self.damage > 0.0)
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        for number, bonds in enumerate(self.lists):
            mine = source[:, 0] == number
            broken[mine] = bonds.pairs.weight[source[mine, 1]] == 0.0
        words = np.zeros((len(particles), self.words.shape[1]), np.int64)
        bond_state.write_bits(start, broken, words)
        self.words[particles] = words

    def unpack(self) -> None:
        """Break the bonds whose bits are set, after the words were put back; collective."""
        particles = np.flatnonzero(self.words.any(axis=1))
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        bond_state.read_bits(start, self.words[particles], broken)
        for number, bonds in enumerate(self.lists):
            mine = broken & (source[:, 0] == number)
            bonds.pairs.weight[source[mine, 1]] = 0.0
        self._refresh(particles)
        self.bond_system.halo.update([self.resistance])

    def _slots(self, particles: np.ndarray) -> np.ndarray:
        slot = np.full(len(self.resistance), -1, np.int64)
        slot[particles] = np.arange(len(particles))
        return slot

    def _count(self, slot: np.ndarray, count: np.ndarray) -> None:
        for pairs, _, both in self.lists:
            bond_state.count_neighbours(pairs, both, slot, count)

    def _neighbourhoods(self, particles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Neighbours of some particles in the order of the bits: row starts (n + 1,), sources (m, 2) list and pair."""
        slot, count = self._slots(particles), np.zeros(len(particles), np.int64)
        self._count(slot, count)
        start = np.concatenate(([0], np.cumsum(count)))
        key, source, cursor = np.empty(start[-1], np.int64), np.empty((start[-1], 2), np.int64), start[:-1].copy()
        identifier = self.bond_system.identifier
        for number, (pairs, images, both) in enumerate(self.lists):
            bond_state.list_neighbours(pairs, images, both, number, slot, identifier, cursor, key, source)
        bond_state.sort_neighbours(start, key, source)
        return start, source


def _largest_of_body(comm, values: np.ndarray, body: np.ndarray) -> np.ndarray:
    """For each particle the largest value (n,) in its body, over all ranks; collective."""
    bodies = maximum(comm, int(body.max(initial=0))) + 1
    largest = np.zeros(bodies)
    np.maximum.at(largest, body, values)
    return maximum(comm, largest)[body]
