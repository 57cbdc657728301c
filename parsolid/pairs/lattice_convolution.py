"""The two sweeps over all bonds of a lattice without lists of bonds, for weights that are the same for all.

Where particles a stand on places of one lattice and w = 1, both sweeps (see `methods.peridynamics.sweeps`) are sums
over offsets o of the lattice, with h o for a bond,

    sum_b V_b (f_b - f_a) (x) xi  =  sum_o V f(a + o) (x) h o  -  f_a (x) sum_o V(a + o) h o,
    sum_b V_b [(M_a + M_b) xi + (C_a + C_b)(f_b - f_a)]
        =  sum_o [V M(a + o) h o + V C f(a + o)]  +  M_a sum_o V(a + o) h o  +  C_a sum_b V_b (f_b - f_a)
           -  sum_o V C(a + o) f_a,

with V = 0 where a place is empty. The offsets are rows of bonds along the fast axis, of some lengths. Over such a row
about every place, the even sum of values, and the odd sum of values times their distance, are found once for each
length, and given to all places that see the row, 29 in place of 122 offsets with a horizon of three spacings. All
places of a plane are one row of memory, with zeros between the lines of the lattice and beyond them, so that loops are
long and need not look for ends. Fields are less that of one particle, so that a body that is moved has the forces of
one at rest.
"""

from typing import Any, NamedTuple

import numpy as np

from parsolid.kernels import kernel

# fewer particles of a rank are done as fast by their lists
_FEWEST = 1000
# as are those with fewer bonds each, as in the plane with a horizon of three spacings
_FEWEST_BONDS = 60
# of the places of the lattice's box, what particles take at least
_FULLEST = 0.4
# of the coordinates, how far a particle may stand beside its place: rounding
_ASTRAY = 4e-15


class Offsets(NamedTuple):
    """Offsets within the horizon as rows along the fast axis, by how far apart the planes of both places are: second
    parts from -reach (apart,) to reach, int64; half (apart, second part) int64 of a row's length, the same for both
    signs of the second part."""

    reach: np.ndarray
    half: np.ndarray


class Box(NamedTuple):
    """Places: planes (planes,) of `size` places, in which lines stand `pitch` apart; first, last: the places of a plane
    that lines take, beyond which there are zeros; halves: of rows of offsets, from 0; wanted (planes,): planes with
    particles that receive."""

    planes: int
    size: int
    pitch: int
    first: int
    last: int
    halves: int
    wanted: np.ndarray


class Placed(NamedTuple):
    """Of particles, ghosts behind: place (n,) int64 among all of the box; volume (n,). Of owned ones, sums over
    offsets, themselves among them: volumes (owned,), and moments (owned, 3) of volumes along first, second and fast
    axis, in spacings.

    axis: which of these three each axis of space is; spacing [m]: tuples of d, so that kernels know d.
    """

    place: np.ndarray
    volume: np.ndarray
    volumes: np.ndarray
    moments: np.ndarray
    axis: tuple[int, ...]
    spacing: tuple[float, ...]


class PlacedImages(NamedTuple):
    """Mirror images on places of their own: source (m,) int64, the particle's row; origin, place (m,) int64 of particle
    and image; signs Q, reflections R (m, d)."""

    source: np.ndarray
    origin: np.ndarray
    place: np.ndarray
    signs: np.ndarray
    reflections: np.ndarray


# --- sums over rows of bonds ----------------------------------------------------------------------------------------


@kernel
def add_even(before, behind, ahead, result):
    """result = before + ahead + behind."""
    for p in range(result.size):
        result[p] = before[p] + (ahead[p] + behind[p])


@kernel
def add_odd(before, half, behind, ahead, result):
    """result = before + half (ahead - behind)."""
    for p in range(result.size):
        result[p] = before[p] + half * (ahead[p] - behind[p])


@kernel
def even_sums(box, values, sums):
    """Fill sums (halves, size): of values (size,) over the rows of each length about the places of a plane."""
    a, b = box.first, box.last
    sums[0, a:b] = values[a:b]
    for h in range(1, box.halves):
        add_even(sums[h - 1, a:b], values[a - h : b - h], values[a + h : b + h], sums[h, a:b])


