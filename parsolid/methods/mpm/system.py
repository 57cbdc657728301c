"""Material point method: particles carry the state, a background grid the momentum of each step.

A step: particles give mass, momentum and force to the nodes (summed over ranks); nodes move and obey the boundaries;
particles take velocity, place and velocity gradient; stress; particles are listed by cell anew and handed to other
ranks. No ghost particles, no collective but the loop's.
"""

from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.bisection import CutTree
from decomposition.grid import RankGrid
from parsolid.collective import SolverError, maximum, minimum
from parsolid.materials.plastic.elastic_plastic import ElasticPlastic
from parsolid.materials.registry import laws_of
from parsolid.methods.mpm.cells import CellMigration
from parsolid.methods.mpm.conditions import GridConditions
from parsolid.methods.mpm.elastic_plastic import ElasticPlasticSolid
from parsolid.methods.mpm.energies import StepEnergies
from parsolid.methods.mpm.external_forces import ExternalForces, LaggingWork
from parsolid.methods.mpm.grid import Nodes
from parsolid.methods.mpm.heat import Conduction, common_conductivity, conducts
from parsolid.methods.mpm.hyperelastic import HyperelasticSolid
from parsolid.methods.mpm.output import Reports
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.mpm.shape_functions import nodes_across
from parsolid.methods.mpm.transfer import grid_to_particles, particles_to_grid
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.methods.protocol import Announce, EnergyLedger
from parsolid.particles.law_values import declare_law_values
from parsolid.particles.particle_set import ParticleSet
from parsolid.per_rank import PerRank, own_share
from parsolid.scene import Scene


