"""The state of the material point method at time 0 and after a restart."""

from typing import Any

import numpy as np

from decomposition.bisection import CutTree
from parsolid.collective import SolverError, maximum, minimum
from parsolid.methods.mpm.external_forces import ExternalForces, LaggingWork
from parsolid.methods.mpm.output import Reports
from parsolid.methods.previous_state import take_forces, take_state
from parsolid.particles.particle_set import ParticleSet
from parsolid.per_rank import PerRank, own_share
from parsolid.scene import Scene


class Start(Reports):
    """Start and restart of `system.MaterialPoint`, which derives from it."""

    behind: LaggingWork
    conduction: Any
    loads: Any
    fastest: float
    advance_stress: Any
    _partition: CutTree | None = None

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
