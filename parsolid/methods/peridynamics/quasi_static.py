"""Quasi-static material steps: at the end of each, internal and external forces balance (see `equilibrium`).

With loads that jump, a step of length 0 goes before the next one (a_j = A_j = 1 in the histories).
"""

from typing import Any

import numpy as np

from parsolid.boundary.reactions import report_equilibrium
from parsolid.collective import Stopped
from parsolid.methods.peridynamics.equilibrium import Equilibrium
from parsolid.methods.peridynamics.tangent import Settled, Work
from parsolid.particles.declaration import Columns, Field
from parsolid.scene.codes import Note
from parsolid.solvers import State


class QuasiStatic:
    """Takes one rank's particles from balance to balance; all methods are collective.

    jumps, stop_times, setting: see `velocity_verlet.VelocityVerlet`.
    """

    setting, stop_times = "step", ()

    def __init__(self, body: Any, settings: Any) -> None:
        """body: `system.Peridynamics`, set up but for its state; settings: `settings.QuasiStatic`. Collective."""
        self.body, self.operator, self.settings = body, body.operator, settings
        self.equilibrium = Equilibrium(body.comm, body.operator, settings, body.preconditioners, body.raise_if_stopped)
        # what has not moved yet meets its loads in a jump
        self.jumps = (0.0, *body.conditions.times)
        self.balance: State | None = None
        # times [s] of the states that `earlier` holds, newest first, since loads jumped last
        self.times: list[float] = []
        kept: dict[str, Any] = {"checkpointed": True, "mirror": "vector", "layout": Columns()}
        self.names = [f"earlier_displacement_{k + 1}" for k in range(settings.extrapolation + 1)]
        for name in self.names:
            body.particles.declare(Field(name, body.operator.free.shape[1], "m", **kept))
        self.steps = 0

    @property
    def earlier(self) -> list[np.ndarray]:
        """Displacements (owned, d) [m] of earlier states."""
        return [self.body.particles.owned_rows(name) for name in self.names]

    def begin(self) -> None:
        """The first balance moves what is guided."""

    def stable_step(self) -> float:
        return self.settings.step

    @property
    def unheld(self) -> bool:
        """Whether the last step found no balance because nothing holds a fragment."""
        return self.equilibrium.unheld

    # --- a step ------------------------------------------------------------------------------------------------

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """Nothing: a balance is one with the positions at the end of its step."""

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One material step [s] from a time [s], or none where the run is to stop; balance after the bonds that broke
        last, where a stop has left that out. False, with a `fault`, when balance was lost on the way."""
        body = self.body
        body.reached, body.stopped = None, False
        # what bonds that break leave without balance ends the next step, so that a row shows them
        balanced = True
        try:
            if not body.unsettled:
                # what held the bodies' start lets go as the first loads come
                first = time == step == 0.0
                before = -self.operator.settled_force() if first else self.operator.external(time, step == 0.0)
                self.material_step(before, time, step, ledger)
                balanced = self.reached
            sound = self.settle(time + step, ledger)
        except Stopped:
            sound, body.stopped, body.reached = True, True, None if body.unsettled else time
        body.place()
        announce(balanced, self.settings.step)
        body.conditions.report(step if body.reached is None else 0.0, ledger)
        return sound and body.forces.sound

    def settle(self, time: float, ledger: Any) -> bool:
        """Balance at a time [s] with the bonds that break there, one set after another."""
        fracture = self.body.fracture
        sound = self.balance_anew(time, ledger) if self.body.unsettled else self.reached
        while sound and fracture is not None and fracture.ranks_find():
            fracture.break_bonds(ledger)
            self.body.unsettled = True
            sound = self.balance_anew(time, ledger)
        return sound

    @property
    def reached(self) -> bool:
        """Whether forces balance at the end of the last step."""
        return self.balance is not None and self.equilibrium.reached(self.balance)

    def material_step(self, before: np.ndarray, time: float, step: float, ledger: Any) -> Work:
        """Balance at the end of a step under loads (owned, d) [N] at its start, with the bonds as they are, and the
        histories through it; what was done."""
        operator, conditions = self.operator, self.body.conditions
        start = Settled(operator.displacement.copy(), operator.settled_force(), operator.forces.stored_energy())
        guess = self.extrapolated(start.displacement, time, step)
        # a step ends before a jump of that time, one of length 0 after it
        if conditions.motion.there:
            conditions.motion.displace(time, step, guess.T)
        after = operator.external(time + step, step > 0.0)
        found = operator.forces.force.copy()
        try:
            self.balance = balance = self.equilibrium.find(guess, after, step)
        except Stopped:
            operator.displacement[:], operator.forces.force[:] = start.displacement, found
            self.body.bring_state_up_to_date()
            self.body.resume()
            raise
        lost = operator.commit(balance.displacement, step)
        softened = self.body.forces.book_softening(ledger)
        work = operator.work_since(start, before, after)
        change, force = operator.displacement - start.displacement, operator.settled_force()
        places = (operator.particles.owned_rows("reference_position") + operator.displacement).T
        of_conditions = -0.5 * (start.force + force + before + after) * change
        report_equilibrium(conditions, places, change, -(force + after), of_conditions, time, step)
        # within a step strain goes linearly whatever the loads do, so that forces are out of balance; a jump is as it
        # should be
        numerical = work.internal - lost - softened - work.stored if step > 0.0 else 0.0
        ledger.add(1.0, lost, numerical, work.external)
        ledger.add_term("residual_work", work.residual)
        self.remember(balance.displacement, time + step, step)
        return work

    def balance_anew(self, time: float, ledger: Any) -> bool:
        """Balance at a time [s] after bonds have broken, in a jump; what loads do beyond the work of internal forces,
        cracks take.
        """
        self.equilibrium.stiffness_changed()
        before = self.operator.external(time)
        work = self.material_step(before, time, 0.0, ledger)
        self.body.unsettled = False
        # loads do more work than the forces that were out of balance take up: cracks run by it
        ledger.add_term("fracture_dissipation", work.external - work.internal)
        return self.reached

    # --- first guesses -----------------------------------------------------------------------------------------

    def extrapolated(self, now: np.ndarray, time: float, step: float) -> np.ndarray:
        """First guess (n, d) [m] for the end of a step [s] that starts at a time [s] with the displacement `now`."""
        if step == 0.0 or len(self.times) < 2:
            return now.copy()
        result = np.zeros(now.shape)
        for weight, earlier in zip(lagrange_weights(self.times, time + step), self.earlier):
            result += weight * earlier
        return result

    def remember(self, displacement: np.ndarray, time: float, step: float) -> None:
        """Keep the displacement (n, d) [m] of a step [s] that ended at a time [s], for the next guesses."""
        self.steps += 1
        if step == 0.0:
            # what went before the jump says nothing about what follows
            self.times = []
        earlier = self.earlier
        self.times = [time, *self.times][: len(earlier)]
        for k in range(len(earlier) - 1, 0, -1):
            earlier[k][:] = earlier[k - 1]
        earlier[0][:] = displacement

    # --- what is asked of it -----------------------------------------------------------------------------------

    def cost_notes(self) -> list[Note]:
        """Volumes so stiff in bodies so large that a solution takes many iterations; collective."""
        if self.settings.solver != "conjugate-gradients":
            return []
        told = self.equilibrium.preconditioners.near_incompressibility_note((0.0, self.settings.step))
        return [Note("stiff-volumes", told)] if told else []

    def first_invalid(self) -> tuple[int, str] | None:
        """This rank's particle farthest from balance, where the last step found none; and why."""
        if self.balance is None or self.reached or not len(self.balance.residual):
            return None
        return int(np.argmax(np.abs(self.balance.residual).max(axis=1))), self.equilibrium.fault

    def state(self) -> dict[str, Any]:
        """What a restart needs besides the `earlier` displacements."""
        return {
            "largest_load": self.equilibrium.largest_load,
            "times": self.times,
            "unsettled": self.body.unsettled,
            "counts": [self.steps, self.equilibrium.iterations, self.equilibrium.most_iterations],
        }

    def set_state(self, state: dict[str, Any]) -> None:
        self.equilibrium.largest_load, self.times = state["largest_load"], list(state["times"])
        # earlier versions had no such state
        self.body.unsettled = state.get("unsettled", False)
        self.steps, self.equilibrium.iterations, self.equilibrium.most_iterations = state["counts"]

    def summary(self) -> dict[str, Any]:
        """Entries of summary.json: force evaluations, those of a step on average and at most."""
        iterations = self.equilibrium.iterations
        return {
            "material_steps": self.steps,
            "iterations": iterations,
            "iterations_per_step": iterations / self.steps if self.steps else None,
            "most_iterations": self.equilibrium.most_iterations,
        }


def lagrange_weights(times: Any, time: float) -> list[float]:
    """Weights of values at distinct times with which their interpolating polynomial gives the value at another time."""
    return [
        float(np.prod([(time - other) / (own - other) for k, other in enumerate(times) if k != i]))
        for i, own in enumerate(times)
    ]
