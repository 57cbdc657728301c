"""Newton's method with solutions that are not what was asked for."""

import numpy as np
import pytest

from parsolid.solvers.conjugate_gradients import Solution
from parsolid.solvers.newton import State, newton


class OneLoaded:
    """(x - 1)^4/4 of one component on the first rank; the other ranks have components that nothing moves."""

    def __init__(self, comm, first_solution):
        """first_solution: what the first linear solution has in place of its own."""
        self.comm, self.free, self.first_solution = comm, np.full((1, 1), comm.rank == 0), first_solution
        self.preconditioned = 0

    def evaluate(self, displacement):
        self.x = displacement
        residual = np.where(self.free, -((displacement - 1.0) ** 3), 0.0)
        energy, norm = self.comm.bcast((0.25 * float(displacement[0, 0] - 1.0) ** 4, float(np.abs(residual).max())))
        return State(displacement, residual, norm, energy, 0.0, True)

    def linearise(self):
        pass

    def solve(self, load, target):
        if self.first_solution is not None:
            value, self.first_solution = self.first_solution * self.free, None
            return Solution(value, 2, 1.0, False, "a direction without positive stiffness")
        return Solution(load / (3.0 * (self.x - 1.0) ** 2), 1, 0.0, True)

    def precondition(self, residual):
        self.preconditioned += 1
        return residual


@pytest.mark.parametrize(("first_solution", "preconditioned"), [(0.1, 0), (0.0, 1), (-0.1, 1)])
def test_ranks_agree_on_steps(comm, first_solution, preconditioned):
    """What an unfinished solution has is taken by all ranks, those without a part of it, too, or by none; where it is
    no way down the preconditioned residual is."""
    problem = OneLoaded(comm, first_solution)
    found = newton(problem, problem.evaluate(np.zeros((1, 1))), 1e-9)
    assert not found.fault and found.state.norm <= 1e-9
    assert comm.allgather(problem.preconditioned) == [preconditioned] * comm.size
