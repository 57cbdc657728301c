"""Upwind total-Lagrangian SPH (Lee et al., sections 5 and 6): state {v, x, F, H, J, A_alpha} of each particle."""

from itertools import pairwise
from typing import Any

import numpy as np

from decomposition.boxes import cut_boxes
from parsolid.boundary.conditions import EXTERNAL_FORCE, Conditions
from parsolid.collective import anywhere, minimum
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.registry import laws_of
from parsolid.methods.plastic_particles import begin_plastic, declare_plastic
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.methods.tlsph.body_weights import ON_LATTICES, meshes_of, weights_of_bodies
from parsolid.methods.tlsph.fixed_walls import fixed_walls_of
from parsolid.methods.tlsph.implicit import Implicit
from parsolid.methods.tlsph.initial_stress import initial_stress_of
from parsolid.methods.tlsph.lattice_bodies import BoxCuts, boxes_of, find_lattice_bodies, without_edges
from parsolid.methods.tlsph.leapfrog import Leapfrog, slowing_of
from parsolid.methods.tlsph.output import Reports
from parsolid.methods.tlsph.plastic import RIEMANN_HEAT, PlasticBlock
from parsolid.methods.tlsph.pressures import pressures_of
from parsolid.methods.tlsph.ssp_rk3 import StagedStep
from parsolid.methods.tlsph.state import LawBlock, declare_fields, deformation_gradients
from parsolid.methods.tlsph.static import FIRST, Static
from parsolid.methods.tlsph.sweeps_of_bodies import (
    box_bodies_of,
    groups_of,
    list_bodies_of,
    mesh_bodies_of,
    smoothing_of,
)
from parsolid.methods.tlsph.updated_reference import UpdatedReference
from parsolid.pairs.candidates import metrics
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field
from parsolid.particles.distribution import sort_for_speed
from parsolid.particles.generated import CELL_VOLUME
from parsolid.particles.initial_fields import initial_deformation_gradient, initial_displacement, initial_velocity
from parsolid.particles.law_values import declare_law_values, rows_of_laws
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.contact import bodies_in_contact, tied_pairs
from parsolid.scene.method_settings import STAGE_CHANGE
from parsolid.scene.systems import settings_of_stages


