"""Non-ordinary state-based (correspondence) peridynamics (Galadima et al.; checked in docs/peridynamics.md), on one
rank.

State: displacement, velocity, and of viscoelastic bodies one vector a Prony term (`relaxing_displacement`). A time
solver, `velocity_verlet` or `quasi_static`, takes it from step to step with the `forces` of its laws; `damage` breaks
bonds.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.conditions import Conditions
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import SolverError, maximum
from parsolid.materials.registry import laws_of
from parsolid.materials.viscoelastic.prony import Prony
from parsolid.methods.leapfrog import kinetic_energy
from parsolid.methods.peridynamics.damage import fracture_of
from parsolid.methods.peridynamics.forces import build_forces, particles_of
from parsolid.methods.peridynamics.quasi_static import QuasiStatic
from parsolid.methods.peridynamics.solids import is_small_strain
from parsolid.methods.peridynamics.tangent import Operator, instantaneous_wave_modulus
from parsolid.methods.peridynamics.tractions import Tractions
from parsolid.methods.peridynamics.velocity_verlet import VelocityVerlet
from parsolid.methods.previous_state import take_state
from parsolid.methods.protocol import BrokenPairs, ParticleSystem
from parsolid.particles.declaration import Columns, Field
from parsolid.scene import initial_displacement, initial_velocity
from parsolid.scene.boundaries.surface import Pressure
from parsolid.scene.boundaries.traction import Traction
from parsolid.scene.warned import Note, Warned

# small strain takes a turn for a strain of half its square: 1 %; that of a few particles, of crumbs say, is no matter
_TURN, _TURNED = 0.14, 0.05


class Peridynamics(ParticleSystem):
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
        self.fracture = fracture_of(comm, scene, particle_set, self.forces)
        self.operator = Operator(self.forces, self.conditions)
        columns: dict[str, Any] = {"mirror": "vector", "layout": Columns()}
        self.particles.declare(Field("position", self.dimension, "m", **columns), particle_set.position)
        self.particles.declare(Field("velocity", self.dimension, "m/s", checkpointed=True, shown=True, **columns))
        self.solver: Any = (VelocityVerlet if explicit else QuasiStatic)(self, self.settings.solution)
        self.jumps, self.landings = self.solver.jumps, self.solver.landings
        self._shown: dict[str, np.ndarray] = {}
        self._evaluation = -1

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        """Interactions counted once a particle."""
        return self.pairs.directed_pairs

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": self.particles.ghosts, "interactions": self.pairs.directed_pairs}

    def arrays(self) -> list[np.ndarray]:
        """Bond lists."""
        return self.pairs.arrays()

    # --- state -------------------------------------------------------------------------------------------------

    def begin(self, scene: Any, particle_set: Any) -> None:
        """Velocity and displacement by the bodies' formulas, and what is stored in the branches; collective."""
        place = (scene, particle_set.body, particle_set.position, particle_set.regions)
        self.particles.owned_rows("velocity")[:] = initial_velocity(*place)
        displacement = initial_displacement(*place)
        if displacement is not None:
            self.particles.owned_rows("displacement")[:] = displacement
        self._hold()
        self.forces.start(self.settings.initial_state == "instantaneous")
        if take_state(self.comm, scene, self, particle_set):
            self._hold()
            if self.fracture is not None:
                self.fracture.take_over()
            self.forces.evaluate_anew()
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
        """Take it back."""
        self.solver.set_state(state)

    # --- what the loop asks ------------------------------------------------------------------------------------

    @property
    def news(self) -> bool:  # type: ignore[override]
        """Whether this rank has found bonds that fail."""
        return self.fracture is not None and self.fracture.found

    @property
    def news_anywhere(self) -> bool:
        """Whether any rank had found some."""
        return self.fracture is not None and self.fracture.found_anywhere

    @news_anywhere.setter
    def news_anywhere(self, found: bool) -> None:
        if self.fracture is not None:
            self.fracture.found_anywhere = found

    def stable_step(self) -> float:
        """The time solver's step [s]; the first call is collective."""
        return self.solver.stable_step()

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """The first part of a step of the time solver."""
        self.solver.advance_positions(time, step, ledger)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """The second part."""
        return bool(self.solver.complete_step(time, step, ledger, announce))

    @property
    def placements(self) -> int:  # type: ignore[override]
        """Bonds break."""
        return 0 if self.fracture is None else self.fracture.breaks

    def broken_pairs(self) -> BrokenPairs | None:
        """Bonds of pre-cracks and failed ones."""
        return None if self.fracture is None else self.fracture.damage.broken_pairs()

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Rollers."""
        return symmetry_planes(self.conditions.planes)

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """Of the instantaneous solid."""
        law = self.laws_of_bodies[body]
        return instantaneous_wave_modulus(law), law.density

    def held_components(self) -> np.ndarray | None:
        """Those of supports and of prescribed motion."""
        return self.conditions.constrained

    def take_external_forces(self, keep_rows: bool) -> None:
        """See `ParticleSystem`; raises SolverError where there is no motion that forces could change."""
        if self.settings.solution.kind == "quasi-static":
            raise SolverError(
                'method.solution.kind: expected "explicit" with contact, ties and tools, found equilibrium'
            )
        super().take_external_forces(keep_rows)

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, the stabiliser's included."""
        storage = self.particles.storage
        kinetic = kinetic_energy(self.owned, storage("velocity"), storage("mass"), storage("share"))
        return kinetic, self.forces.stored_energy()

    # --- what the output and the reports ask -------------------------------------------------------------------

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and Cauchy stress (n, 3, 3); damage (n,)."""
        if name == "damage":
            return np.zeros(last - first) if self.fracture is None else self.fracture.damage.damage[first:last]
        if name not in ("deformation_gradient", "stress"):
            return None
        return self._tensors(name)[first:last]

    def _tensors(self, name: str) -> np.ndarray:
        """Deformation gradients or Cauchy stresses (owned, 3, 3), kept until the next evaluation of forces."""
        if self._evaluation != self.forces.evaluations:
            self._shown, self._evaluation = {}, self.forces.evaluations
        if name not in self._shown and name == "stress":
            self._shown[name] = self.forces.cauchy_stresses(self._tensors("deformation_gradient"))
        elif name not in self._shown:
            gradients = self.forces.displacement_gradients()
            d = gradients.shape[1]
            F = self._shown[name] = np.tile(np.eye(3), (self.owned, 1, 1))
            F[:, :d, :d] += gradients
        return self._shown[name]

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """Broken bonds, and the place of the crack's tip; collective."""
        if name == "broken_bonds":
            return "sum", np.array(0.0 if self.fracture is None else self.fracture.broken_bonds())
        # the same on all ranks
        return "maximum", np.full(self.dimension, np.nan) if self.fracture is None else self.fracture.tip()

    def unsound(self) -> tuple[int, str] | None:
        """The first particle that is inside out or whose velocity is not finite, or the one farthest from balance."""
        if not self.forces.sound:
            jacobian = np.linalg.det(self._tensors("deformation_gradient"))
            index = int(np.argmin(np.where(np.isfinite(jacobian), jacobian, -np.inf)))
            return index, f"the Jacobian is {jacobian[index]:.4g}, not positive: matter is turned inside out"
        return self.solver.unsound()

    def warnings(self) -> list[Warned]:
        """Pressures in regions that are too thin for them."""
        return self._warnings

    def doubt(self) -> str | None:
        """Whether more than a little of what has small strain has turned so far that this is strain; collective."""
        G = self._tensors("deformation_gradient")
        angle = np.linalg.norm(G - G.swapaxes(1, 2), axis=(1, 2)) / np.sqrt(8.0)
        small = np.zeros(self.owned, bool)
        for first, last, law in self.laws:
            small[first:last] = is_small_strain(law)
        volume = self.particles.owned_rows("volume") * self.share
        turned, whole = sums(self.comm, [volume[small & (angle > _TURN)].sum(), volume.sum()])
        if not turned > _TURNED * whole:
            return None
        most = maximum(self.comm, float(angle[small].max(initial=0.0)))
        return (
            f"{turned / whole:.2g} of the volume has turned by more than {_TURN:g} rad, {most:.2g} rad at most: small "
            'strain takes that for a strain of half its square (material.strain = "finite", or a hyperelastic law)'
        )

    def advice(self) -> str:
        """What most likely helps."""
        if self.solver.unheld:
            return "a support of the piece, or loads on it that balance"
        hints = []
        if self.settings.stabilisation.kind == "none":
            hints.append('method.stabilisation.kind = "shear-scaled"')
        if any(isinstance(law, Prony) and law.finite_strain is not None for _, _, law in self.laws):
            hints.append("a hyperelastic law (St. Venant and Kirchhoff's gives way when compressed to 0.58)")
        return ", or ".join([*hints, f"a smaller method.solution.{self.solver.setting}", "a milder load"])

    def cost_notes(self) -> list[Note]:
        """Iterations of quasi-static solutions where they are many."""
        return self.solver.cost_notes()

    def summary(self) -> dict[str, Any]:
        """Iterations of quasi-static solutions."""
        return self.solver.summary()

    def exchanged_records(self) -> dict[str, int]:
        """The rows of the divergence sweep."""
        return {"bond stress": self.particles.fields["bond_stress"].components}

    def bytes_a_step(self) -> int:
        """Fields and records."""
        return self.forces.bytes_sent()
