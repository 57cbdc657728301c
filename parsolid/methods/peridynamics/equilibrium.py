"""Balance of internal and external forces at the end of a material step, while histories are frozen.

The residual is F = f_int(u) + f_ext on free components; a step has converged when |F|_2 is at most the tolerance times
the largest |f_ext|_2 (or reaction, where only displacements are prescribed) of the run so far: after unloading there is
no other scale.
"""

from collections.abc import Callable
from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.solvers import (
    Solution,
    State,
    Unsolvable,
    conjugate_gradients,
    dynamic_relaxation,
    largest_eigenvalue,
    newton,
    relaxation_mass,
    start_vector,
)

# a linear solution stops a little below the target, so that rounding does not ask for another one
_INNER = 0.9
# solutions, whose reactions may ask for another one
_PASSES = 10
_HEAVIER = 6


class Equilibrium:
    """Solves for balance on one rank; all methods are collective. It is the `solvers.newton.Problem` of its loads.

    largest_load, target [N]: of the run so far, and what need not be balanced; fault: why the last solution is not in
    balance; unheld: whether because nothing holds a fragment; iterations: force evaluations of the run so far,
    most_iterations: of a step at most.
    """

    def __init__(
        self,
        comm: Any,
        operator: Any,
        settings: Any,
        preconditioners: Any = None,
        look_for_stop: Callable[[int], None] = lambda every: None,
    ) -> None:
        """operator: see `tangent.Operator`; settings: `settings.QuasiStatic`; preconditioners: of conjugate
        gradients, see `preconditioner.Preconditioners`; look_for_stop: see `ParticleSystem.raise_if_stopped`."""
        self.comm, self.operator, self.settings = comm, operator, settings
        self.free, self.preconditioners, self.look_for_stop = operator.free, preconditioners, look_for_stop
        self.largest_load, self.target, self.fault, self.unheld = 0.0, 0.0, "", False
        self.iterations, self.most_iterations = 0, 0
        self._fictitious: dict[float, np.ndarray] = {}

    def find(self, start: np.ndarray, external: np.ndarray, step: float) -> State:
        """The state at the end of a step [s] under external forces (n, d) [N], from a first guess with prescribed
        values in place.

        Where it is not `reached`, `fault` says why. The operator's `commit` ends the step.
        """
        self.fault, self.unheld, count = "", False, self.iterations
        self.external, self.step = external, step
        solve = self.relax_dynamically if self.settings.solver == "dynamic-relaxation" else self.correct
        state = self.evaluate(start)
        for _ in range(_PASSES):
            # reactions only where nothing is loaded: they may be large at a first guess
            reference = self._load if max(self._load, self.largest_load) > 0.0 else self._reaction
            self.target = self.settings.tolerance * max(self.largest_load, reference)
            if self.reached(state) or self.fault:
                break
            state = solve(state)
        else:
            self.fault = f"no balance after {_PASSES} solutions"
        self.largest_load = max(self.largest_load, reference)
        self.most_iterations = max(self.most_iterations, self.iterations - count)
        return state

    def reached(self, state: State) -> bool:
        return state.norm <= self.target

    def correct(self, state: State) -> State:
        """By Newton's method."""
        found = newton(self, state, self.target)
        self.fault = found.fault
        return found.state

    # --- the problem of Newton's method ------------------------------------------------------------------------

    def evaluate(self, displacement: np.ndarray) -> State:
        """See `Problem`; there is no energy of a step."""
        self.look_for_stop(1)
        internal, free = np.empty_like(displacement), self.free
        self.operator.force(displacement, internal, self.step)
        self.iterations += 1
        residual = (internal + self.external) * free
        squares = [np.vdot(one, one) for one in (self.external, internal[~free], residual)]
        self._load, self._reaction, norm = map(float, np.sqrt(sums(self.comm, squares)))
        self._at = displacement
        return State(displacement, residual, norm, np.nan, 0.0, bool(np.isfinite(norm)))

    def linearise(self) -> None:
        self._linear = self._tangent(self._at)

    def _tangent(self, displacement: np.ndarray) -> Any:
        """K du of the step at a displacement."""

        def product(du: np.ndarray, out: np.ndarray) -> None:
            self.look_for_stop(10)
            self.operator.linear(displacement, du, out, self.step)

        return product

    def precondition(self, residual: np.ndarray) -> np.ndarray:
        return residual if self.preconditioners is None else self.preconditioners.of_step(self.step)(residual)

    def solve(self, load: np.ndarray, target: float) -> Solution:
        """See `Problem`; the whole of it where the problem is linear."""
        linear, preconditioners, limit = self.operator.is_linear, self.preconditioners, self.settings.most_iterations

        def unbalanced() -> str:
            words = str(preconditioners.unbalanced_fragment(load, self.target))
            self.unheld = bool(words)
            return words

        solution = conjugate_gradients(
            self.comm,
            self._linear,
            load,
            _INNER * self.target if linear else target,
            self.free,
            limit,
            None if preconditioners is None else preconditioners.of_step(self.step),
            None if preconditioners is None else unbalanced,
        )
        self.iterations += solution.iterations
        if not solution.converged and (linear or self.unheld or solution.iterations >= limit):
            raise Unsolvable(f"conjugate gradients: {solution.reason}")
        return solution

    # --- dynamic relaxation ------------------------------------------------------------------------------------

    def relax_dynamically(self, state: State) -> State:
        """With larger masses where the stiffness grows on the way and the motion diverges."""
        operator = self.operator

        def force(displacement: np.ndarray, out: Any) -> None:
            self.look_for_stop(10)
            operator.force(displacement, out, self.step)
            out += self.external

        mass = self._mass(state.displacement)
        for _ in range(1 if operator.is_linear else _HEAVIER):
            limit = self.settings.most_iterations
            found = dynamic_relaxation(self.comm, force, state.displacement, mass, self.target, self.free, limit)
            self.iterations += found.iterations
            if found.converged:
                return self.evaluate(found.value)
            mass = 4.0 * mass
        self.fault = f"dynamic relaxation: {found.reason}"
        return state

    def _mass(self, displacement: np.ndarray) -> np.ndarray:
        """Fictitious masses for the stiffness of a step of this length, from a power iteration the first time.

        A stiffness that changes with the displacement is found anew in every step, and may double on the way.
        """
        key, operator = float(f"{self.step:.6e}"), self.operator
        if key not in self._fictitious or not operator.is_linear:
            mass = operator.mass if operator.is_linear else 2.0 * operator.mass
            start = start_vector(operator.identifier, self.free.shape[1])
            largest = largest_eigenvalue(self.comm, self._tangent(displacement), start, operator.mass, self.free)
            self._fictitious[key] = relaxation_mass(largest, mass)
        return self._fictitious[key]

    def stiffness_changed(self) -> None:
        """Forget what was found for the old stiffness (bonds have broken)."""
        self._fictitious.clear()
