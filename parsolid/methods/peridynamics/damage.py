"""Damage: bonds that are broken from the start or fail by a criterion, particles that fail, and the bits of a restart.

Bonds are looked at in every settled state. Breaking some changes the forces everywhere near, and evaluating those anew
takes all ranks; so what a rank has found waits until the ranks have agreed, with the next time step, that some rank
found something. The bonds then break at the beginning of that step, at the displacement at which they were found.

Both ends of a bond decide alike, so that nothing is sent but the limit of each particle, with its motion. A particle
whose shape tensor has nearly degenerated, or that has lost most of its neighbours, fails: it bears no stress from then
on, and its remaining bonds break, on all ranks, when bonds are looked at next. Which bonds are broken is all of the
state: what else is here follows from it, to the bit.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import anywhere, maximum, minimum, raise_together
from parsolid.kernels import exact, inlined, kernel
from parsolid.materials.damage.fracture import breaking_limit
from parsolid.materials.law_functions import law_function
from parsolid.methods.peridynamics.bond_based import BondBasedForces
from parsolid.methods.peridynamics.cracks import distance, find_crossing, patch_of
from parsolid.methods.peridynamics.sweeps import bond_vectors, image_of
from parsolid.methods.protocol import BrokenPairs
from parsolid.particles.declaration import Field, Rows

_FAILED = -1.0
# on a lattice a damage may be the limit itself; sums in another order must not decide then
_SLACK = 1e-9
# a particle with this share of its bonds broken is on a crack: the two sides of a plane cut are damaged by less than a
# half
_ON_CRACK = 0.35
# bits of a word that tell of bonds; keys of neighbours are image codes and, below these, identifiers
_BITS, _IDENTIFIERS = 63, 1 << 52


class Failing(NamedTuple):
    """Bonds that are to break: rows (particle, bond) for each list, and the owned particles (k,) that lose any."""

    rows: list[np.ndarray]
    particles: np.ndarray


class EnergyCriterion(NamedTuple):
    """A stretched bond fails when t . eta/2 exceeds the limit [J/m^6, in the plane J/m^4].

    eta is the change of the bond's vector and t = w [(M_a + M_b) xi + (C_a + C_b)(f_b - f_a)] its force density in the
    latest evaluation. driving: rows of the motion of f; M, C (n, 12 or 4), C zeros without control; volume (n,) [m^3].
    Source: Foster, Silling and Chen, Int. J. Multiscale Comput. Eng. 9 (2011), eq (11).
    """

    driving: np.ndarray
    M: np.ndarray
    C: np.ndarray
    volume: np.ndarray


class StoredEnergyCriterion(NamedTuple):
    """A stretched bond of the bond-based law fails when what it stores, w c s^2 |xi|/2, exceeds the limit as above.

    micromodulus (n,), of which c is the mean of both ends'; volume (n,) [m^3].
    """

    micromodulus: np.ndarray
    volume: np.ndarray


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
        self.bonds, self.particles, self.comm, self.owned = bonds, bonds.particles, bonds.comm, bonds.owned
        self.least_determinant, self.largest_damage = least_determinant, largest_damage
        body = self.particles.owned_rows("body")
        largest = np.zeros(maximum(self.comm, int(body.max(initial=0))) + 1)
        np.maximum.at(largest, body, bonds.determinant)
        self.whole = maximum(self.comm, largest)[body]
        self.neighbours = self._volume_of_neighbours(np.arange(self.owned))
        self._room = [np.empty((64, 2), np.int64) for _ in bonds.lists]
        self.particles.declare(Field("damage", 1, "1", shown=True))
        self.particles.declare(Field("bond_limit", 1, "1", ghosts="forward", message="motion"), limit)
        count = np.zeros(self.owned, np.int64)
        for pairs, _, receivers in bonds.lists:
            count_neighbours(pairs, receivers, np.arange(len(bonds.positions)), count)
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

    def failing(self, criterion: EnergyCriterion | StoredEnergyCriterion | None) -> Failing | None:
        """The bonds that fail by an energy, or without one by their stretch; None when there are none on this rank."""
        self.bonds.fill("displacement", 0, len(self.bonds.positions))
        return self._collect(find_failed, criterion, self.bonds.motion_of("displacement"), self.limit)

    def introduce(self, patches: list[Any]) -> None:
        """Break the bonds that cross some `cracks.Patch`."""
        positions = np.pad(self.bonds.positions, ((0, 0), (0, 3 - self.bonds.d)))
        for patch in patches:
            crossing = self._collect(find_crossing, positions, patch)
            if crossing is not None:
                self.cut(crossing)

    def _collect(self, find: Any, *what: Any) -> Failing | None:
        rows, touched = [], []
        for number, (pairs, images, receivers) in enumerate(self.bonds.lists):
            count = find(pairs, images, *what, self._room[number])
            if count > len(self._room[number]):
                self._room[number] = np.empty((2 * count, 2), np.int64)
                find(pairs, images, *what, self._room[number])
            rows.append(self._room[number][:count])
            touched.append(rows[-1][:, 0])
            if receivers:
                touched.append(pairs.neighbour[rows[-1][:, 1]].astype(np.int64))
        particles = np.unique(np.concatenate(touched))
        return Failing(rows, particles) if len(particles) else None

    def cut(self, failing: Failing) -> None:
        """Break bonds, let particles fail by it, and bring the shape tensors up to date."""
        for rows, (pairs, _, _) in zip(failing.rows, self.bonds.lists):
            pairs.weight[rows[:, 1]] = 0.0
        self._refresh(failing.particles)

    def _refresh(self, particles: np.ndarray) -> None:
        """What follows from the bonds of some owned particles."""
        chosen = np.zeros(self.owned, bool)
        chosen[particles] = True
        self.bonds.refresh_shapes(chosen)
        self.damage[particles] = 1.0 - self._volume_of_neighbours(particles) / self.neighbours[particles]
        least = (1.0 - _SLACK) * self.least_determinant * self.whole[particles]
        fails = self.bonds.determinant[particles] < least
        fails |= self.damage[particles] > self.largest_damage + _SLACK
        self.limit[particles[fails]] = _FAILED
        failed = particles[self.limit[particles] < 0.0]
        self.particles.storage("inverse_shape")[:, failed] = 0.0

    def _volume_of_neighbours(self, particles: np.ndarray) -> np.ndarray:
        """Volume [m^3] of the neighbours that owned particles are bonded to, summed in an order that never changes."""
        local = len(self.bonds.positions)
        chosen, volume = np.zeros(local, bool), np.zeros(local)
        chosen[particles] = True
        for pairs, _, receivers in self.bonds.lists:
            add_neighbours(pairs, receivers, chosen, self.bonds.volume, volume)
        return volume[particles]

    def broken_count(self) -> float:
        """This rank's share of the broken bonds."""
        return sum((1.0 if one[2] else 0.5) * np.count_nonzero(one[0].weight == 0.0) for one in self.bonds.lists)

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
        words = np.zeros((len(particles), self.words.shape[1]), np.int64)
        write_bits(start, broken, words)
        self.words[particles] = words

    def unpack(self) -> None:
        """Break the bonds whose bits are set, after the words were put back; ghosts are told with the next motion."""
        particles = np.flatnonzero(self.words.any(axis=1))
        start, source = self._neighbourhoods(particles)
        broken = np.zeros(len(source), bool)
        read_bits(start, self.words[particles], broken)
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
        slot, count = np.full(len(self.bonds.positions), -1, np.int64), np.zeros(len(particles), np.int64)
        slot[particles] = np.arange(len(particles))
        for pairs, _, receivers in self.bonds.lists:
            count_neighbours(pairs, receivers, slot, count)
        start = np.concatenate(([0], np.cumsum(count)))
        key, source, cursor = np.empty(start[-1], np.int64), np.empty((start[-1], 2), np.int64), start[:-1].copy()
        identifier = self.particles.storage("identifier")
        for number, (pairs, images, receivers) in enumerate(self.bonds.lists):
            list_neighbours(pairs, images, receivers, number, slot, identifier, cursor, key, source)
        order = np.lexsort((key, np.repeat(np.arange(len(particles)), count)))
        return start, source[order]


