"""Multilinear functions on a grid of nodes over particles: their values at particles, and their elastic stiffness.

The stiffness of a cell is a sum over its particles of polynomials of their places, two degrees an axis: what particles
give it are moments, 3^d of each modulus, that are the same for all pairs of its functions and add up over ranks.
"""

from itertools import product
from typing import Any, NamedTuple

import numpy as np

from parsolid.collective import maximum, minimum
from parsolid.kernels import kernel

# nodes of the grid are as many at most, in so many dimensions: factors fill up faster in space
_MOST_NODES = {1: 4000, 2: 8000, 3: 1400}


class Grid(NamedTuple):
    """lower (d,) [m]; width (d,) [m] of a cell; cells (d,); strides (d,): from a node's number to that of the next
    along an axis, the longest axis being the slowest, so that numbers of a cell's nodes are near one another.
    """

    lower: np.ndarray
    width: np.ndarray
    cells: np.ndarray
    strides: np.ndarray

    @classmethod
    def over(cls, comm: Any, places: np.ndarray, width: float) -> "Grid":
        """From the least to the greatest of places (n, d) [m] on all ranks, in cells of a width [m] or wider; not all
        ranks need have places. Collective.
        """
        d = places.shape[1]
        lower = minimum(comm, places.min(axis=0, initial=np.inf))
        size = np.maximum(maximum(comm, places.max(axis=0, initial=-np.inf)) - lower, 1e-9 * width)
        cells = np.maximum(np.ceil(size / width - 1e-6), 1.0)
        while np.prod(cells + 1) > _MOST_NODES[d]:
            width *= 1.05
            cells = np.maximum(np.ceil(size / width - 1e-6), 1.0)
        strides = np.ones(d, np.int64)
        fast = np.argsort(cells, kind="stable")
        strides[fast[1:]] = np.cumprod(cells[fast[:-1]] + 1)
        return cls(lower, size / cells, cells.astype(np.int64), strides)

    @property
    def nodes(self) -> int:
        """How many."""
        return int(np.prod(self.cells + 1))

    @property
    def numbers(self) -> np.ndarray:
        """Places (nodes, d) int64 of nodes, in widths from the lower corner."""
        return np.arange(self.nodes)[:, None] // self.strides % (self.cells + 1)

    @property
    def corners(self) -> np.ndarray:
        """From the number of a cell's lower node to those (2^d,) of all its nodes."""
        return np.array(list(product((0, 1), repeat=len(self.cells)))) @ self.strides

    def within(self, places: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Numbers (n,) of the lower nodes of cells, and places within the cells (n, d), from 0 to 1."""
        scaled = (places - self.lower) / self.width
        cell = np.clip(scaled.astype(np.int64), 0, self.cells - 1)
        return cell @ self.strides, scaled - cell


def shape_values(within: np.ndarray) -> np.ndarray:
    """Multilinear functions (n, 2^d) of a cell's nodes at places within it (n, d)."""
    factors = [[1.0 - one, one] for one in within.T]
    corners = product((0, 1), repeat=within.shape[1])
    return np.stack([np.prod([factors[axis][k] for axis, k in enumerate(at)], axis=0) for at in corners], axis=1)


class Functions(NamedTuple):
    """The functions at particles: lower (n,), within (n, d) of `Grid.within`; corners (2^d,)."""

    lower: np.ndarray
    within: np.ndarray
    corners: np.ndarray

    @classmethod
    def of(cls, grid: Grid, places: np.ndarray) -> "Functions":
        """At places (n, d) [m]."""
        return cls(*grid.within(places), grid.corners)

    def matrix(self, nodes: int) -> Any:
        """Their values (n, nodes), sparse: what functions with values at nodes are at particles."""
        from scipy import sparse

        rows = np.repeat(np.arange(len(self.lower)), len(self.corners))
        places = rows, (self.lower[:, None] + self.corners).ravel()
        return sparse.csr_array((shape_values(self.within).ravel(), places), (len(self.lower), nodes))


@kernel
def add_moments(at: Functions, weights: np.ndarray, result: np.ndarray) -> None:
    """Add weights (n, kinds) of particles times products of powers 0 to 2 of their places within cells to result
    (nodes, kinds, 3^d), at the lower node of each cell; the first axis is the fastest.
    """
    powers = np.empty(result.shape[2])
    for p in range(len(at.lower)):
        powers[0], count = 1.0, 1
        for axis in range(at.within.shape[1]):
            for k in range(2 * count):
                powers[count + k] = at.within[p, axis] * powers[k]
            count *= 3
        for kind in range(weights.shape[1]):
            if weights[p, kind] != 0.0:
                for k in range(count):
                    result[at.lower[p], kind, k] += weights[p, kind] * powers[k]


def stiffness_of_moments(width: np.ndarray) -> np.ndarray:
    """From moments to stiffness of a cell: (2 + d, 3^d, 2^d, d, 2^d, d), of first Lame constants, shear moduli
    [Pa m^3], and of what holds each component in place [N/m]; width (d,) [m] of cells.
    """
    d = len(width)
    # of an axis, coefficients of the product of two functions, each a value or a slope
    value, slope = np.array([[1.0, -1.0], [0.0, 1.0]]), np.array([[-1.0, 0.0], [1.0, 0.0]])
    parts = [np.stack((value, slope / one)) for one in width]
    products = [np.stack([_times(first, second) for first, second in product(one, one)]) for one in parts]
    result = np.zeros((2 + d, 3**d, 1 << d, d, 1 << d, d))

    def of(i: int | None, j: int | None) -> np.ndarray:
        """(3^d, 2^d, 2^d) of the i-th slope of one function and the j-th of the other, None for values."""
        whole = np.ones((1, 1, 1))
        for axis in range(d):
            one = products[axis][2 * (i == axis) + (j == axis)]
            whole = np.einsum("mab,xye->emaxby", whole, one).reshape(3 * len(whole), 2 * whole.shape[1], -1)
        return whole

    for i, j in product(range(d), repeat=2):
        result[0, :, :, i, :, j] += of(i, j)
        result[1, :, :, i, :, j] += of(j, i)
    squares = sum(of(k, k) for k in range(d))
    for i in range(d):
        result[1, :, :, i, :, i] += squares
        result[2 + i, :, :, i, :, i] += of(None, None)
    return result


def _times(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Coefficients (2, 2, 3) of products of linear functions (2, 2 coefficients)."""
    result = np.zeros((2, 2, 3))
    for a, b in product(range(2), repeat=2):
        result[a, b] = np.convolve(first[a], second[b])
    return result