@kernel
def odd_sums(box, values, sums):
    """The same of values times how far they stand; sums[0] is given."""
    a, b = box.first, box.last
    for h in range(1, box.halves):
        add_odd(sums[h - 1, a:b], float(h), values[a - h : b - h], values[a + h : b + h], sums[h, a:b])


@kernel
def add_lines(step, even_behind, even_ahead, odd_behind, odd_ahead, total, along, slope):
    """Add the sums of two lines, a step behind and ahead."""
    for p in range(total.size):
        total[p] += even_ahead[p] + even_behind[p]
        along[p] += step * (even_ahead[p] - even_behind[p])
        slope[p] += odd_ahead[p] + odd_behind[p]


@kernel
def add_scaled_to(result, factor, values):
    """result += factor values."""
    for p in range(result.size):
        result[p] += factor * values[p]


@kernel
def moments(box, offsets, values, result, work):
    """Fill result (4, planes, size): sums over offsets of values (planes, size), and of values times each offset's
    first, second and fast part. work (5, 3 or halves, size): zeros outside of the places of lines."""
    result[:] = 0.0
    a, b = box.first, box.last
    even, odd = work[0], work[1]
    total, along, slope = work[4, 0, a:b], work[4, 1, a:b], work[4, 2, a:b]
    for x in range(box.planes):
        even_sums(box, values[x], even)
        odd[0, a:b] = 0.0
        odd_sums(box, values[x], odd)
        for apart in range(offsets.reach.shape[0]):
            before, behind = receiver(box, x - apart), receiver(box, x + apart)
            if max(before, behind) < 0:
                continue
            h = offsets.half[apart, 0]
            total[:], along[:], slope[:] = even[h, a:b], 0.0, odd[h, a:b]
            for step in range(1, offsets.reach[apart] + 1):
                h, s = offsets.half[apart, step], step * box.pitch
                c, d = a + s, b + s
                add_lines(float(step), even[h, a - s : b - s], even[h, c:d], odd[h, a - s : b - s], odd[h, c:d],
                          total, along, slope)  # fmt: skip
            for side in range(2 if apart > 0 else 1):
                t = behind if side == 1 else before
                if t >= 0:
                    add_scaled_to(result[0, t, a:b], 1.0, total)
                    add_scaled_to(result[2, t, a:b], 1.0, along)
                    add_scaled_to(result[3, t, a:b], 1.0, slope)
                    if apart > 0:
                        add_scaled_to(result[1, t, a:b], float(apart if side == 0 else -apart), total)


@kernel
def add_contracted(
    step, first_behind, first_ahead, second_behind, second_ahead, slope_behind, slope_ahead, jump, total
):
    """Add the sums of two lines, a step behind and ahead."""
    for p in range(total.size):
        jump[p] += first_ahead[p] + first_behind[p]
        total[p] += (slope_ahead[p] + slope_behind[p]) + step * (second_ahead[p] - second_behind[p])