class Fracture:
    """Damage of a scene with pre-cracks or with a criterion by which bonds fail.

    settings: those of the criterion, or None; found: whether this rank has found bonds that fail in the last state it
    looked at; found_anywhere: whether any rank had, told before the next step; breaks: how often bonds have broken, the
    same on all ranks.
    """

    def __init__(self, comm: Any, scene: Any, particle_set: Any, forces: Any) -> None:
        """particle_set: this rank's sorted particles; forces: of `forces.build_forces`, all bonds whole. Collective."""
        self.comm, self.forces, self.settings = comm, forces, scene.method.damage
        self.positions, settings = particle_set.position, scene.method.damage
        self.found_anywhere, self.breaks = False, 0
        self.pending: Any = None
        limits = (0.0, 1.0) if settings is None else (settings.least_shape_ratio, settings.largest_damage)
        self.damage = BondDamage(forces.bonds, _limits_of(scene, particle_set), *limits)
        lower = minimum(comm, self.positions.min(axis=0, initial=np.inf))
        upper = maximum(comm, self.positions.max(axis=0, initial=-np.inf))
        self.patches = [patch_of(crack, lower, upper) for crack in scene.method.pre_cracks]
        self.damage.introduce(self.patches)
        self._initial, self._cut_at_start = self.damage.damage.copy(), self.damage.broken_count()

    # --- in a step --------------------------------------------------------------------------------------------

    @property
    def found(self) -> bool:
        """Whether this rank has found bonds that fail."""
        return self.pending is not None

    def look(self) -> None:
        """Look for bonds that fail in the state just evaluated."""
        if self.settings is None:
            return
        criterion = self._energy_criterion() if self.settings.criterion == "energy" else None
        self.pending = self.damage.failing(criterion)

    def _energy_criterion(self) -> EnergyCriterion | StoredEnergyCriterion:
        """Over the arrays of the latest evaluation; all bodies relax alike."""
        forces, bonds, M = self.forces, self.forces.bonds, self.forces.particles.storage("bond_stress")
        if isinstance(forces, BondBasedForces):
            return StoredEnergyCriterion(forces.particles["micromodulus"], bonds.volume)
        memory, control = forces.memories[0], forces.controls[0]
        bonds.fill(memory.field, 0, len(bonds.positions))
        control = np.zeros_like(M) if control is None else control
        return EnergyCriterion(bonds.motion_of(memory.field), M, control, bonds.volume)

    def ranks_find(self) -> bool:
        """Look, and tell whether any rank has found some; collective."""
        self.look()
        return anywhere(self.comm, self.found)

    def break_what_ranks_found(self, ledger: Any) -> None:
        """Break what ranks have found, before the next step moves anything; collective where they have."""
        if self.found_anywhere:
            self.break_bonds(ledger)

    def break_bonds(self, ledger: Any) -> None:
        """Break what any rank has found, and evaluate the forces of the state anew; collective."""
        self.breaks += 1
        stored = self.forces.stored_energy()
        if self.pending is not None:
            self.damage.cut(self.pending)
            self.pending = None
        self.forces.evaluate_anew()
        ledger.add_term("dissipation_fracture", stored - self.forces.stored_energy())

    def take_over(self) -> None:
        """Break the bonds of the state of another run; collective.

        Raises SolverError, on all ranks, where its particles had other neighbours.
        """
        fault = "initial: expected the bonds of the results (their horizon and bodies), found particles with other ones"
        raise_together(self.comm, None if self.damage.take_over() else fault)

    # --- for the output ---------------------------------------------------------------------------------------

    def broken_bonds(self) -> float:
        """This rank's share of the bonds that have broken since the start, those of pre-cracks not among them."""
        return self.damage.broken_count() - self._cut_at_start

    def tip(self) -> np.ndarray:
        """Reference position (d,) [m] of the crack's tip, of the particles on grown cracks the farthest from all
        pre-cracks.

        Of several equally far the last by its coordinates; NaN without any. Collective, the same on any number of
        ranks.
        """
        damage = self.damage.damage
        rows = np.flatnonzero((damage > _ON_CRACK) & (damage > self._initial))
        mine = []
        if len(rows) and self.patches:
            far = np.min([distance(patch, self.positions[rows]) for patch in self.patches], axis=0)
            mine = [(float(far[i]), *map(float, self.positions[rows[i]])) for i in np.flatnonzero(far == far.max())]
        found = [one for piece in self.comm.allgather(mine) for one in piece]
        return np.array(max(found)[1:]) if found else np.full(self.positions.shape[1], np.nan)


