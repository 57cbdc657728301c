"""The lowest modes K u = w^2 M u by LOBPCG on all ranks: conjugate gradients on a block of vectors.

Every iteration looks for the best vectors, by Rayleigh and Ritz, among the present ones X, their preconditioned
residuals W and the last changes P. W is orthonormal to X and P, and P to X, in M, which keeps the small matrices well
conditioned where modes have nearly one frequency. Vectors are rows of a rank's particles; what ranks exchange beside
the products are sums of small matrices.

Sources: A. V. Knyazev, SIAM J. Sci. Comput. 23 (2001) 517; U. Hetmaniuk, R. Lehoucq, J. Comput. Phys. 218 (2006) 324;
orthonormal vectors by A. Stathopoulos, K. Wu, SIAM J. Sci. Comput. 23 (2002) 2165.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums

# of the largest, what a square of a singular value is at least of vectors that count as independent
_INDEPENDENT = 1e-13
# of all its squares, what a motion that nothing holds may be where something holds: rounding
_LOOSE = 1e-13
# iterations after which products are taken anew, as rounding adds up in combinations of them
_RENEWED = 25
Operator = Callable[[np.ndarray], np.ndarray]


class Modes(NamedTuple):
    """squares (k,): w^2 [1/s^2], ascending; shapes (k, n, d): u with u . M u = 1 over all ranks; residuals (k,):
    |K u - w^2 M u| over |w^2 M u| in the norm of 1/M, which is how near w^2 is to an eigenvalue at least, relative, and
    where no other is near its square; iterations; products: with K; converged: whether all residuals are small."""

    squares: np.ndarray
    shapes: np.ndarray
    residuals: np.ndarray
    iterations: int
    products: int
    converged: bool


class _Block(NamedTuple):
    """Vectors (k, n, d) and their products with K."""

    vectors: np.ndarray
    images: np.ndarray

    def combined(self, factors: np.ndarray) -> "_Block":
        """Combinations of them by factors (k, l)."""
        return _Block(*(np.tensordot(factors.T, one, 1) for one in self))


class LowestModes:
    """The iteration on one rank; all methods are collective.

    product(u): K u (n, d) of all ranks' u (n, d), K symmetric; mass (n, 1) [kg]; precondition(r): about K^-1 r, of a
    symmetric and positive definite matrix; excluded (l, n, d): modes that are known, orthonormal in M.
    """

    def __init__(
        self, comm: Any, product: Operator, mass: np.ndarray, precondition: Operator, excluded: np.ndarray
    ) -> None:
        self.comm, self.product, self.mass = comm, product, mass
        self.precondition, self.excluded, self.products = precondition, excluded, 0

    def find(self, start: np.ndarray, count: int, tolerance: float, limit: int) -> Modes:
        """The lowest `count` modes from vectors (m, n, d), m >= count, in at most `limit` iterations.

        Gives fewer where the excluded ones leave no more.
        """
        X = self._with_images(orthonormal(self.comm, start, self.mass, self.excluded))
        squares, factors = self._ritz(X, len(X.vectors))
        X, P = X.combined(factors), _Block(start[:0], start[:0])
        count, iterations, renewed = min(count, len(squares)), 0, True
        while True:
            residual = X.images - squares[:, None, None] * self.mass * X.vectors
            norms = np.sqrt(sums(self.comm, np.sum(residual**2 / self.mass, axis=(1, 2))))
            sizes = norms / np.maximum(np.abs(squares), np.finfo(float).tiny)
            done = bool((sizes[:count] <= tolerance).all())
            if iterations == limit or (done and renewed):
                break
            if done or iterations % _RENEWED == _RENEWED - 1:
                X, P, renewed = self._with_images(X.vectors), self._with_images(P.vectors), True
                iterations += not done
                continue
            rest = residual[sizes > 0.1 * tolerance]
            W = np.array([self.precondition(one) for one in rest]).reshape(rest.shape)
            known = np.concatenate((self.excluded, X.vectors, P.vectors))
            W = orthonormal(self.comm, W, self.mass, known)
            S = _Block(*map(np.concatenate, zip(X, self._with_images(W), P)))
            squares, factors = self._ritz(S, len(squares))
            X, P, renewed = S.combined(factors), S.combined(self._changes(S, factors)), False
            iterations += 1
        found = squares[:count], X.vectors[:count], sizes[:count]
        return Modes(*found, iterations, self.products, done)

    def _with_images(self, vectors: np.ndarray) -> _Block:
        """Vectors and their products."""
        self.products += len(vectors)
        images = [self.product(one) for one in vectors]
        return _Block(vectors, np.array(images).reshape(vectors.shape))

    def _ritz(self, S: _Block, count: int) -> tuple[np.ndarray, np.ndarray]:
        """Least w^2 (count,) of combinations of vectors, and the factors (k, count) of these."""
        from scipy.linalg import eigh

        stiffness, masses = sums(self.comm, np.array([_gram(S.vectors, S.images), self._masses(S.vectors)]))
        squares, factors = eigh(0.5 * (stiffness + stiffness.T), 0.5 * (masses + masses.T))
        return squares[:count], factors[:, :count]

    def _masses(self, vectors: np.ndarray) -> np.ndarray:
        """u . M v of this rank's part of vectors, (k, k)."""
        return _gram(vectors, self.mass * vectors)

    def _changes(self, S: _Block, factors: np.ndarray) -> np.ndarray:
        """Factors of what new vectors have that is not of the old ones, orthonormal to the new ones and each other."""
        masses, changes = sums(self.comm, self._masses(S.vectors)), factors.copy()
        changes[: factors.shape[1]] = 0.0
        for _ in range(2):
            changes -= factors @ (factors.T @ masses @ changes)
            changes = changes @ _independent(changes.T @ masses @ changes)
        return changes


