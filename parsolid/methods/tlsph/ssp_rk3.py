"""Three stages a step: the strong-stability-preserving Runge-Kutta scheme of third order, eq (77) of Lee et al.

Each stage is y <- keep y0 + take (y + dt dy/dt) of v, x, F, H and J, with y0 at the start of the step; branches relax
exactly from the start of the step to the stage.
"""

from typing import Any

import numpy as np

from parsolid.kernels import reduction
from parsolid.solvers.runge_kutta import SSP_RK3, Stage


class StagedStep:
    """Steps of one rank's particles by the stages of SSP-RK3."""

    def __init__(self, system: Any, scene: Any) -> None:
        """system: `system.TotalLagrangianSPH`, with its fields declared."""
        self.system = system

    def step_of(self, law: Any, modulus: float) -> float:
        """Largest step [s] for the greatest rho c_p^2 [Pa], eq (79)."""
        system = self.system
        if not modulus > 0.0:
            return 0.0
        step = system.settings.cfl * system.spacing * np.sqrt(law.density / modulus) / system.slowing[law]
        return float(step)

    def stable_step(self) -> float:
        found = [self.step_of(one.law, one.wave_speeds((0.0,) * 6)[0]) for one in self.system.blocks]
        return min(self.system.conditions.largest_step, *found, np.inf)

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Nothing: forces between bodies, which are found once a step, do not act on stages."""

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One step [s] from a time [s]; see `ParticleSystem`."""
        system, sound = self.system, True
        conditions, walls = system.conditions, system.fixed_walls
        conditions.begin_step()
        for stage in SSP_RK3:
            conditions.keep_deformation()
            positive, internal, stable = True, 0.0, conditions.largest_step
            for bodies in system.sweeps:
                good, rate, allowed = bodies.advance_stage(stage, step)
                positive, internal, stable = positive and good, internal + rate, min(stable, allowed)
            if stage.last:
                announce(positive, stable)
            for bodies in system.sweeps:
                bodies.find_forces()
            if walls is not None:
                walls.find()
                walls.observe(stage.quadrature * step)
            numerical, external = self.advance_motion(stage, time, step)
            ledger.add(stage.quadrature * step, internal, numerical, external)
            sound = sound and positive
        ledger.add(1.0, 0.0, 0.0, conditions.end_step(step, ledger))
        if walls is not None:
            walls.book(ledger)
        return sound

    def advance_motion(self, stage: Stage, time: float, step: float) -> tuple[float, float]:
        """v and x of a stage; (numerical dissipation rate, power of the loads) [W]."""
        system, conditions = self.system, self.system.conditions
        stored, now = system.particles.storage, time + stage.time * step
        T, D = stored("stress_force"), stored("dissipative_force")
        external = conditions.external_force(now, T, D, before_jump=stage.time > 0.0)
        conditions.observe(stage.quadrature * step)
        rates = advance_motion(
            system.owned, stage.first, stage.keep, stage.take, step, stored("velocity"), stored("position"),
            stored("velocity_at_start"), stored("position_at_start"), T, D, system.mass, system.share, external,
            conditions.free,
        )  # fmt: skip
        if stage.last:
            conditions.end_motion(time + step)
        else:
            conditions.impose(time + stage.next_time * step, before_jump=True)
        return rates


@reduction
def advance_motion(owned, first, keep, take, step, v, x, v_start, x_start, T, D, mass, share, external, free):
    """One stage of v and x (d, n). T, D [N]: on whole particles, mass (n,) [kg]; share (n,): the part on this side of
    mirror planes; external (d, n) [N]: on that part, or None; free (d, n): 0 for components that are held, or None.

    Returns the rate of dissipation and the power of the external forces [W] at the start of the stage.
    """
    dissipation, power = 0.0, 0.0
    for c in range(v.shape[0]):
        velocity, place, v0, x0, stress_force, dissipative = v[c], x[c], v_start[c], x_start[c], T[c], D[c]
        for a in range(owned):
            old = velocity[a]
            if first:
                v0[a], x0[a] = old, place[a]
            acceleration = (stress_force[a] + dissipative[a]) / mass[a]
            dissipation -= share[a] * dissipative[a] * old
            if external is not None:
                acceleration += external[c, a] / (mass[a] * share[a])
                power += external[c, a] * old
            new = keep * v0[a] + take * (old + step * acceleration)
            if free is not None:
                new *= free[c, a]
            place[a] = keep * x0[a] + take * (place[a] + step * old)
            velocity[a] = new
    return dissipation, power