@kernel
def contraction(box, offsets, values, plain, result, work):
    """Fill result (planes, size): sums over offsets of values (4, planes, size), the last three of them times the
    offset's first, second and fast part, and of plain (planes, size) unless None. work: see `moments`."""
    result[:] = 0.0
    a, b = box.first, box.last
    firsts, seconds, slopes, total_of_plain = work[0], work[1], work[2], work[3]
    total, jump = work[4, 0, a:b], work[4, 1, a:b]
    for x in range(box.planes):
        even_sums(box, values[1, x], firsts)
        even_sums(box, values[2, x], seconds)
        slopes[0, a:b] = 0.0
        odd_sums(box, values[3, x], slopes)
        if plain is not None:
            even_sums(box, plain[x], total_of_plain)
            for h in range(box.halves):
                add_scaled_to(slopes[h, a:b], 1.0, total_of_plain[h, a:b])
        for apart in range(offsets.reach.shape[0]):
            before, behind = receiver(box, x - apart), receiver(box, x + apart)
            if max(before, behind) < 0:
                continue
            h = offsets.half[apart, 0]
            total[:], jump[:] = slopes[h, a:b], firsts[h, a:b]
            for step in range(1, offsets.reach[apart] + 1):
                h, s = offsets.half[apart, step], step * box.pitch
                c, d, e, f = a - s, b - s, a + s, b + s
                add_contracted(float(step), firsts[h, c:d], firsts[h, e:f], seconds[h, c:d], seconds[h, e:f],
                               slopes[h, c:d], slopes[h, e:f], jump, total)  # fmt: skip
            if before >= 0:
                add_scaled_to(result[before, a:b], 1.0, total)
            if before >= 0 and apart > 0:
                add_scaled_to(result[before, a:b], float(apart), jump)
            if behind >= 0 and apart > 0:
                add_scaled_to(result[behind, a:b], 1.0, total)
                add_scaled_to(result[behind, a:b], -float(apart), jump)


@kernel
def receiver(box, x):
    """A plane with particles that receive, else -1."""
    if x < 0 or x >= box.planes or not box.wanted[x]:
        return -1
    return x


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
    d = len(at.spacing)
    f = 2 * (d - 1)
    for b in range(at.place.shape[0]):
        for i in range(d):
            values[i, at.place[b]] = at.volume[b] * (motion[b, f + i] - base[i])


