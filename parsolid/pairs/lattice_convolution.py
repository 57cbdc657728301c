"""The two sweeps over all bonds of a lattice without lists of bonds, for weights that are the same for all.

Where particles a stand on places of one lattice and w = 1, both sweeps (see `methods.peridynamics.sweeps`) are sums
over offsets o of the lattice, with h o for a bond,

    sum_b V_b (f_b - f_a) (x) xi  =  sum_o V f(a + o) (x) h o  -  f_a (x) sum_o V(a + o) h o,
    sum_b V_b [(M_a + M_b) xi + (C_a + C_b)(f_b - f_a)]
        =  sum_o [V M(a + o) h o + V C f(a + o)]  +  M_a sum_o V(a + o) h o  +  C_a sum_b V_b (f_b - f_a)
           -  sum_o V C(a + o) f_a,

with V = 0 where a place is empty. The offsets are rows of bonds along the fast axis, of some lengths: the sum over such
a row about a place, and the sum of values times their distance, are found once for each length, and given to all places
that see the row, 29 in place of 122 offsets with a horizon of three spacings. Four places side by side in memory are
taken at once. Fields are less that of one particle, so that a body that is moved has the forces of one at rest.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import inlined, kernel
from parsolid.pairs.rows_of_four import add, add_scaled, load_row, store_row, subtract

# fewer particles of a rank are done as fast by their lists
_FEWEST = 1000
# as are those with fewer bonds each, as in the plane with a horizon of three spacings
_FEWEST_BONDS = 60
# of the places of the lattice's box, what particles take at least
_FULLEST = 0.4
# of the coordinates, how far a particle may stand beside its place: rounding
_ASTRAY = 4e-15
NOTHING = (0.0, 0.0, 0.0, 0.0)


class Offsets(NamedTuple):
    """Offsets within the horizon as rows along the fast axis, by how far apart the planes of both places are: second
    parts from -reach (apart,) to reach, int64; half (apart, ...) int64 of a row's length, second part 0 in the
    middle."""

    reach: np.ndarray
    half: np.ndarray


class Box(NamedTuple):
    """Places: rows (first, second) of `room` places, up to a multiple of four, with `lead` empty ones before and
    behind; halves: of rows of offsets, from 0; wanted (rows,): those with particles that receive; planes: whether there
    are several, so that offsets have a first part."""

    first: int
    second: int
    room: int
    lead: int
    halves: int
    wanted: np.ndarray
    planes: bool


class Placed(NamedTuple):
    """Of particles, ghosts behind: place (n,) int64 among all of the box; volume (n,). Of owned ones: target (owned,)
    int64 among places without leads, and sums over offsets, themselves among them: volumes (owned,), and moments
    (owned, 3) of volumes along first, second and fast axis, in spacings.

    axis (d,) int64: which of these three an axis of space is; spacing (d,) [m].
    """

    place: np.ndarray
    target: np.ndarray
    volume: np.ndarray
    volumes: np.ndarray
    moments: np.ndarray
    axis: np.ndarray
    spacing: np.ndarray


class PlacedImages(NamedTuple):
    """Mirror images on places of their own: source (m,) int64, the particle's row; origin, place (m,) int64 of particle
    and image; signs Q, reflections R (m, d)."""

    source: np.ndarray
    origin: np.ndarray
    place: np.ndarray
    signs: np.ndarray
    reflections: np.ndarray


# --- sums over rows of bonds ----------------------------------------------------------------------------------------


@inlined
def row_of_offsets(box, offsets, apart, y, step):
    """Where the sums about row y + step stand that an offset of this second part takes."""
    return (y + step) * box.halves + offsets.half[apart, step + offsets.half.shape[1] // 2]


@kernel
def receiver(box, x, y):
    """The number of a row with particles that receive, else -1."""
    row = x * box.second + y
    if x < 0 or x >= box.first or not box.wanted[row]:
        return -1
    return row


@kernel
def sum_rows(box, values, row, sums, first):
    """Sums of values of a row over rows of bonds of all lengths about each place, into rows of sums from the first."""
    for z in range(0, box.room, 4):
        total = load_row(values, row, box.lead + z)
        store_row(sums, first, z, total)
        for half in range(1, box.halves):
            behind, ahead = load_row(values, row, box.lead + z - half), load_row(values, row, box.lead + z + half)
            total = add(total, add(ahead, behind))
            store_row(sums, first + half, z, total)


@kernel
def sum_tilted_rows(box, values, plain, row, sums, first):
    """The same of values times how far they stand, and of plain values unless None."""
    for z in range(0, box.room, 4):
        total = NOTHING
        if plain is not None:
            total = load_row(plain, row, box.lead + z)
        store_row(sums, first, z, total)
        for half in range(1, box.halves):
            behind, ahead = load_row(values, row, box.lead + z - half), load_row(values, row, box.lead + z + half)
            total = add_scaled(total, float(half), subtract(ahead, behind))
            if plain is not None:
                plain_behind = load_row(plain, row, box.lead + z - half)
                total = add(total, add(load_row(plain, row, box.lead + z + half), plain_behind))
            store_row(sums, first + half, z, total)


@kernel
def moments(box, offsets, values, result, sums, slopes):
    """Fill result (4, rows, room): sums over offsets of values (rows, places), and of values times each offset's first,
    second and fast part. sums, slopes (second halves, room): to work in."""
    result[:] = 0.0
    plain, first, second, fast = result[0], result[1], result[2], result[3]
    for x in range(box.first):
        for y in range(box.second):
            sum_rows(box, values, x * box.second + y, sums, y * box.halves)
            sum_tilted_rows(box, values, None, x * box.second + y, slopes, y * box.halves)
        for apart in range(offsets.reach.shape[0]):
            reach = offsets.reach[apart]
            for y in range(box.second):
                low, high = max(-reach, -y), min(reach, box.second - 1 - y)
                before, behind = receiver(box, x - apart, y), receiver(box, x + apart, y)
                for z in range(0, box.room if max(before, behind) >= 0 else 0, 4):
                    total, along, slope = NOTHING, NOTHING, NOTHING
                    for step in range(low, high + 1):
                        r = row_of_offsets(box, offsets, apart, y, step)
                        term = load_row(sums, r, z)
                        total, along = add(total, term), add_scaled(along, float(step), term)
                        slope = add(slope, load_row(slopes, r, z))
                    for side in range(2 if apart > 0 else 1):
                        t = behind if side == 1 else before
                        if t >= 0:
                            store_row(plain, t, z, add(load_row(plain, t, z), total))
                            store_row(second, t, z, add(load_row(second, t, z), along))
                            store_row(fast, t, z, add(load_row(fast, t, z), slope))
                            if box.planes:
                                signed = float(apart if side == 0 else -apart)
                                store_row(first, t, z, add_scaled(load_row(first, t, z), signed, total))


@kernel
def contraction(box, offsets, values, plain, result, sums, slopes):
    """Fill result (rows, room): sums over offsets of values (4, rows, places), the last three of them times the
    offset's first, second and fast part, and of plain (rows, places) unless None. sums (2, second halves, room),
    slopes: to work in."""
    result[:] = 0.0
    firsts, seconds = sums[0], sums[1]
    for x in range(box.first):
        for y in range(box.second):
            row = x * box.second + y
            if box.planes:
                sum_rows(box, values[1], row, firsts, y * box.halves)
            sum_rows(box, values[2], row, seconds, y * box.halves)
            sum_tilted_rows(box, values[3], plain, row, slopes, y * box.halves)
        for apart in range(offsets.reach.shape[0]):
            reach = offsets.reach[apart]
            for y in range(box.second):
                low, high = max(-reach, -y), min(reach, box.second - 1 - y)
                before, behind = receiver(box, x - apart, y), receiver(box, x + apart, y)
                for z in range(0, box.room if max(before, behind) >= 0 else 0, 4):
                    total, jump = NOTHING, NOTHING
                    for step in range(low, high + 1):
                        r = row_of_offsets(box, offsets, apart, y, step)
                        total = add(total, add_scaled(load_row(slopes, r, z), float(step), load_row(seconds, r, z)))
                        jump = add(jump, load_row(firsts, r, z))
                    if before >= 0:
                        so_far = add(load_row(result, before, z), total)
                        store_row(result, before, z, add_scaled(so_far, float(apart), jump))
                    if behind >= 0 and apart > 0:
                        so_far = add(load_row(result, behind, z), total)
                        store_row(result, behind, z, add_scaled(so_far, -float(apart), jump))


# --- from particles to places and back ------------------------------------------------------------------------------


@kernel
def reflect(images, signs, values):
    """Fill values (components, places) of images: those of the particles times signs (m, components)."""
    for k in range(values.shape[0]):
        for m in range(images.place.shape[0]):
            values[k, images.place[m]] = signs[m, k] * values[k, images.origin[m]]


@kernel
def spread(at, motion, base, values):
    """Fill V (f - base) into values (d, places)."""
    d = base.shape[0]
    f = 2 * (d - 1)
    for b in range(at.place.shape[0]):
        for i in range(d):
            values[i, at.place[b]] = at.volume[b] * (motion[b, f + i] - base[i])


@kernel
def collect(at, motion, base, result, jumps, sums):
    """Add the gradients' sums of result (d, 4, targets) to rows; jumps (owned, d): sum V_b (f_b - f_a)."""
    d = base.shape[0]
    f, width = 2 * (d - 1), sums.shape[1] // d
    for a in range(at.volumes.shape[0]):
        z = at.target[a]
        for i in range(d):
            value = motion[a, f + i] - base[i]
            jumps[a, i] = result[i, 0, z] - at.volumes[a] * value
            for j in range(d):
                k = at.axis[j]
                moment = result[i, 1 + k, z] - at.moments[a, k] * value
                sums[a, width * j + i] += at.volume[a] * at.spacing[j] * moment


