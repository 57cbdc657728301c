"""When bonds of peridynamics break: pre-cracks, the criterion by which bonds fail, and the tip of a crack.

Bonds are looked at in every settled state. Breaking some changes the forces everywhere near, and evaluating those anew
takes all ranks; so what a rank has found waits until the ranks have agreed, with the next time step, that some rank
found something. The bonds then break at the beginning of that step, at the displacement at which they were found. Both
ends of a bond decide alike, so that nothing is sent but the limit of each particle, with its motion.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import anywhere, maximum, minimum, raise_together
from parsolid.kernels import exact, inlined, kernel
from parsolid.materials.damage.fracture import breaking_limit
from parsolid.materials.law_functions import law_function
from parsolid.methods.peridynamics.bond_based import BondBasedForces
from parsolid.methods.peridynamics.bond_damage import BondDamage, Failing
from parsolid.methods.peridynamics.cracks import Patch, distance, find_crossing, patch_of
from parsolid.methods.peridynamics.sweeps import bond_vectors, image_of

# so many particles that follow one another are looked at or spared together
_BLOCK = 64
# rooms are found anew when blocks were looked at as often as in so many checks of all; it takes a little more than one
_CHECKS = 3
# a particle with this share of its bonds broken is on a crack: the two sides of a plane cut are damaged by less than a
# half
_ON_CRACK = 0.35


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


class Fracture:
    """Damage of a scene with pre-cracks or with a criterion by which bonds fail.

    settings: those of the criterion, or None; found: whether this rank has found bonds that fail in the last state it
    looked at; found_anywhere: whether any rank had, told before the next step; breaks: how often bonds have broken;
    given [J]: by how much stored energy has risen in steps in which breaking raised it; the same on all ranks.
    """

    def __init__(self, comm: Any, scene: Any, particle_set: Any, forces: Any) -> None:
        """particle_set: this rank's sorted particles; forces: of `forces.build_forces`, all bonds whole. Collective."""
        self.comm, self.forces, self.settings = comm, forces, scene.method.damage
        self.positions, settings = particle_set.position, scene.method.damage
        self.found_anywhere, self.breaks, self.given = False, 0, 0.0
        self.pending: Any = None
        limits = (0.0, 1.0) if settings is None else (settings.least_shape_ratio, settings.largest_damage)
        self.damage = BondDamage(forces.bonds, _limits_of(scene, particle_set), *limits)
        lower = minimum(comm, self.positions.min(axis=0, initial=np.inf))
        upper = maximum(comm, self.positions.max(axis=0, initial=-np.inf))
        self.patches = [patch_of(crack, lower, upper) for crack in scene.method.pre_cracks]
        break_across(self.damage, self.patches)
        self._initial, self._cut_at_start = self.damage.damage.copy(), self.damage.broken_count()
        self.spared = SparedBlocks(forces.bonds)

    # --- in a step --------------------------------------------------------------------------------------------

    @property
    def found(self) -> bool:
        return self.pending is not None

    def look(self) -> None:
        """Look for bonds that fail in the state just evaluated."""
        if self.settings is None:
            return
        forces, bonds = self.forces, self.forces.bonds
        criterion: EnergyCriterion | StoredEnergyCriterion | None = None
        if self.settings.criterion == "energy" and isinstance(forces, BondBasedForces):
            criterion = StoredEnergyCriterion(forces.particles["micromodulus"], bonds.volume)
        elif self.settings.criterion == "energy":
            # all bodies relax alike
            memory, control, M = forces.memories[0], forces.controls[0], forces.particles.storage("bond_stress")
            bonds.fill(memory.field, 0, len(bonds.positions))
            control = np.zeros_like(M) if control is None else control
            criterion = EnergyCriterion(bonds.motion_of(memory.field), M, control, bonds.volume)
        spared = None if isinstance(criterion, EnergyCriterion) else self.spared.now(criterion, self.damage.limit)
        self.pending = failing_bonds(self.damage, criterion, spared)

    def ranks_find(self) -> bool:
        """Look, and tell whether any rank has found some; collective."""
        self.look()
        return anywhere(self.comm, self.found)

    def break_bonds(self, ledger: Any) -> None:
        """Break what any rank has found, and correct the forces of the state; collective."""
        self.breaks += 1
        released = self.forces.break_bonds(self.damage, self.pending)
        ledger.add_term("fracture_dissipation", released)
        self.given += max(-self.comm.allreduce(released), 0.0)
        self.pending = None

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
        far = [distance(patch, self.positions[rows]) for patch in self.patches]
        left = np.column_stack((np.min(far, axis=0), self.positions[rows])) if far else np.zeros((0, 1))
        result = np.full(1 + self.positions.shape[1], np.nan)
        for column in range(len(result) if far else 0):
            result[column] = maximum(self.comm, float(left[:, column].max(initial=-np.inf)))
            left = left[left[:, column] == result[column]]
        return np.where(np.isfinite(result[1:]), result[1:], np.nan)


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


