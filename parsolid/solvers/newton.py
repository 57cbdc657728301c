"""Newton's method with inexact solutions: the displacement at which the forces of a body vanish.

Where forces are the gradient of an energy, this is lower at the end of every correction, so that what is found is
stable; conjugate gradients end at a direction without positive stiffness with what they have. Tolerances of the linear
solutions: S. C. Eisenstat, H. F. Walker, SIAM J. Sci. Comput. 17 (1996) 16, choice 2.
"""

from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

import numpy as np

from decomposition.reduction import sums
from parsolid.solvers.conjugate_gradients import Solution

# of the residual, what the first correction leaves, and what any leaves at most; of the goal, what the last ones do
_FIRST, _MOST, _LAST = 0.05, 0.05, 0.5
_GAMMA = 0.9
# corrections, halvings of one of them, and solutions with a target that becomes smaller
_CORRECTIONS, _HALVINGS, _PASSES = 40, 10, 4
# what may grow of what is not balanced in a step towards a saddle
_UPHILL = 10.0
# of the decrease that the slope promises, what a step must reach
_ARMIJO = 1e-4


class State(NamedTuple):
    """A displacement (n, d) [m]; residual (n, d) [N]: forces there on free components, 0 elsewhere, and norm, their
    2-norm over all ranks; energy [J] of which they are the negative gradient, nan where there is none; rounding: of its
    differences [J]; sound: whether the body is still a solid; saddle: whether what is sought is neither least nor
    largest, so that steps go no way down."""

    displacement: np.ndarray
    residual: np.ndarray
    norm: float
    energy: float
    rounding: float
    sound: bool
    saddle: bool = False


class Unsolvable(Exception):
    """Why a linear problem has no solution."""


class Problem(Protocol):
    """What is to vanish; all methods are collective."""

    comm: Any
    free: np.ndarray

    def evaluate(self, displacement: np.ndarray) -> State:
        """Forces and energy at a displacement."""

    def linearise(self) -> None:
        """Find the tangent at the displacement evaluated last."""

    def solve(self, load: np.ndarray, target: float) -> Solution:
        """K du = load on free components, until |load - K du| is at most target [N]; may raise `Unsolvable` on all
        ranks."""

    def precondition(self, residual: np.ndarray) -> np.ndarray:
        """About K^-1 r, of a positive definite matrix."""


class Found(NamedTuple):
    """The state that was found; fault: why it is no solution, or nothing; corrections: how many."""

    state: State
    fault: str
    corrections: int


def newton(problem: Problem, start: State, target: float, limit: int = _CORRECTIONS) -> Found:
    """The state with a norm of at most target [N], from one that was evaluated last; collective.

    Each correction takes the whole step, or a half, quarter and so on of it: the first with less energy, as its slope
    promises, or half the residual. Ends after `limit` corrections, where no part of a step is any better, or where the
    state at the start is no solid.
    """
    state, forcing, before = start, _FIRST, 0.0
    if not state.sound:
        return Found(state, "matter is turned inside out", 0)
    for count in range(limit + 1):
        if state.norm <= target:
            return Found(state, "", count)
        if count == limit:
            break
        if before > 0.0:
            # choice 2 of Eisenstat and Walker
            ratio, kept = state.norm / before, _GAMMA * forcing * forcing
            forcing = _GAMMA * ratio * ratio
            forcing = max(forcing, kept) if kept > 0.1 else forcing
        problem.linearise()
        left = max(min(forcing, _MOST), _LAST * target / state.norm)
        try:
            step = problem.solve(state.residual, left * state.norm).value
        except Unsolvable as why:
            return Found(state, str(why), count)
        slope = -float(sums(problem.comm, [np.vdot(state.residual, step)])[0])
        if slope >= 0.0 and not state.saddle:
            # not a way down, or no step at all where the first direction has no positive stiffness
            step = problem.precondition(state.residual)
            slope = -float(sums(problem.comm, [np.vdot(state.residual, step)])[0])
        before, better = state.norm, _shortened(problem, state, step, slope)
        if better is None:
            return Found(state, "no shorter step of Newton's method reduces what is not balanced", count)
        state = better
    return Found(state, f"no balance after {limit} corrections", limit)


def newton_to_share(problem: Problem, start: State, target: Callable[[], float]) -> Found:
    """As `newton`, to a target [N] that is found from the forces of the state evaluated last; collective.

    At a first guess these may be larger than in balance by many orders, so the target is found again there.
    """
    state, corrections = start, 0
    for _ in range(_PASSES):
        found = newton(problem, state, target())
        state, corrections = found.state, corrections + found.corrections
        if found.fault or state.norm <= target():
            return Found(state, found.fault, corrections)
    return Found(state, f"no balance after {_PASSES} solutions", corrections)


def _shortened(problem: Problem, state: State, step: np.ndarray, slope: float) -> State | None:
    """The first of the whole step (n, d), half of it and so on that is accepted, None where none is; slope [J]: of the
    energy along it."""
    part = 1.0
    for _ in range(_HALVINGS):
        trial = problem.evaluate(state.displacement + part * step)
        if trial.sound and _accepted(problem, state, trial, step, part, slope):
            return trial
        part *= 0.5
    return None


def _accepted(problem: Problem, state: State, trial: State, step: np.ndarray, part: float, slope: float) -> bool:
    """Whether a trial is better: in differences of energies that are rounding its own slope counts (W. W. Hager, H.
    Zhang, SIAM J. Optim. 16 (2005) 170)."""
    if trial.norm <= (_UPHILL if state.saddle else 0.5) * state.norm:
        return True
    if not np.isfinite(state.energy):
        return bool(trial.norm < (1.0 - _ARMIJO * part) * state.norm)
    if trial.energy <= state.energy + _ARMIJO * part * slope:
        return True
    if trial.energy > state.energy + state.rounding:
        return False
    ahead = -float(sums(problem.comm, [np.vdot(trial.residual, step)])[0])
    return ahead <= (1.0 - 2.0 * _ARMIJO) * abs(slope)