@kernel
def spread_stresses(at, C, motion, base, M, values):
    """Fill V M h, and V C f unless C is None, into values (d, 4, places)."""
    d = base.shape[0]
    f, width = 2 * (d - 1), M.shape[1] // d
    for b in range(at.place.shape[0]):
        place, volume = at.place[b], at.volume[b]
        for i in range(d):
            for j in range(d):
                values[i, 1 + at.axis[j], place] = volume * at.spacing[j] * M[b, width * j + i]
            if C is not None:
                total = 0.0
                for j in range(d):
                    total += C[b, width * j + i] * (motion[b, f + j] - base[j])
                values[i, 0, place] = volume * total


@kernel
def collect_forces(at, C, sums_of_C, motion, base, M, result, jumps, force):
    """Add forces of result (d, targets) to rows; sums_of_C (owned, d, d): sum V_b C_b."""
    d = base.shape[0]
    f, width = 2 * (d - 1), M.shape[1] // d
    for a in range(at.volumes.shape[0]):
        for i in range(d):
            total = result[i, at.target[a]]
            for j in range(d):
                total += M[a, width * j + i] * at.spacing[j] * at.moments[a, at.axis[j]]
                if C is not None:
                    total += C[a, width * j + i] * jumps[a, j]
                    total -= sums_of_C[a, i, j] * (motion[a, f + j] - base[j])
            force[a, i] += at.volume[a] * total


