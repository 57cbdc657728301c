"""A preconditioner for stiffnesses of particles: the particles themselves, and a hierarchy of grids over all of them.

It is that of equilibria and of `modes`.

    M^-1 r = D^-1 r + P V P^T r

(additive Schwarz: Smith, Bjorstad and Gropp, Domain Decomposition, 1996, chapter 2). P takes motions of the finest grid
to the particles, and V is a V-cycle for the grid's stiffness. A node moves and turns, multilinear functions blend the
rigid motions of nodes: beams and plates bend without being sheared, whatever the width of the cells across them.
Cells are twice as wide from grid to grid, and functions of a coarser grid are combinations of those of the finer one.
The finest stiffness is found by quadrature over the particles, the others follow from it. A few particles in a cell
that the surface cuts do not feel all that may happen in it, so that a part is spread evenly over the cell.

Of every grid a rank has the nodes around its own particles alone. Matrices are those of its own particles, so that sums
over ranks at shared nodes are all that is exchanged; only the coarsest grid, which has at most `_MOST_NODES` nodes
however large the bodies, is factorised on every rank. What a rank does and keeps therefore grows with its own particles
alone. Vectors of nodes are partial, a sum over ranks being due (forces), or whole (motions).
"""

from itertools import combinations, product
from math import prod
from typing import Any, NamedTuple

import numpy as np

from decomposition.halo import near_ranks
from decomposition.plan import Exchange, Plan, swap
from decomposition.reduction import sums
from parsolid.collective import anywhere, maximum, minimum

# width of the finest cells over the mean spacing of particles: more than the horizon of a nonlocal stiffness, which is
# nearly a multiple of 1 for all that varies within it
_WIDTH = 4.0
# nodes of the coarsest grid at most, whose matrix is dense
_MOST_NODES = 150
# steps of Chebyshev's iteration before and after a coarser grid; the part of eigenvalues that it takes care of
_SMOOTHINGS, _SMOOTHED = 3, 0.1
# iterations that find the largest eigenvalue, and what it may be larger than it is found
_POWER_STEPS, _MARGIN = 12, 1.1
# of the diagonal, what is added to matrices that may be singular
_FLOOR = 1e-9
# of the stiffness of a cell, what is spread over it
_SPREAD = 0.1
# numbers of a chunk of the quadrature
_CHUNK = 500_000
# of the shear modulus, Lame's first at most: Poisson's ratio 0.4; a grid locks where volumes are stiffer
SOFTEST = 4.0


class SharedNodes:
    """Sums over the ranks that have a node: numbers (m, d) of this rank's nodes. Collective, as are its calls."""

    def __init__(self, comm: Any, numbers: np.ndarray, keys: np.ndarray) -> None:
        """keys (m,) int64: what nodes are told apart by, ascending."""
        # those whose boxes of numbers overlap
        ranks, boxes = near_ranks(comm, numbers.astype(float), 0.5)
        mine = [keys[((numbers >= lower) & (numbers <= upper)).all(axis=1)] for lower, upper in boxes]
        common = [np.intersect1d(one, theirs, assume_unique=True) for one, theirs in zip(mine, swap(comm, ranks, mine))]
        rows = [np.searchsorted(keys, one) for one in common]
        self.plan = Plan(comm, ranks, rows, rows)
        self._exchanges: dict[tuple[int, ...], tuple[np.ndarray, Exchange]] = {}

    def sum(self, partial: np.ndarray) -> np.ndarray:
        """Whole values (m, ...) of partial ones, which it may give back; the same to the bit on all ranks."""
        if not self.plan.neighbours:
            return partial
        if partial.shape not in self._exchanges:
            values = np.empty(partial.shape)
            self._exchanges[partial.shape] = values, self.plan.sum(values)
        values, exchange = self._exchanges[partial.shape]
        values[:] = partial
        exchange.now()
        return values.copy()


