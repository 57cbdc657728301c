"""Non-ordinary state-based (correspondence) peridynamics (Galadima et al.; checked in docs/peridynamics.md), on one rank.

State: displacement, velocity, and of viscoelastic bodies one vector a Prony term (`relaxing`). An explicit step is: kick and
drift; ghosts' fields while the inner gradient runs; stress and stabiliser of each particle; ghosts' records while the inner
forces run; kick.
"""

import numpy as np

from parsolid.collective import anywhere
from parsolid.materials.blocks import material_blocks
from parsolid.materials.registry import laws_of
from parsolid.methods.peridynamics import velocity_verlet as bond_motion
from parsolid.methods.peridynamics.bond_based import BondBasedForce
from parsolid.methods.peridynamics.correspondence import stresses
from parsolid.methods.peridynamics.forces import build_forces
from parsolid.methods.peridynamics.fracture import Fracture
from parsolid.methods.peridynamics.history_force import HistoryForce
from parsolid.methods.peridynamics.loads import PeridynamicLoads
from parsolid.methods.peridynamics.operator import Operator
from parsolid.methods.peridynamics.quasi_static import QuasiStatic
from parsolid.methods.protocol import ParticleMethod
from parsolid.numerics.lanes import aligned_zeros, padded
from parsolid.particles.fields import Field, FieldTable
from parsolid.scene import initial_displacement, initial_velocity
from parsolid.solvers import largest_eigenvalue, start_vector


