"""Upwind total-Lagrangian SPH (Lee et al., sections 5 and 6): state {v, x, F, H, J, A_alpha} of each particle.

A stage is: ghosts' v and x while the inner gradient runs; gradient at the rim; strain, stress and waves of each particle;
ghosts' records while the inner forces run; forces at the rim; momentum.
"""

import time as clock

import numpy as np

from parsolid.boundary_set import build_boundaries
from parsolid.integrators import SSP_RK3
from parsolid.kernels import layout, pairs, pairs_plane, pairs_space
from parsolid.kernels.simd import aligned_zeros, padded
from parsolid.kernels.smoothing import KERNELS
from parsolid.laws import laws_of
from parsolid.methods import motion
from parsolid.methods.deformation import Body, Stage, advance_deformation, largest_wave_modulus
from parsolid.methods.groups import Group, groups_of
from parsolid.methods.pair_correction import surface_area
from parsolid.methods.pairing import Pairing, build_pairing, metrics
from parsolid.methods.protocol import ParticleMethod
from parsolid.methods.stresses import deformation_gradients, first_piola_kirchhoff_stresses
from parsolid.particles import Field, FieldTable
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_velocity
from parsolid.together import anywhere, maximum, minimum

_PASSES = {2: pairs_plane, 3: pairs_space}


