"""Motion in steps longer than waves allow: `integrator = "implicit"`, an energy-momentum method of second order.

    M (v1 - v0)/dt = T + L(t + dt/2),   v1 + v0 = 2 (x1 - x0)/dt
    P = (F0 + F1)/2 S,   S = int_0^1 S(C0 + s (C1 - C0)) ds

S is that of the law, its mean by Gauss's quadrature. S : (C1 - C0)/2 is what W gains, so that the energy is kept; S is
symmetric, so that the angular momentum is (J. C. Simo, N. Tarnow, ZAMP 43 (1992) 757; O. Gonzalez, Comput. Methods
Appl. Mech. Engrg. 190 (2000) 1763). What is linear in F, stabilisers and a stress of the start, is exact at the middle.
Contact and ties have the mean force of the step, half of those at its ends and what begins or ends within it.
Newton's method takes half of K at the middle with the masses, which is not the whole derivative, but symmetric.

Of bodies with `pressures` as unknowns J C^-1 times p - k j is part of S, with the mean of the pressures at both ends,
and the pressure at the end belongs to the volumes there: as what they store is quadratic in them, the energy is kept.
"""

from typing import Any, NamedTuple

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.conditions import EXTERNAL_FORCE, EXTERNAL_IMPULSE
from parsolid.boundary.reactions import report_equilibrium
from parsolid.collective import Stopped, minimum
from parsolid.particles.declaration import Columns, Field
from parsolid.solvers.conjugate_gradients import Solution
from parsolid.solvers.newton import State, newton_to_share

# places in [0, 1] and weights; exact for polynomials of fifth degree
_GAUSS = ((0.5 - 0.15**0.5, 5.0 / 18.0), (0.5, 8.0 / 18.0), (0.5 + 0.15**0.5, 5.0 / 18.0))
# of a displacement, what a step may err by where a scene states neither this nor a step
_ACCURACY = 1e-3
# over what a step may err by, from which it is taken again in halves
_TOO_FAR = 8.0
# of a spacing, what a step may err by in any case
_AT_REST = 1e-12
# of a step that was asked for, the shortest that is tried
_LEAST = 2.0**-12
_PRODUCTS = 3000
_STATE = ("next_step", "last", "scale", "largest", "steps", "retries", "corrections", "products", "norm", "target")


class Start(NamedTuple):
    """Where a step begins: time [s], its length [s], displacement u and velocity v (owned, d) [m, m/s], F (owned, 3,
    3) and C = F^T F; unknowns [m]: u, and those of pressures; force (owned, d) [N] of contact and ties, and the power
    of tools [W] on this rank."""

    time: float
    step: float
    u: np.ndarray
    v: np.ndarray
    F: np.ndarray
    C: np.ndarray
    unknowns: np.ndarray
    meeting: np.ndarray
    power: float


