"""Upwind total-Lagrangian SPH (Lee et al., sections 5 and 6): state {v, x, F, H, J, A_alpha} of each particle.

A stage is: ghosts' v and x while the inner gradient runs; gradient at the rim; strain, stress and waves of each particle;
ghosts' records while the inner forces run; forces at the rim; momentum.
"""

import time as clock

import numpy as np

from parsolid.collective import anywhere, maximum, minimum
from parsolid.materials.blocks import MaterialBlock, material_blocks
from parsolid.materials.hyperelastic.law import isotropic_shear_modulus
from parsolid.materials.registry import laws_of
from parsolid.methods.protocol import ParticleMethod
from parsolid.methods.tlsph import momentum as motion
from parsolid.methods.tlsph.boundaries import build_boundaries
from parsolid.methods.tlsph.deformation import Body, Stage, advance_deformation, largest_wave_modulus
from parsolid.methods.tlsph.stresses import deformation_gradients, first_piola_kirchhoff_stresses
from parsolid.numerics import layout
from parsolid.numerics.lanes import aligned_zeros, padded
from parsolid.pairs import layout as pairs
from parsolid.pairs import passes_plane as pairs_plane
from parsolid.pairs import passes_space as pairs_space
from parsolid.pairs.closure import surface_area
from parsolid.pairs.neighbour_lists import NeighbourLists, build_neighbour_lists, metrics
from parsolid.pairs.smoothing import KERNELS
from parsolid.particles.fields import Field, FieldTable
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_velocity
from parsolid.solvers.runge_kutta import SSP_RK3

_PASSES = {2: pairs_plane, 3: pairs_space}


