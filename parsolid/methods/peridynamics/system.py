"""Non-ordinary state-based (correspondence) peridynamics (Galadima et al.; checked in docs/peridynamics.md), on one
rank.

State: displacement, velocity, and of viscoelastic bodies one vector a Prony term (`relaxing_displacement`). A time
solver, `velocity_verlet` or `quasi_static`, takes it from step to step with the `forces` of its laws; `fracture` breaks
bonds.
"""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import Conditions
from parsolid.collective import SolverError
from parsolid.materials.registry import laws_of
from parsolid.methods.peridynamics.cracks import parted
from parsolid.methods.peridynamics.forces import build_forces, particles_of
from parsolid.methods.peridynamics.fracture import Fracture
from parsolid.methods.peridynamics.output import Reports
from parsolid.methods.peridynamics.preconditioner import Preconditioners
from parsolid.methods.peridynamics.quasi_static import QuasiStatic
from parsolid.methods.peridynamics.tangent import Operator
from parsolid.methods.peridynamics.tractions import Tractions
from parsolid.methods.peridynamics.velocity_verlet import VelocityVerlet
from parsolid.methods.plastic_particles import begin_plastic
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.particles.declaration import Columns, Field
from parsolid.particles.initial_fields import initial_displacement, initial_velocity
from parsolid.scene.boundaries import Pressure, Traction


