"""Non-ordinary state-based (correspondence) peridynamics (Galadima et al.; checked in docs/peridynamics.md), on one
rank.

State: displacement, velocity, and of viscoelastic bodies one vector a Prony term (`viscoelastic_history`). A time
solver, `velocity_verlet` or `quasi_static`, takes it from step to step; `fracture` breaks bonds.
"""

from typing import Any

import numpy as np

from decomposition.reduction import sums
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import SolverError, maximum
from parsolid.materials.damage.bond_based import BondBased
from parsolid.materials.registry import laws_of
from parsolid.materials.viscoelastic.prony_lanes import Prony
from parsolid.methods.pair_method import PairMethod
from parsolid.methods.peridynamics.forces import build_forces, particles_of
from parsolid.methods.peridynamics.fracture import fracture_of
from parsolid.methods.peridynamics.loads import PeridynamicLoads
from parsolid.methods.peridynamics.operator import Operator, instantaneous_wave_modulus
from parsolid.methods.peridynamics.quasi_static import QuasiStatic
from parsolid.methods.peridynamics.reactions import reactions_of
from parsolid.methods.peridynamics.tensor_history import is_small_strain
from parsolid.methods.peridynamics.velocity_verlet import VelocityVerlet
from parsolid.methods.peridynamics.velocity_verlet_kernels import kinetic_energy
from parsolid.methods.previous_state import take_state
from parsolid.methods.protocol import BrokenPairs
from parsolid.particles.declaration import Field, Rows
from parsolid.scene import initial_displacement, initial_velocity

# small strain takes a turn for a strain of half its square: 1 %; that of a few particles, of crumbs say, is no matter
_TURN, _TURNED = 0.14, 0.05
TIME_SOLVERS = {"explicit": VelocityVerlet, "quasi-static": QuasiStatic}


