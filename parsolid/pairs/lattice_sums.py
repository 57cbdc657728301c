"""The two passes over all bonds of a lattice without its list of bonds, for radial weights that are constant.

Where particles a stand on places of one lattice and w = 1, both passes (see `passes`) are sums over offsets o of it,
    sum_b V_b (f_b - f_a) (x) xi  =  sum_o V f (a + o) (x) h o  -  f_a (x) sum_o V (a + o) h o,
    sum_b V_b [(M_a + M_b) xi + (C1_a + C1_b)(f_b - f_a)]
        =  sum_o [V M (a + o) h o + V C1 f (a + o)]  +  M_a sum_o V (a + o) h o  +  C1_a sum_b V_b (f_b - f_a)
           -  sum_o V C1 (a + o) f_a,
with V = 0 where a place is empty. The offsets are lines along the fast axis, of some lengths: a line of a place is
added up once for each length and given to all places that see it, 29 in place of 122 with a horizon of three spacings,
and four places at a time lie side by side in memory. Fields are less that of one particle, so that a body that is
moved has the forces of one at rest.
"""

from typing import Any

import numpy as np

from parsolid.numerics.lanes import aligned_zeros, padded
from parsolid.pairs.lattice_kernels import (
    Box,
    Lines,
    Mirrored,
    Rows,
    collect,
    collect_forces,
    contraction,
    moments,
    reflect,
    spread,
    spread_records,
)
from parsolid.pairs.lists import mutual
from parsolid.pairs.pair_system import FIELD
from parsolid.pairs.passes import add_forces, add_gradients
from parsolid.pairs.radial_weights import Constant
from parsolid.pairs.terms import ShearScaled, matrix_columns, record_columns

# fewer particles of a rank are done as fast by their lists
_FEWEST = 1000
# as are those with fewer bonds each, as in the plane with a horizon of three spacings
_FEWEST_BONDS = 60
# of the places of the lattice's box, what particles take at least
_FULLEST = 0.4
# of the coordinates, how far a particle may stand beside its place: rounding
_ASTRAY = 4e-15


