"""Which bonds of a rank's particles are broken, the particles that fail by it, and the bits of a restart.

A particle whose shape tensor has nearly degenerated, or that has lost most of its neighbours, fails: it bears no stress
from then on, and its remaining bonds break, on all ranks, when bonds are looked at next. Which bonds are broken is all
of the state: what else is here follows from it, to the bit.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import maximum
from parsolid.kernels import kernel
from parsolid.methods.peridynamics.sweeps import BondList, Lists
from parsolid.methods.protocol import BrokenPairs
from parsolid.particles.declaration import Field, Rows

_FAILED = -1.0
# on a lattice a damage may be the limit itself; sums in another order must not decide then
_SLACK = 1e-9
# bits of a word that tell of bonds; keys of neighbours are image codes and, below these, identifiers
_BITS, _IDENTIFIERS = 63, 1 << 52


class Failing(NamedTuple):
    """Bonds that are to break: rows (particle, bond) for each list, and the owned particles (k,) that lose any."""

    rows: list[np.ndarray]
    particles: np.ndarray


class BondDamage:
    """Which bonds of a rank's particles are broken. It declares, for every particle,

    damage        share of the volume of its neighbours that it is no longer bonded to
    bond_limit    the limit of the criterion, negative of failed particles; ghosts have it with the motion
    broken_bonds  words of bits for a restart, as of the last `pack`
    """

    def __init__(self, bonds: Any, limit: np.ndarray, least_determinant: float, largest_damage: float) -> None:
        """bonds: `bonds.Bonds`, all whole; limit (owned,) of particles as they are made; least_determinant, over that
        of a whole neighbourhood, and largest_damage: beyond these a particle fails. Collective.
        """
        from scipy.sparse import csr_array

        self.bonds, self.particles, self.comm, self.owned = bonds, bonds.particles, bonds.comm, bonds.owned
        inner, shape = bonds.lists[0][0], (self.owned, self.owned)
        seconds = csr_array((np.ones(len(inner.weight), bool), inner.neighbour, inner.start), shape).tocsc()
        # row starts (owned + 1,), and the particles that are first ends of bonds of which a particle is the second
        self._seconds = seconds.indptr, seconds.indices
        self.least_determinant, self.largest_damage = least_determinant, largest_damage
        body = self.particles.owned_rows("body")
        largest = np.zeros(maximum(self.comm, int(body.max(initial=0))) + 1)
        np.maximum.at(largest, body, bonds.determinant)
        self.whole = maximum(self.comm, largest)[body]
        self.neighbours = self._volume_of_neighbours(np.arange(self.owned), bonds.lists)
        self._room = [np.empty((64, 2), np.int64) for _ in bonds.lists]
        self.particles.declare(Field("damage", 1, "1", shown=True))
        self.particles.declare(Field("bond_limit", 1, "1", ghosts="forward", message="motion"), limit)
        count = np.zeros(self.owned, np.int64)
        for pairs, _, mutual in bonds.lists:
            count += np.diff(pairs.start)
            if mutual:
                count += np.bincount(pairs.neighbour, minlength=self.owned)
        words = -(-int(maximum(self.comm, int(count.max(initial=1)))) // _BITS)
        bits: dict[str, Any] = {"checkpointed": True, "whole": True, "layout": Rows(words)}
        self.particles.declare(Field("broken_bonds", words, "bits", **bits))

    @property
    def damage(self) -> np.ndarray:
        """Damage (owned,)."""
        return self.particles.owned_rows("damage")

    @property
    def limit(self) -> np.ndarray:
        """Limit (rows,), ghosts behind."""
        return self.particles["bond_limit"]

    @property
    def words(self) -> np.ndarray:
        """Bits (owned, words) of the broken bonds."""
        return self.particles.storage("broken_bonds")[: self.owned]

    def arrays(self) -> list[np.ndarray]:
        return [*self._seconds, self.whole, self.neighbours, *self._room]

    def collect(self, find: Any, *what: Any, of_lists: Any = ()) -> Failing | None:
        """The bonds of all lists that a kernel finds, such as `fracture.find_failed`; None where there are none on this
        rank; of_lists: an argument for each list, or nothing."""
        rows, touched = [], []
        for number, (pairs, images, mutual) in enumerate(self.bonds.lists):
            given = pairs, images, *what, *of_lists[number : number + 1]
            count = find(*given, self._room[number])
            if count > len(self._room[number]):
                self._room[number] = np.empty((2 * count, 2), np.int64)
                find(*given, self._room[number])
            rows.append(self._room[number][:count])
            touched.append(rows[-1][:, 0])
            if mutual:
                touched.append(pairs.neighbour[rows[-1][:, 1]].astype(np.int64))
        return Failing(rows, np.unique(np.concatenate(touched))) if any(map(len, rows)) else None

    def near(self, particles: np.ndarray) -> Lists:
        """The lists with all bonds that some owned particles have now: those with ghosts and images, which are few,
        are whole."""
        lists, (start, _) = self.bonds.lists, self._seconds
        inner, room = lists[0][0], np.zeros((2, self.owned), bool)
        most = sum(int((starts[particles + 1] - starts[particles]).sum()) for starts in (inner.start, start))
        near = BondList(np.zeros_like(inner.start), np.empty(most, inner.neighbour.dtype), np.empty(most))
        copy_near(inner, *self._seconds, particles, *room, near)
        return [(near, None, True), *lists[1:]]

    def cut(self, failing: Failing) -> Lists:
        """Break bonds, let particles fail by it, and bring the shape tensors up to date; what `near` gives then."""
        for rows, (pairs, _, _) in zip(failing.rows, self.bonds.lists):
            pairs.weight[rows[:, 1]] = 0.0
        return self._refresh(failing.particles)

    def _refresh(self, particles: np.ndarray) -> Lists:
        """What follows from the bonds of some owned particles, and the lists near them."""
        self.bonds.leave_out_broken()
        chosen = np.zeros(self.owned, bool)
        chosen[particles] = True
        near = self.near(particles)
        self.bonds.refresh_shapes(chosen, near)
        self.damage[particles] = 1.0 - self._volume_of_neighbours(particles, near) / self.neighbours[particles]
        least = (1.0 - _SLACK) * self.least_determinant * self.whole[particles]
        fails = self.bonds.determinant[particles] < least
        fails |= self.damage[particles] > self.largest_damage + _SLACK
        self.limit[particles[fails]] = _FAILED
        failed = particles[self.limit[particles] < 0.0]
        self.particles.storage("inverse_shape")[:, failed] = 0.0
        return near

    def _volume_of_neighbours(self, particles: np.ndarray, lists: Lists) -> np.ndarray:
        """Volume [m^3] of the neighbours that owned particles are bonded to, summed in an order that never changes;
        lists: with all of their bonds."""
        local = len(self.bonds.positions)
        chosen, volume = np.zeros(local, bool), np.zeros(local)
        chosen[particles] = True
        for pairs, _, mutual in lists:
            add_neighbours(pairs, mutual, chosen, self.bonds.volume, volume)
        return volume[particles]

    def broken_count(self) -> float:
        """This rank's share of the broken bonds; half of those that another rank, or the image, has in a list, too."""
        return sum(
            (1.0 if mutual else 0.5) * np.count_nonzero(pairs.weight == 0.0) for pairs, _, mutual in self.bonds.lists
        )

    def broken_pairs(self) -> BrokenPairs:
        """Broken bonds of owned particles, without images."""
        particles = np.flatnonzero(self.damage > 0.0)
        start, source = self._neighbourhoods(particles)
        row, gone = np.repeat(particles, np.diff(start)), np.zeros(len(source), bool)
        other = np.zeros(len(source), np.int64)
        for number, (pairs, images, _) in enumerate(self.bonds.lists):
            mine = np.flatnonzero(source[:, 0] == number)
            if images is None and len(mine):
                at = source[mine, 1]
                gone[mine] = pairs.weight[at] == 0.0
                owner = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start))[at]
                other[mine] = np.where(owner == row[mine], pairs.neighbour[at], owner)
        row, other, X = row[gone], other[gone], self.bonds.positions
        apart = np.linalg.norm(X[row] - X[other], axis=1)
        return BrokenPairs(row, self.particles["identifier"][other], apart, self.bonds.volume[other])

    # --- for a restart ----------------------------------------------------------------------------------------

    def pack(self) -> None:
        """Bring the bits of all broken bonds up to date, for a checkpoint."""
        particles = np.flatnonzero(self.damage > 0.0)
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        for number, (pairs, _, _) in enumerate(self.bonds.lists):
            mine = source[:, 0] == number
            broken[mine] = pairs.weight[source[mine, 1]] == 0.0
        row, word, bit = places_of_bits(start)
        words = np.zeros((len(particles), self.words.shape[1]), np.int64)
        np.bitwise_or.at(words, (row[broken], word[broken]), np.int64(1) << bit[broken])
        self.words[particles] = words

    def unpack(self) -> None:
        """Break the bonds whose bits are set, after the words were put back; ghosts are told with the next motion."""
        particles = np.flatnonzero(self.words.any(axis=1))
        start, source = self._neighbourhoods(particles)
        row, word, bit = places_of_bits(start)
        broken = (self.words[particles][row, word] >> bit & 1).astype(bool)
        for number, (pairs, _, _) in enumerate(self.bonds.lists):
            mine = broken & (source[:, 0] == number)
            pairs.weight[source[mine, 1]] = 0.0
        self._refresh(particles)

    def take_over(self) -> bool:
        """Break the bonds of the bits of another run; whether both ends of each agree, as they do if its neighbours are
        these."""
        taken, of_cracks = self.words.copy(), self.words
        of_cracks[:] = 0
        self.pack()
        known = taken | of_cracks
        self.words[:] = taken
        self.unpack()
        self.pack()
        return not (self.words & ~known).any()

    def _neighbourhoods(self, particles: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """All neighbours of some particles, broken off or not, in an order that does not depend on ranks: row starts
        (n + 1,), sources (m, 2), which are the list and the bond in it.

        The order is that of (image code + 1, or 0 without a mirror; identifier): bit r of a particle is its r-th.
        """
        slot = np.full(len(self.bonds.positions), -1, np.int64)
        slot[particles] = np.arange(len(particles))
        identifier = self.particles.storage("identifier")
        rows, keys, sources = [], [], []
        for number, (pairs, images, mutual) in enumerate(self.bonds.lists):
            ends = np.repeat(np.arange(len(pairs.start) - 1), np.diff(pairs.start)), pairs.neighbour.astype(np.int64)
            for own, other in (ends, ends[::-1]) if mutual else (ends,):
                bond = np.flatnonzero(slot[own] >= 0)
                code = 0 if images is None else images.code[bond].astype(np.int64) + 1
                rows.append(slot[own[bond]])
                keys.append(code * _IDENTIFIERS + identifier[other[bond]])
                sources.append(np.column_stack((np.full(len(bond), number), bond)))
        row = np.concatenate(rows)
        order = np.lexsort((np.concatenate(keys), row))
        start = np.concatenate(([0], np.cumsum(np.bincount(row, minlength=len(particles)))))
        return start, np.concatenate(sources)[order]


def places_of_bits(start: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Row, word and bit (m,) of each neighbour, of row starts (n + 1,)."""
    row = np.repeat(np.arange(len(start) - 1), np.diff(start))
    number = np.arange(start[-1]) - start[row]
    return row, number // _BITS, number % _BITS


@kernel
def copy_near(bonds, second_start, seconds, particles, chosen, looked_at, near):
    """Copy the bonds of some particles to a list with room for them.

    second_start, seconds: rows of the first ends of the bonds that have a particle as their second; chosen, looked_at
    (owned,) bool: room, False.
    """
    for a in particles:
        chosen[a] = looked_at[a] = True
        for k in range(second_start[a], second_start[a + 1]):
            looked_at[seconds[k]] = True
    count = 0
    for a in range(looked_at.size):
        if looked_at[a]:
            for k in range(bonds.start[a], bonds.start[a + 1]):
                if chosen[a] or chosen[bonds.neighbour[k]]:
                    near.neighbour[count], near.weight[count] = bonds.neighbour[k], bonds.weight[k]
                    count += 1
        near.start[a + 1] = count


@kernel
def add_neighbours(bonds, mutual, chosen, volume, result):
    """Add the volumes [m^3] of the neighbours that chosen (n,) particles are still bonded to, to result (n,)."""
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            if bonds.weight[k] != 0.0:
                if chosen[a]:
                    result[a] += volume[b]
                if mutual is not None and chosen[b]:
                    result[b] += volume[a]
