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
    Rows,
    collect,
    collect_forces,
    contraction,
    moments,
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
    """The passes over a rank's bonds; those with mirror images have their list."""

    def __init__(self, bonds: Any, box: Box, lines: Lines, rows: Rows) -> None:
        """bonds: `PairSystem`; rows: without their sums over offsets."""
        self.bonds, self.box, self.lines, self.rows, self.particles = bonds, box, lines, rows, bonds.particles
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
        self.neighbours = self.over_offsets(np.ones(len(rows.volume)))[:, 0] - 1.0
        whole = self.over_offsets(rows.volume)
        self.rows = rows._replace(volumes=whole[:, 0].copy(), moments=whole[:, 1:].copy())

    def arrays(self) -> list[np.ndarray]:
        """Arrays of the lattice, for what counts memory."""
        kept = [self.values, self.field, self.result, self.forces, self.sums, self.slopes, self.jumps, self.unused]
        return [*kept, *(array for array in self.rows if isinstance(array, np.ndarray))]

    def over_offsets(self, values: np.ndarray) -> np.ndarray:
        """Sums (owned, 4) over offsets of values (n,), and of values times the offset, in spacings."""
        field, result = np.zeros_like(self.field[0]), np.zeros_like(self.result[0])
        field[self.rows.line, self.rows.place] = values
        moments(self.box, self.lines, field, self.across, result, self.sums[0], self.slopes)
        owned = slice(self.bonds.owned)
        return result[:, self.rows.line[owned], self.rows.place[owned] - self.box.lead].T

    def gradient(
        self, message: str | None, fields: tuple[Any, ...] = FIELD, sums: np.ndarray | None = None
    ) -> np.ndarray:
        """See `PairSystem.gradient`; of one vector."""
        kinematics = self.particles.storage("kinematics")
        result, column = self.particles.storage("pair_sums") if sums is None else sums, fields[0].column or 0
        self._tell(message)
        spread(self.bonds.space, self.rows, column, kinematics, self.base, self.field)
        for field, moved in zip(self.field, self.result):
            moments(self.box, self.lines, field, self.across, moved, self.sums[0], self.slopes)
        at = self.box.lead, self.width, column
        jumps = self.jumps if column == 0 else self.unused
        collect(self.bonds.space, self.rows, *at, kinematics, self.base, self.result, jumps, result)
        self._images(add_gradients, fields, kinematics, result)
        return result

    def divergence(self, terms: Any = None) -> np.ndarray:
        """See `PairSystem.divergence`; `ShearScaled` acts on the field that the last gradient was taken of."""
        kinematics, record, force = map(self.particles.storage, ("kinematics", "record", "pair_force"))
        self._tell("record")
        stiffness = None
        if terms is not None:
            stiffness = record_columns(self.bonds.space, terms).stiffness
            if self.stiffnesses is None:
                self.stiffnesses = self._over_stiffnesses(record, stiffness)
            self.base[:] = kinematics[0, : len(self.base)]
        spread_records(self.bonds.space, self.rows, self.width, stiffness, kinematics, self.base, record, self.values)
        for values, result in zip(self.values, self.forces):
            plain = None if terms is None else values[0]
            contraction(self.box, self.lines, values, self.across, plain, result, self.sums, self.slopes)
        at, moved = (self.box.lead, self.width, stiffness, self.stiffnesses), (self.forces, self.jumps)
        collect_forces(self.bonds.space, self.rows, *at, kinematics, self.base, record, *moved, force)
        self._images(add_forces, terms, kinematics, record, force)
        return force

    def _tell(self, message: str | None) -> None:
        """Ghosts, all at once: a line of places has both them and owned particles."""
        if message is not None:
            self.particles.send(message)
            self.particles.receive(message)

    def _images(self, add: Any, what: Any, *arrays: np.ndarray) -> None:
        """A pass over the bonds with mirror images."""
        if self.bonds.mirror is not None:
            add(self.bonds.space, self.bonds.mirror, what, *arrays)

    def _over_stiffnesses(self, record: np.ndarray, stiffness: int) -> np.ndarray:
        """sum V_b C1_b (owned, d, d)."""
        d, rows = len(self.base), self.rows
        result = np.empty((self.bonds.owned, d, d))
        for i in range(d):
            for j in range(d):
                values = rows.volume * record[: len(rows.volume), stiffness + self.width * j + i]
                result[:, i, j] = self.over_offsets(values)[:, 0]
        return result


# --- whether particles are on a lattice --------------------------------------------------------------------------


def lattice_sums(bonds: Any) -> LatticeSums | None:
    """Of this rank's bonds between particles and ghosts, None where they are not those of one lattice, or few."""
    weights, terms = bonds.weights, bonds.terms
    fits = isinstance(weights.influence, Constant) and not weights.bar and len(bonds.metric) == 1
    if not fits or bonds.owned < _FEWEST or not isinstance(terms, ShearScaled | None):
        return None
    found = _places(bonds.positions)
    if found is None:
        return None
    index, spacing = found
    d, counts = index.shape[1], index.max(axis=0) + 1
    if len(index) < _FULLEST * np.prod(counts.astype(float)):
        return None
    # the axis along which particles stand one behind the other, if it is long, else the longest
    fast = int(np.argmax(np.abs(index[1] - index[0])))
    fast = fast if 2 * counts[fast] >= counts.max() else int(np.argmax(counts))
    slow = [axis for axis in range(d) if axis != fast]
    order = np.array([0, 0, 0])
    order[-1 - len(slow) : -1], order[-1] = slow, fast
    lines = _lines(spacing, bonds.metric[0], weights.support, order, d)
    if _offsets(lines) <= _FEWEST_BONDS:
        return None
    first = int(counts[slow[0]]) if d == 3 else 1
    second, room = int(counts[slow[-1]]), padded(int(counts[fast]))
    line = index[:, slow[-1]] + (second * index[:, slow[0]] if d == 3 else 0)
    wanted = np.zeros(first * second, bool)
    wanted[line[: bonds.owned]] = True
    lead, axis = padded(int(lines.half.max())), np.zeros(d, np.int64)
    axis[slow], axis[fast] = np.arange(3 - d, 2), 2
    nothing = np.zeros(0)
    rows = Rows(line, index[:, fast] + lead, bonds.volume.copy(), nothing, np.zeros((0, 3)), axis, spacing)
    result = LatticeSums(bonds, Box(first, second, room, lead, int(lines.half.max()) + 1, wanted), lines, rows)
    return result if np.array_equal(result.neighbours, _neighbours(bonds)) else None


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


def _neighbours(bonds: Any) -> np.ndarray:
    """So many (owned,) are bonded with each particle, mirror images aside."""
    result = np.zeros(bonds.owned)
    for pairs in (bonds.inner, bonds.rim):
        if pairs is not None:
            result += np.diff(pairs.start)[: bonds.owned]
            if mutual(pairs):
                result += np.bincount(pairs.neighbour, minlength=bonds.owned)
    return result
