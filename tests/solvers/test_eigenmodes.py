"""LOBPCG against dense solutions: definite, free, clustered and badly scaled matrices, on any number of ranks."""

import numpy as np
import pytest
from scipy.linalg import eigh

from parsolid.solvers import LowestModes, rigid_modes


def chain(n, d, springs=None):
    """K (n d, n d) of points on a line, each joined to the next two in every component, free at both ends."""
    K = np.zeros((n * d, n * d))
    strength = np.ones(n) if springs is None else springs
    for reach in (1, 2):
        for a in range(n - reach):
            for i in range(d):
                at = np.array([a, a + reach]) * d + i
                K[np.ix_(at, at)] += strength[a] * (1.0 + 0.1 * i) / reach * np.array([[1.0, -1.0], [-1.0, 1.0]])
    return K


def rows_of_rank(comm, n):
    """This rank's part of so many particles: none on the second rank of three."""
    bounds = {1: [0, n], 2: [0, n // 3, n], 3: [0, n // 2, n // 2, n]}[comm.size]
    return slice(bounds[comm.rank], bounds[comm.rank + 1])


def on_ranks(comm, K, n, d):
    """The product with a whole matrix of what ranks have."""
    own = rows_of_rank(comm, n)

    def product(u):
        whole = np.concatenate(comm.allgather(u.ravel()))
        return (K @ whole).reshape(n, d)[own]

    return own, product


def find(comm, K, mass, count, precondition=None, excluded=None, tolerance=1e-7, seed=0):
    n, d = len(mass), len(K) // len(mass)
    own, product = on_ranks(comm, K, n, d)
    diagonal = K.diagonal().reshape(n, d)[own]
    none = np.zeros((0, *diagonal.shape))
    solver = LowestModes(
        comm, product, mass[own, None], precondition or (lambda r: r / diagonal), none if excluded is None else excluded
    )
    start = np.random.default_rng(seed).normal(size=(count + 3, n, d))[:, own]
    return solver.find(start, count, tolerance, 500)


@pytest.mark.parametrize("spread", [1.0, 1e4])
def test_lowest_modes_of_a_clamped_chain(comm, spread):
    n, d = 40, 2
    random = np.random.default_rng(1)
    K = chain(n, d, np.exp(np.log(spread) * random.random(n)))
    K[:d, :d] += np.eye(d)
    mass = 1.0 + random.random(n)
    expected, vectors = eigh(K, np.diag(np.repeat(mass, d)), subset_by_index=(0, 5))
    found = find(comm, K, mass, 6)
    assert found.converged
    assert found.squares == pytest.approx(expected, rel=1e-9)
    whole = np.concatenate(comm.allgather(found.shapes), axis=1).reshape(6, -1)
    overlap = np.abs(vectors.T @ (np.repeat(mass, d)[:, None] * whole.T))
    assert overlap == pytest.approx(np.eye(6), abs=1e-5)
    assert found.residuals.max() <= 1e-7


def test_modes_of_one_frequency_are_all_found(comm):
    """Three equal components: every frequency three times."""
    n = 30
    K = np.kron(chain(n, 1), np.eye(3)) + 0.01 * np.eye(3 * n)
    expected = eigh(K, eigvals_only=True, subset_by_index=(0, 7))
    found = find(comm, K, np.ones(n), 8)
    assert found.converged
    assert found.squares == pytest.approx(expected, rel=1e-9)


def test_rigid_modes_are_found_and_left_out(comm):
    """Two chains that nothing joins: of the motions of each and of what deforms them, two translations have no
    stiffness."""
    n, half = 24, 12
    K = np.zeros((n, n))
    K[:half, :half], K[half:, half:] = chain(half, 1), 3.0 * chain(half, 1)
    mass = 1.0 + np.random.default_rng(2).random(n)
    own, product = on_ranks(comm, K, n, 1)
    first, place = (np.arange(n) < half) * 1.0, np.arange(n) * 1.0
    motions = np.array([first, 1.0 - first, place, first * place, first + 0.5])[:, own, None]
    shapes, squares = rigid_modes(comm, motions, product, mass[own, None], 1e-9)
    assert len(shapes) == 2
    assert np.abs(squares).max() < 1e-12
    found = find(comm, K, mass, 4, excluded=shapes)
    expected = eigh(K, np.diag(mass), eigvals_only=True, subset_by_index=(2, 5))
    assert found.squares == pytest.approx(expected, rel=1e-9)


def test_fewer_modes_than_asked_for(comm):
    """A body of three points has three modes, and then none."""
    K, mass = chain(3, 1) + np.eye(3), np.ones(3)
    own, product = on_ranks(comm, K, 3, 1)
    solver = LowestModes(comm, product, mass[own, None], lambda r: r, np.zeros((0, len(mass[own]), 1)))
    found = solver.find(np.random.default_rng(3).normal(size=(5, 3, 1))[:, own], 5, 1e-9, 50)
    assert found.squares == pytest.approx(eigh(K, eigvals_only=True), rel=1e-12)


def test_a_limit_of_iterations_is_told(comm):
    K, mass = chain(60, 1) + 1e-3 * np.eye(60), np.ones(60)
    own, product = on_ranks(comm, K, 60, 1)
    solver = LowestModes(comm, product, mass[own, None], lambda r: r, np.zeros((0, len(mass[own]), 1)))
    found = solver.find(np.random.default_rng(3).normal(size=(3, 60, 1))[:, own], 2, 1e-12, 3)
    assert not found.converged
    assert found.iterations == 3
    assert found.residuals.max() > 1e-6