def fracture_of(comm: Any, scene: Any, particle_set: Any, forces: Any) -> Fracture | None:
    """The damage of a scene, None where all bonds are whole and stay so; as the constructor of `Fracture`."""
    if scene.method.damage is None and not scene.method.pre_cracks:
        return None
    return Fracture(comm, scene, particle_set, forces)


def _limits_of(scene: Any, particle_set: Any) -> np.ndarray:
    """The limit of the criterion (n,) for each particle, infinite without one."""
    settings, spacing = scene.method.damage, particle_set.spacing.max(axis=1)
    result = np.full(len(particle_set), np.inf)
    if settings is None:
        return result
    state = scene.method.state(scene.dimension)
    for number, body in enumerate(scene.bodies):
        for one in np.unique(spacing[particle_set.body == number]):
            rows, horizon = (particle_set.body == number) & (spacing == one), scene.method.horizon(one)
            result[rows] = breaking_limit(settings, body.material, state, scene.method.influence, horizon)
    return result


# --- kernels -------------------------------------------------------------------------------------------------------


# without contraction, so that a product rounds alike from both ends of a bond
@exact
def find_failed(bonds, images, criterion, motion, limit, found):
    """List the intact bonds that are to break as rows (particle a, bond k) of found (capacity, 2) int64; returns how
    many.

    A bond fails by its criterion, with the lesser limit (n,) of its ends, see `exceeds`. When they are more than the
    capacity, the first that fit are listed. A bond with a mirror image is looked at from both of its sides, (a, b') and
    (b, a').
    """
    count = 0
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            w, b = bonds.weight[k], bonds.neighbour[k]
            if w == 0.0:
                continue
            Q, R, T = image_of(images, k)
            sides = 1 if images is None else 2
            least = min(limit[a], limit[b])
            # of a failed particle
            fails = least < 0.0
            for side in range(sides):
                one, other = (a, b) if side == 0 else (b, a)
                fails = fails or exceeds(criterion, motion, w, Q, R, T, one, other, least)
            if fails:
                if count < found.shape[0]:
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@law_function
def exceeds(criterion, motion, weight, Q, R, T, a, b, limit):
    """Whether a bond, seen from a, is beyond the limit of a criterion; without one that of (|y| - |xi|)/|xi|.

    Source: Silling and Askari, Comput. Struct. 83 (2005), eqs (23) to (27).
    """