class LatticeConvolution:
    """The sweeps over all bonds of a rank, those with mirror images among them."""

    def __init__(self, bonds: Any, box: Box, offsets: Offsets, at: Placed, images: PlacedImages | None) -> None:
        """bonds: `methods.peridynamics.bonds.Bonds`; at: without sums over offsets."""
        d, rows, places = bonds.d, box.first * box.second, box.room + 2 * box.lead
        self.box, self.offsets, self.at, self.images, self.d = box, offsets, at, images, d
        self.values, self.field = aligned_zeros(d, 4, rows, places), aligned_zeros(d, rows, places)
        self.result, self.forces_found = aligned_zeros(d, 4, rows, box.room), aligned_zeros(d, rows, box.room)
        work = box.second * box.halves
        self.sums, self.slopes = aligned_zeros(2, work, box.room), aligned_zeros(work, box.room)
        self.base, self.jumps = np.zeros(d), np.zeros((bonds.owned, d))
        self.sums_of_C: np.ndarray | None = None
        # what a plane turns round does not move as one
        self.moves = np.ones(d)
        if images is not None:
            Q, across = images.signs, np.ones((len(images.place), 4))
            across[:, 1 + at.axis] = images.reflections
            self.moves = (Q > 0.0).all(axis=0).astype(float)
            # of V C f and V M h, M' = Q M R
            self.stress_signs = np.ascontiguousarray((Q[:, :, None] * across[:, None]).reshape(len(Q), -1))
        self.neighbours = self.over_offsets(np.ones(len(at.volume)))[:, 0] - 1.0
        whole = self.over_offsets(at.volume)
        self.at = at._replace(volumes=whole[:, 0].copy(), moments=whole[:, 1:].copy())

    def arrays(self) -> list[np.ndarray]:
        """What counts as memory."""
        kept = [self.values, self.field, self.result, self.forces_found, self.sums, self.slopes, self.jumps]
        return [*kept, *(array for array in (*self.at, *(self.images or ())) if isinstance(array, np.ndarray))]

    def over_offsets(self, values: np.ndarray, signs: np.ndarray | float = 1.0) -> np.ndarray:
        """Sums (owned, 4) over offsets of values (n,), and of values times the offset, in spacings; signs: of images
        (m,)."""
        field, result = np.zeros_like(self.field[0]), np.zeros_like(self.result[0])
        field.ravel()[self.at.place] = values
        if self.images is not None:
            field.ravel()[self.images.place] = values[self.images.source] * signs
        moments(self.box, self.offsets, field, result, self.sums[0], self.slopes)
        return result.reshape(4, -1)[:, self.at.target].T

    def gradients(self, motion: np.ndarray, sums: np.ndarray) -> None:
        """Add the sums of the gradient sweep to rows, see `methods.peridynamics.sweeps`."""
        d = self.d
        self.base[:] = self.moves * motion[0, 2 * (d - 1) : 3 * d - 2]
        spread(self.at, motion, self.base, self.field.reshape(d, -1))
        if self.images is not None:
            reflect(self.images, self.images.signs, self.field.reshape(d, -1))
        for field, result in zip(self.field, self.result):
            moments(self.box, self.offsets, field, result, self.sums[0], self.slopes)
        collect(self.at, motion, self.base, self.result.reshape(d, 4, -1), self.jumps, sums)

    def forces(self, motion: np.ndarray, M: np.ndarray, C: np.ndarray | None, force: np.ndarray) -> None:
        """Add the forces of the divergence sweep to rows; with C on the field that the last gradients were taken of."""
        d = self.d
        if C is not None:
            self.base[:] = self.moves * motion[0, 2 * (d - 1) : 3 * d - 2]
            if self.sums_of_C is None:
                self.sums_of_C = self._over_controls(C)
        spread_stresses(self.at, C, motion, self.base, M, self.values.reshape(d, 4, -1))
        if self.images is not None:
            reflect(self.images, self.stress_signs, self.values.reshape(4 * d, -1))
        for values, result in zip(self.values, self.forces_found):
            plain = None if C is None else values[0]
            contraction(self.box, self.offsets, values, plain, result, self.sums, self.slopes)
        found, sums_of_C = self.forces_found.reshape(d, -1), None if C is None else self.sums_of_C
        collect_forces(self.at, C, sums_of_C, motion, self.base, M, found, self.jumps, force)

    def _over_controls(self, C: np.ndarray) -> np.ndarray:
        """sum V_b C_b (owned, d, d)."""
        d, at = self.d, self.at
        width, result = C.shape[1] // d, np.empty((len(self.jumps), d, d))
        for i in range(d):
            for j in range(d):
                values = at.volume * C[: len(at.volume), width * j + i]
                signs = 1.0 if self.images is None else self.images.signs[:, i] * self.images.signs[:, j]
                result[:, i, j] = self.over_offsets(values, signs)[:, 0]
        return result


