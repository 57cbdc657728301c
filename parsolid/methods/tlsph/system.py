"""Upwind total-Lagrangian SPH (Lee et al., sections 5 and 6): state {v, x, F, H, J, A_alpha} of each particle."""

from typing import Any

import numpy as np

from parsolid.boundary.conditions import Conditions
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import anywhere, maximum, minimum
from parsolid.materials.blocks import block_numbers, material_blocks
from parsolid.materials.hyperelastic.functions import elastic_moduli, isotropic_shear_modulus
from parsolid.materials.registry import laws_of
from parsolid.materials.viscoelastic.maxwell import total_modulus
from parsolid.methods.leapfrog import kinetic_energy
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.methods.protocol import ParticleSystem
from parsolid.methods.tlsph.body_weights import ON_LATTICES, weights_are_rounded, weights_of_bodies
from parsolid.methods.tlsph.fixed_walls import fixed_walls_of
from parsolid.methods.tlsph.initial_stress import initial_stress_of
from parsolid.methods.tlsph.lattice_bodies import put_on_lattices
from parsolid.methods.tlsph.leapfrog import Leapfrog
from parsolid.methods.tlsph.list_bodies import ListBodies
from parsolid.methods.tlsph.ssp_rk3 import StagedStep
from parsolid.methods.tlsph.state import LawBlock, declare_fields, deformation_gradients
from parsolid.methods.tlsph.updated_reference import UpdatedReference
from parsolid.pairs.candidates import metrics
from parsolid.pairs.closure import surface_area
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_velocity