@inlined
def squares(motion, Q, R, T, a, b):
    """|y|^2 and |xi|^2 of a bond [m^2]."""
    x, u = bond_vectors(motion, Q, R, T, a, b)
    y = (x[0] + u[0], x[1] + u[1], x[2] + u[2])
    return y[0] * y[0] + y[1] * y[1] + y[2] * y[2], x[0] * x[0] + x[1] * x[1] + x[2] * x[2]


@exceeds.of(None)
def _stretched(criterion, motion, weight, Q, R, T, a, b, limit):
    present, reference = squares(motion, Q, R, T, a, b)
    return present > (1.0 + limit) * (1.0 + limit) * reference


@exceeds.of(StoredEnergyCriterion)
def _stored(criterion, motion, weight, Q, R, T, a, b, limit):
    present, reference = squares(motion, Q, R, T, a, b)
    change = present**0.5 - reference**0.5
    # w c s^2 |xi|/2
    energy = 0.25 * weight * (criterion.micromodulus[a] + criterion.micromodulus[b]) * change * change
    # the product of the volumes first, so that it rounds alike from both ends
    volumes = criterion.volume[a] * criterion.volume[b]
    return change > 0.0 and energy > limit * volumes * reference**0.5


@exceeds.of(EnergyCriterion)
def _strained(criterion, motion, weight, Q, R, T, a, b, limit):
    x, u = bond_vectors(motion, Q, R, T, a, b)
    _, f = bond_vectors(criterion.driving, Q, R, T, a, b)
    d = 2 if motion.shape[1] == 4 else 3
    column, work = 2 if d == 2 else 4, 0.0
    for j in range(d):
        for i in range(d):
            at = j * column + i
            work += u[i] * (criterion.M[a, at] + Q[i] * R[j] * criterion.M[b, at]) * x[j]
            work += u[i] * (criterion.C[a, at] + Q[i] * Q[j] * criterion.C[b, at]) * f[j]
    present, reference = squares(motion, Q, R, T, a, b)
    volumes = criterion.volume[a] * criterion.volume[b]
    return present > reference and 0.5 * weight * work > limit * volumes