class TotalLagrangianSPH(ParticleMethod):
    """The method on one rank. Arrays are laid out as `kernels.layout` and `kernels.pairs` say."""

    stages = SSP_RK3
    evaluations = len(SSP_RK3)

    def __init__(self, comm, scene, cloud):
        """cloud: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be paired. Collective."""
        self.comm, self.settings = comm, scene.method
        self.groups, density = groups_of(laws_of(scene), cloud.body)
        self.boundaries = build_boundaries(comm, scene, cloud, density)
        self.owned, self.dimension = cloud.position.shape
        settings, groups, boundaries = self.settings, self.groups, self.boundaries
        self.space = layout.LAYOUT[self.dimension]
        self.passes = _PASSES[self.dimension]
        factor = float(settings.dissipation)
        self.riemann = 1.0 if factor > 0.0 else None
        self.reconstruct = 1.0 if settings.reconstruction and self.riemann else None
        self.branches = maximum(comm, max((group.branches for group in groups), default=0))
        directional = any(group.law.directional_shear for group in groups)
        directional = anywhere(comm, directional)
        self.shear = 1.0 if directional and self.riemann else None
        share = 0.5 ** boundaries.plane_count(cloud)
        self.pairing = self._pair(cloud, share, factor)
        self._allocate(cloud, share)
        self.table = FieldTable(self.owned)
        self._declare(cloud)
        self._plan_exchanges()

    def _pair(self, cloud, share, factor) -> Pairing:
        metric = metrics(cloud.spacing, cloud.axes, self.settings.smoothing)
        kernel = KERNELS[self.settings.kernel]
        codes, surface = self.boundaries.codes, None
        if self.settings.pair_correction == "closure":
            surface = (surface_area(self.comm, cloud, self.boundaries.planes), share)
        return build_pairing(
            self.comm, kernel, cloud.position, cloud.body, metric, cloud.volume / share, codes, factor, surface
        )

    def _allocate(self, cloud, share) -> None:
        d, owned = self.dimension, self.owned
        local = owned + self.pairing.halo.ghosts
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
        correction[:, :owned] = self.pairing.correction[:owned].reshape(owned, d * d).T
        volume, tributary = np.ones((1, capacity)), np.zeros((1, capacity))
        volume[0, :owned], tributary[0, :owned] = self.pairing.volume[:owned], cloud.volume
        self.body = Body(deformation, deformation.copy(), internal, correction, volume, tributary)
        self.pairing.correction = None
        self.share = share
        self.mass = np.empty(owned)
        for group in self.groups:
            self.mass[group.first : group.last] = group.law.density * volume[0, group.first : group.last]
        # the narrowest spacing of all ranks bounds the step (79), so that it does not depend on their number
        self.spacing = minimum(self.comm, float(cloud.spacing.min(initial=np.inf)))

    def _declare(self, cloud) -> None:
        d, add = self.dimension, self.table.add
        place = 4 if d == 3 else 2
        add(Field("identifier", 1, "1", checkpointed=True, shown=True), cloud.identifier)
        add(Field("body", 1, "1", checkpointed=True, shown=True), cloud.body)
        reference = self.kinematics[:, 2 * place : 2 * place + d]
        add(Field("reference_position", d, "m", checkpointed=True), reference)
        add(Field("volume", 1, "m^3", checkpointed=True), cloud.volume)
        add(Field("spacing", d, "m", checkpointed=True), cloud.spacing)
        if cloud.axes is not None:
            add(Field("axes", d * d, "1", checkpointed=True), cloud.axes.reshape(self.owned, d * d))
        add(Field("area", d, "m^2", checkpointed=True), cloud.area)
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
        reference[: self.owned] = cloud.position
        self.table.arrays["position"][: self.owned] = cloud.position

    def _plan_exchanges(self) -> None:
        halo, arrays = self.pairing.halo, self.table.arrays
        halo.update([arrays["reference_position"]])
        self.motion_exchange = halo.exchange([arrays["velocity"], arrays["position"]])
        self.record_exchange = halo.exchange([self.record])

    def begin(self, scene, cloud) -> None:
        """Set velocity, displacement and deformation gradient at time 0 by the bodies' formulas; collective."""
        table, place = self.table, (scene, cloud.body, cloud.position)
        table.owned_rows("velocity")[:] = initial_velocity(*place)
        displacement, given = initial_displacement(*place), initial_deformation_gradient(*place)
        derived = np.zeros(len(cloud), bool)
        if displacement is not None:
            table.owned_rows("position")[:] += displacement
            derived[:] = True
        if given is not None:
            gradient, where = given
            table.owned_rows("deformation_gradient")[:] = gradient.reshape(len(cloud), -1)
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
        return min((self._group_step(group, self._modulus(group)) for group in self.groups), default=np.inf)

    def _modulus(self, group: Group) -> float:
        return largest_wave_modulus(self.space, group.first, group.last, group.law, self.body_of(group))

    def _group_step(self, group: Group, modulus: float) -> float:
        return self.settings.cfl * self.spacing * np.sqrt(group.law.density / modulus)

    def body_of(self, group: Group) -> Body:
        """The particle arrays as a group's law sees them."""
        return self.body if group.branches else self.body._replace(branches=None)

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
        for group in self.groups:
            stage = self._stage(group, number, step)
            good, rate, modulus = advance_deformation(
                self.space, group.first, group.last, group.law, stage, self.body_of(group), self.gradient,
                self.riemann, self.shear, self.record,
            )  # fmt: skip
            sound, dissipation = sound and good, dissipation + rate
            if stage.last:
                stable = min(stable, self._group_step(group, modulus) if modulus > 0.0 else 0.0)
        if number == len(self.stages) - 1:
            announce(sound, stable)
        self._pass_force()
        numerical, external = self._momentum(number, time, step)
        ledger.add(weights.quadrature * step, dissipation, numerical, external)
        return sound

    def evaluate_forces(self) -> None:
        """One stabilised force evaluation of the current state, which stays as it is (for measurements)."""
        self._pass_gradient()
        for group in self.groups:
            stage = self._stage(group, 0, 0.0)
            advance_deformation(
                self.space, group.first, group.last, group.law, stage, self.body_of(group), self.gradient,
                self.riemann, self.shear, self.record,
            )  # fmt: skip
        self._pass_force()
        self.gradient[:] = 0.0
        self.force[:] = 0.0

    def _stage(self, group: Group, number: int, step: float) -> Stage:
        weights, last = self.stages[number], number == len(self.stages) - 1
        decay = group.relaxation(weights.time * step)
        commit = group.relaxation(step) if last else decay
        return Stage(number == 0, last, step, weights.keep, weights.take, decay, commit)

    def _pass_gradient(self) -> None:
        pairing, passes = self.pairing, self.passes
        self._timed(self.motion_exchange.start)
        passes.add_gradients(0, self.owned, pairing.inner, None, True, 0, self.kinematics, self.gradient)
        self._timed(self.motion_exchange.finish)
        if pairing.rim is not None:
            passes.add_gradients(0, self.owned, pairing.rim, None, None, 0, self.kinematics, self.gradient)
        if pairing.mirror is not None:
            passes.add_gradients(0, self.owned, pairing.mirror, pairing.images, None, 0, self.kinematics, self.gradient)

    def _timed(self, communicate) -> None:
        """Send or receive, and count the seconds it takes."""
        began = clock.perf_counter()
        communicate()
        self.communication_seconds += clock.perf_counter() - began

    def _pass_force(self) -> None:
        pairing, passes = self.pairing, self.passes
        choices = (None, self.riemann, self.shear, self.reconstruct, self.kinematics, self.record, self.force)
        self._timed(self.record_exchange.start)
        passes.add_forces(0, self.owned, pairing.inner, None, True, *choices)
        self._timed(self.record_exchange.finish)
        if pairing.rim is not None:
            passes.add_forces(0, self.owned, pairing.rim, None, None, *choices)
        if pairing.mirror is not None:
            passes.add_forces(0, self.owned, pairing.mirror, pairing.images, None, *choices)

    def _momentum(self, number: int, time: float, step: float) -> tuple[float, float]:
        """Advance v and x; (numerical dissipation rate, external power) [W]."""
        weights, boundaries = self.stages[number], self.boundaries
        stage = Stage(number == 0, False, step, weights.keep, weights.take, _NO_BRANCHES, _NO_BRANCHES)
        loads = boundaries.loads_at(time + weights.time * step)
        held = boundaries.prescribed_power(self.kinematics, self.force, self.mass, self.share, loads)
        dissipation, power = motion.advance_motion(
            self.space, self.owned, stage, self.kinematics, self.start_motion, self.force, self.gradient,
            self.mass, self.share, loads, boundaries.clamp,
        )  # fmt: skip
        boundaries.prescribe(time + weights.next_time * step, self.kinematics)
        return dissipation, held + power

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, with tributary volumes."""
        kinetic = motion.kinetic_energy(self.owned, self.dimension, self.kinematics, self.mass, self.share)
        stored = 0.0
        for group in self.groups:
            stored += motion.stored_energy(self.space, group.first, group.last, group.law, self.body_of(group))
        return kinetic, stored

    # --- what the output and the reports ask ------------------------------------------------------------------

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and first Piola-Kirchhoff stress (n, 3, 3)."""
        if name == "deformation_gradient":
            return deformation_gradients(self.table, self.dimension, first, last)
        if name == "first_piola_kirchhoff_stress":
            return first_piola_kirchhoff_stresses(self.space, self.groups, self.body_of, first, last)
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
        return self.pairing.directed_pairs

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": self.pairing.halo.ghosts, "interactions": self.pairing.directed_pairs}

    def exchanged_records(self) -> dict[str, int]:
        """The record of the second pass."""
        return {"second-pass record": self.record.shape[1]}

    def arrays(self) -> list[np.ndarray]:
        """Work arrays and pair lists."""
        arrays = [self.kinematics, self.record, self.gradient, self.force, self.start_motion, self.mass, self.share]
        arrays += [array for array in self.body if array is not None]
        for pairs in (self.pairing.inner, self.pairing.rim, self.pairing.mirror):
            arrays += list(pairs or ())
        return arrays

    def bytes_a_step(self) -> int:
        """Motion and records, in every stage."""
        return len(self.stages) * (self.motion_exchange.bytes_sent + self.record_exchange.bytes_sent)

    def warm(self) -> None:
        """Lists of ghosts have no images."""
        self.passes.add_gradients(0, 0, self.pairing.inner, None, None, 0, self.kinematics, self.gradient)
        choices = (None, self.riemann, self.shear, self.reconstruct, self.kinematics, self.record, self.force)
        self.passes.add_forces(0, 0, self.pairing.inner, None, None, *choices)


_NO_BRANCHES = np.zeros((0, 3))
