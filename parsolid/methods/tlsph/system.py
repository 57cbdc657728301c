"""Upwind total-Lagrangian SPH (Lee et al., sections 5 and 6): state {v, x, F, H, J, A_alpha} of each particle."""

from typing import Any

import numpy as np

from decomposition.recalled import Recalled, RecalledEach
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import maximum, minimum
from parsolid.materials.blocks import MaterialBlock, block_numbers, material_blocks
from parsolid.materials.hyperelastic.law import elastic_moduli, total_modulus
from parsolid.materials.registry import laws_of
from parsolid.methods.pair_method import PairMethod
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.methods.tlsph import momentum as motion
from parsolid.methods.tlsph import state
from parsolid.methods.tlsph.advice import advice_of
from parsolid.methods.tlsph.body_weights import ON_LATTICES, weights_are_tabled, weights_of_bodies
from parsolid.methods.tlsph.boundaries import build_boundaries
from parsolid.methods.tlsph.deformation import Relaxation, advance_deformation, largest_wave_modulus
from parsolid.methods.tlsph.displacement import complete_strain
from parsolid.methods.tlsph.dissipation import dissipation_of
from parsolid.methods.tlsph.fixed_walls import watch_fixed_walls
from parsolid.methods.tlsph.initial_stress import initial_stress_of
from parsolid.methods.tlsph.lattice_bodies import put_on_lattices
from parsolid.methods.tlsph.leapfrog import Leapfrog
from parsolid.methods.tlsph.state import Body
from parsolid.methods.tlsph.stresses import deformation_gradients, first_piola_kirchhoff_stresses
from parsolid.methods.tlsph.updated_reference import UpdatedReference
from parsolid.numerics import layout
from parsolid.pairs.candidates import metrics
from parsolid.pairs.closure import surface_area
from parsolid.pairs.pair_system import PairSystem
from parsolid.pairs.smoothed_weights import SmoothedWeights
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_velocity
from parsolid.solvers.runge_kutta import SSP_RK3, Stage