class Peridynamics(ParticleMethod):
    """The method on one rank. Arrays are laid out as `pairs.layout` says; bars lie in the plane."""

    even_steps = True

    def __init__(self, comm, scene, particle_set):
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be bonded. Collective."""
        self.comm, self.settings, self.scene = comm, scene.method, scene
        laws = laws_of(scene)
        self.blocks, density = material_blocks(laws, particle_set.body)
        self.loads = PeridynamicLoads(comm, scene, particle_set)
        self.owned, self.dimension = particle_set.position.shape
        self.share = self.loads.share
        self.mass = density * particle_set.volume / self.share
        forces = build_forces(comm, scene, particle_set, laws, self.blocks, self.loads)
        self.bond_system, self.engine, self.relaxation = forces.bond_system, forces.engine, forces.relaxation
        self.loads.install_tractions(self.engine, forces.horizon)
        self.fracture = None
        if self.settings.damage is not None or self.settings.pre_cracks:
            self.fracture = Fracture(comm, scene, particle_set, self.engine)
        self.operator = Operator(self.engine, self.blocks, self.relaxation, self.share, self.mass, self.loads.free)
        self.clamp = np.ones((self.owned, 4))
        self.clamp[:, : self.dimension] = self.loads.free
        self.quasi_static = None
        if self.settings.solution.kind == "quasi-static":
            self.quasi_static = QuasiStatic(comm, self.operator, self.settings.solution)
            # what has not moved yet meets its loads in a jump
            self.jumps = tuple(sorted({0.0, *self.loads.jumps}))
        else:
            self.landings = tuple(time for time in self.loads.jumps if time > 0.0)
        self.laws = [(block.first, block.last, block.law) for block in self.blocks]
        self.velocity = aligned_zeros((padded(self.owned) + 4, 4))
        self.table = FieldTable(self.owned)
        self._declare(particle_set)
        self.largest_eigenvalue = None
        self._gradients = None

    def _declare(self, particle_set) -> None:
        d, add, owned = self.dimension, self.table.add, self.owned
        add(Field("identifier", 1, "1", checkpointed=True, shown=True), particle_set.identifier)
        add(Field("body", 1, "1", checkpointed=True, shown=True), particle_set.body)
        add(Field("reference_position", d, "m", checkpointed=True), particle_set.position)
        add(Field("volume", 1, "m^3", checkpointed=True), particle_set.volume)
        add(Field("spacing", d, "m", checkpointed=True), particle_set.spacing)
        if particle_set.axes is not None:
            add(Field("axes", d * d, "1", checkpointed=True), particle_set.axes.reshape(owned, d * d))
        add(Field("area", d, "m^2", checkpointed=True), particle_set.area)
        add(Field("position", d, "m", evolved=True), particle_set.position.copy())
        moving = {"evolved": True, "checkpointed": True, "shown": True}
        add(Field("velocity", d, "m/s", **moving), self.velocity[:, :d])
        add(Field("displacement", d, "m", exchanged=True, **moving), self.engine.displacement[:, :d])
        history, kept = self.relaxation, {"evolved": True, "checkpointed": True}
        if len(history.terms):
            add(Field("settled_displacement", history.old.shape[1], "m", **kept), history.old)
            add(Field("elastic_force", history.old.shape[1], "N", **kept), history.elastic)
        for j in range(len(history.terms)):
            add(Field(f"relaxing_displacement_{j + 1}", history.old.shape[1], "m", **kept), history.terms[j])
            add(Field(f"relaxing_force_{j + 1}", history.old.shape[1], "N", **kept), history.forces[j])
        for k, earlier in enumerate(self.quasi_static.earlier if self.quasi_static is not None else ()):
            add(Field(f"earlier_displacement_{k + 1}", d, "m", **kept), earlier)
        self.engine.declare(self.table)
        if self.fracture is not None:
            self.fracture.damage.declare(self.table)

    # --- state -------------------------------------------------------------------------------------------------

    def begin(self, scene, particle_set) -> None:
        """Velocity and displacement by the bodies' formulas, and what is stored in the branches; collective."""
        place = (scene, particle_set.body, particle_set.position)
        self.table.owned_rows("velocity")[:] = initial_velocity(*place)
        displacement = initial_displacement(*place)
        if displacement is not None:
            self.table.owned_rows("displacement")[:] = displacement
        velocity, moved = self.table.owned_rows("velocity"), self.table.owned_rows("displacement")
        velocity[self.loads.held], moved[self.loads.held] = 0.0, 0.0
        if self.quasi_static is None:
            # quasi-static solutions meet what guides them in the first jump
            self.loads.move(0.0, 0.0, moved)
            velocity[self.loads.entries] = self.loads.guided_velocities(0.0, 0.0, np.zeros(len(self.loads.entries[0])))
        self._place()
        self.relaxation.start(self.laws, self.settings.initial_state == "instantaneous")
        self._look()

    def resume(self) -> None:
        """The forces of a state that was put back into the table; collective."""
        self._place()
        if self.fracture is not None:
            self.fracture.resume()
        self.relaxation.resume(self.laws)
        self._look()

    def _place(self) -> None:
        rows = self.table.owned_rows
        rows("position")[:] = rows("reference_position") + rows("displacement")

    def state(self) -> dict:
        """The largest eigenvalue, which decides on the step, and what quasi-static solutions remember."""
        if self.fracture is not None:
            self.fracture.damage.pack()
        solver = {} if self.quasi_static is None else {"quasi_static": self.quasi_static.state()}
        return {"largest_eigenvalue": self.largest_eigenvalue} | solver

    def set_state(self, state: dict) -> None:
        """Take it back."""
        self.largest_eigenvalue = state["largest_eigenvalue"]
        if self.quasi_static is not None:
            self.quasi_static.set_state(state["quasi_static"])

    # --- fracture ----------------------------------------------------------------------------------------------

    def _look(self) -> None:
        """Look for bonds that fail in the state just evaluated; they are news to all ranks."""
        self.news = self.fracture is not None and self.fracture.look()

    def _break_bonds(self, ledger) -> None:
        """Break what any rank has found, and evaluate the forces of the state anew; collective."""
        stored = self.energies()[1]
        self.fracture.break_found()
        self.relaxation.evaluate_anew(self.laws)
        self._gradients = None
        ledger.add_term("dissipation_fracture", stored - self.energies()[1])

    def _settled(self, time: float, ledger) -> bool:
        """Break bonds in balance at a time [s] until none fails any more; False when balance is lost on the way. Collective."""
        sound = True
        self._look()
        while sound and anywhere(self.comm, self.news):
            self._break_bonds(ledger)
            self.quasi_static.stiffness_changed()
            start, force = self.operator.displacement.copy(), self.operator.settled_force()
            sound = self.quasi_static.advance(self.loads, time, 0.0, ledger, lambda *announced: None)
            # loads do more work than the forces that were out of balance take up: cracks run by it
            mean = 0.5 * (force + self.operator.settled_force())
            excess = float(np.vdot(self.loads.external(time) + mean, self.operator.displacement - start))
            ledger.add(1.0, 0.0, 0.0, excess)
            ledger.add_term("dissipation_fracture", excess)
            self._look()
        return sound

    # --- explicit motion ---------------------------------------------------------------------------------------

    def stable_step(self) -> float:
        """The material step, or safety times 2/sqrt(lambda_max) [s] of the body's instantaneous stiffness; the first call is collective."""
        if self.quasi_static is not None:
            return self.settings.solution.step
        if self.largest_eigenvalue is None:
            operator = self.operator
            start = start_vector(operator.identifier, self.dimension)
            self.largest_eigenvalue = largest_eigenvalue(
                self.comm, lambda x, y: operator.stiffness(x, y, 0.0), start, operator.mass, operator.free
            )
            # the field and the forces of the state, which the iteration has used
            self.relaxation.resume(self.laws)
        solution = self.settings.solution
        safety = solution.safety if self.settings.damage is None else min(solution.safety, solution.damage_safety)
        return safety * 2.0 / np.sqrt(self.largest_eigenvalue)

    def advance(self, time: float, step: float, ledger, announce) -> bool:
        """One leapfrog step, see `bond_motion`, or one material step."""
        if self.quasi_static is not None:
            sound = self.quasi_static.advance(self.loads, time, step, ledger, announce)
            if self.fracture is not None:
                sound = sound and self._settled(time + step, ledger)
            self._place()
            self._gradients = None
            return sound and self.engine.sound
        if self.news_anywhere:
            self._break_bonds(ledger)
        d, engine, loads = self.dimension, self.engine, self.loads
        rows, velocity, half = self.table.owned_rows, self.velocity[: self.owned], 0.5 * step
        guided = self._guided_motion()
        moved = (velocity, engine.force[: self.owned], self.mass, self.share)
        work = bond_motion.kick(d, half, *moved, self._accelerations(time, False), self.clamp)
        bond_motion.drift(d, step, velocity, rows("reference_position"), engine.displacement, rows("position"))
        if guided is not None:
            loads.move(time, step, rows("displacement"))
            self._place()
        sound = bool(np.isfinite(velocity.sum()))
        if self.fracture is None:
            announce(sound, self.stable_step())
        self.relaxation.propose(step)
        engine.evaluate(self.laws)
        self._gradients = None
        if self.fracture is not None:
            # bonds that fail in the new state are part of what is announced
            self._look()
            announce(sound, self.stable_step())
        lost = self.relaxation.settle(step)
        work += bond_motion.kick(d, half, *moved, self._accelerations(time + step, True), self.clamp)
        if guided is not None:
            work += self._guide(guided, time, step)
        ledger.add(1.0, lost, 0.0, work)
        return sound and self.engine.sound

    def _accelerations(self, time: float, before: bool) -> np.ndarray | None:
        """Loads over mass (owned, 4) [m/s^2] where components are free; None without loads."""
        if not self.loads.acting:
            return None
        result = np.zeros((self.owned, 4))
        external = self.loads.external(time, before)
        result[:, : self.dimension] = self.loads.free * external / (self.mass * self.share)[:, None]
        return result

    def _guided_motion(self) -> tuple | None:
        """Displacement, velocity and force of guided components before a step; None where nothing is guided on this rank."""
        if not len(self.loads.entries[0]):
            return None
        return tuple(
            array[self.loads.entries] for array in (self.engine.displacement, self.velocity, self.engine.force)
        )

    def _guide(self, before: tuple, time: float, step: float) -> float:
        """Set the velocity of guided components after a step; the work [J] of what guides them and of their loads."""
        displacement, velocity, force = before
        entries, particles = self.loads.entries, self.loads.entries[0]
        change = self.engine.displacement[entries] - displacement
        self.velocity[entries] = self.loads.guided_velocities(time, step, change)
        share, mass = self.share[particles], self.mass[particles]
        kinetic = 0.5 * mass * (self.velocity[entries] ** 2 - velocity**2)
        return float(np.sum(share * (kinetic - 0.5 * (force + self.engine.force[entries]) * change)))

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, the stabiliser's included."""
        kinetic = bond_motion.kinetic_energy(self.dimension, self.velocity, self.mass, self.share)
        return kinetic, self.relaxation.stored_energy()

    # --- what the output and the reports ask -------------------------------------------------------------------

    @property
    def communication_seconds(self) -> float:
        """Seconds spent on sending and receiving."""
        return self.engine.communication_seconds

    @property
    def directed_pairs(self) -> int:
        """Bonds counted once a particle."""
        return self.bond_system.directed_pairs

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and Cauchy stress (n, 3, 3); damage (n,)."""
        if name == "damage" and self.fracture is None:
            return np.zeros(last - first)
        if name not in ("deformation_gradient", "stress"):
            return None
        if name == "stress" and not isinstance(self.engine, HistoryForce | BondBasedForce):
            return self._stresses()[first:last]
        F = np.tile(np.eye(3), (last - first, 1, 1))
        d = self.engine.dimension
        F[:, :d, :d] += self._displacement_gradients()[first:last]
        if name == "deformation_gradient":
            return F
        P = self.engine.settled_stresses(self.laws)[first:last]
        return P if self.operator.is_linear else P @ F.swapaxes(1, 2) / np.linalg.det(F)[:, None, None]

    def measure(self, name: str) -> tuple[str, np.ndarray]:
        """Broken bonds, and the place of the crack's tip; collective."""
        fracture = self.fracture
        if name == "broken_bonds":
            return "sum", np.array(0.0 if fracture is None else fracture.broken_bonds())
        # the same on all ranks
        return "maximum", np.full(self.dimension, np.nan) if fracture is None else fracture.tip()

    def _stresses(self) -> np.ndarray:
        """sigma (owned, 3, 3) [Pa] of the last evaluation's field."""
        result, engine = np.zeros((self.owned, 3, 3)), self.engine
        for first, last, law in self.laws:
            stresses(engine.space, first, last, law, engine.body, engine.gradient, result)
        return result

    def _displacement_gradients(self) -> np.ndarray:
        """grad u (owned, d, d); ghosts' displacements are those of the last evaluation."""
        if self._gradients is None:
            self._gradients = self.engine.displacement_gradients()
        return self._gradients

    def unsound(self) -> tuple[int, str] | None:
        """The first particle that is inside out or whose velocity is not finite, or the one farthest from balance."""
        if not self.engine.sound:
            jacobian = np.linalg.det(self.shown("deformation_gradient", 0, self.owned))
            index = int(np.argmin(np.where(np.isfinite(jacobian), jacobian, -np.inf)))
            return index, f"the Jacobian is {jacobian[index]:.4g}, not positive: matter is turned inside out"
        if self.quasi_static is not None:
            return self.quasi_static.unsound()
        bad = ~np.isfinite(self.table.owned_rows("velocity")).all(axis=1)
        return (int(np.argmax(bad)), "a number is no longer finite") if bad.any() else None

    def advice(self) -> str:
        """What most likely helps."""
        hints = []
        if self.settings.stabilisation.kind != "shear-scaled":
            hints.append('method.stabilisation.kind = "shear-scaled"')
        smaller = f"a smaller method.solution.{'safety' if self.quasi_static is None else 'step'}"
        return ", or ".join([*hints, smaller, "a milder load"])

    def summary(self) -> dict:
        """Iterations of quasi-static solutions."""
        return {} if self.quasi_static is None else self.quasi_static.summary()

    def numbers(self) -> dict[str, int]:
        """Ghosts and bonds."""
        return {"ghosts": self.bond_system.halo.ghosts, "interactions": self.bond_system.directed_pairs}

    def exchanged_records(self) -> dict[str, int]:
        """The record of the second pass and the relaxing displacement."""
        return {"second-pass record": self.engine.record.shape[1], "relaxing displacement": self.dimension}

    def arrays(self) -> list[np.ndarray]:
        """Work arrays and bond lists."""
        return [*self.engine.arrays(), self.mass, self.share]

    def bytes_a_step(self) -> int:
        """Fields and records."""
        return self.engine.bytes_sent()

    def warm(self) -> None:
        """Lists of ghosts have no images."""
        self.engine.warm()