class Implicit:
    """Steps of one rank's particles; all methods are collective. Also the `solvers.newton.Problem` of a step.

    reached, fault: see `static.Static`; next_step [s]: the step that accuracy asks for; last [s]: the step before, 0
    where its accelerations say nothing; scale [m]: the largest displacement so far, root of the mean square by mass;
    largest [N]: force so far.
    """

    def __init__(self, system: Any) -> None:
        """system: `system.TotalLagrangianSPH` with its `statics`, whose tangent, loads and preconditioner are used."""
        self.system, self.statics, self.comm = system, system.statics, system.comm
        self.tangent, self.free, self.pressures = self.statics.tangent, self.statics.free, system.pressures
        self.preconditioner = self.statics.preconditioner
        kept: dict[str, Any] = {"checkpointed": True, "mirror": "vector", "layout": Columns()}
        system.particles.declare(Field("mean_acceleration", system.dimension, "m/s^2", **kept))
        self.mass = self.tangent.mass
        self.total_mass = float(sums(self.comm, [self.mass.sum()])[0])
        self.next_step = self.last = self.scale = self.largest = self.norm = self.target = 0.0
        # largest force [N] of the state evaluated last
        self._size = 0.0
        self.steps = self.retries = self.corrections = self.products = 0
        self.reached: float | None = None
        self.fault = ""
        self._residual = np.zeros(self.free.shape)

    # --- the problem of a step -----------------------------------------------------------------------------------

    def evaluate(self, displacement: np.ndarray) -> State:
        """See `Problem`: the displacement is that at the end of the step, all unknowns are; there is no energy that
        falls."""
        start, of, statics, d = self.start, self.system.particles.owned_rows, self.statics, self.system.dimension
        statics.look_for_stop()
        unknowns = displacement.copy()
        displacement = unknowns[:, :d]
        self.tangent.share_moves(displacement)
        meeting = self._meet(displacement, start.step)
        if self.pressures is not None:
            self.pressures.set(0.5 * (start.unknowns[:, -1] + unknowns[:, -1]))
        F = self._place(0.5 * (start.u + displacement))
        force, sound = self._internal_force(2.0 * F - start.F)
        force += 0.5 * (start.meeting + meeting)
        of("velocity")[:] = (displacement - start.u) / start.step
        external = statics.loads_at(start.time + 0.5 * start.step, False)
        inertia = self.inertia[:, None] * (displacement - start.u - start.step * start.v)
        residual = np.zeros(self.free.shape)
        residual[:, :d] = force + external - inertia
        if self.pressures is not None:
            residual[:, -1] = 0.5 * self.pressures.residual(unknowns[:, -1], np.linalg.det(2.0 * F - start.F))
        residual[~self.free] = 0.0
        lost, free = float(not sound), self.tangent.free
        squares = [np.vdot(residual, residual), *(np.vdot(one * free, one) for one in (force, external, inertia))]
        square, *sizes, lost = sums(self.comm, [*squares, lost])
        self.norm, self._residual = float(np.sqrt(square)), residual
        self._size = float(np.sqrt(max(sizes)))
        self.force, self.external = force, external
        sound, saddle = bool(lost == 0.0 and np.isfinite(square)), self.pressures is not None
        return State(unknowns, residual, self.norm, np.nan, 0.0, sound, saddle)

    def _meet(self, displacement: np.ndarray, over: float) -> np.ndarray:
        """Forces of contact and ties (owned, d) [N] at a displacement a time over [s] after the start of the step:
        twice their mean over it less those of the start."""
        particles = self.system.particles
        if EXTERNAL_FORCE not in particles:
            return np.zeros_like(displacement)
        force, impulse = particles.owned_rows(EXTERNAL_FORCE), particles.owned_rows(EXTERNAL_IMPULSE)
        np.add(particles.owned_rows("reference_position"), displacement, out=particles.owned_rows("position"))
        force[:], impulse[:] = 0.0, 0.0
        for one in self.system.interactions:
            one.try_forces(self._kept_at, over, over == 0.0, over > 0.0)
        found = force + (2.0 / over * impulse if over > 0.0 else 0.0)
        impulse[:] = 0.0
        return np.asarray(found)

    def _place(self, displacement: np.ndarray) -> np.ndarray:
        """Put the particles; their F (owned, 3, 3), also as a field."""
        system, of, d = self.system, self.system.particles.owned_rows, self.system.dimension
        of("displacement")[:] = displacement
        np.add(of("reference_position"), displacement, out=of("position"))
        F = np.tile(np.eye(3), (len(displacement), 1, 1))
        F[:, :d, :d] += system.displacement_gradient()
        of("deformation_gradient")[:] = F[:, :d, :d].reshape(-1, d * d)
        of("jacobian")[:] = np.linalg.det(F)
        return F

    def _internal_force(self, F: np.ndarray) -> tuple[np.ndarray, bool]:
        """Internal force (owned, d) [N] of a step to F (owned, 3, 3), and whether that is a solid."""
        system, d, start = self.system, self.system.dimension, self.start
        sound = bool((np.linalg.det(F) > 0.0).all() and (system.particles.owned_rows("jacobian") > 0.0).all())
        S, change = np.zeros(F.shape), F.swapaxes(1, 2) @ F - start.C
        for part, weight in _GAUSS if sound else ():
            root = upper_root(start.C + part * change)
            P = np.zeros(F.shape) if self.pressures is None else self.pressures.stresses(0, len(F), root)
            for block in system.blocks:
                rows = np.arange(block.first, block.last)
                P[rows] += block.stresses_of(rows, root[rows], None)
            S += weight * solve_upper(root, P)
        if system.initial_stress is not None:
            S[:, :d, :d] += system.particles.owned_rows("initial_stress").reshape(-1, d, d)
        P = (0.5 * (start.F + F) @ S)[:, :d, :d].reshape(-1, d * d)
        return self.tangent.force_of(P, system.particles.owned_rows("displacement")), sound

    def linearise(self) -> None:
        """See `Problem`."""
        self.tangent.linearise()
        self.preconditioner.follow_tools()

    def precondition(self, residual: np.ndarray) -> np.ndarray:
        """See `Problem`."""
        return self.statics.precondition(residual)

    def solve(self, load: np.ndarray, target: float) -> Solution:
        """See `Problem`."""
        solver = self.statics.krylov_method(self.statics.conservative)
        found = solver(self.comm, self._product, load, target, self.free, _PRODUCTS, self.precondition)
        self.products += found.iterations
        return found

    def _product(self, change: np.ndarray, out: np.ndarray) -> None:
        self.statics.look_for_stop(True)
        moved = change[:, : self.system.dimension]
        out[:] = 0.5 * self.statics.stiffness(change)
        out[:, : self.system.dimension] += self.inertia[:, None] * moved
        if not self.statics.dead:
            out[:, : self.system.dimension] -= 0.5 * self.statics.change_of_loads(moved)

    # --- steps ---------------------------------------------------------------------------------------------------

    def set_settings(self, settings: Any) -> None:
        """Steps of a stage."""
        self.settings = settings
        fixed = settings.accuracy is None and settings.maximum_step is not None
        self.accuracy = None if fixed else settings.accuracy or _ACCURACY

    def begin(self) -> None:
        """Begin with the present places and velocities, of which no acceleration is known."""
        self.last = self.next_step = 0.0
        self.statics.follow_motion()
        self.statics.stabilise()

    def stable_step(self) -> float:
        """The next step [s]: at first that of leapfrog where accuracy is to choose."""
        if self.accuracy is None:
            return float(self.settings.maximum_step)
        return self.next_step or float(self.system.leapfrog.stable_step())

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Nothing: positions at the end of a step are found with its forces."""

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One step [s] from a time [s], in parts where it is too long, or as far as there is a way."""
        part, length, self.fault, self.reached = 0.0, 1.0, "", None
        self.system.stopped = False
        first = self.system.particles.owned_rows("displacement").copy()
        work, reaction = np.zeros(first.shape), np.zeros(first.shape)
        while part < 1.0:
            over = min(length, 1.0 - part)
            try:
                found = self._attempt(time + part * step, over * step, ledger)
            except Stopped:
                self._return()
                self.system.stopped, self.reached = True, time + part * step
                break
            if found is not None:
                work, reaction, part, length = work + found[0], found[1], part + over, over
                continue
            self.retries, length = self.retries + 1, 0.5 * over
            if length < _LEAST or length * step < (self.settings.minimum_step or 0.0):
                self.reached = time + part * step
                break
        done = step if self.reached is None else part * step
        self._report(time, done, first, work, reaction, ledger)
        announce(True, self.stable_step())
        return True

    def _attempt(self, time: float, step: float, ledger: Any) -> tuple[np.ndarray, np.ndarray] | None:
        """One step [s] from a time [s]; the work [J] of loads, or of what prescribes components, and the forces [N] of
        that (owned, d). None where there is no balance, or the step errs by too much: then nothing has changed."""
        system, of = self.system, self.system.particles.owned_rows
        self._begin(time, step)
        start, guess = self.start, self.start.u + step * self.start.v
        guess += 0.5 * step**2 * of("mean_acceleration") * (self.last > 0.0)
        moved = start.u.copy()
        if system.conditions.motion.there:
            system.conditions.motion.displace(time, step, moved.T)
        first = start.unknowns.copy()
        first[:, : guess.shape[1]] = np.where(self.tangent.free, guess, moved)
        state = self.evaluate(first)
        found = newton_to_share(self, state, self._find_target)
        self.corrections += found.corrections
        self.fault = found.fault
        u = np.ascontiguousarray(found.state.displacement[:, : guess.shape[1]])
        acceleration = 2.0 * (u - start.u - step * start.v) / step**2 * self.tangent.free
        if not found.fault and self._choose_step(step, u, acceleration):
            self.largest = max(self.largest, self._size)
            self._set_pressures(found.state.displacement)
            return self._end(time, step, u, acceleration, ledger)
        self._return()
        return None

    def _return(self) -> None:
        """Take back the state at the start of the step."""
        self._set_pressures(self.start.unknowns)
        self._meet(self.start.u, 0.0)
        self._place(self.start.u)
        self.system.particles.owned_rows("velocity")[:] = self.start.v
        self._end_state()

    def _find_target(self) -> float:
        """Force [N] that need not be balanced: the tolerance times the largest force so far, that of the state
        evaluated last included; at least the rounding of forces."""
        self.target = max(self.settings.tolerance * max(self.largest, self._size), self.preconditioner.rounding)
        return self.target

    def _begin(self, time: float, step: float) -> None:
        of, d = self.system.particles.owned_rows, self.system.dimension
        F = np.tile(np.eye(3), (self.system.owned, 1, 1))
        F[:, :d, :d] = of("deformation_gradient").reshape(-1, d, d)
        u, v = of("displacement").copy(), of("velocity").copy()
        self._kept_at = time
        for one in self.system.interactions:
            one.keep(None)
            one.ahead = step
        meeting = self._meet(u, 0.0)
        power = sum(one.power() for one in self.system.interactions)
        unknowns = u if self.pressures is None else np.column_stack((u, self.pressures.unknowns()))
        self.start = Start(time, step, u, v, F, F.swapaxes(1, 2) @ F, unknowns, meeting, power)
        self.inertia, self.statics.sought = 2.0 * self.mass / step**2, (time, step, 0.5)
        # of twice the matrix
        self.preconditioner.begin(2.0 * self.inertia)

    def _set_pressures(self, unknowns: np.ndarray) -> None:
        """Take those of some unknowns as the present ones."""
        if self.pressures is not None:
            self.pressures.set(unknowns[:, -1])
            self.pressures.settle()

    def _choose_step(self, step: float, u: np.ndarray, acceleration: np.ndarray) -> bool:
        """Choose the next step [s] by the error of this one, dt^2/12 times the change of the acceleration within it;
        whether that can be borne."""
        if self.accuracy is None:
            return True
        change = (acceleration - self.system.particles.owned_rows("mean_acceleration")) * (self.last > 0.0)
        moved = (u - self.start.u) / step
        squares = [np.vdot(self.mass[:, None] * one, one) for one in (change, u, moved)]
        change, size, speed = np.sqrt(sums(self.comm, squares) / self.total_mass)
        self.scale = max(self.scale, float(size))
        error = step**2 / 12.0 * change * 2.0 * step / (step + self.last)
        # bodies at rest move by rounding
        allowed = max(self.accuracy * max(self.scale, step * speed), _AT_REST * self.preconditioner.spacing)
        if error > _TOO_FAR * allowed and step > minimum(self.comm, float(self.system.leapfrog.stable_step())):
            self.fault = "the motion changes within the step"
            return False
        ratio = (allowed / max(error, 1e-300)) ** (1.0 / 3.0)
        # roots of 2, so that rounding on other ranks changes no step
        factor = 2.0 ** (0.5 * np.clip(np.floor(2.0 * np.log2(ratio)), -2.0, 2.0)) if self.last > 0.0 else 1.0
        self.next_step = factor * step if factor < 1.0 else max(self.next_step, factor * step)
        return True

    def _end(
        self, time: float, step: float, u: np.ndarray, a: np.ndarray, ledger: Any
    ) -> tuple[np.ndarray, np.ndarray]:
        """Take the end of a step; see `_attempt`."""
        system, of, start = self.system, self.system.particles.owned_rows, self.start
        du, v = u - start.u, start.v + step * a
        # prescribed components have their mean velocity until they are given that of the end
        of("velocity")[:] = np.where(self.tangent.free, v, du / step)
        of("mean_acceleration")[:] = a
        # products have moved what contact knows of the state
        self._meet(u, step)
        of_tools = sum(one.power() for one in system.interactions)
        for one in system.interactions:
            one.keep(ledger)
        ledger.add(1.0, 0.0, 0.0, 0.5 * step * (start.power + of_tools))
        self._place(u)
        system.conditions.impose(time + step, True)
        mass, end = self.mass[:, None], of("velocity")
        kinetic = 0.5 * mass * (end * end - start.v * start.v)
        reaction = np.where(self.tangent.free, 0.0, mass * (end - start.v) / step - self.force - self.external)
        work = np.where(self.tangent.free, self.external * du, kinetic - self.force * du)
        self._end_state()
        self.last, self.steps = step, self.steps + 1
        return work, reaction

    def _end_state(self) -> None:
        """What energies need of the present places."""
        if self.system.meshes is not None:
            self.system.meshes.begin()
        self.statics.stabilise()

    def _report(
        self, time: float, step: float, first: np.ndarray, work: np.ndarray, reaction: np.ndarray, ledger: Any
    ) -> None:
        ledger.add(1.0, 0.0, 0.0, float(work.sum()))
        of, conditions = self.system.particles.owned_rows, self.system.conditions
        if step > 0.0:
            change, held = of("displacement") - first, np.where(self.tangent.free, 0.0, work)
            report_equilibrium(conditions, of("position").T, change, reaction, held, time, step)
        conditions.report(step, ledger)

    # --- what is asked of it -------------------------------------------------------------------------------------

    def first_invalid(self) -> tuple[int, str] | None:
        """This rank's particle farthest from balance, where the last step found none; and why."""
        if self.reached is None or not len(self._residual):
            return None
        index = int(np.argmax(np.linalg.norm(self._residual, axis=1)))
        return index, f"{self.fault}, however short the step"

    def state(self) -> dict[str, Any]:
        """What a restart needs besides the fields."""
        return {f"implicit_{name}": getattr(self, name) for name in _STATE}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        for name in _STATE:
            setattr(self, name, state[f"implicit_{name}"])

    def summary(self) -> dict[str, Any]:
        """Entries of summary.json."""
        return {
            "implicit_steps": self.steps,
            "implicit_steps_retried": self.retries,
            "implicit_newton_iterations": self.corrections,
            "implicit_linear_iterations": self.products,
        }