@kernel
def add_neighbours(bonds, receivers, chosen, volume, result):
    """Add the volumes [m^3] of the neighbours that chosen (n,) particles are still bonded to, to result (n,)."""
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            if bonds.weight[k] != 0.0:
                if chosen[a]:
                    result[a] += volume[b]
                if b < receivers and chosen[b]:
                    result[b] += volume[a]


@kernel
def count_neighbours(bonds, receivers, slot, count):
    """Add the number of neighbours, broken off or not, of particles with a slot (n,), others have -1, to count."""
    for a in range(bonds.start.shape[0] - 1):
        if slot[a] >= 0:
            count[slot[a]] += bonds.start[a + 1] - bonds.start[a]
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b = bonds.neighbour[k]
            if b < receivers and slot[b] >= 0:
                count[slot[b]] += 1


@kernel
def list_neighbours(bonds, images, receivers, number, slot, identifier, cursor, key, source):
    """Append key (m,) and source (m, 2), the number of the list and the bond in it, of each neighbour at cursor
    (slots,)."""
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            b, code = bonds.neighbour[k], 0
            if images is not None:
                code = images.code[k] + 1
            if slot[a] >= 0:
                at = cursor[slot[a]]
                key[at], source[at, 0], source[at, 1] = code * _IDENTIFIERS + identifier[b], number, k
                cursor[slot[a]] += 1
            if b < receivers and slot[b] >= 0:
                at = cursor[slot[b]]
                key[at], source[at, 0], source[at, 1] = code * _IDENTIFIERS + identifier[a], number, k
                cursor[slot[b]] += 1


@kernel
def write_bits(start, broken, words):
    """Bits of words (slots, w) int64 from broken (m,), in the order of the rows."""
    words[:] = 0
    for i in range(start.shape[0] - 1):
        for r in range(start[i + 1] - start[i]):
            if broken[start[i] + r]:
                words[i, r // _BITS] |= np.int64(1) << (r % _BITS)


@kernel
def read_bits(start, words, broken):
    """The inverse of `write_bits`."""
    for i in range(start.shape[0] - 1):
        for r in range(start[i + 1] - start[i]):
            broken[start[i] + r] = (words[i, r // _BITS] >> (r % _BITS)) & 1