def orthonormal(comm: Any, vectors: np.ndarray, mass: np.ndarray, others: np.ndarray) -> np.ndarray:
    """Vectors (l, n, d), l <= k, with the span of (k, n, d) less that of others (m, n, d), which are orthonormal in the
    mass (n, 1), and orthonormal among each other. Collective."""
    for _ in range(2):
        vectors = vectors - np.tensordot(sums(comm, _gram(others, mass * vectors)).T, others, 1)
        vectors = np.tensordot(_independent(sums(comm, _gram(vectors, mass * vectors))).T, vectors, 1)
    return np.asarray(vectors)


def rigid_modes(
    comm: Any, motions: np.ndarray, product: Operator, mass: np.ndarray, least: float
) -> tuple[np.ndarray, np.ndarray]:
    """Those (l, n, d), orthonormal in the mass (n, 1), of the span of some motions (k, n, d) that K does not resist,
    and their w^2 (l,) by rounding. least: w^2 [1/s^2] of a mode that is resisted. Collective."""
    basis = orthonormal(comm, motions, mass, motions[:0])
    images = np.array([product(one) for one in basis]).reshape(basis.shape)
    stiffness = sums(comm, _gram(basis, images))
    squares, axes = np.linalg.eigh(0.5 * (stiffness + stiffness.T))
    rigid = np.abs(squares) < least
    return np.tensordot(axes[:, rigid].T, basis, 1), squares[rigid]


def unrestrained_modes(comm: Any, motions: np.ndarray, restraint: np.ndarray) -> np.ndarray:
    """Those (l, n, d), orthonormal over all ranks, of the span of some motions (k, n, d) that nothing holds; restraint
    (k, k): sums of products of what the motions are wherever something holds, on all ranks together. Collective."""
    gram = sums(comm, np.tensordot(motions, motions, ((1, 2), (1, 2))))
    sizes, axes = np.linalg.eigh(gram)
    basis = axes[:, sizes > 1e-12 * sizes[-1]] / np.sqrt(sizes[sizes > 1e-12 * sizes[-1]])
    values, modes = np.linalg.eigh(basis.T @ restraint @ basis)
    return np.asarray(np.tensordot((basis @ modes[:, values < _LOOSE]).T, motions, 1))


def _gram(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """This rank's part of products (k, l) of vectors."""
    size = int(np.prod(first.shape[1:]))
    return np.asarray(first.reshape(len(first), size) @ second.reshape(len(second), size).T)


def _independent(gram: np.ndarray) -> np.ndarray:
    """Factors (k, l) by which vectors with such products (k, k) become orthonormal; what depends on others is left
    out."""
    scale = 1.0 / np.sqrt(np.maximum(np.diag(gram), np.finfo(float).tiny))
    scale[np.diag(gram) <= 0.0] = 0.0
    squares, axes = np.linalg.eigh(scale[:, None] * (0.5 * (gram + gram.T)) * scale)
    kept = squares > _INDEPENDENT * max(squares.max(initial=0.0), np.finfo(float).tiny)
    return np.asarray(scale[:, None] * axes[:, kept] / np.sqrt(squares[kept]))