class Peridynamics(Reports):
    """The method on one rank. Bars lie in the plane."""

    even_steps = undamped = True

    def __init__(self, comm: Any, scene: Any, particle_set: Any) -> None:
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be
        bonded. Collective.
        """
        self.comm, self.settings, self.laws_of_bodies = comm, scene.method, laws_of(scene)
        self.owned, self.dimension = particle_set.position.shape
        self.particles = particles_of(scene, particle_set)
        self.conditions = Conditions(comm, scene, particle_set, self.particles, others=(Traction, Pressure))
        explicit = self.settings.solution.kind == "explicit"
        if self.conditions.rollers and not explicit:
            key = f"boundaries.{scene.boundaries.index(self.conditions.rollers[0].condition)}.kind"
            raise SolverError(f'{key}: expected method.solution.kind = "explicit" for a normal that is held')
        self.forces = build_forces(comm, scene, particle_set, self.conditions)
        self.pairs, self.laws = self.forces.bonds, self.forces.laws
        self._warnings = Tractions(self.conditions, self.forces).warnings
        self.reactions = self.conditions.reactions
        breaks = self.settings.damage is not None or self.settings.pre_cracks
        self.fracture = Fracture(comm, scene, particle_set, self.forces) if breaks else None
        self.operator = Operator(self.forces, self.conditions)
        newton = not explicit and self.settings.solution.solver == "conjugate-gradients"
        self.preconditioners = Preconditioners(self.operator, self.conditions.planes) if newton else None
        columns: dict[str, Any] = {"mirror": "vector", "layout": Columns()}
        self.particles.declare(Field("position", self.dimension, "m", **columns), particle_set.position)
        # a control on velocities asks for those of neighbours
        if self.forces.damping is not None:
            columns |= {"ghosts": "forward", "message": "motion"}
        self.particles.declare(Field("velocity", self.dimension, "m/s", checkpointed=True, shown=True, **columns))
        self.solver: Any = (VelocityVerlet if explicit else QuasiStatic)(self, self.settings.solution)
        self.jumps, self.stop_times = self.solver.jumps, self.solver.stop_times

    # --- state -------------------------------------------------------------------------------------------------

    def begin(self, scene: Any, particle_set: Any) -> None:
        """Velocity and displacement by the bodies' formulas, and what is stored in the branches; collective."""
        place = (scene, particle_set.body, particle_set.position, particle_set.regions)
        self.particles.owned_rows("velocity")[:] = initial_velocity(*place)
        displacement = initial_displacement(*place)
        if displacement is not None:
            self.particles.owned_rows("displacement")[:] = displacement
        if self.forces.plastic is not None:
            begin_plastic(scene, self.particles, particle_set, self.forces.plastic.blocks)
        self._hold()
        self.forces.start(self.settings.initial_state == "instantaneous")
        if take_state(self.comm, scene, self, particle_set):
            self._hold()
            if self.fracture is not None:
                self.fracture.take_over()
            self.forces.evaluate_anew()
            take_forces(self.comm, scene, self)
        if self.fracture is not None:
            self.fracture.look()

    def _hold(self) -> None:
        """Displacement and velocity at time 0 as supports and what is driven have them."""
        self.velocity[self.conditions.held] = 0.0
        self.displacement[self.conditions.held] = 0.0
        self.solver.begin()
        self.place()

    def resume(self) -> None:
        """The forces of a state that was put back into the table; collective."""
        self.place()
        if self.fracture is not None:
            self.fracture.damage.unpack()
        # those of the step that led here: evaluated anew, from settled histories, they may differ in the last bit
        found = self.forces.force.copy()
        self.forces.resume()
        self.forces.force[:] = found
        if self.fracture is not None:
            self.fracture.look()

    def forget(self) -> None:
        """Forces of the laws of the checkpoint; collective."""
        self.forces.resume()

    @property
    def velocity(self) -> np.ndarray:
        """Velocity (owned, d) [m/s], a view."""
        return self.particles.owned_rows("velocity")

    @property
    def displacement(self) -> np.ndarray:
        """Displacement (owned, d) [m], a view."""
        return self.particles.owned_rows("displacement")

    def place(self) -> None:
        """x = X + u."""
        rows = self.particles.owned_rows
        np.add(rows("reference_position"), self.displacement, out=rows("position"))

    def bring_state_up_to_date(self) -> None:
        """The bits of broken bonds."""
        if self.fracture is not None:
            self.fracture.damage.pack()

    def state(self) -> dict[str, Any]:
        """What the time solver remembers."""
        self.bring_state_up_to_date()
        return self.solver.state()

    def set_state(self, state: dict[str, Any]) -> None:
        self.solver.set_state(state)

    # --- what the loop asks ------------------------------------------------------------------------------------

    @property
    def rebuild_needed(self) -> bool:  # type: ignore[override]
        return self.fracture is not None and self.fracture.found

    @property
    def rebuild_anywhere(self) -> bool:
        """Whether any rank had found some."""
        return self.fracture is not None and self.fracture.found_anywhere

    @rebuild_anywhere.setter
    def rebuild_anywhere(self, found: bool) -> None:
        if self.fracture is not None:
            self.fracture.found_anywhere = found

    def stable_step(self) -> float:
        """The time solver's step [s]; the first call is collective."""
        return self.solver.stable_step()

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """The first part of a step of the time solver."""
        self.solver.advance_positions(time, step, ledger)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        return bool(self.solver.complete_step(time, step, ledger, announce))

    @property
    def placements(self) -> int:  # type: ignore[override]
        """Bonds break."""
        return 0 if self.fracture is None else self.fracture.breaks

    @property
    def given(self) -> float:  # type: ignore[override]
        """By bonds that broke. In equilibria the work of loads on the way to the new balance belongs to it, too."""
        explicit = self.settings.solution.kind == "explicit"
        return self.fracture.given if self.fracture is not None and explicit else 0.0

    def parted(self, place: np.ndarray, others: np.ndarray) -> np.ndarray:
        patches = [] if self.fracture is None else self.fracture.patches
        return np.any([parted(patch, place, others) for patch in patches] or [super().parted(place, others)], axis=0)

    def take_external_forces(self, keep_rows: bool) -> None:
        """See `ParticleSystem`; raises SolverError where there is no motion that forces could change."""
        if self.settings.solution.kind == "quasi-static":
            raise SolverError(
                'method.solution.kind: expected "explicit" with contact, ties and tools, found equilibrium'
            )
        super().take_external_forces(keep_rows)