@kernel
def collect(at, motion, base, result, jumps, sums):
    """Add the gradients' sums of result (d, 4, places) to rows; jumps (owned, d): sum V_b (f_b - f_a)."""
    d = len(at.spacing)
    f, width = 2 * (d - 1), 2 * (d - 1)
    for a in range(at.volumes.shape[0]):
        z = at.place[a]
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
    d = len(at.spacing)
    f, width = 2 * (d - 1), 2 * (d - 1)
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
    """Add forces of result (d, places) to rows; sums_of_C (owned, d, d): sum V_b C_b."""
    d = len(at.spacing)
    f, width = 2 * (d - 1), 2 * (d - 1)
    for a in range(at.volumes.shape[0]):
        for i in range(d):
            total = result[i, at.place[a]]
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
        d = bonds.d
        self.box, self.offsets, self.at, self.images, self.d = box, offsets, at, images, d
        shape = box.planes, box.size
        self.values, self.field = aligned_zeros(d, 4, *shape), aligned_zeros(d, *shape)
        self.result, self.forces_found = aligned_zeros(d, 4, *shape), aligned_zeros(d, *shape)
        self.work = aligned_zeros(5, max(3, box.halves), box.size)
        self.base, self.jumps = np.zeros(d), np.zeros((bonds.owned, d))
        self.sums_of_C: np.ndarray | None = None
        # what a plane turns round does not move as one
        self.moves = np.ones(d)
        if images is not None:
            Q, across = images.signs, np.ones((len(images.place), 4))
            across[:, 1 + np.array(at.axis)] = images.reflections
            self.moves = (Q > 0.0).all(axis=0).astype(float)
            # of V C f and V M h, M' = Q M R
            self.stress_signs = np.ascontiguousarray((Q[:, :, None] * across[:, None]).reshape(len(Q), 4 * d))
        self.neighbours = self.over_offsets(np.ones(len(at.volume)))[:, 0] - 1.0
        whole = self.over_offsets(at.volume)
        self.at = at._replace(volumes=whole[:, 0].copy(), moments=whole[:, 1:].copy())

    def arrays(self) -> list[np.ndarray]:
        kept = [self.values, self.field, self.result, self.forces_found, self.work, self.jumps]
        return [*kept, *(array for array in (*self.at, *(self.images or ())) if isinstance(array, np.ndarray))]

    def over_offsets(self, values: np.ndarray, signs: np.ndarray | float = 1.0) -> np.ndarray:
        """Sums (owned, 4) over offsets of values (n,), and of values times the offset, in spacings; signs: of images
        (m,)."""
        field, result = np.zeros_like(self.field[0]), np.zeros_like(self.result[0])
        field.ravel()[self.at.place] = values
        if self.images is not None:
            field.ravel()[self.images.place] = values[self.images.source] * signs
        moments(self.box, self.offsets, field, result, self.work)
        return result.reshape(4, -1)[:, self.at.place[: len(self.jumps)]].T

    def gradients(self, motion: np.ndarray, sums: np.ndarray) -> None:
        """Add the sums of the gradient sweep to rows, see `methods.peridynamics.sweeps`."""
        d = self.d
        self.base[:] = self.moves * motion[0, 2 * (d - 1) : 3 * d - 2]
        spread(self.at, motion, self.base, self.field.reshape(d, -1))
        if self.images is not None:
            reflect(self.images, self.images.signs, self.field.reshape(d, -1))
        for field, result in zip(self.field, self.result):
            moments(self.box, self.offsets, field, result, self.work)
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
            contraction(self.box, self.offsets, values, plain, result, self.work)
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
    planes, lines = int(counts[slow[0]]) if d == 3 else 1, int(counts[slow[-1]])
    # zeros between lines, and lines of zeros beyond the first and the last
    lead, beyond = int(offsets.half.max()), int(offsets.reach.max())
    pitch = int(counts[fast]) + lead
    first = beyond * pitch + lead
    last, size = first + lines * pitch, -(-(lines + 2 * beyond + 2) * pitch // 8) * 8
    plane = index[:, slow[0]] if d == 3 else np.zeros(len(index), np.int64)
    wanted, axis = np.zeros(planes, bool), np.zeros(d, np.int64)
    wanted[plane[: bonds.owned]] = True
    axis[slow], axis[fast] = np.arange(3 - d, 2), 2
    place = plane * size + first + index[:, slow[-1]] * pitch + index[:, fast]
    # particles of bodies that are not bonded may stand at one place
    if len(np.unique(place)) < len(place):
        return None
    n, nothing = len(bonds.positions), np.zeros(0)
    of_axes = tuple(map(int, axis)), tuple(map(float, spacing))
    at = Placed(place[:n], bonds.volume.copy(), nothing, np.zeros((0, 3)), *of_axes)
    placed = None
    if images is not None:
        source, Q, R = images
        placed = PlacedImages(source, place[source], place[n:], np.ascontiguousarray(Q), np.ascontiguousarray(R))
    box = Box(planes, size, pitch, first, last, lead + 1, wanted)
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
    reach = []
    half = np.zeros((int(1.0 / step[0]) + 1 if d == 3 else 1, int(1.0 / step[1]) + 1), np.int64)
    for apart in range(len(half)):
        # of an offset on the horizon rounding leaves less than nothing
        left = max(1.0 - (apart * step[0] if d == 3 else 0.0) ** 2, 0.0)
        reach.append(int(np.sqrt(left) / step[1]))
        for second in range(reach[-1] + 1):
            half[apart, second] = int(np.sqrt(max(left - (second * step[1]) ** 2, 0.0)) / step[2])
    return Offsets(np.array(reach), half)


def _count(offsets: Offsets) -> int:
    """So many offsets, 0 among them."""
    lengths = [2 * half[: reach + 1] + 1 for reach, half in zip(offsets.reach, offsets.half)]
    planes = [int(2 * row.sum() - row[0]) for row in lengths]
    return planes[0] + 2 * sum(planes[1:])


def _neighbours(bonds: Any) -> np.ndarray:
    """So many (owned,) are bonded with each particle."""
    result = np.zeros(bonds.owned)
    for pairs, _, mutual in bonds.lists:
        result += np.diff(pairs.start)[: bonds.owned]
        if mutual:
            result += np.bincount(pairs.neighbour.astype(np.int64), minlength=bonds.owned)
    return result


def aligned_zeros(*shape: int) -> np.ndarray:
    """Zeros at an address that is a multiple of 64 bytes."""
    size = int(np.prod(shape))
    whole = np.zeros(size + 8)
    first = -whole.ctypes.data // 8 % 8
    return whole[first : first + size].reshape(shape)
