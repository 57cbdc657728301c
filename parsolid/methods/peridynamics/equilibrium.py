"""Balance of internal and external forces at the end of a material step, while histories are frozen.

The residual is F = f_int(u) + f_ext on free components; a step has converged when |F|_2 is at most the tolerance times
the largest |f_ext|_2 (or reaction, where only displacements are prescribed) of the run so far: after unloading there is
no other scale.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums
from parsolid.solvers import conjugate_gradients, dynamic_relaxation, largest_eigenvalue, relaxation_mass, start_vector

# inner solutions stop a little below the target, so that rounding does not ask for another pass
_INNER = 0.9
# of a residual, what conjugate gradients leave when the problem is not linear and will be linearised again
_FORCING = 0.02
_PASSES, _HALVINGS = 50, 8
_HEAVIER = 6
# lengths of steps whose preconditioners are kept: jumps, the material step, a shorter one
_KEPT = 3


class Balance(NamedTuple):
    """A displacement (n, d) [m], the internal force (n, d) [N] there, what is not balanced, and how far from the goal
    that is.
    """

    displacement: np.ndarray
    internal: np.ndarray
    residual: np.ndarray
    norm: float
    target: float
    reference: float

    @property
    def reached(self) -> bool:
        """Whether forces balance to the tolerance."""
        return self.norm <= self.target


class Equilibrium:
    """Solves for balance on one rank; all methods are collective.

    largest_load [N]: of the run so far; fault: why the last solution is not in balance; unheld:
    whether because nothing holds a fragment; iterations: force evaluations
    of the run so far, most_iterations: of a step at most.
    """

    def __init__(self, comm: Any, operator: Any, settings: Any, coarse: Any = None) -> None:
        """operator: see `tangent.Operator`; settings: `settings.QuasiStatic`; coarse: `coarse_space.CoarseSpace`, or
        None.
        """
        self.comm, self.operator, self.settings = comm, operator, settings
        self.largest_load, self.fault, self.unheld = 0.0, "", False
        self.iterations, self.most_iterations = 0, 0
        self._fictitious: dict[float, np.ndarray] = {}
        self.coarse = coarse
        self._preconditioners: dict[float, Any] = {}

    def solve(self, start: np.ndarray, external: np.ndarray, step: float) -> Balance:
        """Balance at the end of a step [s] under external forces (n, d) [N], from a first guess with prescribed values
        in place.

        Where it is not `reached`, `fault` says why. The operator's `commit` ends the step.
        """
        self.fault, self.unheld, count, self.step = "", False, self.iterations, step
        improve = self.relax_dynamically if self.settings.solver == "dynamic-relaxation" else self.correct
        balance = self._balance(start, external)
        for _ in range(_PASSES):
            if balance.reached or self.fault:
                break
            balance = improve(balance, external)
        else:
            self.fault = f"no balance after {_PASSES} passes"
        self.largest_load = max(self.largest_load, balance.reference)
        self.most_iterations = max(self.most_iterations, self.iterations - count)
        return balance

    def _balance(self, u: np.ndarray, external: np.ndarray) -> Balance:
        """What is left over at a displacement: one force evaluation."""
        internal, free = np.empty_like(u), self.operator.free
        self.operator.force(u, internal, self.step)
        self.iterations += 1
        residual = (internal + external) * free
        squares = [_square(external), _square(internal[~free]), _square(residual)]
        load, reaction, norm = np.sqrt(sums(self.comm, squares))
        # reactions only where nothing is loaded: they may be large at a first guess
        reference = load if max(load, self.largest_load) > 0.0 else reaction
        target = self.settings.tolerance * max(self.largest_load, reference)
        return Balance(u, internal, residual, float(norm), float(target), float(reference))

    def correct(self, balance: Balance, external: np.ndarray) -> Balance:
        """Newton's correction by conjugate gradients; the whole of it where the problem is linear."""
        operator, target, apply = self.operator, _INNER * balance.target, self._linear(balance.displacement)
        if not operator.is_linear:
            target = max(target, _FORCING * balance.norm)
        solution = conjugate_gradients(
            self.comm,
            apply,
            balance.residual,
            target,
            operator.free,
            self.settings.most_iterations,
            self._preconditioner(),
            None if self.coarse is None else lambda: self._unbalanced_fragment(balance.residual, target),
        )
        self.iterations += solution.iterations
        if not solution.converged:
            self.fault = f"conjugate gradients: {solution.reason}"
            return balance
        factor = 1.0
        for _ in range(_HALVINGS):
            trial = self._balance(balance.displacement + factor * solution.value, external)
            if operator.is_linear or trial.norm < balance.norm:
                return trial
            factor *= 0.5
        self.fault = "Newton's method: no shorter step reduces what is not balanced"
        return balance

    def _unbalanced_fragment(self, residual: np.ndarray, target: float) -> str:
        """What nothing holds, in words."""
        words = self.coarse.unbalanced_fragment(residual, target)
        self.unheld = bool(words)
        return str(words)

    def _preconditioner(self) -> Any:
        """Of a step of this length, or None."""
        if self.coarse is None:
            return None
        # steps that differ by rounding are alike, to the bit also after a restart
        key, kept = float(f"{self.step:.6e}"), self._preconditioners
        if key not in kept:
            if len(kept) == _KEPT:
                del kept[next(iter(kept))]
            kept[key] = self.coarse.preconditioner(key)
        return kept[key]

    def _linear(self, displacement: np.ndarray) -> Any:
        """K du of the step at a displacement."""
        return lambda du, out: self.operator.linear(displacement, du, out, self.step)

    def relax_dynamically(self, balance: Balance, external: np.ndarray) -> Balance:
        """Dynamic relaxation; with larger masses where the stiffness grows on the way and the motion diverges."""
        operator = self.operator

        def force(displacement: np.ndarray, out: Any) -> None:
            operator.force(displacement, out, self.step)
            out += external

        mass = self._mass(balance.displacement)
        for _ in range(1 if operator.is_linear else _HEAVIER):
            solution = dynamic_relaxation(
                self.comm,
                force,
                balance.displacement,
                mass,
                balance.target,
                operator.free,
                self.settings.most_iterations,
            )
            self.iterations += solution.iterations
            if solution.converged:
                return self._balance(solution.value, external)
            mass = 4.0 * mass
        self.fault = f"dynamic relaxation: {solution.reason}"
        return balance

    def _mass(self, displacement: np.ndarray) -> np.ndarray:
        """Fictitious masses for the stiffness of a step of this length, from a power iteration the first time.

        A stiffness that changes with the displacement is found anew in every step, and may double on the way.
        """
        key, operator = float(f"{self.step:.6e}"), self.operator
        if key not in self._fictitious or not operator.is_linear:
            mass = operator.mass if operator.is_linear else 2.0 * operator.mass
            start = start_vector(operator.identifier, operator.free.shape[1])
            largest = largest_eigenvalue(self.comm, self._linear(displacement), start, operator.mass, operator.free)
            self._fictitious[key] = relaxation_mass(largest, mass)
        return self._fictitious[key]

    def stiffness_changed(self) -> None:
        """Forget what was found for the old stiffness (bonds have broken)."""
        self._fictitious.clear()


def _square(values: np.ndarray) -> float:
    return float(np.vdot(values, values))