class TotalLagrangianSPH(ParticleSystem):
    """The method on one rank.

    blocks: ranges of particles that share a law; branches: most of any law. sweeps: what finds velocity gradients and
    forces, each for its bodies: advance_step(step), advance_stage(stage, step), find_forces(), displacement_gradient(),
    see `ListBodies`. leapfrog or staged_step: the integrator, the other is None.
    """

    def __init__(self, comm: Any, scene: Any, particle_set: Any) -> None:
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when particles cannot be
        paired. Collective."""
        self.comm, self.settings = comm, scene.method
        self.owned, self.dimension = particle_set.position.shape
        self.laws = laws_of(scene)
        blocks, density = material_blocks(self.laws, particle_set.body)
        self.particles = Particles(particle_set.body, block_numbers(self.laws, np.arange(len(self.laws)))[1])
        staged = self.settings.integrator == "ssp-rk3"
        self.branches = maximum(comm, max((len(one.law.branch_moduli or ()) for one in blocks), default=0))
        declare_fields(self.particles, particle_set, self.branches, staged)
        self.blocks = [LawBlock(self.particles, one.first, one.last, one.law) for one in blocks]
        self.body_weights = weights_of_bodies(self.settings.pair_weights, scene)
        closed = frozenset(i for i, kind in enumerate(self.body_weights) if kind in ON_LATTICES)
        self.conditions = Conditions(comm, scene, particle_set, self.particles, closed)
        self.on_lattices = put_on_lattices(comm, scene, particle_set, self.conditions, self.body_weights, self.laws)
        if self.on_lattices is not None:
            self.farthest = float((self.on_lattices.reach * particle_set.spacing.T).max(initial=0.0))
            # lattices have volumes and areas of their own
            self.particles.owned_rows("volume")[:] = particle_set.volume
            self.particles.owned_rows("area")[:] = particle_set.area
        share = self.conditions.share
        self.particles.declare(Field("mass", 1, "kg"), particle_set.volume / share * density)
        self.particles.declare(Field("share", 1, "1"), share)
        # the narrowest spacing of all ranks bounds the step (79), so that it does not depend on their number
        self.spacing = minimum(comm, float(particle_set.spacing.min(initial=np.inf)))
        self.reactions = self.conditions.reactions
        self.leapfrog = None if staged else Leapfrog(self, scene)
        self.staged_step = StagedStep(self, scene) if staged else None
        self.evaluations, self.landings = (3, ()) if staged else (1, self.conditions.times)
        self.initial_stress = initial_stress_of(self, scene)
        self.lists = self._list_bodies(scene, particle_set)
        self.sweeps = [self.lists]
        self.fixed_walls = fixed_walls_of(self, self.lists)
        fixed = self.settings.reference == "fixed"
        self.reference = None if fixed else UpdatedReference(self, particle_set.position)
        metric = metrics(particle_set.spacing, particle_set.axes, self._smoothing())
        even = getattr(self.on_lattices, "even", None)
        self.find_pairs(particle_set.position, particle_set.body, metric, particle_set.volume / share, even)

    def _list_bodies(self, scene: Any, particle_set: Any) -> ListBodies:
        settings, conditions, surface = self.settings, self.conditions, None
        if "closure" in self.body_weights:
            here = np.array(self.body_weights)[particle_set.body] == "closure"
            surface = (surface_area(self.comm, particle_set, conditions.planes, here), conditions.share, here)
        # where the reference moves, shear that does not depend on the original direction depends on the moved one
        directional = settings.reference == "updated" or anywhere(
            self.comm, any(isotropic_shear_modulus(block.law) is None for block in self.blocks)
        )
        waves = 0
        if settings.dissipation > 0.0:
            waves = 1 if self.staged_step is None else 3 if directional else 2
        lattices = getattr(self.on_lattices, "lattices", None)
        rounded = weights_are_rounded(scene) and surface is None and lattices is None
        kernel, factor = smoothing_kernel(settings.kernel), float(settings.dissipation)
        return ListBodies(
            self, ListWeights(kernel, factor, waves >= 2, surface, lattices, rounded), waves, scene.unbonded
        )

    def _smoothing(self) -> Any:
        """h/dx, (n, 1) where bodies on lattices have their own."""
        if self.on_lattices is None:
            return self.settings.smoothing
        own = self.on_lattices.reach / smoothing_kernel(self.settings.kernel).support
        return np.where(own > 0.0, own, self.settings.smoothing)[:, None]

    def find_pairs(self, positions: Any, body: Any, metric: Any, volume: Any, even: Any = None) -> None:
        """Lists, weights and corrections at some places; see `pair_list.Neighbours`. Collective."""
        correction = self.lists.rebuild(positions, body, metric, volume, even)
        self.particles.owned_rows("correction")[:] = correction.reshape(self.owned, -1)
        self.particles.owned_rows("pair_volume")[:] = volume

    # --- state ------------------------------------------------------------------------------------------------

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
        if self.initial_stress is not None:
            self.initial_stress.begin(*place)
        self.complete_strain(derived)
        take_state(self.comm, scene, self, particle_set)
        self.conditions.hold(0.0)
        if take_forces(self.comm, scene, self) and self.leapfrog is not None:
            self.leapfrog.forces_of = 0

    def complete_strain(self, derived: np.ndarray) -> None:
        """H and J at time 0 from F; derived (n,): particles whose F is that of their displacement, by the scheme's own
        gradient. Collective."""
        rows, d, owned = self.particles.owned_rows, self.dimension, self.owned
        if anywhere(self.comm, bool(derived.any())):
            gradient = np.zeros((owned, d, d))
            for bodies in self.sweeps:
                gradient += bodies.displacement_gradient()
            rows("deformation_gradient")[derived] += gradient.reshape(owned, d * d)[derived]
        F = deformation_gradients(self.particles, 0, owned)
        rows("jacobian")[:] = np.linalg.det(F)
        if "cofactor" in self.particles:
            rows("cofactor")[:] = np.cross(F[:, (1, 2, 0)], F[:, (2, 0, 1)]).reshape(owned, 9)

    @property
    def reference_updates(self) -> int:
        """How often the reference was moved."""
        return 0 if self.reference is None else self.reference.updates

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
        if self.initial_stress is not None:
            self.initial_stress.resume()
        if self.reference is not None:
            self.reference.resume()

    def forget(self) -> None:
        """Forces of the laws and weights of the checkpoint."""
        if self.leapfrog is not None:
            self.leapfrog.forces_of = None

    # --- what the loop asks -----------------------------------------------------------------------------------

    @property
    def integrator(self) -> Any:
        """Leapfrog or the stages of SSP-RK3."""
        return self.leapfrog or self.staged_step

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles in the present state."""
        return float(self.integrator.stable_step())

    @property
    def news(self) -> bool:  # type: ignore[override]
        """Whether this rank's particles ask for another reference."""
        return self.reference is not None and self.reference.asks

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """See `ParticleSystem`; of a reference that follows where it is moved, collective there."""
        self.reference_lost = self.reference is not None and not self.reference.follow(self.news_anywhere)
        if not self.reference_lost:
            self.integrator.advance_positions(time, step, ledger)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        """See `ParticleSystem`."""
        if self.reference_lost:
            announce(False, 0.0)
            return False
        return bool(self.integrator.complete_step(time, step, ledger, announce))

    def energies(self) -> tuple[float, float]:
        """Kinetic and stored energy [J] of this rank's particles, with tributary volumes."""
        kinetic = kinetic_energy(self.owned, self.particles.storage("velocity"), self.mass, self.share)
        stored = 0.0 if self.initial_stress is None else self.initial_stress.energy()
        return float(kinetic), stored + sum(block.energy() for block in self.blocks)

    # --- what contact asks ------------------------------------------------------------------------------------

    def held_components(self) -> np.ndarray | None:
        """Those of supports and of prescribed velocities."""
        return self.conditions.constrained

    @property
    def symmetry_planes(self) -> list[MirrorPlane]:
        """Rollers."""
        return symmetry_planes(self.conditions.planes)

    def wave_modulus(self, body: int) -> tuple[float, float]:
        """With all branches."""
        law = self.laws[body]
        shear, lame = elastic_moduli(law)
        return lame + 2.0 * (shear + total_modulus(law.branch_moduli)), law.density

    # --- what the output and the reports ask ------------------------------------------------------------------

    def shown(self, name: str, first: int, last: int) -> np.ndarray | None:
        """Deformation gradient and first Piola-Kirchhoff stress (n, 3, 3)."""
        if name == "deformation_gradient":
            return deformation_gradients(self.particles, first, last)
        if name != "first_piola_kirchhoff_stress":
            return None
        stress = np.zeros((last - first, 3, 3))
        for block in self.blocks:
            low, high = max(first, block.first), min(last, block.last)
            if low < high:
                stress[low - first : high - first] = block.stresses(low, high)
        if self.initial_stress is not None:
            stress += self.initial_stress.first_piola_kirchhoff_stress(first, last)
        return stress

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
        """What most likely helps when a run goes wrong, by the settings."""
        settings, hints = self.settings, list[str]()
        if settings.integrator == "leapfrog" and settings.safety > 1.0:
            hints.append(f"a smaller method.safety (it is {settings.safety:g}; 0.9 is stable)")
        if settings.integrator == "ssp-rk3" and settings.cfl > 0.9:
            hints.append(f"a smaller method.cfl (it is {settings.cfl:g}; 0.7 is stable for smoothing of 0.85 and more)")
        smaller = bool(hints)
        if settings.dissipation == 0.0:
            hints.append("method.dissipation = 1 (there is none)")
        hints.append("more particles" if smaller else "more particles where the body is crushed")
        return ", or ".join([*hints, "a milder load"])

    @property
    def directed_pairs(self) -> int:  # type: ignore[override]
        """Interactions counted once a particle."""
        return self.lists.directed_pairs

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": self.particles.ghosts, "interactions": self.directed_pairs}

    def arrays(self) -> list[np.ndarray]:
        """Pair lists, and the rows of their sweeps."""
        return self.lists.arrays()

    def bytes_a_step(self) -> int:
        """Motion and records, in every evaluation."""
        return self.evaluations * self.lists.bytes_a_step()
