"""The state of updated-Lagrangian SPH at time 0 and after a restart."""

from typing import Any

import numpy as np

from parsolid.collective import anywhere
from parsolid.methods import previous_state
from parsolid.methods.ulsph.output import Reports
from parsolid.particles.initial_fields import (
    initial_displacement,
    initial_micro_rate,
    initial_plastic_strain,
    initial_temperature,
    initial_velocity,
)
from parsolid.particles.particle_set import ParticleSet
from parsolid.per_rank import PerRank, own_share
from parsolid.scene import Scene


class Start(Reports):
    """Start and restart of `system.UpdatedLagrangianSPH`, which derives from it."""

    kicks: Any
    planes: Any
    centred: bool | None
    deletion: Any
    find_rates: Any
    advance_state: Any
    advance_fluxes: Any
    checkpoint: dict[str, Any] | None = None

    def take_external_forces(self, keep_rows: bool) -> None:
        """Forces of contact do their work at the ends of steps, for which the correction is carried on."""
        super().take_external_forces(keep_rows)
        self.centred = True

    def begin(self, scene: Scene, particle_set: ParticleSet) -> None:
        """Set the state at time 0 by the bodies' formulas; collective."""
        rows, place = self.particles.owned_rows, (scene, particle_set.body, particle_set.position)
        rows("velocity")[:] = initial_velocity(*place, particle_set.regions)
        displacement = initial_displacement(*place, particle_set.regions)
        if displacement is not None:
            rows("position")[:] += displacement
        usual = [getattr(law, "reference_temperature", 0.0) for law in self.laws]
        reference = np.array(usual)[self.particles.law_of_body]
        rows("temperature")[:] = initial_temperature(*place, reference, particle_set.regions)
        rows("plastic_strain")[:] = initial_plastic_strain(*place, particle_set.regions)
        flowing = initial_micro_rate(*place)
        if flowing is not None:
            rows("micro_rate")[:] = flowing * (rows("micro_free") if "micro_free" in self.particles else 1.0)
        for solid, here in self.parts():
            solid.begin(scene, self.particles, here, particle_set)
        if previous_state.take_state(self.comm, scene, self, particle_set) and self.deletion is not None:
            self.deletion.lighten()
        self.conditions.hold(0.0)
        if self.planes is not None:
            self.planes.drive(0.0, 0.0)
        self.pairs.rebuild(0.0)
        self.neighbours.follow()
        self.find_rates(0.0)
        self.advance_state(0.0, 0.0)
        self.neighbours.find_forces()
        self.advance_fluxes(0.0)
        self.kicks.viscous_heat.continues = previous_state.take_forces(self.comm, scene, self)
        if self.kicks.viscous_heat.continues:
            # weights of pairs in tension follow the stress
            self.neighbours.follow()

    def resume(self) -> None:
        """Continue with the list of the checkpoint; collective."""
        assert self.checkpoint is not None
        if self.deletion is not None:
            self.deletion.lighten()
        self.pairs.restore(self.checkpoint["pairs"], self.checkpoint["time"])
        self.neighbours.follow()

    def state(self) -> dict[str, Any]:
        """The list, whether it is used up, and viscous heat to come; collective."""
        rebuild_needed = anywhere(self.comm, self.rebuild_needed)
        heat = self.kicks.viscous_heat.state()
        kept = {"pairs": self.pairs.state(), "time": self.time, "rebuild_needed": rebuild_needed, "viscous_heat": heat}
        if self.planes is not None:
            kept["plane_forces"] = PerRank(*self.neighbours.plane_forces.ravel())
        kept["torn"] = anywhere(self.comm, self.neighbours.torn)
        return kept | {"last_step": self.kicks.leapfrog.last_step}

    def set_state(self, state: dict[str, Any]) -> None:
        self.checkpoint, self.time, self.rebuild_needed = state, state["time"], state["rebuild_needed"]
        self.kicks.leapfrog.last_step, self.neighbours.torn = state["last_step"], state["torn"]
        self.kicks.viscous_heat.set_state(self.comm, state["viscous_heat"])
        if self.planes is not None:
            forces = np.array(own_share(self.comm, state["plane_forces"]))
            self.neighbours.plane_forces = forces.reshape(-1, 2, self.dimension)