class LatticeSums:
    """The passes over a rank's bonds; those with mirror images have their list unless images have places."""

    def __init__(self, bonds: Any, box: Box, lines: Lines, rows: Rows, mirrored: Mirrored | None) -> None:
        """bonds: `PairSystem`; rows: without their sums over offsets; mirrored: images with places."""
        self.bonds, self.box, self.lines, self.rows, self.particles = bonds, box, lines, rows, bonds.particles
        self.mirrored = mirrored
        d, count = bonds.space.dimension, box.first * box.second
        self.across = None if box.first == 1 else True
        self.width = matrix_columns(d) // d
        self.values = aligned_zeros((d, 4, count, box.room + 2 * box.lead))
        self.field = aligned_zeros((d, count, box.room + 2 * box.lead))
        self.result, self.forces = aligned_zeros((d, 4, count, box.room)), aligned_zeros((d, count, box.room))
        rows_of_sums = box.second * box.halves
        self.sums, self.slopes = aligned_zeros((2, rows_of_sums, box.room)), aligned_zeros((rows_of_sums, box.room))
        self.base, self.jumps, self.unused = np.zeros(d), np.zeros((bonds.owned, d)), np.zeros((bonds.owned, d))
        self.stiffnesses: np.ndarray | None = None
        # what a plane turns round does not move as one
        self.moves = np.ones(d)
        if mirrored is not None:
            self._reflect_by(bonds.codes.signs[:, :d], bonds.codes.reflections[:, :d])
        self.neighbours = self.over_offsets(np.ones(len(rows.volume)))[:, 0] - 1.0
        whole = self.over_offsets(rows.volume)
        self.rows = rows._replace(volumes=whole[:, 0].copy(), moments=whole[:, 1:].copy())

    def _reflect_by(self, Q: np.ndarray, R: np.ndarray) -> None:
        """Signs of a vector, Q (codes, d), of V C1 f and V M h, M' = Q M R, and of C1' = Q C1 Q."""
        codes, d = Q.shape
        across = np.ones((codes, 4))
        across[:, 1 + self.rows.axis] = R
        self.vector_signs, self.record_signs = Q.copy(), (Q[:, :, None] * across[:, None]).reshape(codes, -1)
        self.matrix_signs = Q[:, :, None] * Q[:, None]
        self.moves = (Q > 0.0).all(axis=0).astype(float)

    def arrays(self) -> list[np.ndarray]:
        """Arrays of the lattice, for what counts memory."""
        kept = [self.values, self.field, self.result, self.forces, self.sums, self.slopes, self.jumps, self.unused]
        return [*kept, *(array for array in (*self.rows, *(self.mirrored or ())) if isinstance(array, np.ndarray))]

    def over_offsets(self, values: np.ndarray, signs: np.ndarray | None = None) -> np.ndarray:
        """Sums (owned, 4) over offsets of values (n,), and of values times the offset, in spacings; signs (codes,):
        of their images.
        """
        field, result = np.zeros_like(self.field[0]), np.zeros_like(self.result[0])
        field.ravel()[self.rows.place] = values
        if self.mirrored is not None:
            images = values[self.mirrored.source]
            field.ravel()[self.mirrored.place] = images if signs is None else images * signs[self.mirrored.code]
        moments(self.box, self.lines, field, self.across, result, self.sums[0], self.slopes)
        return result.reshape(4, -1)[:, self.rows.target].T

    def gradient(
        self, message: str | None, fields: tuple[Any, ...] = FIELD, sums: np.ndarray | None = None
    ) -> np.ndarray:
        """See `PairSystem.gradient`; of one vector."""
        kinematics, d = self.particles.storage("kinematics"), len(self.base)
        result, column = self.particles.storage("pair_sums") if sums is None else sums, fields[0].column or 0
        self._tell(message)
        self.base[:] = self.moves * kinematics[0, column : column + d]
        spread(self.bonds.space, self.rows, column, kinematics, self.base, self.field.reshape(d, -1))
        if self.mirrored is not None:
            reflect(self.mirrored, self.vector_signs, self.field.reshape(d, -1))
        for field, moved in zip(self.field, self.result):
            moments(self.box, self.lines, field, self.across, moved, self.sums[0], self.slopes)
        at, found = (self.width, column, kinematics, self.base), self.result.reshape(d, 4, -1)
        collect(self.bonds.space, self.rows, *at, found, self.jumps if column == 0 else self.unused, result)
        self._images(add_gradients, fields, kinematics, result)
        return result

    def divergence(self, terms: Any = None) -> np.ndarray:
        """See `PairSystem.divergence`; `ShearScaled` acts on the field that the last gradient was taken of."""
        kinematics, record, force = map(self.particles.storage, ("kinematics", "record", "pair_force"))
        self._tell("record")
        stiffness, d = None, len(self.base)
        if terms is not None:
            stiffness = record_columns(self.bonds.space, terms).stiffness
            if self.stiffnesses is None:
                self.stiffnesses = self._over_stiffnesses(record, stiffness)
            self.base[:] = self.moves * kinematics[0, :d]
        known = self.width, stiffness
        spread_records(
            self.bonds.space, self.rows, *known, kinematics, self.base, record, self.values.reshape(d, 4, -1)
        )
        if self.mirrored is not None:
            reflect(self.mirrored, self.record_signs, self.values.reshape(4 * d, -1))
        for values, result in zip(self.values, self.forces):
            plain = None if terms is None else values[0]
            contraction(self.box, self.lines, values, self.across, plain, result, self.sums, self.slopes)
        at, found = (*known, self.stiffnesses, kinematics, self.base, record), self.forces.reshape(d, -1)
        collect_forces(self.bonds.space, self.rows, *at, found, self.jumps, force)
        self._images(add_forces, terms, kinematics, record, force)
        return force

    def _tell(self, message: str | None) -> None:
        """Ghosts, all at once: a line of places has both them and owned particles."""
        if message is not None:
            self.particles.send(message)
            self.particles.receive(message)

    def _images(self, add: Any, what: Any, *arrays: np.ndarray) -> None:
        """A pass over the bonds with mirror images, unless these have places."""
        if self.bonds.mirror is not None and self.mirrored is None:
            add(self.bonds.space, self.bonds.mirror, what, *arrays)

    def _over_stiffnesses(self, record: np.ndarray, stiffness: int) -> np.ndarray:
        """sum V_b C1_b (owned, d, d)."""
        d, rows = len(self.base), self.rows
        result = np.empty((self.bonds.owned, d, d))
        for i in range(d):
            for j in range(d):
                values = rows.volume * record[: len(rows.volume), stiffness + self.width * j + i]
                signs = None if self.mirrored is None else self.matrix_signs[:, i, j]
                result[:, i, j] = self.over_offsets(values, signs)[:, 0]
        return result


# --- whether particles are on a lattice --------------------------------------------------------------------------


def lattice_sums(bonds: Any) -> LatticeSums | None:
    """Of this rank's bonds between particles and ghosts, None where they are not those of one lattice, or few."""
    weights, terms = bonds.weights, bonds.terms
    fits = isinstance(weights.influence, Constant) and not weights.bar and len(bonds.metric) == 1
    if not fits or bonds.owned < _FEWEST or not isinstance(terms, ShearScaled | None):
        return None
    images = _images_of(bonds)
    return _on_lattice(bonds, images) or (_on_lattice(bonds, None) if images is not None else None)


