"""Solvers against dense linear algebra, rows of the matrix spread over the ranks."""

import numpy as np
import pytest

from parsolid.solvers import conjugate_gradients, dynamic_relaxation, largest_eigenvalue, relaxation_mass, start_vector

_PARTICLES, _DIMENSION = 24, 2


class Spread:
    """A dense matrix of which each rank holds the rows of its particles; the last rank of several holds none."""

    def __init__(self, comm, matrix):
        self.comm, self.matrix = comm, matrix
        holders = max(comm.size - 1, 1)
        self.ends = [min(rank, holders) * _PARTICLES // holders for rank in range(comm.size + 1)]
        self.mine = slice(self.ends[comm.rank], self.ends[comm.rank + 1])
        self.products = 0

    def part(self, vector):
        return np.ascontiguousarray(vector.reshape(_PARTICLES, -1)[self.mine])

    def whole(self, part):
        return np.concatenate(self.comm.allgather(part)).ravel()

    def apply(self, x, out):
        self.products += 1
        out[:] = self.part(self.matrix @ self.whole(x))


def stiffness(largest=1e4):
    """A symmetric matrix with eigenvalues between 1 and `largest`."""
    size = _PARTICLES * _DIMENSION
    basis, _ = np.linalg.qr(np.random.default_rng(4).normal(size=(size, size)))
    return (basis * np.geomspace(1.0, largest, size)) @ basis.T


def some_vector(seed=0):
    return np.random.default_rng(seed).normal(size=_PARTICLES * _DIMENSION)


def solution_where_free(matrix, load, free):
    result = np.zeros(len(load))
    result[free] = np.linalg.solve(matrix[np.ix_(free, free)], load[free])
    return result


@pytest.fixture
def spread(comm):
    return Spread(comm, stiffness())


@pytest.mark.parametrize("masked", (False, True))
def test_conjugate_gradients_solve(spread, masked):
    load, free = some_vector(), np.ones(_PARTICLES * _DIMENSION, bool)
    if masked:
        free[::5] = False
    mask = spread.part(free) if masked else None
    mine = spread.part(load)
    solution = conjugate_gradients(spread.comm, spread.apply, mine, 1e-9, mask)
    assert np.array_equal(mine, spread.part(load))
    wanted = solution_where_free(spread.matrix, load, free)
    found = spread.whole(solution.value)
    assert solution.converged and solution.residual <= 1e-9 and solution.iterations == spread.products
    assert np.abs(found - wanted).max() < 1e-8
    assert np.all(found[~free] == 0.0)


def test_conjugate_gradients_need_as_many_iterations_as_distinct_eigenvalues(comm):
    direction = some_vector(3)
    matrix = np.eye(_PARTICLES * _DIMENSION) + np.outer(direction, direction)
    spread = Spread(comm, matrix)
    solution = conjugate_gradients(comm, spread.apply, spread.part(some_vector()), 1e-10)
    assert solution.converged and solution.iterations == 2


def test_conjugate_gradients_say_why_they_stop(spread):
    load = spread.part(some_vector())
    short = conjugate_gradients(spread.comm, spread.apply, load, 1e-9, limit=3)
    assert not short.converged and short.iterations == 3 and "3 iterations" in short.reason
    opposite = Spread(spread.comm, -spread.matrix)
    assert "positive stiffness" in conjugate_gradients(spread.comm, opposite.apply, load, 1e-9).reason
    broken = Spread(spread.comm, spread.matrix * np.nan)
    assert "not finite" in conjugate_gradients(spread.comm, broken.apply, load, 1e-9).reason


def test_nothing_to_solve(spread):
    nothing = spread.part(np.zeros(_PARTICLES * _DIMENSION))
    solution = conjugate_gradients(spread.comm, spread.apply, nothing, 0.0)
    assert solution.converged and solution.iterations == 0 and not solution.value.any()


def test_power_iteration_finds_the_largest_eigenvalue(spread):
    mass = np.random.default_rng(1).uniform(0.5, 2.0, _PARTICLES)
    start = start_vector(np.arange(_PARTICLES)[spread.mine], _DIMENSION)
    for masked in (False, True):
        free = np.ones(_PARTICLES * _DIMENSION, bool)
        free[:6] = not masked
        root = 1.0 / np.sqrt(np.repeat(mass, _DIMENSION))
        scaled = (root[:, None] * spread.matrix * root)[np.ix_(free, free)]
        wanted = np.linalg.eigvalsh(scaled)[-1]
        found = largest_eigenvalue(
            spread.comm, spread.apply, start, mass[spread.mine], spread.part(free), iterations=2000, tolerance=1e-10
        )
        assert found == pytest.approx(wanted, rel=1e-7)
        rough = largest_eigenvalue(spread.comm, spread.apply, start, mass[spread.mine], spread.part(free))
        assert 0.95 * wanted < rough <= wanted * (1 + 1e-12)


def test_power_iteration_of_special_matrices(comm):
    start = start_vector(np.arange(_PARTICLES)[Spread(comm, None).mine], _DIMENSION)
    assert largest_eigenvalue(comm, Spread(comm, 0.0 * stiffness()).apply, start) == 0.0
    assert largest_eigenvalue(comm, Spread(comm, np.nan * stiffness()).apply, start) == np.inf
    assert largest_eigenvalue(comm, None, start, free=np.zeros(start.shape, bool)) == 0.0


def test_start_vector_follows_the_identifier():
    identifier = np.arange(10_000)
    vector = start_vector(identifier, 3)
    assert np.array_equal(start_vector(identifier[::-1], 3), vector[::-1])
    assert len(np.unique(vector)) == vector.size and np.abs(vector).max() < 1.0
    # mean and mean square of a uniform distribution, to four standard errors
    assert abs(vector.mean()) < 4.0 * np.sqrt(1.0 / 3.0 / vector.size)
    assert abs((vector**2).mean() - 1.0 / 3.0) < 4.0 * np.sqrt(4.0 / 45.0 / vector.size)


def relaxed(spread, load, target, free=None, factor=1.0, start=None, limit=100_000):
    """Dynamic relaxation of load - K u, with a fictitious mass `factor` times the one it should have."""

    def force(u, out):
        spread.apply(u, out)
        np.subtract(spread.part(load), out, out=out)

    ones = np.ones(spread.mine.stop - spread.mine.start)
    mass = factor * relaxation_mass(np.linalg.eigvalsh(spread.matrix)[-1], ones)
    start = np.zeros(_PARTICLES * _DIMENSION) if start is None else start
    return dynamic_relaxation(spread.comm, force, spread.part(start), mass, target, free, limit)


def test_dynamic_relaxation_comes_to_rest_where_forces_balance(comm):
    spread, load = Spread(comm, stiffness(1e3)), some_vector()
    free = np.ones(_PARTICLES * _DIMENSION, bool)
    free[::7] = False
    start = np.where(free, 0.0, 0.1)
    solution = relaxed(spread, load, 1e-9, spread.part(free), start=start)
    wanted = np.where(free, solution_where_free(spread.matrix, load - spread.matrix @ start, free), 0.1)
    assert solution.converged and solution.residual <= 1e-9 and solution.iterations == spread.products
    assert np.abs(spread.whole(solution.value) - wanted).max() < 1e-8


def test_dynamic_relaxation_needs_iterations_like_the_root_of_the_condition(comm):
    counts = [relaxed(Spread(comm, stiffness(largest)), some_vector(), 1e-6).iterations for largest in (1e2, 1e4)]
    assert 4.0 < counts[1] / counts[0] < 25.0


def test_dynamic_relaxation_with_too_small_a_mass_diverges(comm):
    spread = Spread(comm, stiffness(1e2))
    diverged = relaxed(spread, some_vector(), 1e-9, factor=0.5, limit=5000)
    assert not diverged.converged and diverged.reason