class TotalLagrangianSPH(PairMethod):
    """The method on one rank. Arrays are laid out as `numerics.layout` and `pairs.passes` say.

    lost: what the stages of the step have taken [J], where that is told.
    """

    pairs: PairSystem
    stages, lost = SSP_RK3, 0.0

    def __init__(self, comm: Any, scene: Any, particle_set: Any) -> None:
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be
        paired. Collective."""
        self.comm, self.settings = comm, scene.method
        self.owned, self.dimension = particle_set.position.shape
        self.space = layout.LAYOUT[self.dimension]
        laws = self.laws = laws_of(scene)
        self.blocks, density = material_blocks(laws, particle_set.body)
        self.particles = Particles(particle_set.body, block_numbers(laws, np.arange(len(laws)))[1])
        # of each block, as its law is; what a stage does is other numbers at every call
        self._advance_strain = RecalledEach(advance_deformation, free=(5, 6))
        self._advance_motion = Recalled(motion.advance_motion, free=(2,))
        self.body_weights = weights_of_bodies(self.settings.pair_weights, scene)
        closed = frozenset(i for i, kind in enumerate(self.body_weights) if kind in ON_LATTICES)
        self.boundaries = build_boundaries(comm, scene, particle_set, self.particles, closed)
        self.on_lattices = put_on_lattices(comm, scene, particle_set, self.boundaries, self.body_weights, laws)
        if self.on_lattices is not None:
            self.farthest = float((self.on_lattices.reach * particle_set.spacing.T).max(initial=0.0))
        self.branches = maximum(comm, max((block.branches for block in self.blocks), default=0))
        self.pairs = self._pair_system(particle_set, weights_are_tabled(scene))
        self.pairs.unbonded = scene.unbonded
        fixed = self.settings.reference == "fixed"
        staged = self.settings.integrator == "ssp-rk3"
        self.leapfrog = None if staged else Leapfrog(self, scene)
        watch_fixed_walls(self)
        self.evaluations, self.landings = (len(self.stages), ()) if staged else (1, self.boundaries.jump_times)
        state.declare_motion(self.particles, particle_set, fixed, staged)
        state.declare_strain(self.particles, self.dimension, self.branches, staged)
        share = self.boundaries.share
        volume = particle_set.volume / share
        self.particles.declare(Field("mass", 1, "kg"), volume * density)
        self.particles.declare(Field("share", 1, "1"), share)
        self.initial_stress = initial_stress_of(self, scene)
        metric = metrics(particle_set.spacing, particle_set.axes, self._smoothing())
        updated = (self.pairs, self.settings, particle_set.position, self.boundaries)
        self.reference = None if fixed else UpdatedReference(*updated)
        where = particle_set.position, particle_set.body, metric, volume
        self.pairs.rebuild(*where, getattr(self.on_lattices, "even", None))
        # the narrowest spacing of all ranks bounds the step (79), so that it does not depend on their number
        self.spacing = minimum(comm, float(particle_set.spacing.min(initial=np.inf)))

    def _smoothing(self) -> Any:
        """h/dx, (n, 1) where bodies on lattices have their own."""
        if self.on_lattices is None:
            return self.settings.smoothing
        own = self.on_lattices.reach / self.pairs.weights.support
        return np.where(own > 0.0, own, self.settings.smoothing)[:, None]

    def _pair_system(self, particle_set: Any, tabled: bool) -> PairSystem:
        settings, boundaries, surface = self.settings, self.boundaries, None
        if "closure" in self.body_weights:
            here = np.array(self.body_weights)[particle_set.body] == "closure"
            surface = (surface_area(self.comm, particle_set, boundaries.planes, here), boundaries.share, here)
        more = surface, getattr(self.on_lattices, "lattices", None), tabled
        weights = SmoothedWeights(smoothing_kernel(settings.kernel), float(settings.dissipation), *more)
        terms = dissipation_of(self.comm, settings, self.blocks)
        return PairSystem(self.comm, self.particles, self.space, weights, terms, boundaries.codes)

    def begin(self, scene: Any, particle_set: Any) -> None:
        """Set velocity, displacement and deformation gradient at time 0 by the bodies' formulas; collective."""
        rows, place = self.particles.owned_rows, (scene, particle_set.body, particle_set.position, particle_set.regions)
        rows("velocity")[:] = initial_velocity(*place)
        displacement, given = initial_displacement(*place), initial_deformation_gradient(*place)
        derived = np.zeros(len(particle_set), bool)
        if displacement is not None:
            rows("position")[:] += displacement
            derived[:] = True
        if given is not None:
            gradient, where = given
            rows("deformation_gradient")[:] = gradient.reshape(len(particle_set), -1)
            derived &= ~where
        self.initial_stress.begin(*place)
        complete_strain(self, derived)
        take_state(self.comm, scene, self, particle_set)
        self.hold()
        if take_forces(self.comm, scene, self) and self.leapfrog is not None:
            self.leapfrog.forces_of = 0

    def hold(self) -> None:
        """Velocities at time 0 as supports and what is driven have them; collective."""
        velocity = self.particles.owned_rows("velocity")
        if self.boundaries.clamp is not None:
            velocity[:] *= self.boundaries.clamp[:, : self.dimension]
        if self.boundaries.surfaces is not None:
            self.boundaries.surfaces.stop(velocity)
        self.boundaries.prescribe(0.0, self.kinematics)
        self.prescribed_energy_gain()

    def state(self) -> dict[str, Any]:
        """When the reference was moved, and whether the particles have the forces that a step begins with."""
        moved = {} if self.reference is None else self.reference.state()
        return moved if self.leapfrog is None else {**moved, "forces_of": self.leapfrog.forces_of}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        if self.reference is not None:
            self.reference.set_state(state)
        if self.leapfrog is not None:
            self.leapfrog.forces_of = state["forces_of"]

    def resume(self) -> None:
        """Continue from a state that was put back into the particles."""
        self.initial_stress.resume()
        if self.reference is not None:
            self.reference.resume()
        self.prescribed_energy_gain()

    def forget(self) -> None:
        """Forces of the laws and weights of the checkpoint."""
        if self.leapfrog is not None:
            self.leapfrog.forces_of = None

    @property
    def kinematics(self) -> np.ndarray:
        """v, x and X, as kernels take them."""
        return self.particles.storage("kinematics")

    # --- what the loop asks -----------------------------------------------------------------------------------

    def stable_step(self) -> float:
        """Largest step [s] here, eq (79) with the exact c_max over all directions, or leapfrog's."""
        steps = map(self._stable_step_of if self.leapfrog is None else self.leapfrog.stable_step, self.blocks)
        return min(self.boundaries.largest_step, *steps, np.inf)

    def _stable_step_of(self, block: MaterialBlock) -> float:
        return self._group_step(block, largest_wave_modulus(*self.part(block), self.body_of(block)))

    def _group_step(self, block: MaterialBlock, modulus: float) -> float:
        step = self.settings.cfl * self.spacing * np.sqrt(block.law.density / modulus)
        if self.on_lattices is None:
            return step
        shear = elastic_moduli(block.law)[0] + total_modulus(block.law.branch_moduli)
        pressure, shear = np.sqrt(modulus / block.law.density), np.sqrt(shear / block.law.density)
        return min(step, self.spacing * self.on_lattices.largest_step(pressure, shear, self.settings.dissipation))

    def body_of(self, block: MaterialBlock | None) -> Body:
        """The particle arrays as a block's law sees them, or those of all laws."""
        branches = block is not None and bool(block.branches)
        moved = None if self.reference is None else self.reference.moved
        return self.particles.kept(("body", branches), lambda: state.body_of(self.particles, branches, moved))

    @property
    def news(self) -> bool:  # type: ignore[override]
        """Whether this rank's particles ask for another reference."""
        return self.reference is not None and self.reference.asks

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """See `ParticleSystem`; collective where the reference is moved."""
        self.lost_reference = self.reference is not None and not self.reference.follow(self.news_anywhere)
        if self.lost_reference:
            return
        if self.boundaries.reactions is not None:
            self.boundaries.reactions.begin()
        if self.leapfrog is not None:
            self.leapfrog.advance_positions(time, step, ledger)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """See `ParticleSystem`; stages do all of a step here."""
        if self.lost_reference:
            announce(False, 0.0)
            return False
        advance = self.advance_in_stages if self.leapfrog is None else self.leapfrog.complete_step
        sound = advance(time, step, ledger, announce)
        self.boundaries.place(time + step)
        reactions = self.boundaries.reactions
        if reactions is not None:
            reactions.finish(step, self.mass, self.share, ledger)
        return sound

    def reaction(self, name: str) -> np.ndarray | None:
        """Of the last step."""
        return None if self.boundaries.reactions is None else self.boundaries.reactions.told(name)

    def advance_in_stages(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """One step, stage by stage of the integrator, as eqs (70)-(77) say."""
        sound, self.lost = True, 0.0
        for stage in self.stages:
            self.pairs.gradient("motion")
            positive, internal, stable = self.advance_deformation(stage, step)
            if stage.last:
                announce(positive, stable)
            self.pairs.divergence(self.pairs.terms)
            numerical, external = self.advance_motion(stage, time, step)
            ledger.add(stage.quadrature * step, internal, numerical, external)
            sound = sound and positive
        ledger.add(1.0, 0.0, self.lost, self.prescribed_energy_gain())
        return sound

    def advance_deformation(self, stage: Stage, step: float) -> tuple[bool, float, float]:
        """Stress at a stage, and F, H, J after it; (sound, internal dissipation rate [W], stable step [s] after the
        last stage)."""
        sound, dissipation, stable = True, 0.0, self.boundaries.largest_step
        self.boundaries.look()
        if self.initial_stress.there:
            self.initial_stress.note()
        for block in self.blocks:
            to_stage = block.relaxation(stage.time * step)
            to_end = block.relaxation(step) if stage.last else to_stage
            relaxation = Relaxation(to_stage, to_end, block.dissipation_factors(stage.time, step))
            positive, rate, modulus, lost = self._advance_strain(
                block.first, *self.part(block), self.pairs.terms, stage.update(step), relaxation, self.body_of(block)
            )
            sound, dissipation = sound and positive, dissipation + rate
            self.lost += lost
            stable = min(stable, self._group_step(block, modulus) if modulus > 0.0 else 0.0)
        if self.initial_stress.there:
            self.initial_stress.add()
        return sound, dissipation, stable

    def advance_motion(self, stage: Stage, time: float, step: float) -> tuple[float, float]:
        """v and x of a stage; (numerical dissipation rate, external power) [W]."""
        boundaries, stored, mass, share = self.boundaries, self.particles.storage, self.mass, self.share
        kinematics, force = stored("kinematics"), stored("pair_force")
        loads, _ = boundaries.meet(time + stage.time * step, stage.time > 0.0, force, mass, share)
        if boundaries.reactions is not None:
            boundaries.reactions.book(stage.quadrature, stage.quadrature * step)
        held = boundaries.prescribed_power(kinematics, force, mass, share, loads)
        arrays = (kinematics, stored("motion_at_start"), force, stored("pair_sums"))
        told = (None, None)
        dissipation, power, lost = self._advance_motion(
            self.space, self.owned, stage.update(step), *arrays, mass, share, loads, boundaries.clamp, *told
        )
        self.lost += lost
        boundaries.prescribe(time + stage.next_time * step, kinematics, before=not stage.last)
        return dissipation, held + power

    def prescribed_energy_gain(self) -> float:
        """Kinetic energy [J] that prescribed components gained since the last call: the work of what moves them."""
        return self.boundaries.prescribed_energy_gain(self.kinematics, self.mass, self.share)

    def part(self, block: MaterialBlock) -> tuple[Any, ...]:
        """(space, first, last, law) of a block, as kernels take them."""
        return self.space, block.first, block.last, block.law

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Rollers."""
        return symmetry_planes(self.boundaries.planes)

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """With all branches."""
        law = self.laws[body]
        shear, lame = elastic_moduli(law)
        return lame + 2.0 * (shear + total_modulus(law.branch_moduli)), law.density

    def held_components(self) -> np.ndarray | None:
        """Those of supports and of prescribed velocities."""
        return self.boundaries.not_free.mask(self.dimension)

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, with tributary volumes."""
        kinetic = motion.kinetic_energy(self.owned, self.dimension, self.kinematics, self.mass, self.share)
        stored = self.initial_stress.energy() if self.initial_stress.there else 0.0
        for block in self.blocks:
            stored += motion.stored_energy(self.space, block.first, block.last, block.law, self.body_of(block))
        return kinetic, stored

    # --- what the output and the reports ask ------------------------------------------------------------------

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and first Piola-Kirchhoff stress (n, 3, 3)."""
        if name == "deformation_gradient":
            return deformation_gradients(self.particles, self.dimension, first, last)
        if name == "first_piola_kirchhoff_stress":
            stress = first_piola_kirchhoff_stresses(self.space, self.blocks, self.body_of, first, last)
            return stress + self.initial_stress.first_piola_kirchhoff_stress(first, last)
        return None

    def unsound(self) -> tuple[int, str] | None:
        """Also a reference that could not be moved."""
        if self.reference is not None and self.reference.fault is not None and self.owned:
            most = int(np.argmin(self.particles.owned_rows("jacobian")))
            return most, f"the reference could not be moved: {self.reference.fault}"
        return super().unsound()

    def summary(self) -> dict[str, Any]:
        """How often the reference was moved, and which weights each body has where a scene leaves the choice."""
        moved = {} if self.reference is None else {"reference_updates": self.reference.updates}
        return moved if self.settings.weights != "best" else {**moved, "pair_weights": list(self.body_weights)}

    def advice(self) -> str:
        """What most likely helps."""
        return advice_of(self.settings)

    def bytes_a_step(self) -> int:
        """Motion and records, in every evaluation."""
        return self.evaluations * (self.particles.bytes_sent("motion") + self.particles.bytes_sent("record"))

    def warm(self) -> None:
        """Lists of ghosts have no images."""
        self.pairs.warm()