def break_across(damage: BondDamage, patches: list[Patch]) -> None:
    """Break the bonds that cross some cracks."""
    positions = np.pad(damage.bonds.positions, ((0, 0), (0, 3 - damage.bonds.d)))
    for patch in patches:
        crossing = damage.collect(find_crossing, positions, patch)
        if crossing is not None:
            damage.cut(crossing)


class SparedBlocks:
    """Blocks of owned particles whose bonds with owned particles need not be looked at: by how much particles near
    have moved beside one another since they were seen, no bond can have been elongated to failure.

    looked_at: how many blocks were to be looked at since the rooms were found.
    """

    def __init__(self, bonds: Any) -> None:
        self.bonds, blocks = bonds, -(-bonds.owned // _BLOCK)
        # by how much [m] bonds may be elongated, from the displacement that was seen then
        self._room, self._seen = np.full(blocks, -1.0), bonds.particles.storage("displacement")[:, :0]
        self._failed, self.looked_at = np.zeros(0, bool), 0
        self._reach, self._boxes = np.empty((blocks, 2), np.int64), np.empty((blocks, 2, len(self._seen)))
        self._spared = [np.zeros(blocks, bool) for _ in bonds.lists]
        if blocks:
            find_reach(bonds.inner, self._reach)

    def now(self, criterion: StoredEnergyCriterion | None, limit: np.ndarray) -> list[np.ndarray]:
        """Which blocks (blocks,) are spared of each list, those with ghosts and images looked at as a whole; limit
        (n,), which only changes where particles fail."""
        bonds, failed, displacement = self.bonds, limit < 0.0, self.bonds.particles.storage("displacement")
        if self.looked_at >= _CHECKS * len(self._room) or not np.array_equal(failed, self._failed):
            bonds.fill("displacement", 0, len(bonds.positions))
            motion = bonds.motion_of("displacement")
            find_rooms(bonds.inner, True if bonds.d == 2 else None, criterion, motion, limit, self._room)
            self._seen, self._failed, self.looked_at = displacement[:, : bonds.owned].copy(), failed, 0
        spared = self._spared[0]
        spare(displacement, self._seen, self._reach, self._room, self._boxes, spared)
        self.looked_at += len(spared) - int(np.count_nonzero(spared))
        return self._spared


def failing_bonds(
    damage: BondDamage, criterion: EnergyCriterion | StoredEnergyCriterion | None, spared: Any = None
) -> Failing | None:
    """The bonds that fail by an energy, or without one by their stretch; None when there are none on this rank; spared:
    see `SparedBlocks.now`."""
    bonds, plane = damage.bonds, True if damage.bonds.d == 2 else None
    bonds.fill("displacement", 0, len(bonds.positions))
    spared = spared or [np.zeros(-(-damage.owned // _BLOCK), bool)] * len(bonds.lists)
    given = plane, criterion, bonds.motion_of("displacement"), damage.limit
    return damage.collect(find_failed, *given, of_lists=spared)


@kernel
def find_reach(bonds, reach):
    """Fill reach (blocks, 2): the first and last block with neighbours of each, itself among them."""
    for i in range(reach.shape[0]):
        reach[i, 0] = reach[i, 1] = i
    for a in range(bonds.start.shape[0] - 1):
        for k in range(bonds.start[a], bonds.start[a + 1]):
            i, j = a // _BLOCK, np.int64(bonds.neighbour[k]) // _BLOCK
            reach[i, 0], reach[i, 1] = min(reach[i, 0], j), max(reach[i, 1], j)


@kernel
def spare(displacement, seen, reach, room, boxes, spared):
    """Fill spared (blocks,): whether the box of all displacements (d, n) since those seen, of the particles in reach
    of a block, is smaller than its room; boxes (blocks, 2, d): place for those of the blocks."""
    boxes[:, 0], boxes[:, 1] = np.inf, -np.inf
    for c in range(seen.shape[0]):
        for a in range(seen.shape[1]):
            change, i = displacement[c, a] - seen[c, a], a // _BLOCK
            # what is not a number is spared nowhere
            change = np.inf if np.isnan(change) else change
            boxes[i, 0, c], boxes[i, 1, c] = min(boxes[i, 0, c], change), max(boxes[i, 1, c], change)
    for i in range(spared.size):
        square = 0.0
        for c in range(seen.shape[0]):
            lower, upper = np.inf, -np.inf
            for j in range(reach[i, 0], reach[i, 1] + 1):
                lower, upper = min(lower, boxes[j, 0, c]), max(upper, boxes[j, 1, c])
            square += (upper - lower) * (upper - lower)
        spared[i] = square**0.5 < room[i]


@kernel
def find_rooms(bonds, plane, criterion, motion, limit, room):
    """Fill room (blocks,): by how much [m] every intact bond of a block may be elongated before it fails, whatever its
    direction."""
    room[:] = np.inf
    for a in range(bonds.start.shape[0] - 1):
        least = room[a // _BLOCK]
        for k in range(bonds.start[a], bonds.start[a + 1]):
            w, b = bonds.weight[k], bonds.neighbour[k]
            if w != 0.0:
                present, reference = squares(plane, motion, None, k, a, b)
                left = reference**0.5 - present**0.5
                left += failing_elongation(criterion, w, a, b, reference**0.5, min(limit[a], limit[b]))
                # less what may be rounded
                least = min(least, left - 1e-9 * reference**0.5)
        room[a // _BLOCK] = least


# without contraction, so that a product rounds alike from both ends of a bond
@exact
def find_failed(bonds, images, plane, criterion, motion, limit, spared, found):
    """List the intact bonds that are to break as rows (particle a, bond k) of found (capacity, 2) int64; returns how
    many. Blocks of particles that are spared (blocks,) are left out.

    A bond fails by its criterion, with the lesser limit (n,) of its ends, see `exceeds`. When they are more than the
    capacity, the first that fit are listed. A bond with a mirror image is looked at from both of its sides, (a, b') and
    (b, a').
    """
    count = 0
    for a in range(bonds.start.shape[0] - 1):
        if spared[a // _BLOCK]:
            continue
        for k in range(bonds.start[a], bonds.start[a + 1]):
            w, b = bonds.weight[k], bonds.neighbour[k]
            least = min(limit[a], limit[b])
            fails = exceeds(criterion, plane, motion, images, w, k, a, b, least)
            if images is not None:
                fails |= exceeds(criterion, plane, motion, images, w, k, b, a, least)
            if fails and w != 0.0:
                if count < found.shape[0]:
                    found[count, 0], found[count, 1] = a, k
                count += 1
    return count


@law_function
def exceeds(criterion, plane, motion, images, weight, k, a, b, limit):
    """Whether a bond, seen from a, is beyond the limit of a criterion; without one that of (|y| - |xi|)/|xi|.

    With a limit of -1, that of failed particles, every bond is.
    Source: Silling and Askari, Comput. Struct. 83 (2005), eqs (23) to (27).
    """


@inlined
def squares(plane, motion, images, k, a, b):
    """|y|^2 and |xi|^2 of a bond [m^2]."""
    x, u = bond_vectors(plane, motion, images, k, a, b)
    y = (x[0] + u[0], x[1] + u[1], x[2] + u[2])
    return y[0] * y[0] + y[1] * y[1] + y[2] * y[2], x[0] * x[0] + x[1] * x[1] + x[2] * x[2]


@exceeds.of(None)
def _stretched(criterion, plane, motion, images, weight, k, a, b, limit):
    present, reference = squares(plane, motion, images, k, a, b)
    return present > (1.0 + limit) * (1.0 + limit) * reference


@exceeds.of(StoredEnergyCriterion)
def _stored(criterion, plane, motion, images, weight, k, a, b, limit):
    present, reference = squares(plane, motion, images, k, a, b)
    change = present**0.5 - reference**0.5
    # w c s^2 |xi|/2
    energy = 0.25 * weight * (criterion.micromodulus[a] + criterion.micromodulus[b]) * change * change
    # the product of the volumes first, so that it rounds alike from both ends
    volumes = criterion.volume[a] * criterion.volume[b]
    return limit < 0.0 or (change > 0.0 and energy > limit * volumes * reference**0.5)


@law_function
def failing_elongation(criterion, weight, a, b, reference, limit):
    """The elongation [m] at which a bond of some length [m] fails, of criteria that depend on it alone."""


@failing_elongation.of(None)
def _most_of_stretch(criterion, weight, a, b, reference, limit):
    return limit * reference


@failing_elongation.of(StoredEnergyCriterion)
def _most_of_energy(criterion, weight, a, b, reference, limit):
    volumes = criterion.volume[a] * criterion.volume[b]
    energy = max(limit, 0.0) * volumes * reference
    return (4.0 * energy / (weight * (criterion.micromodulus[a] + criterion.micromodulus[b]))) ** 0.5


@exceeds.of(EnergyCriterion)
def _strained(criterion, plane, motion, images, weight, k, a, b, limit):
    x, u = bond_vectors(plane, motion, images, k, a, b)
    _, f = bond_vectors(plane, criterion.driving, images, k, a, b)
    Q, R, _ = image_of(images, k)
    d, column, work = 2 if plane is not None else 3, 2 if plane is not None else 4, 0.0
    for j in range(d):
        for i in range(d):
            at = j * column + i
            work += u[i] * (criterion.M[a, at] + Q[i] * R[j] * criterion.M[b, at]) * x[j]
            work += u[i] * (criterion.C[a, at] + Q[i] * Q[j] * criterion.C[b, at]) * f[j]
    present, reference = squares(plane, motion, images, k, a, b)
    volumes = criterion.volume[a] * criterion.volume[b]
    return limit < 0.0 or (present > reference and 0.5 * weight * work > limit * volumes)