def _on_lattice(bonds: Any, images: tuple[np.ndarray, np.ndarray, np.ndarray] | None) -> LatticeSums | None:
    """With images (m, d) [m] of particles in some rows (m,) by reflections (m,), on places of their own; or with their
    list.
    """
    found = _places(bonds.positions if images is None else np.concatenate((bonds.positions, images[0])))
    if found is None:
        return None
    index, spacing = found
    d, counts = index.shape[1], index.max(axis=0) + 1
    if len(index) < _FULLEST * np.prod(counts.astype(float)):
        return None
    # the axis along which particles stand one behind the other, if it is long, else the longest
    fast = int(np.argmax(np.abs(index[1] - index[0])))
    fast = fast if 2 * counts[fast] >= counts.max() else int(np.argmax(counts))
    # lines one behind the other in memory, too
    turns = np.count_nonzero(np.diff(index[: bonds.owned], axis=0), axis=0)
    slow = sorted((axis for axis in range(d) if axis != fast), key=lambda axis: turns[axis])
    order = np.array([0, 0, 0])
    order[-1 - len(slow) : -1], order[-1] = slow, fast
    lines = _lines(spacing, bonds.metric[0], bonds.weights.support, order, d)
    if _offsets(lines) <= _FEWEST_BONDS:
        return None
    first = int(counts[slow[0]]) if d == 3 else 1
    second, room = int(counts[slow[-1]]), padded(int(counts[fast]))
    line = index[:, slow[-1]] + (second * index[:, slow[0]] if d == 3 else 0)
    wanted = np.zeros(first * second, bool)
    wanted[line[: bonds.owned]] = True
    lead, axis = padded(int(lines.half.max())), np.zeros(d, np.int64)
    axis[slow], axis[fast] = np.arange(3 - d, 2), 2
    place, target = line * (room + 2 * lead) + lead + index[:, fast], line * room + index[:, fast]
    # particles of bodies that are not bonded may stand at one place
    if len(np.unique(place)) < len(place):
        return None
    n, nothing = len(bonds.positions), np.zeros(0)
    rows = Rows(place[:n], target[: bonds.owned], bonds.volume.copy(), nothing, np.zeros((0, 3)), axis, spacing)
    mirrored = None if images is None else Mirrored(images[1], place[images[1]], place[n:], images[2])
    box = Box(first, second, room, lead, int(lines.half.max()) + 1, wanted)
    result = LatticeSums(bonds, box, lines, rows, mirrored)
    return result if np.array_equal(result.neighbours, _neighbours(bonds, images is not None)) else None


def _images_of(bonds: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray] | None:
    """Mirror images (m, d) [m] that are bonded with owned particles, rows (m,) of their particles, reflections (m,)."""
    if bonds.mirror is None or not len(bonds.mirror.neighbour):
        return None
    codes, pairs = bonds.codes, bonds.mirror
    which = np.unique(pairs.neighbour * np.int64(len(codes.signs)) + pairs.images.code)
    row, code = np.divmod(which, len(codes.signs))
    d = bonds.positions.shape[1]
    return bonds.positions[row] * codes.reflections[code, :d] + codes.shifts[code, :d], row, code


def _places(positions: np.ndarray) -> tuple[np.ndarray, np.ndarray] | None:
    """Places (n, d) int64 on a lattice and its spacing (d,) [m], None where positions (n, d) are on none."""
    index, spacing = np.zeros(positions.shape, np.int64), np.ones(positions.shape[1])
    for i, X in enumerate(positions.T):
        largest = float(np.abs(X).max())
        sorted_places = np.sort(X)
        gaps = np.diff(sorted_places)
        apart = gaps[gaps > 1e-9 * largest]
        if len(apart):
            size = sorted_places[-1] - sorted_places[0]
            spacing[i] = size / np.rint(size / apart.min())
            index[:, i] = np.rint((X - sorted_places[0]) / spacing[i])
        if np.abs(sorted_places[0] + index[:, i] * spacing[i] - X).max() > _ASTRAY * largest:
            return None
    return index, spacing


def _lines(spacing: np.ndarray, metric: np.ndarray, support: float, order: np.ndarray, d: int) -> Lines:
    """Lines of the offsets within a horizon; order (3,): the axes first, second and fast, of which d count."""
    step = np.sqrt(metric[order]) * spacing[order] / support
    reach = []
    middle = int(1.0 / step[1])
    half = np.zeros((int(1.0 / step[0]) + 1 if d == 3 else 1, 2 * middle + 1), np.int64)
    for apart in range(len(half)):
        # of an offset on the horizon rounding leaves less than nothing
        left = max(1.0 - (apart * step[0] if d == 3 else 0.0) ** 2, 0.0)
        reach.append(int(np.sqrt(left) / step[1]))
        for second in range(-reach[-1], reach[-1] + 1):
            half[apart, middle + second] = int(np.sqrt(max(left - (second * step[1]) ** 2, 0.0)) / step[2])
    return Lines(np.array(reach), half)


def _offsets(lines: Lines) -> int:
    """So many of them, 0 among them."""
    middle = lines.half.shape[1] // 2
    inside = [2 * half[middle - reach : middle + reach + 1] + 1 for reach, half in zip(lines.reach, lines.half)]
    return int(inside[0].sum() + 2 * sum(one.sum() for one in inside[1:]))


def _neighbours(bonds: Any, images: bool) -> np.ndarray:
    """So many (owned,) are bonded with each particle, with mirror images or without."""
    result = np.zeros(bonds.owned)
    for pairs in (bonds.inner, bonds.rim, bonds.mirror if images else None):
        if pairs is not None:
            result += np.diff(pairs.start)[: bonds.owned]
            if mutual(pairs):
                result += np.bincount(pairs.neighbour, minlength=bonds.owned)
    return result