# --- whether particles are on a lattice ------------------------------------------------------------------------------


def lattice_convolution(bonds: Any) -> LatticeConvolution | None:
    """Of this rank's bonds, None where they are not those of one lattice, or few; the bonds with mirror images must be
    among them."""
    horizon = bonds.horizon
    uniform = len(horizon) > 0 and np.ptp(horizon) <= 1e-9 * horizon.max()
    if bonds.influence != "constant" or bonds.bar or not uniform or bonds.owned < _FEWEST:
        return None
    positions, images = bonds.positions, None
    if bonds.mirror is not None and len(bonds.mirror.neighbour):
        pairs, given = bonds.mirror, bonds.images
        which = np.unique(pairs.neighbour.astype(np.int64) * len(given.signs) + given.code)
        row, code = np.divmod(which, len(given.signs))
        Q, R, T = (array[code, : bonds.d] for array in (given.signs, given.reflections, given.shifts))
        positions, images = np.concatenate((positions, positions[row] * R + T)), (row, Q, R)
    found = _places(positions)
    if found is None:
        return None
    index, spacing = found
    d, counts = index.shape[1], index.max(axis=0) + 1
    if len(index) < _FULLEST * np.prod(counts.astype(float)):
        return None
    # the axis along which particles stand one behind the other, if it is long, else the longest
    fast = int(np.argmax(np.abs(index[1] - index[0])))
    fast = fast if 2 * counts[fast] >= counts.max() else int(np.argmax(counts))
    # rows one behind the other in memory, too
    turns = np.count_nonzero(np.diff(index[: bonds.owned], axis=0), axis=0)
    slow = sorted((axis for axis in range(d) if axis != fast), key=lambda axis: turns[axis])
    order = np.array([0, 0, 0])
    order[-1 - len(slow) : -1], order[-1] = slow, fast
    offsets = _offsets(spacing[order] / horizon[0], d)
    if _count(offsets) <= _FEWEST_BONDS:
        return None
    first, second = int(counts[slow[0]]) if d == 3 else 1, int(counts[slow[-1]])
    room, lead = -(-int(counts[fast]) // 4) * 4, -(-int(offsets.half.max()) // 4) * 4
    row = index[:, slow[-1]] + (second * index[:, slow[0]] if d == 3 else 0)
    wanted, axis = np.zeros(first * second, bool), np.zeros(d, np.int64)
    wanted[row[: bonds.owned]] = True
    axis[slow], axis[fast] = np.arange(3 - d, 2), 2
    place, target = row * (room + 2 * lead) + lead + index[:, fast], row * room + index[:, fast]
    # particles of bodies that are not bonded may stand at one place
    if len(np.unique(place)) < len(place):
        return None
    n, nothing = len(bonds.positions), np.zeros(0)
    at = Placed(place[:n], target[: bonds.owned], bonds.volume.copy(), nothing, np.zeros((0, 3)), axis, spacing)
    placed = None
    if images is not None:
        source, Q, R = images
        placed = PlacedImages(source, place[source], place[n:], np.ascontiguousarray(Q), np.ascontiguousarray(R))
    box = Box(first, second, room, lead, int(offsets.half.max()) + 1, wanted, first > 1)
    result = LatticeConvolution(bonds, box, offsets, at, placed)
    return result if np.array_equal(result.neighbours, _neighbours(bonds)) else None


def _places(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Places (n, d) int64 on a lattice and its spacing (d,) [m], None where positions (n, d) are on none."""
    index, spacing = np.zeros(positions.shape, np.int64), np.ones(positions.shape[1])
    for i, X in enumerate(positions.T):
        largest = float(np.abs(X).max())
        ranked = np.sort(X)
        gaps = np.diff(ranked)
        apart = gaps[gaps > 1e-9 * largest]
        if len(apart):
            size = ranked[-1] - ranked[0]
            spacing[i] = size / np.rint(size / apart.min())
            index[:, i] = np.rint((X - ranked[0]) / spacing[i])
        if np.abs(ranked[0] + index[:, i] * spacing[i] - X).max() > _ASTRAY * largest:
            return None
    return index, spacing


def _offsets(step: np.ndarray, d: int) -> Offsets:
    """Rows of the offsets within a horizon; step (3,): spacings over the horizon along first, second and fast axis, of
    which d count."""
    reach, middle = [], int(1.0 / step[1])
    half = np.zeros((int(1.0 / step[0]) + 1 if d == 3 else 1, 2 * middle + 1), np.int64)
    for apart in range(len(half)):
        # of an offset on the horizon rounding leaves less than nothing
        left = max(1.0 - (apart * step[0] if d == 3 else 0.0) ** 2, 0.0)
        reach.append(int(np.sqrt(left) / step[1]))
        for second in range(-reach[-1], reach[-1] + 1):
            half[apart, middle + second] = int(np.sqrt(max(left - (second * step[1]) ** 2, 0.0)) / step[2])
    return Offsets(np.array(reach), half)


def _count(offsets: Offsets) -> int:
    """So many offsets, 0 among them."""
    middle = offsets.half.shape[1] // 2
    inside = [2 * half[middle - reach : middle + reach + 1] + 1 for reach, half in zip(offsets.reach, offsets.half)]
    return int(inside[0].sum() + 2 * sum(one.sum() for one in inside[1:]))


def _neighbours(bonds: Any) -> np.ndarray:
    """So many (owned,) are bonded with each particle."""
    result = np.zeros(bonds.owned)
    for pairs, _, receivers in bonds.lists:
        result += np.diff(pairs.start)[: bonds.owned]
        if receivers:
            result += np.bincount(pairs.neighbour.astype(np.int64), minlength=bonds.owned)
    return result


def aligned_zeros(*shape: int) -> np.ndarray:
    """Zeros at an address that is a multiple of 64 bytes."""
    size = int(np.prod(shape))
    whole = np.zeros(size + 8)
    first = -whole.ctypes.data // 8 % 8
    return whole[first : first + size].reshape(shape)
