"""Upwind total-Lagrangian SPH (Lee et al., sections 5 and 6): state {v, x, F, H, J, A_alpha} of each particle."""

from itertools import pairwise
from typing import Any

import numpy as np

from decomposition.boxes import cut_boxes
from parsolid.boundary.conditions import Conditions
from parsolid.boundary.mirror_planes import MirrorPlane, symmetry_planes
from parsolid.collective import anywhere, minimum, raise_together
from parsolid.materials.blocks import block_numbers
from parsolid.materials.hyperelastic.functions import elastic_moduli, isotropic_shear_modulus
from parsolid.materials.registry import laws_of
from parsolid.materials.viscoelastic.maxwell import total_modulus
from parsolid.methods.leapfrog import kinetic_energy
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.methods.protocol import ParticleSystem
from parsolid.methods.tlsph.body_weights import ON_LATTICES, meshes_of, weights_are_rounded, weights_of_bodies
from parsolid.methods.tlsph.box_bodies import BoxBodies
from parsolid.methods.tlsph.fixed_walls import fixed_walls_of
from parsolid.methods.tlsph.initial_stress import initial_stress_of
from parsolid.methods.tlsph.lattice_bodies import BoxCuts, boxes_of, find_lattice_bodies
from parsolid.methods.tlsph.leapfrog import Leapfrog
from parsolid.methods.tlsph.list_bodies import ListBodies
from parsolid.methods.tlsph.mesh_bodies import MeshBodies
from parsolid.methods.tlsph.ssp_rk3 import StagedStep
from parsolid.methods.tlsph.state import LawBlock, declare_fields, deformation_gradients
from parsolid.methods.tlsph.updated_reference import UpdatedReference
from parsolid.pairs.candidates import metrics
from parsolid.pairs.cell_weights import NodesOfCells
from parsolid.pairs.closure import surface_area
from parsolid.pairs.list_weights import ListWeights
from parsolid.pairs.smoothing import smoothing_kernel
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.particles.distribution import sort_for_speed
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import initial_deformation_gradient, initial_displacement, initial_velocity
from parsolid.scene.warned import Note