class TotalLagrangianSPH(ParticleMethod):
    """The method on one rank. Arrays are laid out as `numerics.layout` and `pairs.layout` say."""

    stages = SSP_RK3
    evaluations = len(SSP_RK3)

    def __init__(self, comm, scene, particle_set):
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be paired. Collective."""
        self.comm, self.settings = comm, scene.method
        self.blocks, _ = material_blocks(laws_of(scene), particle_set.body)
        self.boundaries = build_boundaries(comm, scene, particle_set)
        self.owned, self.dimension = particle_set.position.shape
        settings, blocks, boundaries = self.settings, self.blocks, self.boundaries
        self.space = layout.LAYOUT[self.dimension]
        self.passes = _PASSES[self.dimension]
        factor = float(settings.dissipation)
        self.riemann = 1.0 if factor > 0.0 else None
        self.reconstruct = 1.0 if settings.reconstruction and self.riemann else None
        self.branches = maximum(comm, max((block.branches for block in blocks), default=0))
        directional = any(isotropic_shear_modulus(block.law) is None for block in blocks)
        directional = anywhere(comm, directional)
        self.shear = 1.0 if directional and self.riemann else None
        share = boundaries.share
        self.neighbour_lists = self._pair(particle_set, share, factor)
        self._allocate(particle_set, share)
        self.table = FieldTable(self.owned)
        self._declare(particle_set)
        self._plan_exchanges()

    def _pair(self, particle_set, share, factor) -> NeighbourLists:
        metric = metrics(particle_set.spacing, particle_set.axes, self.settings.smoothing)
        kernel = KERNELS[self.settings.kernel]
        codes, surface = self.boundaries.codes, None
        if self.settings.pair_correction == "closure":
            surface = (surface_area(self.comm, particle_set, self.boundaries.planes), share)
        return build_neighbour_lists(
            self.comm,
            kernel,
            particle_set.position,
            particle_set.body,
            metric,
            particle_set.volume / share,
            codes,
            factor,
            surface,
        )

    def _allocate(self, particle_set, share) -> None:
        d, owned = self.dimension, self.owned
        local = owned + self.neighbour_lists.halo.ghosts
        rows, capacity = padded(local) + 4, padded(owned) + 4
        self.kinematics = aligned_zeros((rows, pairs.KINEMATICS_WIDTH[d]))
        self.record = aligned_zeros((rows, pairs.record_width(d, self.riemann is not None, self.shear is not None)))
        self.gradient = aligned_zeros((capacity, pairs.GRADIENT_WIDTH[d]))
        self.force = aligned_zeros((capacity, pairs.FORCE_WIDTH))
        self.start_motion = aligned_zeros((capacity, 8))
        deformation = aligned_zeros((layout.DEFORMATION_ROWS[d], capacity))
        deformation[[0, 3, 4] if d == 2 else [0, 4, 8, 9, 13, 17, 18]] = 1.0
        internal = None
        if self.branches:
            # A = I where a law has fewer branches than another
            internal = aligned_zeros((self.branches * layout.BRANCH_ROWS[d], capacity))
            internal.reshape(self.branches, -1, capacity)[:, :d] = 1.0
        correction = aligned_zeros((layout.CORRECTION_ROWS[d], capacity))
        correction[:, :owned] = self.neighbour_lists.correction[:owned].reshape(owned, d * d).T
        volume, tributary = np.ones((1, capacity)), np.zeros((1, capacity))
        volume[0, :owned], tributary[0, :owned] = self.neighbour_lists.volume[:owned], particle_set.volume
        self.body = Body(deformation, deformation.copy(), internal, correction, volume, tributary)
        self.neighbour_lists.correction = None
        self.share = share
        self.mass = np.empty(owned)
        for block in self.blocks:
            self.mass[block.first : block.last] = block.law.density * volume[0, block.first : block.last]
        # the narrowest spacing of all ranks bounds the step (79), so that it does not depend on their number
        self.spacing = minimum(self.comm, float(particle_set.spacing.min(initial=np.inf)))

    def _declare(self, particle_set) -> None:
        d, add = self.dimension, self.table.add
        place = 4 if d == 3 else 2
        add(Field("identifier", 1, "1", checkpointed=True, shown=True), particle_set.identifier)
        add(Field("body", 1, "1", checkpointed=True, shown=True), particle_set.body)
        reference = self.kinematics[:, 2 * place : 2 * place + d]
        add(Field("reference_position", d, "m", checkpointed=True), reference)
        add(Field("volume", 1, "m^3", checkpointed=True), particle_set.volume)
        add(Field("spacing", d, "m", checkpointed=True), particle_set.spacing)
        if particle_set.axes is not None:
            add(Field("axes", d * d, "1", checkpointed=True), particle_set.axes.reshape(self.owned, d * d))
        add(Field("area", d, "m^2", checkpointed=True), particle_set.area)
        moving = {"evolved": True, "exchanged": True, "checkpointed": True, "shown": True}
        add(Field("velocity", d, "m/s", **moving), self.kinematics[:, :d])
        add(Field("position", d, "m", **moving), self.kinematics[:, place : place + d])
        strain = self.body.deformation
        add(Field("deformation_gradient", d * d, "1", evolved=True, checkpointed=True), strain[: d * d].T)
        if d == 3:
            add(Field("cofactor", 9, "1", evolved=True, checkpointed=True), strain[9:18].T)
        add(Field("jacobian", 1, "1", evolved=True, checkpointed=True, shown=True), strain[-1])
        rows = layout.BRANCH_ROWS[d]
        for alpha in range(self.branches):
            name = f"viscous_strain_inverse_{alpha + 1}"
            internal = self.body.branches[alpha * rows : (alpha + 1) * rows].T
            add(Field(name, rows, "1", evolved=True, checkpointed=True), internal)
        reference[: self.owned] = particle_set.position
        self.table.arrays["position"][: self.owned] = particle_set.position

    def _plan_exchanges(self) -> None:
        halo, arrays = self.neighbour_lists.halo, self.table.arrays
        halo.update([arrays["reference_position"]])
        self.motion_exchange = halo.exchange([arrays["velocity"], arrays["position"]])
        self.record_exchange = halo.exchange([self.record])

    def begin(self, scene, particle_set) -> None:
        """Set velocity, displacement and deformation gradient at time 0 by the bodies' formulas; collective."""
        table, place = self.table, (scene, particle_set.body, particle_set.position)
        table.owned_rows("velocity")[:] = initial_velocity(*place)
        displacement, given = initial_displacement(*place), initial_deformation_gradient(*place)
        derived = np.zeros(len(particle_set), bool)
        if displacement is not None:
            table.owned_rows("position")[:] += displacement
            derived[:] = True
        if given is not None:
            gradient, where = given
            table.owned_rows("deformation_gradient")[:] = gradient.reshape(len(particle_set), -1)
            derived &= ~where
        self.start(derived)

    def start(self, derived: np.ndarray) -> None:
        """Complete the state at time 0 from velocity, position and deformation gradient; collective.

        derived (n,): particles whose deformation gradient is that of their displacement, by the scheme's own gradient.
        """
        arrays, d, owned = self.table.arrays, self.dimension, self.owned
        if anywhere(self.comm, derived.any()):
            gradient = self._displacement_gradient()
            arrays["deformation_gradient"][:owned][derived] += gradient[derived]
        F = np.zeros((owned, 3, 3))
        F[:, :d, :d] = arrays["deformation_gradient"][:owned].reshape(owned, d, d)
        F[:, d:, d:] = 1.0
        arrays["jacobian"][:owned] = np.linalg.det(F)
        if d == 3:
            cofactor = np.cross(F[:, (1, 2, 0)], F[:, (2, 0, 1)])
            arrays["cofactor"][:owned] = cofactor.reshape(owned, 9)
        if self.boundaries.clamp is not None:
            arrays["velocity"][:owned] *= self.boundaries.clamp[:, :d]
        self.boundaries.prescribe(0.0, self.kinematics)
        self.boundaries.prescribed_energy_gain(self.kinematics, self.mass, self.share)

    def resume(self) -> None:
        """Continue from a state that was put back into the table."""
        self.boundaries.prescribed_energy_gain(self.kinematics, self.mass, self.share)

    def _displacement_gradient(self) -> np.ndarray:
        """grad u (n, d d) by the gradient pass, with the displacement in the velocity's place."""
        velocity, d = self.table.arrays["velocity"], self.dimension
        kept = velocity.copy()
        velocity[:] = self.table.arrays["position"] - self.table.arrays["reference_position"]
        self._pass_gradient()
        velocity[:] = kept
        columns = self.gradient[: self.owned].reshape(self.owned, d, -1)[:, :, :d].swapaxes(1, 2).copy()
        self.gradient[:] = 0.0
        L = self.body.correction[:, : self.owned].T.reshape(self.owned, d, d)
        volume = self.body.volume[0, : self.owned, None, None]
        return (columns @ L.swapaxes(1, 2) / volume).reshape(self.owned, d * d)

    # --- what the loop asks -----------------------------------------------------------------------------------

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles, eq (79) with the exact c_max over all directions."""
        return min((self._group_step(block, self._modulus(block)) for block in self.blocks), default=np.inf)

    def _modulus(self, block: MaterialBlock) -> float:
        return largest_wave_modulus(self.space, block.first, block.last, block.law, self.body_of(block))

    def _group_step(self, block: MaterialBlock, modulus: float) -> float:
        return self.settings.cfl * self.spacing * np.sqrt(block.law.density / modulus)

    def body_of(self, block: MaterialBlock) -> Body:
        """The particle arrays as a block's law sees them."""
        return self.body if block.branches else self.body._replace(branches=None)

    def advance(self, time: float, step: float, ledger, announce) -> bool:
        """One step of three stages."""
        sound = [self.advance_stage(number, time, step, ledger, announce) for number in range(len(self.stages))]
        # the work that changed the kinetic energy of prescribed components
        ledger.add(1.0, 0.0, 0.0, self.boundaries.prescribed_energy_gain(self.kinematics, self.mass, self.share))
        return all(sound)

    def advance_stage(self, number: int, time: float, step: float, ledger, announce) -> bool:
        """One Runge-Kutta stage of the step that starts at `time` [s]; False when a Jacobian is not positive.

        In the last stage announce(sound, stable step [s] of this rank after the step) is called before the forces.
        """
        weights = self.stages[number]
        self._pass_gradient()
        sound, dissipation, stable = True, 0.0, np.inf
        for block in self.blocks:
            stage = self._stage(block, number, step)
            good, rate, modulus = advance_deformation(
                self.space,
                block.first,
                block.last,
                block.law,
                stage,
                self.body_of(block),
                self.gradient,
                self.riemann,
                self.shear,
                self.record,
            )
            sound, dissipation = sound and good, dissipation + rate
            if stage.last:
                stable = min(stable, self._group_step(block, modulus) if modulus > 0.0 else 0.0)
        if number == len(self.stages) - 1:
            announce(sound, stable)
        self._pass_force()
        numerical, external = self._momentum(number, time, step)
        ledger.add(weights.quadrature * step, dissipation, numerical, external)
        return sound

    def evaluate_forces(self) -> None:
        """One stabilised force evaluation of the current state, which stays as it is (for measurements)."""
        self._pass_gradient()
        for block in self.blocks:
            stage = self._stage(block, 0, 0.0)
            advance_deformation(
                self.space,
                block.first,
                block.last,
                block.law,
                stage,
                self.body_of(block),
                self.gradient,
                self.riemann,
                self.shear,
                self.record,
            )
        self._pass_force()
        self.gradient[:] = 0.0
        self.force[:] = 0.0

    def _stage(self, block: MaterialBlock, number: int, step: float) -> Stage:
        weights, last = self.stages[number], number == len(self.stages) - 1
        decay = block.relaxation(weights.time * step)
        commit = block.relaxation(step) if last else decay
        return Stage(number == 0, last, step, weights.keep, weights.take, decay, commit)

    def _pass_gradient(self) -> None:
        neighbour_lists, passes = self.neighbour_lists, self.passes
        self._timed(self.motion_exchange.start)
        passes.add_gradients(0, self.owned, neighbour_lists.inner, None, True, 0, self.kinematics, self.gradient)
        self._timed(self.motion_exchange.finish)
        if neighbour_lists.rim is not None:
            passes.add_gradients(0, self.owned, neighbour_lists.rim, None, None, 0, self.kinematics, self.gradient)
        if neighbour_lists.mirror is not None:
            passes.add_gradients(
                0, self.owned, neighbour_lists.mirror, neighbour_lists.images, None, 0, self.kinematics, self.gradient
            )

    def _timed(self, communicate) -> None:
        """Send or receive, and count the seconds it takes."""
        began = clock.perf_counter()
        communicate()
        self.communication_seconds += clock.perf_counter() - began

    def _pass_force(self) -> None:
        neighbour_lists, passes = self.neighbour_lists, self.passes
        choices = (None, self.riemann, self.shear, self.reconstruct, self.kinematics, self.record, self.force)
        self._timed(self.record_exchange.start)
        passes.add_forces(0, self.owned, neighbour_lists.inner, None, True, *choices)
        self._timed(self.record_exchange.finish)
        if neighbour_lists.rim is not None:
            passes.add_forces(0, self.owned, neighbour_lists.rim, None, None, *choices)
        if neighbour_lists.mirror is not None:
            passes.add_forces(0, self.owned, neighbour_lists.mirror, neighbour_lists.images, None, *choices)

    def _momentum(self, number: int, time: float, step: float) -> tuple[float, float]:
        """Advance v and x; (numerical dissipation rate, external power) [W]."""
        weights, boundaries = self.stages[number], self.boundaries
        stage = Stage(number == 0, False, step, weights.keep, weights.take, _NO_BRANCHES, _NO_BRANCHES)
        loads = boundaries.loads_at(time + weights.time * step)
        held = boundaries.prescribed_power(self.kinematics, self.force, self.mass, self.share, loads)
        dissipation, power = motion.advance_motion(
            self.space,
            self.owned,
            stage,
            self.kinematics,
            self.start_motion,
            self.force,
            self.gradient,
            self.mass,
            self.share,
            loads,
            boundaries.clamp,
        )
        boundaries.prescribe(time + weights.next_time * step, self.kinematics)
        return dissipation, held + power

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, with tributary volumes."""
        kinetic = motion.kinetic_energy(self.owned, self.dimension, self.kinematics, self.mass, self.share)
        stored = 0.0
        for block in self.blocks:
            stored += motion.stored_energy(self.space, block.first, block.last, block.law, self.body_of(block))
        return kinetic, stored

    # --- what the output and the reports ask ------------------------------------------------------------------

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and first Piola-Kirchhoff stress (n, 3, 3)."""
        if name == "deformation_gradient":
            return deformation_gradients(self.table, self.dimension, first, last)
        if name == "first_piola_kirchhoff_stress":
            return first_piola_kirchhoff_stresses(self.space, self.blocks, self.body_of, first, last)
        return None

    def advice(self) -> str:
        """What most likely helps."""
        settings, hints = self.settings, []
        if settings.cfl > 0.9:
            hints.append(f"a smaller method.cfl (it is {settings.cfl:g}; 0.7 is stable for smoothing of 0.85 and more)")
        if settings.dissipation == 0.0:
            hints.append("method.dissipation = 1 (there is none)")
        hints.append("more particles where the body is crushed" if settings.cfl <= 0.9 else "more particles")
        return ", or ".join([*hints, "a milder load"])

    @property
    def directed_pairs(self) -> int:
        """Interactions counted once a particle."""
        return self.neighbour_lists.directed_pairs

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": self.neighbour_lists.halo.ghosts, "interactions": self.neighbour_lists.directed_pairs}

    def exchanged_records(self) -> dict[str, int]:
        """The record of the second pass."""
        return {"second-pass record": self.record.shape[1]}

    def arrays(self) -> list[np.ndarray]:
        """Work arrays and pair lists."""
        arrays = [self.kinematics, self.record, self.gradient, self.force, self.start_motion, self.mass, self.share]
        arrays += [array for array in self.body if array is not None]
        for pairs in (self.neighbour_lists.inner, self.neighbour_lists.rim, self.neighbour_lists.mirror):
            arrays += list(pairs or ())
        return arrays

    def bytes_a_step(self) -> int:
        """Motion and records, in every stage."""
        return len(self.stages) * (self.motion_exchange.bytes_sent + self.record_exchange.bytes_sent)

    def warm(self) -> None:
        """Lists of ghosts have no images."""
        self.passes.add_gradients(0, 0, self.neighbour_lists.inner, None, None, 0, self.kinematics, self.gradient)
        choices = (None, self.riemann, self.shear, self.reconstruct, self.kinematics, self.record, self.force)
        self.passes.add_forces(0, 0, self.neighbour_lists.inner, None, None, *choices)


_NO_BRANCHES = np.zeros((0, 3))
