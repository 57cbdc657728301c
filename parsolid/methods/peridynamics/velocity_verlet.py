"""Explicit motion of peridynamic particles: velocity Verlet, as `methods.leapfrog` has it.

Its displacements are those of symplectic Euler ((37) of Galadima et al.), whose velocities are those in the middle of
the steps.
"""

from math import ceil, isfinite, log, sqrt
from typing import Any

import numpy as np

from parsolid.methods.leapfrog import Leapfrog, drift
from parsolid.scene.codes import Note
from parsolid.scene.method_settings import KINETIC_OFFSET
from parsolid.solvers import largest_eigenvalue, start_vector

# leapfrog likes steps of one length: the bound of stiffness is followed in stairs
_STAIR = 1.1
# a body that is so much stiffer than at rest is crushed
_LOST = 1e100


class VelocityVerlet:
    """Moves one rank's particles; the stable step is that of the instantaneous stiffness of the whole body at rest,
    less where finite strain stiffens it.

    jumps, stop_times: see `methods.protocol.ParticleSystem`; setting: the key of method.solution whose smaller value
    makes steps milder; unheld: whether no balance was found because nothing holds a fragment.
    """

    setting, unheld = "safety", False
    jumps: tuple[float, ...] = ()

    def __init__(self, body: Any, settings: Any) -> None:
        """body: `system.Peridynamics`, set up but for its state; settings: `settings.Explicit`."""
        self.body, self.settings, self.stop_times = body, settings, body.conditions.times
        damping = "dissipative_force" if body.forces.damping is not None else None
        self.leapfrog = Leapfrog(body.particles, body.conditions, "internal_force", damping)
        self.largest_eigenvalue: float | None = None
        self.largest_damping = 0.0
        self.finite = True

    def begin(self) -> None:
        """What is prescribed is where, and as fast, as it is at time 0."""
        self.body.conditions.hold(0.0)

    @property
    def breaks_bonds(self) -> bool:
        return self.body.fracture is not None and self.body.fracture.settings is not None

    def stable_step(self) -> float:
        """Safety times the largest step [s] of the last settled state; the first call is collective.

        It is 2/sqrt(lambda) with the largest eigenvalue of the stiffness; with a damping of largest eigenvalue b that
        lags by half a step, lambda dt^2 + 2 b dt = 4, which is less than any wave allows.
        """
        if self.largest_eigenvalue is None:
            # of the stiffness of the undeformed body, and that of the damping; collective
            operator = self.body.operator

            def stiffness(change: np.ndarray, out: np.ndarray) -> None:
                operator.stiffness(change, out, 0.0)

            if self.body.forces.damping is not None:
                self.largest_damping = self._power_iteration(operator.damping, operator.free)
            # all are driven: the step that they would have if none were
            found = self._power_iteration(stiffness, operator.free)
            self.largest_eigenvalue = (
                found if found > 0.0 else self._power_iteration(stiffness, np.ones_like(operator.free))
            )
        growth, b, plastic = self.body.forces.growth, self.largest_damping, self.body.forces.plastic
        if plastic is not None:
            growth = max(growth, plastic.damped_growth(self.largest_eigenvalue, b))
        if not growth < _LOST:
            return 0.0
        growth = _STAIR ** ceil(log(growth) / log(_STAIR) - 1e-3)
        safety = self.settings.safety
        if self.breaks_bonds:
            safety = min(safety, self.settings.damage_safety)
        return safety * 4.0 / (b + sqrt(b * b + 4.0 * self.largest_eigenvalue * growth))

    def _power_iteration(self, multiply: Any, free: np.ndarray) -> float:
        operator = self.body.operator
        start = start_vector(operator.identifier, self.body.dimension)
        return largest_eigenvalue(operator.comm, multiply, start, operator.mass, free)

    # --- a step -----------------------------------------------------------------------------------------------

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Break the bonds that ranks have found to fail; opening half kick, drift and prescribed motion."""
        body = self.body
        if body.fracture is not None and body.fracture.found_anywhere:
            body.fracture.break_bonds(ledger)
        self.leapfrog.open_step(time, step)
        self.finite = isfinite(drift(0, body.owned, step, *map(body.particles.storage, ("velocity", "displacement"))))
        body.place()
        self.leapfrog.place(time + step, step)
        if body.conditions.motion.there:
            body.place()

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """Forces at the new positions, closing half kick, and energies of a step [s] from a time [s]."""
        body, forces = self.body, self.body.forces
        # what the stable step and the next one depend on is known as soon as particles have moved, or only now
        early = not self.breaks_bonds and not forces.stiffens
        if early:
            announce(self.finite, self.stable_step())
        forces.last_step = self.leapfrog.last_step
        forces.internal_force(step)
        dissipated = forces.commit(step)
        if self.breaks_bonds:
            body.fracture.look()
        if not early:
            announce(self.finite, self.stable_step())
        self.leapfrog.close_step(time + step, step, body.substeps)
        self.leapfrog.book(step, ledger, dissipated, KINETIC_OFFSET)
        forces.book_softening(ledger)
        if forces.plastic is not None:
            forces.plastic.book(ledger)
        return bool(self.finite and forces.sound)

    # --- what is asked of it ----------------------------------------------------------------------------------

    def cost_notes(self) -> list[Note]:
        """Nothing."""
        return []

    def state(self) -> dict[str, Any]:
        """The largest eigenvalues, which decide on the step, and the length of the last step [s]."""
        found = {"largest_eigenvalue": self.largest_eigenvalue, "largest_damping": self.largest_damping}
        return {**found, "last_step": self.leapfrog.last_step, "given": self.body.given}

    def set_state(self, state: dict[str, Any]) -> None:
        self.largest_eigenvalue, self.largest_damping = state["largest_eigenvalue"], state["largest_damping"]
        self.leapfrog.last_step = state["last_step"]
        if self.body.fracture is not None:
            self.body.fracture.given = state.get("given", 0.0)

    def first_invalid(self) -> tuple[int, str] | None:
        """The first particle whose velocity is not finite."""
        bad = ~np.isfinite(self.body.velocity).all(axis=1)
        return (int(np.argmax(bad)), "a number is no longer finite") if bad.any() else None

    def summary(self) -> dict[str, Any]:
        """Nothing."""
        return {}