class Peridynamics(PairMethod):
    """The method on one rank. Bars lie in the plane."""

    even_steps = undamped = True

    def __init__(self, comm: Any, scene: Any, particle_set: Any) -> None:
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be
        bonded. Collective.
        """
        self.comm, self.settings, self.laws_of_bodies = comm, scene.method, laws_of(scene)
        self.loads = PeridynamicLoads(comm, scene, particle_set, particles_of(scene, particle_set))
        forces = build_forces(comm, scene, particle_set, self.loads)
        self.particles, self.bond_system, self.engine, self.history = forces.particles, *forces[2:]
        self.pairs = self.bond_system
        self.owned, self.dimension = particle_set.position.shape
        self.laws = self.history.laws
        self.loads.install_tractions(self.engine, forces.horizon)
        self.reactions = reactions_of(comm, self, particle_set)
        self.told = () if self.reactions is None else self.reactions.told
        self.fracture = fracture_of(comm, scene, particle_set, forces)
        self.operator = Operator(self.engine, self.history, self.loads)
        motion: dict[str, Any] = {"shown": True, "mirror": "vector"}
        self.particles.declare(Field("position", self.dimension, "m", mirror="vector"), particle_set.position)
        self.particles.declare(Field("velocity", self.dimension, "m/s", checkpointed=True, layout=Rows(4), **motion))
        self.solver = TIME_SOLVERS[self.settings.solution.kind](self, self.settings.solution)
        self.jumps, self.landings = self.solver.jumps, self.solver.landings
        self._gradients: Any = None
        self._evaluation = -1

    # --- state -------------------------------------------------------------------------------------------------

    def begin(self, scene: Any, particle_set: Any) -> None:
        """Velocity and displacement by the bodies' formulas, and what is stored in the branches; collective."""
        place = (scene, particle_set.body, particle_set.position, particle_set.regions)
        self.particles.owned_rows("velocity")[:] = initial_velocity(*place)
        displacement = initial_displacement(*place)
        if displacement is not None:
            self.particles.owned_rows("displacement")[:] = displacement
        self._hold()
        self.history.start(self.settings.initial_state == "instantaneous")
        if take_state(self.comm, scene, self, particle_set):
            self._hold()
            self.fracture.take_over()
            self.history.evaluate_anew()
        self.fracture.look()

    def _hold(self) -> None:
        """Displacement and velocity at time 0 as supports and what is driven have them."""
        self.loads.stop(self.velocity)
        self.displacement[self.loads.held] = 0.0
        self.solver.begin()
        self.place()

    def resume(self) -> None:
        """The forces of a state that was put back into the table; collective."""
        self.place()
        self.fracture.resume()
        self.history.resume()
        self.fracture.look()

    @property
    def velocity(self) -> np.ndarray:
        """Velocity (owned, 4) [m/s] as kernels take it."""
        return self.particles.storage("velocity")[: self.owned]

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
        self.fracture.pack()

    def state(self) -> dict[str, Any]:
        """What the time solver remembers."""
        self.fracture.pack()
        return self.solver.state()

    def set_state(self, state: dict[str, Any]) -> None:
        """Take it back."""
        self.solver.set_state(state)

    # --- what the loop asks ------------------------------------------------------------------------------------

    @property
    def news(self) -> bool:  # type: ignore[override]
        """Whether this rank has found bonds that fail."""
        return self.fracture.found

    @property
    def news_anywhere(self) -> bool:
        """Whether any rank had found some."""
        return self.fracture.found_anywhere

    @news_anywhere.setter
    def news_anywhere(self, found: bool) -> None:
        self.fracture.found_anywhere = found

    def stable_step(self) -> float:
        """The time solver's step [s]; the first call is collective."""
        return self.solver.stable_step()

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """See `ParticleSystem`."""
        if hasattr(self.solver, "advance_positions"):
            self.solver.advance_positions(time, step, ledger)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One step of the time solver."""
        advance = self.solver.complete_step if hasattr(self.solver, "complete_step") else self.solver.advance
        sound = advance(time, step, ledger, announce)
        for told in self.told:
            told.finish(step, ledger)
        return sound

    @property
    def placements(self) -> int:  # type: ignore[override]
        """Bonds break."""
        return self.fracture.breaks

    def broken_pairs(self) -> BrokenPairs | None:
        """Bonds of pre-cracks and failed ones."""
        return self.fracture.broken_pairs()

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Rollers."""
        return symmetry_planes(self.loads.planes)

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """Of the instantaneous solid; of a bond-based one by its Young's modulus and Poisson's ratio of 1/4."""
        law = self.laws_of_bodies[body]
        if isinstance(law, BondBased):
            return 1.2 * law.youngs_modulus, law.density
        return instantaneous_wave_modulus(law), law.density

    def held_components(self) -> np.ndarray | None:
        """Those of supports and of guided motion."""
        free = self.loads.free
        return None if free.all() else ~free

    def take_external_forces(self, keep_rows: bool) -> None:
        """See `ParticleSystem`; raises SolverError where there is no motion that forces could change."""
        if self.settings.solution.kind == "quasi-static":
            raise SolverError(
                'method.solution.kind: expected "explicit" with contact, ties and tools, found equilibrium'
            )
        super().take_external_forces(keep_rows)

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, the stabiliser's included."""
        kinetic = kinetic_energy(self.dimension, self.velocity, self.mass, self.share)
        return kinetic, self.history.stored_energy()

    # --- what the output and the reports ask -------------------------------------------------------------------

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and Cauchy stress (n, 3, 3); damage (n,)."""
        if name == "damage":
            return self.fracture.damage_of(first, last)
        if name not in ("deformation_gradient", "stress"):
            return None
        F = np.tile(np.eye(3), (last - first, 1, 1))
        d = self.engine.dimension
        F[:, :d, :d] += self._displacement_gradients()[first:last]
        return F if name == "deformation_gradient" else self.engine.cauchy_stresses(self.laws, first, last, F)

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """Broken bonds, and the place of the crack's tip; collective."""
        if name == "broken_bonds":
            return "sum", np.array(self.fracture.broken_bonds())
        # the same on all ranks
        return "maximum", self.fracture.tip()

    def _displacement_gradients(self) -> np.ndarray:
        """grad u (owned, d, d); ghosts' displacements are those of the last evaluation."""
        if self._evaluation != self.engine.evaluations:
            self._gradients, self._evaluation = self.engine.displacement_gradients(), self.engine.evaluations
        return self._gradients

    def unsound(self) -> tuple[int, str] | None:
        """The first particle that is inside out or whose velocity is not finite, or the one farthest from balance."""
        if not self.engine.sound:
            gradients: Any = self.shown("deformation_gradient", 0, self.owned)
            jacobian = np.linalg.det(gradients)
            index = int(np.argmin(np.where(np.isfinite(jacobian), jacobian, -np.inf)))
            return index, f"the Jacobian is {jacobian[index]:.4g}, not positive: matter is turned inside out"
        return self.solver.unsound()

    def doubt(self) -> str | None:
        """Whether more than a little of what has small strain has turned so far that this is strain; collective."""
        G = self._displacement_gradients()
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
        if self.settings.stabilisation.kind != "shear-scaled":
            hints.append('method.stabilisation.kind = "shear-scaled"')
        if any(isinstance(law, Prony) and law.finite_strain is not None for _, _, law in self.laws):
            hints.append("a hyperelastic law (St. Venant and Kirchhoff's gives way when compressed to 0.58)")
        return ", or ".join([*hints, f"a smaller method.solution.{self.solver.setting}", "a milder load"])

    def cost_notes(self) -> list[str]:
        """Iterations of quasi-static solutions where they are many."""
        return self.solver.cost_notes()

    def summary(self) -> dict[str, Any]:
        """Iterations of quasi-static solutions."""
        return self.solver.summary()

    def exchanged_records(self) -> dict[str, int]:
        """The record of the second pass and the relaxing displacement."""
        return {"second-pass record": self.engine.record.shape[1], "relaxing displacement": self.dimension}

    def bytes_a_step(self) -> int:
        """Fields and records."""
        return self.engine.bytes_sent()

    def arrays(self) -> list[np.ndarray]:
        """Pair lists, and what passes without them keep."""
        return super().arrays() + self.engine.arrays()

    def warm(self) -> None:
        """Lists of ghosts have no images."""
        self.bond_system.warm()