class TotalLagrangianSPH(ParticleSystem):
    """The method on one rank.

    blocks: ranges of particles that share a law, first those of bodies with pair lists, then every box for itself;
    branches: most of any law. lists, boxes: `ListBodies` and `BoxBodies`, None where the scene has no such bodies;
    sweeps: those there are, which find velocity gradients and forces, each for its bodies: advance_step(step),
    advance_stage(stage, step), find_forces(), displacement_gradient(result). leapfrog or staged_step: the integrator,
    the other is None.
    """

    def __init__(self, comm: Any, scene: Any, particle_set: Any) -> None:
        """particle_set: this rank's particles in the order of `sort`. Raises SolverError on all ranks when particles
        cannot be paired. Collective."""
        self.comm, self.settings = comm, scene.method
        self.owned, self.dimension = particle_set.position.shape
        self.laws = laws_of(scene)
        self.body_weights = weights_of_bodies(self.settings.pair_weights, scene)
        groups = _groups_of(self.laws, boxes_of(scene, self.body_weights), meshes_of(self.body_weights))
        self.particles = Particles(particle_set.body, groups)
        staged = self.settings.integrator == "ssp-rk3"
        self.branches = max(len(law.branch_moduli or ()) for law in self.laws)
        declare_fields(self.particles, particle_set, self.branches, staged)
        ends, law_of_group = self.particles.bounds.tolist(), dict(zip(groups.tolist(), self.laws))
        found = [(first, last, law_of_group[g]) for g, (first, last) in enumerate(pairwise(ends)) if last > first]
        self.blocks = [LawBlock(self.particles, *one) for one in found]
        meshes = meshes_of(self.body_weights)
        without_images = frozenset(i for i, kind in enumerate(self.body_weights) if kind in ON_LATTICES)
        self.conditions = Conditions(comm, scene, particle_set, self.particles, without_images, frozenset(meshes))
        held = (self.conditions.planes, self.conditions.held)
        self.lattice_bodies = find_lattice_bodies(comm, scene, particle_set, self.body_weights, *held, self.laws)
        # lattices have volumes and areas of their own
        self.particles.owned_rows("volume")[:] = particle_set.volume
        self.particles.owned_rows("area")[:] = particle_set.area
        density, share = np.array([law.density for law in self.laws])[particle_set.body], self.conditions.share
        self.particles.declare(Field("mass", 1, "kg"), particle_set.volume / share * density)
        self.particles.declare(Field("share", 1, "1"), share)
        # the narrowest spacing of all ranks bounds the step (79), so that it does not depend on their number
        others = ~np.isin(particle_set.body, meshes)
        self.spacing = minimum(comm, float(particle_set.spacing[others].min(initial=np.inf)))
        self.reactions = self.conditions.reactions
        self.leapfrog = None if staged else Leapfrog(self, scene)
        self.staged_step = StagedStep(self, scene) if staged else None
        self.evaluations, self.landings = (3, ()) if staged else (1, self.conditions.times)
        self.initial_stress = initial_stress_of(self, scene)
        self.boxes = self._box_bodies(scene)
        self.lists: Any = self._list_bodies(scene, particle_set)
        self.meshes = self._mesh_bodies(scene, particle_set)
        self.sweeps = [one for one in (self.lists, self.meshes, self.boxes) if one is not None]
        self.fixed_walls = None if self.lists is None else fixed_walls_of(self, self.lists)
        fixed = self.settings.reference == "fixed"
        self.reference = None if fixed else UpdatedReference(self, particle_set.position)
        if self.lists is not None:
            metric = metrics(particle_set.spacing, particle_set.axes, self._smoothing(particle_set))
            self.find_pairs(particle_set.position, particle_set.body, metric, particle_set.volume / share)

    @staticmethod
    def sort(comm: Any, scene: Any, particle_set: ParticleSet) -> np.ndarray:
        """Order (n,) of a rank's particles: those with pair lists by law and along cells, then box by box, the nodes of
        each by its memory axes; collective."""
        laws, cuts = laws_of(scene), BoxCuts(scene, comm.size)
        order = sort_for_speed(comm, particle_set, laws)
        meshes = meshes_of(weights_of_bodies(scene.method.pair_weights, scene))
        return cuts.order(comm, particle_set, order, _groups_of(laws, cuts.bodies, meshes)[particle_set.body])

    @staticmethod
    def owners(comm: Any, scene: Any, particle_set: ParticleSet) -> np.ndarray | None:
        """Ranks (n,) of nodes of boxes, which are cut along their planes, -1 of other particles; collective."""
        cuts = BoxCuts(scene, comm.size)
        return cuts.owners(comm, particle_set) if cuts.bodies else None

    def busiest(self, total: int, ranks: int) -> int:
        """See `ParticleSystem.busiest`; boxes are cut along their planes."""
        if self.boxes is None:
            return super().busiest(total, ranks)
        parts = cut_boxes(self.boxes.nodes, ranks)
        nodes = np.prod(parts[:, :, 1] - parts[:, :, 0], axis=2).sum(axis=0)
        return int(nodes.max()) + super().busiest(total - int(nodes.sum()), ranks)

    def _box_bodies(self, scene: Any) -> BoxBodies | None:
        cuts = BoxCuts(scene, self.comm.size)
        if not cuts.bodies:
            return None
        body, first = self.particles.owned_rows("body"), {block.first: block for block in self.blocks}
        rows = {number: np.flatnonzero(body == number) for number in cuts.bodies}
        blocks = {number: first[int(own[0])] for number, own in rows.items() if len(own)}
        return BoxBodies(self, cuts, [one for one in self.lattice_bodies if one.box], blocks)

    def _list_bodies(self, scene: Any, particle_set: Any) -> ListBodies | None:
        settings, conditions, surface = self.settings, self.conditions, None
        others = [*boxes_of(scene, self.body_weights), *meshes_of(self.body_weights)]
        if len(others) == len(self.body_weights):
            return None
        rows = slice(0, int(np.sum(~np.isin(particle_set.body, others))))
        if "closure" in self.body_weights:
            here = np.array(self.body_weights)[particle_set.body] == "closure"
            area = surface_area(self.comm, particle_set, conditions.planes, here)
            surface = (area[rows], conditions.share[rows], here[rows])
        # where the reference moves, shear that does not depend on the original direction depends on the moved one
        directional = settings.reference == "updated" or anywhere(
            self.comm, any(isotropic_shear_modulus(block.law) is None for block in self.blocks)
        )
        waves = 0
        if settings.dissipation > 0.0:
            waves = 1 if self.staged_step is None else 3 if directional else 2
        cells: Any = None
        if any(one.cells is not None for one in self.lattice_bodies):
            meant = [one for one in self.lattice_bodies if one.cells is not None]
            found: Any = [(one.body, np.flatnonzero(particle_set.body == one.body), one.cells) for one in meant]
            cells = NodesOfCells.of(particle_set.spacing[rows], found)
        rounded = weights_are_rounded(scene) and surface is None and not self.lattice_bodies
        kernel, factor = smoothing_kernel(settings.kernel), float(settings.dissipation)
        weights = ListWeights(kernel, factor, waves >= 2, surface, cells, rounded)
        blocks = [block for block in self.blocks if block.last <= rows.stop]
        return ListBodies(self, blocks, weights, waves, scene.unbonded)

    def _mesh_bodies(self, scene: Any, particle_set: Any) -> MeshBodies | None:
        numbers = meshes_of(self.body_weights)
        if not numbers:
            return None
        raise_together(self.comm, self._bonded_mesh(scene, particle_set, numbers))
        body = self.particles.owned_rows("body")
        blocks = [block for block in self.blocks if body[block.first] in numbers]
        bodies = MeshBodies(self, blocks, 1 if self.settings.dissipation > 0.0 else 0)
        bodies.find_pairs(scene, particle_set, numbers)
        return bodies

    def _bonded_mesh(self, scene: Any, particle_set: Any, numbers: list[int]) -> str | None:
        """The fault of a body with the weights of its mesh within a kernel's reach of another one, by their bounding
        boxes, where no contact keeps them apart: it would not be bonded to it as others are. Collective."""
        count, d = len(scene.bodies), self.dimension
        if count == 1:
            return None
        # lower bounds and the negative upper ones and coarsest spacings of each body
        bounds = np.full((count, 2 * d + 1), np.inf)
        for number in np.unique(particle_set.body):
            here = particle_set.body == number
            X, spacing = particle_set.position[here], particle_set.spacing[here]
            bounds[number] = np.concatenate([X.min(axis=0), -X.max(axis=0), [-spacing.max()]])
        bounds = minimum(self.comm, bounds)
        support = smoothing_kernel(self.settings.kernel).support * self.settings.smoothing
        for i in numbers:
            for j in range(count):
                gap = np.maximum(bounds[i, :d] + bounds[j, d : 2 * d], bounds[j, :d] + bounds[i, d : 2 * d])
                reach = -support * min(bounds[i, -1], bounds[j, -1])
                apart = i == j or (scene.unbonded is not None and scene.unbonded[i, j])
                if not apart and np.linalg.norm(np.maximum(gap, 0.0)) < reach:
                    return (
                        'method.weights: expected for "mesh" bodies apart from others, or in contact or tied, as those '
                        f"that touch are bonded by a kernel, found bodies.{i} and bodies.{j}"
                    )
        return None

    def _smoothing(self, particle_set: Any) -> Any:
        """h/dx, (n, 1) where bodies of cells have their own, by which neighbours are found."""
        result = np.full((len(particle_set), 1), float(self.settings.smoothing))
        for one in self.lattice_bodies:
            result[particle_set.body == one.body] = one.reach / smoothing_kernel(self.settings.kernel).support
        return result if self.lattice_bodies else self.settings.smoothing

    def find_pairs(self, positions: Any, body: Any, metric: Any, volume: Any) -> None:
        """Lists, weights and corrections at some places (owned, d), see `pair_list.Neighbours`. Collective."""
        rows = slice(0, self.lists.last)
        metric = metric if len(metric) == 1 else metric[rows]
        self.lists.rebuild(positions[rows], body[rows], metric, volume[rows])

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
            rows("deformation_gradient")[:] = gradient.reshape(len(particle_set), self.dimension**2)
            derived &= ~where
        if self.initial_stress is not None:
            self.initial_stress.begin(*place)
        if self.meshes is not None:
            self.meshes.begin()
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
            rows("deformation_gradient")[derived] += self.displacement_gradient().reshape(owned, d * d)[derived]
        F = deformation_gradients(self.particles, 0, owned)
        rows("jacobian")[:] = np.linalg.det(F)
        if "cofactor" in self.particles:
            rows("cofactor")[:] = np.cross(F[:, (1, 2, 0)], F[:, (2, 0, 1)]).reshape(owned, 9)

    def displacement_gradient(self) -> np.ndarray:
        """grad u (owned, d, d) by the scheme's own operators; collective."""
        result = np.zeros((self.owned, self.dimension, self.dimension))
        for bodies in self.sweeps:
            bodies.displacement_gradient(result)
        return result

    @property
    def reference_updates(self) -> int:
        """How often the reference was moved."""
        return 0 if self.reference is None else self.reference.updates

    def state(self) -> dict[str, Any]:
        """When the reference was moved, and whether the particles have the forces that a step begins with."""
        moved = {} if self.reference is None else self.reference.state()
        return moved if self.leapfrog is None else {**moved, **self.leapfrog.state()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        if self.reference is not None:
            self.reference.set_state(state)
        if self.leapfrog is not None:
            self.leapfrog.set_state(state)

    def resume(self) -> None:
        """Continue from a state that was put back into the particles."""
        if self.initial_stress is not None:
            self.initial_stress.resume()
        if self.reference is not None:
            self.reference.resume()
        if self.meshes is not None:
            self.meshes.begin()

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
        stored += 0.0 if self.meshes is None else self.meshes.stabiliser_energy()
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
        chosen = self.settings.weights in ("best", "mesh")
        return {**moved, "pair_weights": list(self.body_weights)} if chosen else moved

    def cost_notes(self) -> list[Note]:
        """Elements of second order, of which the corners are taken."""
        found = {} if self.meshes is None else self.meshes.of_second_order
        code, words = "second-order-elements", "are taken by their corners"
        return [
            Note(code, f"bodies.{self.bodies[i]}: elements of second order ({', '.join(kinds)}) {words}")
            for i, kinds in found.items()
        ]

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
        return sum(bodies.directed_pairs for bodies in self.sweeps)

    @property
    def farthest(self) -> float:  # type: ignore[override]
        """Distance of the farthest ghost of nodes of lattices [m]: boxes have two planes of them."""
        reaches = [(2 if one.box else one.reach) * max(axis.step for axis in one.axes) for one in self.lattice_bodies]
        return max(reaches, default=0.0)

    def numbers(self) -> dict[str, int]:
        """Ghosts and interactions."""
        return {"ghosts": sum(bodies.ghosts for bodies in self.sweeps), "interactions": self.directed_pairs}

    def arrays(self) -> list[np.ndarray]:
        """Pair lists, and what sweeps read and write."""
        return [array for bodies in self.sweeps for array in bodies.arrays()]

    def bytes_a_step(self) -> int:
        """Motion, stresses and impedances, in every evaluation."""
        return self.evaluations * sum(bodies.bytes_a_step() for bodies in self.sweeps)


def _groups_of(laws: list[Any], boxes: list[int], meshes: list[int]) -> np.ndarray:
    """A number for each body: the same for bodies with kernels in pair lists that share a law, then for those with
    weights of meshes, and one for every box behind."""
    _, numbers = block_numbers(laws, np.arange(len(laws)))
    groups, first = np.zeros(len(laws), np.int64), 0
    for some in ([i for i in range(len(laws)) if i not in (*boxes, *meshes)], meshes):
        found = np.unique(numbers[some])
        groups[some] = first + np.searchsorted(found, numbers[some])
        first += len(found)
    groups[boxes] = first + np.arange(len(boxes))
    return groups