class MaterialPoint(Reports):
    """The method on one rank: its particles `points`, its cells and shared nodes `grid`, the arrays of nodes `nodes`.

    solids: of each law, what its particles do between the transfers; fastest [m/s]: largest c + |v| of this rank's
    particles; plastic_work [J]: of all steps.
    """

    def __init__(self, comm: MPI.Intracomm, scene: Scene, particle_set: ParticleSet):
        """particle_set: this rank's particles, sorted by law. Raises SolverError on all ranks when planes do not suit
        the grid. Collective."""
        self.comm, self.settings, self.dimension = comm, scene.method, scene.dimension
        self.points = self.particles = points = MaterialPoints(scene, particle_set)
        declare_law_values(comm, scene, points, particle_set, laws_of(scene))
        self.conditions = GridConditions(comm, scene, particle_set, points)
        self.loads = self.conditions.loads
        self.stop_times = self.loads.times
        self.reactions = self.loads.reactions
        kinds = [ElasticPlasticSolid if isinstance(law, ElasticPlastic) else HyperelasticSolid for law in points.laws]
        self.solids: dict[Any, Any] = {law: kind(law, points, self.settings) for law, kind in zip(points.laws, kinds)}
        if ElasticPlasticSolid in kinds:
            points.declare_plastic_state()
        conducting = conducts(scene, points.laws)
        thermal = self.conditions.thermal_planes(common_conductivity(points.laws)) if conducting else []
        mirrors = [plane.mirror for plane in self.conditions.planes] + [plane.mirror for plane in thermal]
        folds, width = tuple(dict.fromkeys(mirrors)), nodes_across(points.basis)
        self.grid = RankGrid(comm, self.dimension, width, folds, self.conditions.rows_before_planes)
        self.nodes = Nodes(self.grid, points, self.conditions.planes, conducting)
        self.conduction: Conduction | None = None
        if conducting:
            self.conduction = Conduction(scene, self.conditions, points, self.nodes, thermal)
        self.migration = CellMigration(self.grid, points)
        self.behind = LaggingWork(points)
        self.external: ExternalForces | None = None
        # of a step whose nodes have been accelerated already
        self._energies: StepEnergies | None = None
        # of a checkpoint
        self._partition: CutTree | None = None
        self._sound, self.fastest, self.plastic_work = True, 0.0, 0.0

    def accelerate_nodes(self, time: float, step: float) -> None:
        """Start of a step [s] from a time [s]: particles to grid, and the nodes' velocities after the forces.

        Where bodies touch on nodes, `nodal_contact` does this for all of them and changes the velocities.
        """
        points, nodes, external = self.points, self.nodes, self.external
        nodes.follow_cells()
        forces, duration, loads = None, step, self.loads.find_loads(time)
        if loads is not None:
            forces = np.zeros((points.capacity, 4))
            forces[: self.owned, : self.dimension] = loads.T
        self._energies = StepEnergies(points, nodes, forces, external, self.behind)
        if external is not None:
            forces = external.add_to(forces, step, (self.substep, self.substeps))
            duration = external.duration(step)
        self.conditions.keep_slopes_beside_driven(nodes)
        nodes.clear(nodes.motion)
        carried = points.motion, points.find("velocity_slope"), points.storage("stress_and_volume")
        particles_to_grid(points.basis, nodes.cells, *carried, forces, nodes.motion)
        nodes.exchange("motion")
        nodes.accelerate(duration)

    def advance_positions(self, time: float, step: float, ledger: EnergyLedger) -> None:
        """All of a step [s] from a time [s]: external forces of its end act in the next one."""
        if self.conduction is not None:
            self.nodes.follow_cells()
            ledger.add_term("heat_supplied", self.conduction.advance(time, step))
        if not self.settings.motion:
            return
        if self._energies is None:
            self.accelerate_nodes(time, step)
        assert self._energies is not None
        boundaries = self._move_particles(time + step, step)
        self._energies.note_work(step)
        self._sound, materials = self.advance_stress(step)
        self._energies.book(ledger, step, boundaries, materials, self.loads)
        self._energies = None
        self._sound = self.migration.migrate() and self._sound

    def complete_step(self, time: float, step: float, ledger: EnergyLedger, announce: Announce) -> bool:
        announce(self._sound, self.stable_step())
        return self._sound

    def _move_particles(self, time: float, step: float) -> tuple[float, float]:
        """Boundaries of the nodes at the end of a step [s] and grid to particles: velocities, places, velocity
        gradients. Work of the boundaries and what is lost there [J]."""
        points, nodes, conditions, external = self.points, self.nodes, self.conditions, self.external
        slope, rate = points.find("velocity_slope"), points.storage("velocity_gradient")
        paths = external.paths() if external is not None and step > 0.0 else None
        grid, motion = (points.basis, nodes.cells), points.motion
        supplied, lost = conditions.impose(nodes, nodes.motion, time)
        if self.settings.order == "usl":
            grid_to_particles(*grid, nodes.motion, None, step, motion, points.fraction, slope, rate, paths)
        else:
            grid_to_particles(*grid, nodes.motion, None, step, motion, points.fraction, slope, None, None)
            lost += self._remap(time)
            # where external forces act, by places, and particles forget velocities that nodes do not see, places follow
            # the velocities that strain matter: motion that strains nothing would give way to them for ever
            if paths is None or self.settings.adds_changes:
                grid_to_particles(*grid, nodes.motion, nodes.remapped, step, motion, None, None, rate, paths)
            else:
                grid_to_particles(*grid, nodes.remapped, None, step, motion, None, None, rate, paths)
        return supplied, lost

    def _remap(self, time: float) -> float:
        """MUSL: velocities of nodes by the new momentum of particles, which strain matter; what the boundaries do to
        them is no work. What is lost where they held nodes [J]."""
        points, nodes = self.points, self.nodes
        self.conditions.keep_slopes_beside_driven(nodes)
        nodes.clear(nodes.remapped)
        slope = points.find("velocity_slope")
        particles_to_grid(points.basis, nodes.cells, points.motion, slope, None, None, nodes.remapped)
        nodes.exchange("remapped")
        nodes.find_remapped_velocities()
        return self.conditions.impose(nodes, nodes.remapped, time)[1]

    def advance_stress(self, step: float) -> tuple[bool, dict[str, float]]:
        """State and stress of all particles after a step [s] with the velocity gradients that they have: whether all
        are sound, and what this rank's laws tell the ledger [J]."""
        sound, self.fastest, terms = True, 0.0, {"plastic_work": 0.0, "viscous_work": 0.0}
        for block in self.points.blocks:
            good, speed, more = self.solids[block.law].advance(block, step)
            sound, self.fastest = sound and good, max(self.fastest, speed)
            for name, found in more.items():
                terms[name] = terms.get(name, 0.0) + found
        self.plastic_work += terms["plastic_work"]
        return sound, terms

    def stable_step(self) -> float:
        """cfl h / (c + |v|) [s] of this rank's fastest particle, and what conduction and springs allow."""
        settings, fastest = self.settings, self.fastest
        thermal = self.conduction.stable_step() if self.conduction is not None else np.inf
        if not settings.motion:
            return float(thermal)
        waves = settings.cfl * settings.cell / fastest if fastest > 0.0 else np.inf
        if fastest == 0.0:
            # this rank had no particle in the step and may have got some since: any finite step
            waves = 1e300
        return float(min(waves, thermal, self.loads.largest_step))

    # --- start and restart -------------------------------------------------------------------------------------

    def take_external_forces(self, keep_rows: bool) -> None:
        """See `ParticleSystem.take_external_forces` and `CellMigration.keep_rows`."""
        super().take_external_forces(keep_rows)
        if keep_rows:
            self.migration.keep_rows()
        if self.external is None:
            self.external = ExternalForces(self.points, self.behind)

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Set the state at time 0, deal particles out to the owners of their cells, and find the first stress;
        collective."""
        self.points.begin(scene, particle_set)
        if self.takes_heat:
            self.points.begin_plastic_state(scene, particle_set)
        if taken := take_state(self.comm, scene, self, particle_set):
            self.points.without_deleted()
        self.migration.redistribute()
        self.nodes.follow_cells()
        self.advance_stress(0.0)
        take_forces(self.comm, scene, self)
        if taken:
            last = min(minimum(self.comm, self.stable_step()), self.settings.maximum_step or np.inf)
            self.behind.follow(last, self.external is not None)
            if self.external is not None:
                self.external.goes_on = True
        self._look_at_heat()

    def resume(self) -> None:
        """Continue with the checkpoint's owners of cells; on other ranks with new ones; collective."""
        self.points.without_deleted()
        self.loads.masses_changed()
        self.migration.redistribute(self._partition)
        self._look_at_heat()

    def _look_at_heat(self) -> None:
        """Find the stable step of conduction for the first step, and the heat as energy scale; collective."""
        if self.conduction is not None:
            self.conduction.refresh()
            self.energy_scale = max(self.energy_scale, self.comm.allreduce(self.points.heat()))

    def state(self) -> dict[str, Any]:
        """Owners of cells, the step counter that times re-ordering, the largest speed; collective."""
        return {
            "external": self.external is not None,
            "behind": self.behind.state(),
            "partition": self.grid.partition.state(),
            "steps": self.migration.steps,
            "fastest": maximum(self.comm, self.fastest),
            "plastic_work": PerRank(self.plastic_work),
            "driven_planes": [[one.moved, one.at] for one in self.conditions.driven],
        }

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave; owners of cells only for as many ranks. Raises SolverError where external forces
        act on velocities of a run without any, which are of other times."""
        if self.external is not None and not state["external"]:
            raise SolverError("method: expected a checkpoint of a run with contact, ties or tools, found one without")
        self.migration.steps, self.fastest = state["steps"], state["fastest"]
        partition = CutTree.from_state(state["partition"], self.dimension)
        for one, kept in zip(self.conditions.driven, state.get("driven_planes", ())):
            one.moved, one.at = kept
        self.behind.set_state(self.comm, state["behind"])
        self.plastic_work = float(own_share(self.comm, state["plastic_work"])[0])
        if partition.ranks == self.comm.size:
            self._partition = partition
