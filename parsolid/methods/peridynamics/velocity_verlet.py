"""Explicit motion of peridynamic particles: leapfrog with velocities at the ends of steps.

v_h = v + dt/2 a, u_new = u + dt v_h, v_new = v_h + dt/2 a_new: the displacements of symplectic Euler ((37) of Galadima
et al.), whose velocities are the v_h.
"""

from functools import partial
from math import ceil, isfinite, log, sqrt
from typing import Any

import numpy as np

from decomposition.recalled import Recalled
from parsolid.methods.peridynamics import velocity_verlet_kernels as kernels
from parsolid.methods.peridynamics.time_solver import TimeSolver
from parsolid.particles.declaration import Field
from parsolid.solvers import largest_eigenvalue, start_vector

_STAIR = 1.1
# a body that is so much stiffer than at rest is crushed
_LOST = 1e100


class VelocityVerlet(TimeSolver):
    """Moves one rank's particles; the stable step is that of the instantaneous stiffness of the whole body at rest,
    less where finite strain stiffens it.
    """

    setting = "safety"

    def __init__(self, body: Any, settings: Any) -> None:
        """body: `system.Peridynamics`, set up but for its state; settings: `settings.Explicit`."""
        self.body, self.settings = body, settings
        self.landings = tuple(time for time in body.loads.jumps if time > 0.0)
        clamp = np.ones((body.owned, 4))
        clamp[:, : body.dimension] = body.loads.free
        body.particles.declare(Field("clamp", 4, "1"), clamp)
        body.fracture.late = body.engine.stiffens
        self.largest_eigenvalue: float | None = None
        self._kick, self._drift = Recalled(kernels.kick, free=(1,)), Recalled(kernels.drift, free=(1,))

    @property
    def clamp(self) -> np.ndarray:
        """Factors (owned, 4) of the velocity, 0 where it is not free."""
        return self.body.particles.owned_rows("clamp")

    def begin(self) -> None:
        """What is guided is where, and as fast, as it is told at time 0."""
        body, entries = self.body, self.body.loads.entries
        body.loads.move(0.0, 0.0, body.displacement)
        body.velocity[entries] = body.loads.guided_velocities(0.0, 0.0, np.zeros(len(entries[0])))

    def stable_step(self) -> float:
        """Safety times 2/sqrt(lambda_max) [s] of the last settled state; the first call is collective."""
        if self.largest_eigenvalue is None:
            self.largest_eigenvalue = self._power_iteration()
        growth = self.body.engine.growth
        if not growth < _LOST:
            return 0.0
        # leapfrog likes steps of one length: the bound is followed in stairs
        growth = _STAIR ** ceil(log(growth) / log(_STAIR) - 1e-3)
        return self.body.fracture.safety(self.settings) * 2.0 / sqrt(self.largest_eigenvalue * growth)

    def _power_iteration(self) -> float:
        operator = self.body.operator
        start = start_vector(operator.identifier, self.body.dimension)
        result = largest_eigenvalue(
            operator.comm, lambda x, y: operator.stiffness(x, y, 0.0), start, operator.mass, operator.free
        )
        # the field and the forces of the state, which the iteration has used
        self.body.history.resume()
        return result

    # --- a step ------------------------------------------------------------------------------------------------

    def _pull(self, sign: float) -> None:
        """Add external forces to those of bonds, or take them back."""
        body = self.body
        if "external_force" in body.particles:
            force = sign * body.particles.owned_rows("external_force") / body.share[:, None]
            body.engine.force[: body.owned, : body.dimension] += force

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Opening half kick and drift of a step [s] from a time [s]; what broke in its state breaks at its start."""
        fracture = self.body.fracture
        fracture.break_what_ranks_found(ledger)
        self._pull(1.0)
        before = self.guided_motion()
        work, swing = self.half_velocity(time, step, after_jump=True)
        self.opening = before, work, swing, self.new_positions(time, step)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """Forces of the new state and closing half kick."""
        fracture, history = self.body.fracture, self.body.history
        before, work, swing, sound = self.opening
        report = partial(self._report, announce, sound)
        fracture.before_forces(report)
        history.internal_force(step)
        lost = history.settle(step)
        fracture.after_forces(report)
        impulse, given = self.body.impulse_at_end(step), 0.0
        self._pull(1.0)
        more, swings = self.half_velocity(time + step, step, after_jump=False)
        guided = self.guided_velocity(before, time, step)
        self._pull(-1.0)
        if impulse is not None:
            given = impulse.act(self.body.held_components())
        ledger.add(1.0, lost, -given, work + more + guided)
        ledger.add_term("kinetic_offset", swings - swing)
        return sound and self.body.engine.sound

    def _report(self, announce: Any, sound: bool) -> None:
        announce(sound, self.stable_step())

    def half_velocity(self, time: float, step: float, after_jump: bool) -> tuple[float, float]:
        """v += dt/2 a under the loads at a time [s], of a jump just after or just before it; the loads' work and
        leapfrog's oscillation [J].
        """
        body = self.body
        motion = body.particles.kept(("kicked",), self._kicked)
        loads = self._accelerations(time, not after_jump)
        work, swing = self._kick(body.dimension, 0.5 * step, *motion, loads, self.clamp)
        for slide in body.loads.slides:
            # what holds a normal does no work, and keeps loads and forces from some
            rows, d = slide.rows, body.dimension
            removed = slide.held(body.velocity[rows, :d])
            body.velocity[rows, :d] -= removed
            removed *= 0.25 * step * body.share[rows, None]
            swing -= float(np.sum(removed * body.engine.force[rows, :d]))
            work -= float(np.sum(removed * body.mass[rows, None] * loads[rows, :d])) if loads is not None else 0.0
        return work, swing

    def _kicked(self) -> tuple[np.ndarray, ...]:
        body = self.body
        return body.particles.storage("velocity"), body.engine.force, body.mass, body.share

    def new_positions(self, time: float, step: float) -> bool:
        """u += dt v_h, or as guided; x = X + u; whether all velocities are numbers."""
        body, rows = self.body, self.body.particles.owned_rows
        moved = (rows("reference_position"), body.engine.displacement, rows("position"))
        total: float = self._drift(body.dimension, step, body.particles.storage("velocity"), *moved)
        if len(body.loads.entries[0]):
            body.loads.move(time, step, body.displacement)
            body.place()
        return isfinite(total)

    def _accelerations(self, time: float, before: bool) -> np.ndarray | None:
        """Loads over mass (owned, 4) [m/s^2] where components are free; None without loads."""
        body, loads = self.body, self.body.loads
        if not loads.acting:
            return None
        result = np.zeros((body.owned, 4))
        external = loads.external(time, before)
        result[:, : body.dimension] = loads.free * external / (body.mass * body.share)[:, None]
        return result

    def guided_motion(self) -> tuple[Any, ...]:
        """Displacement, velocity and force of guided components before a step."""
        body, entries = self.body, self.body.loads.entries
        if body.reactions is not None:
            body.reactions.begin()
        if not len(entries[0]):
            return ()
        return tuple(array[entries] for array in (body.engine.displacement, body.velocity, body.engine.force))

    def guided_velocity(self, before: tuple[Any, ...], time: float, step: float) -> float:
        """Set the velocity of guided components after a step; the work [J] of what guides them and of their loads."""
        body, entries, particles = self.body, self.body.loads.entries, self.body.loads.entries[0]
        if not before:
            self._tell(time, step)
            return 0.0
        displacement, velocity, force = before
        change = body.engine.displacement[entries] - displacement
        body.velocity[entries] = body.loads.guided_velocities(time, step, change)
        self._tell(time, step)
        share, mass = body.share[particles], body.mass[particles]
        kinetic = 0.5 * mass * (body.velocity[entries] ** 2 - velocity**2)
        return float(np.sum(share * (kinetic - 0.5 * (force + body.engine.force[entries]) * change)))

    def _tell(self, time: float, step: float) -> None:
        if self.body.reactions is not None:
            self.body.reactions.finish(time, step)

    # --- what is asked of it -----------------------------------------------------------------------------------

    def state(self) -> dict[str, Any]:
        """The largest eigenvalue, which decides on the step."""
        return {"largest_eigenvalue": self.largest_eigenvalue}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take it back."""
        self.largest_eigenvalue = state["largest_eigenvalue"]

    def unsound(self) -> tuple[int, str] | None:
        """The first particle whose velocity is not finite."""
        bad = ~np.isfinite(self.body.velocity[:, : self.body.dimension]).all(axis=1)
        return (int(np.argmax(bad)), "a number is no longer finite") if bad.any() else None