def upper_root(C: np.ndarray) -> np.ndarray:
    """Upper triangular F (n, 3, 3) with F^T F = C, of symmetric positive definite C (n, 3, 3)."""
    F = np.zeros(C.shape)
    F[:, 0, 0] = np.sqrt(C[:, 0, 0])
    F[:, 0, 1:] = C[:, 0, 1:] / F[:, 0, :1]
    F[:, 1, 1] = np.sqrt(C[:, 1, 1] - F[:, 0, 1] ** 2)
    F[:, 1, 2] = (C[:, 1, 2] - F[:, 0, 1] * F[:, 0, 2]) / F[:, 1, 1]
    F[:, 2, 2] = np.sqrt(C[:, 2, 2] - F[:, 0, 2] ** 2 - F[:, 1, 2] ** 2)
    return F


def solve_upper(F: np.ndarray, P: np.ndarray) -> np.ndarray:
    """F^-1 P (n, 3, 3) of upper triangular F (n, 3, 3)."""
    S = np.empty(P.shape)
    S[:, 2] = P[:, 2] / F[:, 2, 2, None]
    S[:, 1] = (P[:, 1] - F[:, 1, 2, None] * S[:, 2]) / F[:, 1, 1, None]
    S[:, 0] = (P[:, 0] - F[:, 0, 1, None] * S[:, 1] - F[:, 0, 2, None] * S[:, 2]) / F[:, 0, 0, None]
    return S
