"""Explicit motion of peridynamic particles: velocity Verlet.

v_h = v + dt/2 a, u_new = u + dt v_h, v_new = v_h + dt/2 a_new: the displacements of symplectic Euler ((37) of Galadima
et al.), whose velocities are the v_h.
"""

from math import ceil, isfinite, log, sqrt
from typing import Any

import numpy as np

from parsolid.kernels import kernel, reduction
from parsolid.particles.declaration import Columns, Field
from parsolid.solvers import largest_eigenvalue, start_vector

# leapfrog likes steps of one length: the bound of stiffness is followed in stairs
_STAIR = 1.1
# a body that is so much stiffer than at rest is crushed
_LOST = 1e100


class VelocityVerlet:
    """Moves one rank's particles; the stable step is that of the instantaneous stiffness of the whole body at rest,
    less where finite strain stiffens it.

    jumps, landings: see `methods.protocol.ParticleSystem`; setting: the key of method.solution whose smaller value
    makes steps milder; unheld: whether no balance was found because nothing holds a piece of the bodies.
    """

    setting, jumps, unheld = "safety", (), False

    def __init__(self, body: Any, settings: Any) -> None:
        """body: `system.Peridynamics`, set up but for its state; settings: `settings.Explicit`."""
        self.body, self.settings = body, settings
        self.landings = tuple(time for time in body.loads.jumps if time > 0.0)
        free = body.loads.free.astype(float)
        body.particles.declare(Field("free_components", body.dimension, "1", layout=Columns()), free)
        self.largest_eigenvalue: float | None = None

    def begin(self) -> None:
        """What is guided is where, and as fast, as it is told at time 0."""
        body, entries = self.body, self.body.loads.entries
        body.loads.move(0.0, 0.0, body.displacement)
        body.velocity[entries] = body.loads.guided_velocities(0.0, 0.0, np.zeros(len(entries[0])))

    def stable_step(self) -> float:
        """Safety times 2/sqrt(lambda_max) [s] of the last settled state; the first call is collective."""
        if self.largest_eigenvalue is None:
            self.largest_eigenvalue = self._power_iteration()
        growth, fracture = self.body.forces.growth, self.body.fracture
        if not growth < _LOST:
            return 0.0
        growth = _STAIR ** ceil(log(growth) / log(_STAIR) - 1e-3)
        safety = self.settings.safety
        if fracture is not None and fracture.settings is not None:
            safety = min(safety, self.settings.damage_safety)
        return safety * 2.0 / sqrt(self.largest_eigenvalue * growth)

    def _power_iteration(self) -> float:
        operator = self.body.operator
        start = start_vector(operator.identifier, self.body.dimension)
        return largest_eigenvalue(
            operator.comm, lambda x, y: operator.stiffness(x, y, 0.0), start, operator.mass, operator.free
        )

    # --- a step -----------------------------------------------------------------------------------------------

    def advance(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One step [s] from a time [s]; what broke in its state breaks at its start."""
        return self.complete_step(time, step, self.advance_positions(time, step, ledger), ledger, announce)

    def advance_positions(self, time: float, step: float, ledger: Any) -> "Start":
        """Break bonds that ranks have found to fail, opening half kick, drift and prescribed motion."""
        body = self.body
        if body.fracture is not None:
            body.fracture.break_what_ranks_found(ledger)
        if body.reactions is not None:
            body.reactions.begin()
        start = Start(body)
        start.work, start.offset = self.half_kick(time, step, after_jump=True)
        total = drift(step, *map(body.particles.storage, ("velocity", "displacement")), body.owned)
        body.loads.move(time, step, body.displacement)
        body.place()
        start.sound = isfinite(total)
        return start

    def complete_step(self, time: float, step: float, start: "Start", ledger: Any, announce: Any) -> bool:
        """Forces at the new positions, closing half kick, and energies."""
        body = self.body
        looks = body.fracture is not None and body.fracture.settings is not None
        early = not looks and not body.forces.stiffens
        if early:
            announce(start.sound, self.stable_step())
        body.forces.internal_force(step)
        dissipated = body.forces.settle(step)
        if looks:
            body.fracture.look()
        if not early:
            announce(start.sound, self.stable_step())
        work, offset = self.half_kick(time + step, step, after_jump=False)
        guided = start.guide(time, step)
        if body.reactions is not None:
            body.reactions.finish(time, step)
        ledger.add(1.0, dissipated, 0.0, start.work + work + guided)
        ledger.add_term("leapfrog_oscillation", offset - start.offset)
        return bool(start.sound and body.forces.sound)

    def half_kick(self, time: float, step: float, after_jump: bool) -> tuple[float, float]:
        """v += dt/2 a under the loads at a time [s], of a jump just after or just before it; the loads' work and the
        kinetic-energy offset of leapfrog [J]."""
        body, loads = self.body, self._accelerations(time, not after_jump)
        given = map(body.particles.storage, ("mass", "share", "free_components", "velocity"))
        work, offset = kick(0.5 * step, body.owned, body.forces.force, loads, *given)
        for slide in body.loads.slides:
            # what holds a normal does no work, and keeps loads and forces from some
            rows, d = slide.rows, body.dimension
            removed = slide.held(body.velocity[rows])
            body.velocity[rows] -= removed
            removed *= 0.25 * step * body.share[rows, None]
            offset -= float(np.sum(removed * body.forces.force[rows, :d]))
            work -= float(np.sum(removed * body.mass[rows, None] * loads[:, rows].T)) if loads is not None else 0.0
        return work, offset

    def _accelerations(self, time: float, before: bool) -> np.ndarray | None:
        """Loads over mass (d, owned) [m/s^2] where components are free; None without loads."""
        body, loads = self.body, self.body.loads
        if not loads.acting:
            return None
        found = loads.free * loads.external(time, before) / (body.mass * body.share)[:, None]
        return np.ascontiguousarray(found.T)

    # --- what is asked of it ----------------------------------------------------------------------------------

    def cost_notes(self) -> list[str]:
        """Nothing."""
        return []

    def state(self) -> dict[str, Any]:
        """The largest eigenvalue, which decides on the step."""
        return {"largest_eigenvalue": self.largest_eigenvalue}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take it back."""
        self.largest_eigenvalue = state["largest_eigenvalue"]

    def unsound(self) -> tuple[int, str] | None:
        """The first particle whose velocity is not finite."""
        bad = ~np.isfinite(self.body.velocity).all(axis=1)
        return (int(np.argmax(bad)), "a number is no longer finite") if bad.any() else None

    def summary(self) -> dict[str, Any]:
        """Nothing."""
        return {}


class Start:
    """What the end of a step needs of its start: work of loads [J], offset [J], and guided components then."""

    work, offset, sound = 0.0, 0.0, True

    def __init__(self, body: Any) -> None:
        """body: `system.Peridynamics` before a step."""
        self.body, self.entries = body, body.loads.entries
        self.displacement, self.velocity, self.force = self._guided()

    def _guided(self) -> list[np.ndarray]:
        """Displacement, velocity and force (k,) of guided components."""
        return [array[self.entries] for array in (self.body.displacement, self.body.velocity, self.body.forces.force)]

    def guide(self, time: float, step: float) -> float:
        """Set the velocity of guided components after a step [s]; the work [J] of what guides them and of their
        loads."""
        body, particles = self.body, self.entries[0]
        if not len(particles):
            return 0.0
        change = body.displacement[self.entries] - self.displacement
        body.velocity[self.entries] = body.loads.guided_velocities(time, step, change)
        _, velocity, force = self._guided()
        kinetic = 0.5 * body.mass[particles] * (velocity**2 - self.velocity**2)
        return float(np.sum(body.share[particles] * (kinetic - 0.5 * (self.force + force) * change)))


@reduction
def kick(time, count, force, loads, mass, share, free, velocity):
    """v += time (F/m + load) = dv; on this side of mirror planes the work of the loads and time/2 sum F . dv [J].

    The latter is what leapfrog, with this work, adds to kinetic and stored energy by the end of a step and takes by the
    next, exactly where F is linear; without loads dt^2/8 sum m |a|^2, with time = dt/2 (Hairer, Lubich and Wanner,
    Geometric Numerical Integration, 2006, section I.5).
    force (owned, 4) [N]; loads (d, owned) [m/s^2] or None; mass (n,) [kg], of whole particles; free, velocity (d, n),
    0 of components that are held.
    """
    work, offset = 0.0, 0.0
    for i in range(velocity.shape[0]):
        for a in range(count):
            v, acceleration = velocity[i, a], force[a, i] / mass[a]
            load = 0.0
            if loads is not None:
                load = loads[i, a]
            new = (v + time * (acceleration + load)) * free[i, a]
            velocity[i, a] = new
            work += 0.5 * time * share[a] * mass[a] * load * (v + new)
            # what is held is not kicked, whatever it is moved by
            offset += 0.5 * time * share[a] * force[a, i] * free[i, a] * (new - v)
    return work, offset


@kernel
def drift(step, velocity, displacement, count):
    """u += step v of the owned particles; the sum of all components of v, a number if all of them are."""
    total = 0.0
    for i in range(velocity.shape[0]):
        for a in range(count):
            total += velocity[i, a]
            displacement[i, a] += step * velocity[i, a]
    return total


@reduction
def kinetic_energy(velocity, mass, share, count):
    """Sum of 1/2 m v^2 [J] of the owned particles."""
    energy = 0.0
    for i in range(velocity.shape[0]):
        for a in range(count):
            energy += 0.5 * mass[a] * share[a] * velocity[i, a] * velocity[i, a]
    return energy