class Nodes:
    """The nodes of a grid that a rank has: numbers (m, d) int64 along the axes; width (d,) [m] of cells."""

    def __init__(self, comm: Any, lower: np.ndarray, width: np.ndarray, cells: np.ndarray, numbers: np.ndarray) -> None:
        """cells (d,) of the whole grid; numbers: of nodes, each maybe several times. Collective."""
        self.lower, self.width, self.cells = lower, width, cells
        strides = np.concatenate(([1], np.cumprod(cells[:-1] + 1)))
        keys = np.unique(numbers @ strides)
        self.strides, self.keys = strides, keys
        self.numbers = keys[:, None] // strides % (cells + 1)
        self.shared = SharedNodes(comm, self.numbers, keys)
        # of nodes of several ranks, so that sums over ranks count each once
        self.once = 1.0 / self.shared.sum(np.ones((len(keys), 1)))

    def rows(self, numbers: np.ndarray) -> np.ndarray:
        """Rows (...) of nodes by their numbers (..., d)."""
        return np.searchsorted(self.keys, numbers @ self.strides)


def turns(d: int) -> np.ndarray:
    """Skew matrices (r, d, d) of the turns about the axes of space, or in the plane."""
    result = np.zeros((d * (d - 1) // 2, d, d))
    for k, (i, j) in enumerate(combinations(range(d), 2)):
        result[k, j, i], result[k, i, j] = 1.0, -1.0
    return result


def rigid_motions(arms: np.ndarray) -> np.ndarray:
    """Shifts along the axes, and turns (k, n, d), of places by their arms (n, d) from a middle."""
    shifts = np.eye(arms.shape[1])[:, None] * np.ones((len(arms), 1))
    return np.concatenate((shifts, arms @ turns(arms.shape[1]).swapaxes(1, 2)))


class Blend(NamedTuple):
    """How motions of nodes are those of places: rows (n, c) of the nodes of each place, values (n, c) and slopes
    (n, c, d) [1/m] of their functions, arms (n, c, d) from nodes to places over the width of cells."""

    rows: np.ndarray
    values: np.ndarray
    slopes: np.ndarray
    arms: np.ndarray

    def part(self, some: Any) -> "Blend":
        """Of some places."""
        return Blend(*(one[some] for one in self))

    def motions(self) -> np.ndarray:
        """Motions (d, n, c, k) of the places by each node's k ways to move, where its function is 1."""
        d, W = self.arms.shape[2], turns(self.arms.shape[2])
        result = np.zeros((d, *self.rows.shape, d + len(W)))
        result[range(d), :, :, range(d)] = 1.0
        result[..., d:] = np.moveaxis(np.tensordot(W, self.arms, (2, 2)), 0, -1)
        return result


def blend_at(nodes: Nodes, places: np.ndarray) -> Blend:
    """Of places (n, d) [m]."""
    scaled = (places - nodes.lower) / nodes.width
    cell = np.clip(scaled.astype(np.int64), 0, nodes.cells - 1)
    corners = np.array(list(product((0, 1), repeat=places.shape[1])))
    return Blend(nodes.rows(cell[:, None] + corners), *blend_within(scaled - cell, nodes.width))


def blend_within(within: np.ndarray, width: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Values, slopes and arms of a `Blend` at places within a cell (n, d), from 0 to 1; width (d,) [m] of it."""
    d = within.shape[1]
    corners = np.array(list(product((0, 1), repeat=d)))
    factors = [np.where(corner, x[:, None], 1.0 - x[:, None]) for corner, x in zip(corners.T, within.T)]
    slopes = np.empty((len(within), len(corners), d))
    for i in range(d):
        others = prod(factors[:i] + factors[i + 1 :])
        slopes[:, :, i] = others * np.where(corners[:, i], 1.0, -1.0) / width[i]
    return prod(factors), slopes, (within[:, None] - corners) * width / width.max()


def even_cell(width: np.ndarray) -> np.ndarray:
    """Stiffness (2, c k, c k) of a cell of a width (d,) [m] with Lame's first modulus, and with the shear modulus, of
    1 Pa, over its volume [1/m^2]."""
    d = len(width)
    points, weights = np.polynomial.legendre.leggauss(3)
    within = np.array(list(product(0.5 + 0.5 * points, repeat=d)))
    weight = np.prod(list(product(0.5 * weights, repeat=d)), axis=1)
    blend = Blend(np.zeros((len(within), 1 << d), np.int64), *blend_within(within, width))
    motions, none = blend.motions(), np.zeros(len(within))
    roots = [_energy_roots(motions, blend.slopes, *moduli) for moduli in ((weight, none), (none, weight))]
    return np.array([one.T @ one for one in (root.reshape(-1, root[0, 0].size) for root in roots)])


class Level:
    """A grid with its stiffness: matrix (m k, m k), of this rank's particles, sparse; inverse (m, k, k): of the whole
    blocks of nodes; from_coarser (m k, m' k): to the motions of its nodes from those of the next grid's."""

    from_coarser: Any = None

    def __init__(self, comm: Any, nodes: Nodes, matrix: Any, ways: int) -> None:
        self.comm, self.nodes, self.matrix, self.ways = comm, nodes, matrix, ways
        self.inverse = np.linalg.inv(_floored(nodes.shared.sum(_diagonal_blocks(matrix, ways))))
        largest = _MARGIN * self._largest()
        # roots of Chebyshev's polynomial on the part of eigenvalues that grids with wider cells do not find
        middle, half = 0.5 * largest * (1.0 + _SMOOTHED), 0.5 * largest * (1.0 - _SMOOTHED)
        angles = np.pi * (np.arange(_SMOOTHINGS) + 0.5) / _SMOOTHINGS
        self.steps = 1.0 / (middle + half * np.cos(angles))

    def _largest(self) -> float:
        """The largest eigenvalue of the blocks' inverse times the matrix."""
        x = np.sin(12.9898 * (self.nodes.keys[:, None] % 100_003 + 1) + 78.233 * np.arange(self.ways))
        size = 1.0
        for _ in range(_POWER_STEPS):
            x = self._relaxed(self.matrix @ x.ravel())
            size = float(np.sqrt(sums(self.comm, [np.vdot(x, self.nodes.once * x)])[0]))
            x /= max(size, np.finfo(float).tiny)
        return max(size, np.finfo(float).tiny)

    def _relaxed(self, partial: np.ndarray) -> np.ndarray:
        """Blocks' inverse times the sum over ranks of a partial vector, (m, k)."""
        whole = self.nodes.shared.sum(partial.reshape(-1, self.ways))
        return np.asarray(np.einsum("mij,mj->mi", self.inverse, whole))

    def smooth(self, x: np.ndarray | None, right: np.ndarray) -> np.ndarray:
        """Better motions (m k,) for partial forces (m k,) from some, None for 0."""
        for step in self.steps:
            rest = right if x is None else right - self.matrix @ x
            change = step * self._relaxed(rest).ravel()
            x = change if x is None else x + change
        assert x is not None
        return x


class Coarsest:
    """The coarsest grid, factorised on every rank."""

    def __init__(self, comm: Any, nodes: Nodes, matrix: Any, ways: int) -> None:
        """matrix: as of a `Level`; its sum over ranks is kept, too."""
        from scipy.linalg import cholesky

        self.comm, self.nodes = comm, nodes
        # they are few, and so are what ranks pass on to each other
        keys = comm.allreduce(nodes.keys, np.union1d)
        rows = np.searchsorted(keys, nodes.keys)
        self.places = (rows[:, None] * ways + np.arange(ways)).ravel()
        whole = np.zeros((len(keys) * ways,) * 2)
        whole[np.ix_(self.places, self.places)] = matrix.toarray()
        whole = sums(comm, whole)
        whole += np.diag(_FLOOR * np.diag(whole) + np.finfo(float).tiny)
        self.matrix, self.factors = whole, cholesky(whole, lower=True, check_finite=False)

    def solve(self, partial: np.ndarray) -> np.ndarray:
        """Motions (m k,) for partial forces (m k,)."""
        from scipy.linalg.lapack import dpotrs

        right = np.zeros(len(self.factors))
        right[self.places] = partial
        return np.asarray(dpotrs(self.factors, sums(self.comm, right), lower=1)[0][self.places])


class GridLevels:
    """The preconditioner on one rank; all methods are collective."""

    def __init__(
        self, comm: Any, places: np.ndarray, spacing: float, free: np.ndarray, resisted: np.ndarray | None = None
    ) -> None:
        """places (n, d) [m] of this rank's particles; spacing [m]: their mean one, on all ranks; free (n, d) bool:
        their components that move; resisted (n, d) bool: components that are held by the diagonal's stiffness, those
        that do not move unless given."""
        d = places.shape[1]
        self.comm, self.free = comm, free
        lower = minimum(comm, places.min(axis=0, initial=np.inf))
        size = np.maximum(maximum(comm, places.max(axis=0, initial=-np.inf)) - lower, 1e-9 * spacing)
        cells = np.maximum(np.ceil(size / (_WIDTH * spacing) - 1e-6), 1.0).astype(np.int64)
        width = size / cells
        cell = np.clip(((places - lower) / width).astype(np.int64), 0, cells - 1)
        corners = np.array(list(product((0, 1), repeat=d)))
        self.nodes = Nodes(comm, lower, width, cells, np.unique(cell, axis=0)[:, None].repeat(2**d, 1) + corners)
        self.ways, self.even = d + d * (d - 1) // 2, even_cell(width)
        self.blend = blend_at(self.nodes, places)
        # P (n d, m k), sparse
        self.prolongation = _at_places(self.blend, free, len(self.nodes.keys))
        self.resisted = ~free if resisted is None else resisted
        self.resists = anywhere(comm, bool(self.resisted.any()))

    def of_moduli(
        self,
        lame: np.ndarray,
        shear: np.ndarray,
        volume: np.ndarray,
        diagonal: np.ndarray,
        added: np.ndarray | None = None,
        softest: float = SOFTEST,
        most_nodes: float = _MOST_NODES,
    ) -> None:
        """Take moduli (n,) [Pa] and volumes (n,) [m^3] of the particles, and the diagonal D (n, d) [N/m]; added (n, d)
        [N/m]: what masses in a step of motion and tools add to it; softest: the first over the second modulus at most;
        most_nodes: of the coarsest grid."""
        self.diagonal, lame = diagonal, np.minimum(lame, softest * shear)
        matrix = self._stiffness(lame * volume, shear * volume, diagonal * self.resisted)
        if added is not None:
            self.diagonal = diagonal + added
            matrix = (matrix + self.prolongation.T @ self.prolongation.multiply(added.reshape(-1, 1))).tocsr()
        self.levels: list[Level] = []
        nodes = self.nodes
        while round(sums(self.comm, [nodes.once.sum()])[0]) > most_nodes and (nodes.cells > 1).any():
            level = Level(self.comm, nodes, matrix, self.ways)
            nodes, level.from_coarser = _coarser(self.comm, nodes, self.ways)
            matrix = (level.from_coarser.T @ matrix @ level.from_coarser).tocsr()
            self.levels.append(level)
        self.coarsest = Coarsest(self.comm, nodes, matrix, self.ways)

    def _stiffness(self, lame: np.ndarray, shear: np.ndarray, held: np.ndarray) -> Any:
        """Of the finest grid: of moduli times volumes (n,) [Pa m^3], and of what holds components, held (n, d) [N/m],
        at which functions do not stop: what they lack is their jump there."""
        from scipy import sparse

        size, k, (n, c) = len(self.nodes.keys) * self.ways, self.ways, self.blend.rows.shape
        # particles of a cell have the same nodes
        order = np.argsort(self.blend.rows[:, 0], kind="stable")
        starts = np.flatnonzero(np.diff(self.blend.rows[order, 0], prepend=-1))
        counts = np.diff(starts, append=n)
        d = self.free.shape[1]
        kinds = 1 + d + d * (d - 1) // 2 + (d if self.resists else 0)
        room = max(1, _CHUNK // max(1, int(counts.max(initial=1)) * kinds * c * k))
        chunks = [slice(first, first + room) for first in range(0, len(starts), room)]
        parts = [self._of_cells(order, starts[some], counts[some], lame, shear, held) for some in chunks]
        while len(parts) > 1:
            parts = [sum(parts[i + 1 : i + 2], start=parts[i]) for i in range(0, len(parts), 2)]
        return parts[0] if parts else sparse.csr_array((size, size))

    def _of_cells(
        self, order: np.ndarray, starts: np.ndarray, counts: np.ndarray, lame: Any, shear: Any, held: Any
    ) -> Any:
        """The same of some cells, whose particles (counts) begin at `starts` of an order."""
        cell = np.repeat(np.arange(len(counts)), counts)
        place = starts[0] + np.arange(len(cell))
        rows, within = order[place], place - starts[cell]
        blend = self.blend.part(rows)
        moduli = lame[rows], shear[rows]
        own = [(1.0 - _SPREAD) * one for one in moduli]
        motions = blend.motions()
        strains = _energy_roots(motions, blend.slopes, *own)
        if self.resists:
            jumps = motions * (blend.values * np.sqrt(held[rows]).T[:, :, None])[..., None]
            strains = np.concatenate((strains, jumps.swapaxes(0, 1)), axis=1)
        n, kinds, c, k = strains.shape
        gathered = np.zeros((len(counts), int(counts.max()), kinds, c * k))
        gathered[cell, within] = strains.reshape(n, kinds, c * k)
        gathered = gathered.reshape(len(counts), -1, c * k)
        blocks = gathered.swapaxes(1, 2) @ gathered
        for one, even in zip(moduli, self.even):
            blocks += _SPREAD * np.bincount(cell, one)[:, None, None] * even
        at = self.blend.rows[order[starts]]
        columns = (at[:, :, None] * k + np.arange(k)).reshape(len(counts), 1, c * k)
        return _placed(columns.repeat(c * k, axis=1), blocks, len(self.nodes.keys) * k)

    def __call__(self, residual: np.ndarray) -> np.ndarray:
        """M^-1 r (n, d) of a residual (n, d) that is 0 where a component is prescribed."""
        motions = self._cycle(0, self.prolongation.T @ residual.ravel())
        return residual / self.diagonal + (self.prolongation @ motions).reshape(residual.shape)

    def _cycle(self, number: int, right: np.ndarray) -> np.ndarray:
        """V of a grid: motions for partial forces."""
        if number == len(self.levels):
            return self.coarsest.solve(right)
        level = self.levels[number]
        x = level.smooth(None, right)
        rest = level.from_coarser.T @ (right - level.matrix @ x)
        x = x + level.from_coarser @ self._cycle(number + 1, rest)
        return level.smooth(x, right)


def moduli_of_rows(laws: list[tuple[int, int, float, float, float]], count: int) -> tuple[np.ndarray, np.ndarray]:
    """Lame's first and shear moduli (count,) [Pa] of rows that share laws, see `Tangent.laws`."""
    lame, shear = np.zeros((2, count))
    for first, last, *moduli, _ in laws:
        shear[first:last], lame[first:last] = moduli
    return lame, shear


def _energy_roots(motions: np.ndarray, slopes: np.ndarray, lame: np.ndarray, shear: np.ndarray) -> np.ndarray:
    """Numbers (n, kinds, c, k) of motions (d, n, c, k) by functions of slopes (n, c, d), whose products are energies:
    products of two motions' numbers add up to theirs. Gradients are motions times slopes, but for the skew matrix of a
    turn, which has no energy."""
    d, scale = len(motions), (..., None, None)
    volume, shape = np.sqrt(np.maximum(lame, 0.0))[scale], np.sqrt(shear)[scale]
    along = np.moveaxis(slopes, 2, 0)[..., None]
    parts = [volume * np.einsum("inak,inak->nak", motions, along)]
    parts += [np.sqrt(2.0) * shape * motions[i] * along[i] for i in range(d)]
    parts += [shape * (motions[i] * along[j] + motions[j] * along[i]) for i, j in combinations(range(d), 2)]
    return np.stack(parts, axis=1)


def _coarser(comm: Any, nodes: Nodes, ways: int) -> tuple[Nodes, Any]:
    """The grid of cells twice as wide, but across one cell, and the motions (m k, m' k) of the finer one's nodes by
    those of its nodes."""
    d = nodes.numbers.shape[1]
    factor = np.where(nodes.cells > 1, 2, 1)
    corners = np.array(list(product((0, 1), repeat=d)))
    first, odd = nodes.numbers // factor, nodes.numbers % factor
    # of corners beyond which a node does not lie there is no share
    share = np.prod(np.where(odd[:, None], 0.5, corners == 0), axis=2)
    node, corner = np.nonzero(share)
    parents = first[node] + corners[corner]
    coarse = Nodes(comm, nodes.lower, factor * nodes.width, -(-nodes.cells // factor), parents)
    arms = (nodes.numbers[node] / factor - parents) * coarse.width / coarse.width.max()
    blocks = np.zeros((len(node), ways, ways))
    blocks[:, range(d), range(d)] = 1.0
    blocks[:, :d, d:] = np.einsum("rij,pj->pir", turns(d), arms)
    # turns are in widths
    blocks[:, range(d, ways), range(d, ways)] = nodes.width.max() / coarse.width.max()
    blocks *= share[node, corner][:, None, None]
    return coarse, _blocks(node, coarse.rows(parents), blocks, len(nodes.keys), len(coarse.keys))


def _blocks(rows: np.ndarray, columns: np.ndarray, blocks: np.ndarray, height: int, width: int) -> Any:
    """A sparse matrix of blocks (p, a, b) at rows and columns (p,) of so many blocks."""
    from scipy import sparse

    _, a, b = blocks.shape
    down = np.broadcast_to((rows[:, None] * a + np.arange(a))[:, :, None], blocks.shape)
    across = np.broadcast_to((columns[:, None] * b + np.arange(b))[:, None, :], blocks.shape)
    entries = (blocks.ravel(), (down.ravel(), across.ravel()))
    return sparse.csr_array(sparse.coo_array(entries, (height * a, width * b)))


def _placed(columns: np.ndarray, blocks: np.ndarray, size: int) -> Any:
    """The sum of symmetric blocks (p, a, a), whose columns and rows are at `columns` (p, a, a)."""
    from scipy import sparse

    entries = (blocks.ravel(), (columns.swapaxes(1, 2).ravel(), columns.ravel()))
    return sparse.csr_array(sparse.coo_array(entries, (size, size)))


def _at_places(blend: Blend, free: np.ndarray, nodes: int) -> Any:
    """Motions of n places by those of their nodes, but of components that are not free (n, d), as a matrix (n d,
    nodes k)."""
    from scipy import sparse

    (n, c), d = blend.rows.shape, free.shape[1]
    W = turns(d)
    k = d + len(W)
    values, columns = np.empty((n, d, c, d)), np.empty((n, d, c, d), np.int32)
    for i in range(d):
        # along an axis places are moved by shifts along it and by turns about others
        ways = [i, *(d + r for r in range(len(W)) if W[r, i].any())]
        values[:, i, :, 0] = blend.values
        turned = np.tensordot(blend.arms, W[W[:, i].any(axis=1), i], (2, 1))
        values[:, i, :, 1:] = blend.values[:, :, None] * turned
        columns[:, i] = blend.rows[:, :, None] * k + ways
    values *= free[:, :, None, None]
    starts = np.arange(0, n * d * c * d + 1, c * d, dtype=np.int32)
    return sparse.csr_array((values.ravel(), columns.ravel(), starts), (n * d, nodes * k))


def _diagonal_blocks(matrix: Any, ways: int) -> np.ndarray:
    """Blocks (m, k, k) on the diagonal of a sparse matrix."""
    whole = matrix.tocoo()
    here = whole.row // ways == whole.col // ways
    result = np.zeros((matrix.shape[0] // ways, ways, ways))
    result[whole.row[here] // ways, whole.row[here] % ways, whole.col[here] % ways] = whole.data[here]
    return result


def _floored(blocks: np.ndarray) -> np.ndarray:
    """Blocks (m, k, k) with what makes their inverses finite: of few particles around a node they are singular."""
    diagonal = np.einsum("mii->mi", blocks)
    k = blocks.shape[1]
    result = blocks.copy()
    least = 1e-6 * diagonal.max(axis=1, keepdims=True, initial=0.0)
    result[:, range(k), range(k)] += np.maximum(least, np.finfo(float).tiny ** 0.5)
    return result