class TotalLagrangianSPH(Reports):
    """The method on one rank.

    blocks: ranges of particles that share a law, first those of bodies with pair lists, then every box for itself;
    plastic_blocks: those with laws that flow; branches: most of any law. lists, boxes: `ListBodies` and `BoxBodies`,
    None where the scene has no such bodies;
    sweeps: those there are, which find velocity gradients and forces, each for its bodies: advance_step(step),
    find_forces(), displacement_gradient(result), of lists advance_stage(stage, step). leapfrog or staged_step: the
    integrator of explicit motion, the other is None; statics: that of equilibria, None where no stage solves for
    displacements; implicit: that of motion in long steps, or None; integrator: that of the present stage;
    meshes_of_bodies: the key of the mesh whose weights each body has, or None; settings: those of the present stage,
    see `begin_stage`; slowing: see `leapfrog.slowing_of`.
    """

    def __init__(self, comm: Any, scene: Any, particle_set: Any) -> None:
        """particle_set: this rank's particles in the order of `sort`. Raises SolverError on all ranks when particles
        cannot be paired. Collective."""
        self.stages = settings_of_stages(scene)
        kinds = {one.integrator for one in self.stages}
        moving = next((one for one in self.stages if one.integrator == "leapfrog"), scene.method)
        unknown = next((one for one in self.stages if one.integrator in ("static", "implicit")), None)
        # weights and sums over pairs are those of motion in all stages
        whole, scene = scene, scene.model_copy(update={"method": moving})
        self.comm, self.settings = comm, moving
        self.owned, self.dimension = particle_set.position.shape
        self.laws = laws_of(scene)
        self.body_weights = weights_of_bodies(self.settings.pair_weights, scene)
        groups = groups_of(self.laws, boxes_of(scene, self.body_weights), meshes_of(self.body_weights))
        self.particles = Particles(particle_set.body, groups)
        staged = self.settings.integrator == "ssp-rk3"
        self.branches = max(len(law.branch_moduli or ()) for law in self.laws)
        declare_fields(self.particles, particle_set, self.branches, staged)
        ends, law_of_group = self.particles.bounds.tolist(), dict(zip(groups.tolist(), self.laws))
        of_groups = [law_of_group[group] for group in sorted(law_of_group)]
        heat = None if self.settings.dissipation_of("kernel") == 0.0 else RIEMANN_HEAT
        declare_plastic(self.particles, self.dimension, of_groups, heat)
        found = [(first, last, law_of_group[g]) for g, (first, last) in enumerate(pairwise(ends)) if last > first]
        of_law = {ElasticPlastic: PlasticBlock}
        declare_law_values(comm, scene, self.particles, particle_set, self.laws)
        rows = rows_of_laws(self.laws)
        self.blocks = [of_law.get(type(one[2]), LawBlock)(self.particles, *one, rows.get(one[2])) for one in found]
        self.plastic_blocks = [block for block in self.blocks if isinstance(block, PlasticBlock)]
        meshes = meshes_of(self.body_weights)
        without_images = frozenset(i for i, kind in enumerate(self.body_weights) if kind in ON_LATTICES)
        # solutions for displacements know them, and then a motion may follow them in all stages
        known = scene if unknown is None else scene.model_copy(update={"method": unknown})
        self.conditions = Conditions(comm, known, particle_set, self.particles, without_images, frozenset(meshes))
        held = (self.conditions.planes, self.conditions.held)
        self.lattice_bodies = find_lattice_bodies(comm, scene, particle_set, self.body_weights, *held, self.laws)
        # lattices have volumes and areas of their own
        self.particles.owned_rows("volume")[:] = without_edges(particle_set.volume, self.lattice_bodies)
        self.particles.owned_rows("area")[:] = particle_set.area
        if particle_set.area_across is not None:
            on_lattices = np.isin(particle_set.body, [one.body for one in self.lattice_bodies])
            self.particles.owned_rows("area_across")[on_lattices] = particle_set.area[on_lattices]
        boxes = [one for one in self.lattice_bodies if one.box]
        if boxes:
            cells = particle_set.volume.copy()
            for one in boxes:
                cells[particle_set.body == one.body] = one.cell_volume
            self.particles.declare(Field(CELL_VOLUME, 1, "m^3"), cells)
        density, share = np.array([law.density for law in self.laws])[particle_set.body], self.conditions.share
        self.particles.declare(Field("mass", 1, "kg"), particle_set.volume / share * density)
        self.particles.declare(Field("share", 1, "1"), share)
        # the narrowest spacing of all ranks bounds the step (79), so that it does not depend on their number
        others = ~np.isin(particle_set.body, meshes)
        self.spacing = minimum(comm, float(particle_set.spacing[others].min(initial=np.inf)))
        self.reactions = self.conditions.reactions
        self.slowing = slowing_of(self, scene)
        self.leapfrog = None if staged else Leapfrog(self, scene)
        self.staged_step = StagedStep(self, scene) if staged else None
        self.evaluations, self.stop_times = (3, ()) if staged else (1, self.conditions.times)
        self.meshes_of_bodies = [
            scene.bodies[i].shape.model.mesh_key if i in meshes else None for i in range(len(scene.bodies))
        ]
        self.initial_stress = initial_stress_of(self, scene)
        self.boxes = box_bodies_of(self, scene)
        self.lists: Any = list_bodies_of(self, scene, particle_set)
        self.meshes = mesh_bodies_of(self, scene, particle_set)
        if self.meshes is not None and self.leapfrog is not None:
            self.leapfrog.kicks.shared = self.meshes.shared
        self.pressures = None if unknown is None else pressures_of(self)
        self.sweeps = [one for one in (self.lists, self.meshes, self.boxes) if one is not None]
        self.fixed_walls = None if self.lists is None else fixed_walls_of(self, self.lists)
        fixed = self.settings.reference == "fixed"
        self.reference = None if fixed else UpdatedReference(self, particle_set.position)
        if self.lists is not None:
            metric = metrics(particle_set.spacing, particle_set.axes, smoothing_of(self, particle_set))
            self.find_pairs(particle_set.position, particle_set.body, metric, particle_set.volume / share)
        self.statics = None
        if unknown is not None:
            # the only system of its scene: of others a part does not have all bodies of a tie
            tied = [pair[:2] for pair in tied_pairs(scene)]
            named = enumerate(body.name for body in scene.bodies)
            self.names_of_bodies = [f"bodies.{i}" + (f" ({name})" if name else "") for i, name in named]
            self.statics = Static(self, "static" in kinds, tied, bodies_in_contact(scene))
        self.implicit = Implicit(self) if "implicit" in kinds else None
        self._take_stages(whole)

    @property
    def bounded(self) -> bool:  # type: ignore[override]
        """Not in steps that are solved for."""
        return self.settings.integrator not in ("static", "implicit")

    def _take_stages(self, scene: Any) -> None:
        """Times at which stages of a scene begin, and jumps of the loads, which equilibria follow in a step of no
        length; those of a motion that equilibria end count as such."""
        self.stage_times = [0.0, *(one.start for one in scene.stages), scene.end_time]
        self.stop_times = (*self.stop_times, *self.stage_times[1:-1])
        kinds = [one.integrator for one in self.stages]
        self.jumps = tuple(
            time
            for kind, before, start, end in zip(kinds, [None, *kinds], self.stage_times, self.stage_times[1:])
            for time in sorted({start, *self.conditions.times} if before != kind else self.conditions.times)
            if kind == "static" and (start <= time < end or time == end == scene.end_time)
        )
        self._enter(0)

    def _enter(self, number: int) -> None:
        self.stage, self.settings = number, self.stages[number]
        of_kind = {"static": self.statics, "implicit": self.implicit}
        self.integrator: Any = of_kind.get(self.settings.integrator, self.leapfrog or self.staged_step)
        if self.settings.integrator == "static":
            first = max(k for k in range(number + 1) if k == 0 or self.stages[k - 1].integrator != "static")
            self.statics.set_span(self.stage_times[first], *self.stage_times[number : number + 2], self.settings)
        elif self.implicit is not None and self.settings.integrator == "implicit":
            self.implicit.set_settings(self.settings)
        elif self.leapfrog is not None:
            self.leapfrog.signals, self.leapfrog.safety = self.leapfrog.bounds()

    @staticmethod
    def sort(comm: Any, scene: Any, particle_set: ParticleSet) -> np.ndarray:
        """Order (n,) of a rank's particles: those with pair lists by law and along cells, then box by box, the nodes of
        each by its memory axes; collective."""
        laws, cuts = laws_of(scene), BoxCuts(scene, comm.size)
        order = sort_for_speed(comm, particle_set, laws)
        meshes = meshes_of(weights_of_bodies(scene.method.pair_weights, scene))
        return cuts.order(comm, particle_set, order, groups_of(laws, cuts.bodies, meshes)[particle_set.body])

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
            self.meshes.join()
            self.meshes.begin()
        begin_plastic(scene, self.particles, particle_set, self.plastic_blocks)
        self.complete_strain(derived)
        take_state(self.comm, scene, self, particle_set)
        for block in self.blocks:
            block.settle()
        self.conditions.hold(0.0)
        if self.pressures is not None and self.settings.integrator != "leapfrog":
            self.pressures.release(self.settings.integrator == "implicit")
        if self.settings.integrator in ("static", "implicit"):
            self.integrator.begin()
        elif self.statics is not None:
            self.statics.follow_motion()
            self.statics.stabilise()
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

    def begin_stage(self, time: float, ledger: Any) -> None:
        """See `ParticleSystem`: a motion that goes over to equilibria loses what it has of kinetic energy; bodies that
        begin to move from one are at rest but for what is prescribed."""
        before, (kinetic, _) = self.settings.integrator, self.energies()
        self._enter(self.stage + 1)
        if self.settings.integrator == before:
            return
        if self.pressures is not None:
            if self.settings.integrator == "leapfrog":
                self.pressures.hold()
            elif before == "leapfrog":
                ledger.add_term(STAGE_CHANGE, self.pressures.release(self.settings.integrator == "implicit"))
        if self.settings.integrator == "static":
            self.statics.begin()
            ledger.add_term(STAGE_CHANGE, kinetic)
        else:
            self.integrator.begin()
            self.conditions.impose(time)
            ledger.add(1.0, 0.0, 0.0, self.energies()[0] - kinetic)

    def state(self) -> dict[str, Any]:
        """When the reference was moved, and whether the particles have the forces that a step begins with; the stage,
        where there are several."""
        moved = {} if self.reference is None else self.reference.state()
        moved |= {"stage": self.stage} if len(self.stages) > 1 else {}
        return moved | {name: value for one in self._integrators for name, value in one.state().items()}

    def set_state(self, state: dict[str, Any]) -> None:
        if self.reference is not None:
            self.reference.set_state(state)
        self._enter(state.get("stage", 0))
        for one in self._integrators:
            one.set_state(state)

    @property
    def _integrators(self) -> list[Any]:
        """Those that keep a state, of all stages."""
        kinds = {one.integrator for one in self.stages}
        found = {"static": self.statics, "implicit": self.implicit, "leapfrog": self.leapfrog}
        return [one for kind, one in found.items() if kind in kinds]

    def resume(self) -> None:
        """Continue from a state that was put back into the particles."""
        if self.initial_stress is not None:
            self.initial_stress.resume()
        if self.reference is not None:
            self.reference.resume()
        if self.meshes is not None:
            self.meshes.begin()
        if self.statics is not None:
            self.statics.stabilise()

    def forget(self) -> None:
        """Forces of the laws and weights of the checkpoint."""
        if self.leapfrog is not None:
            self.leapfrog.forces_of = None

    # --- what the loop asks -----------------------------------------------------------------------------------

    @property
    def reached(self) -> float | None:  # type: ignore[override]
        """Time [s] of the last equilibrium, where a step ended before its end."""
        return getattr(self.integrator, "reached", None)

    def stable_step(self) -> float:
        """Largest step [s] of this rank's particles in the present state."""
        return float(self.integrator.stable_step())

    def steps_to(self, end: float) -> float:
        """See `ParticleSystem`; at least, of equilibria and long steps that choose their lengths as they go."""
        spans = [
            (one, max(min(b, end) - a, 0.0)) for one, a, b in zip(self.stages, self.stage_times, self.stage_times[1:])
        ]
        if self.leapfrog is None:
            return super().steps_to(end)
        chosen = {"static": 1.0 / FIRST, "implicit": 1.0}
        return sum(
            span / self.leapfrog.stable_step()
            if one.integrator not in chosen
            else max(chosen[one.integrator], span / (one.maximum_step or np.inf)) * (span > 0.0)
            for one, span in spans
        )

    @property
    def rebuild_needed(self) -> bool:  # type: ignore[override]
        """Whether this rank's particles ask for another reference."""
        return self.reference is not None and self.reference.asks

    def advance_positions(self, time: float, step: float, ledger: Any) -> None:
        """See `ParticleSystem`; of a reference that follows where it is moved, collective there."""
        self.reference_lost = self.reference is not None and not self.reference.follow(self.rebuild_anywhere)
        if not self.reference_lost:
            self.integrator.advance_positions(time, step, ledger)

    def complete_step(self, time: float, step: float, ledger: Any, announce: Any) -> bool:
        if self.reference_lost:
            announce(False, 0.0)
            return False
        sound = bool(self.integrator.complete_step(time, step, ledger, announce))
        if self.statics is not None and self.settings.integrator == "leapfrog":
            self.statics.follow_motion()
        elif self.statics is not None and EXTERNAL_FORCE in self.particles:
            self.particles.owned_rows(EXTERNAL_FORCE)[:] = 0.0
            for one in self.interactions:
                one.settle(time + step, step, ledger)
        return sound
