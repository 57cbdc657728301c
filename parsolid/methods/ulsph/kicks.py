"""Half kicks of updated-Lagrangian SPH with rigid walls, and the energies of a step."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.boundary.walls import Walls
from parsolid.methods.leapfrog import Leapfrog, taken_by_step_change
from parsolid.methods.protocol import EnergyLedger
from parsolid.per_rank import PerRank, own_share


class HalfKick(NamedTuple):
    """Energies of a half kick [J]: external work; loss to the artificial viscosity; kinetic offset of all other forces;
    loss to walls and to impulses of contact; the part of the viscous loss that stored energies take up a step later."""

    external: float
    viscous: float
    offset: float
    lost: float
    to_come: float


class ViscousHeat:
    """Heat of the artificial viscosity, whose forces act in the half steps before and after their time. Laws take up
    the heat of both in the second one.

    step: the last one [s], 0 before the first; continues: whether the first step starts from another run's forces,
    whose last step is taken to be as long; to_come [J]: energy that the viscosity took in the last closing kick from
    particles of this rank whose stored energy gets it in the next step.
    """

    def __init__(self) -> None:
        self.step = self.to_come = 0.0
        self.continues = False

    def mean_step(self, step: float) -> float:
        """Mean length of the step before and this one [s]."""
        return step if self.continues else 0.5 * (self.step + step)

    def finish(self, step: float, taken: float) -> float:
        """End a step [s] whose closing kick took an energy [J]; the change of `to_come` [J]."""
        change = float(taken - self.to_come)
        self.step, self.to_come = step, float(taken)
        self.continues = self.continues and step == 0.0
        return change

    def state(self) -> dict[str, Any]:
        """The step, and `to_come` of each rank."""
        return {"step": self.step, "to_come": PerRank(self.to_come)}

    def set_state(self, comm: Any, state: dict[str, Any]) -> None:
        """Take back what `state` gave; on another number of ranks the first has all."""
        self.step, self.to_come = state["step"], float(own_share(comm, state["to_come"])[0])


class Kicks:
    """The half kicks of a step of one rank's particles: those of `leapfrog`, after which walls catch particles.

    opening, closing: energies of the two kicks.
    """

    def __init__(self, system: Any) -> None:
        """system: `system.UpdatedLagrangianSPH`, whose particles and conditions are made. Collective."""
        self.system, self.particles, self.conditions = system, system.particles, system.conditions
        self.walls = Walls(system.comm, self.conditions)
        self.leapfrog = Leapfrog(self.particles, self.conditions, "force", "viscous_force")
        self.viscous_heat = ViscousHeat()
        self.opening = self.closing = HalfKick(0.0, 0.0, 0.0, 0.0, 0.0)

    def open_step(self, time: float, step: float) -> None:
        """Opening half kick of a step [s] with the forces of a time [s]; walls catch particles after it."""
        before = self.particles.owned_rows("velocity").T.copy()
        self.leapfrog.open_step(time, step)
        self.opening = self._energies(True, time, step, before, 0.0)

    def close_step(self, time: float, step: float) -> None:
        """Closing half kick of a step [s] with the forces of a time [s], then impulses of contact, then walls."""
        before = self.particles.owned_rows("velocity").T.copy()
        self.leapfrog.close_step(time, step, self.system.substeps)
        impulse = self.leapfrog.impulse
        if impulse is not None:
            power, viscous = self.particles.owned_rows("impulse_power"), self.particles.owned_rows("viscous_force")
            power[:] = 0.0
            power[impulse.rows] = np.sum(viscous[impulse.rows] * impulse.change, axis=1)
            before[:, impulse.rows] += impulse.change.T
        self.closing = self._energies(False, time, step, before, self.leapfrog.given)

    def _energies(self, opening: bool, time: float, step: float, before: np.ndarray, gained: float) -> HalfKick:
        """Let walls catch particles; energies of a half kick from velocities `before` (d, owned), in which impulses
        have given energy [J] beyond their work."""
        of, kick = self.particles.owned_rows, self.leapfrog.opening if opening else self.leapfrog.closing
        # the loss to the viscosity is that on the mean of both velocities, which laws take up as heat
        external, dissipated, offset, centred = kick
        offset += -centred if opening else centred
        energies = np.array([external, dissipated + centred, offset, -gained])
        if self.system.planes is not None:
            # images of moving planes do work, of which the viscosity takes its part
            velocity = 0.5 * self.system.planes.velocities[:, : len(before)]
            of_stress, of_viscosity = 0.5 * step * np.einsum("ckj,cj->k", self.system.neighbours.plane_forces, velocity)
            energies[:2] += of_stress + of_viscosity, of_viscosity
        if self.walls.all:
            acting = of("force").T, of("viscous_force").T, self.leapfrog.external
            energies += self.walls.catch(time, 0.5 * step, opening, before, acting)
        to_come = energies[1]
        if self.warms and not all(solid.stores_heat for solid in self.system.solids):
            mean = 0.5 * (before + of("velocity").T)
            storing = [here for solid, here in self.system.parts() if solid.stores_heat]
            to_come = -0.5 * step * sum(np.sum(of("viscous_force").T[:, here] * mean[:, here]) for here in storing)
        return HalfKick(*map(float, (*energies, to_come)))

    def book(self, step: float, ledger: EnergyLedger, plastic: float, lost: float) -> None:
        """Enter the energies of a step [s]; plastic, lost: plastic heat and numerical loss of the state [J]."""
        opening, closing, system = self.opening, self.closing, self.system
        guided = self.conditions.end_step(step, ledger)
        taken = taken_by_step_change(opening.offset, self.leapfrog.last_step, step)
        self.leapfrog.last_step = step
        lost += opening.lost + closing.lost + taken
        ledger.add(1.0, plastic, lost, opening.external + closing.external + guided)
        ledger.add_term("viscous_dissipation", self._viscous_loss(step, opening.viscous + closing.viscous))
        if self.warms:
            ledger.add_term("viscous_heat_to_come", self.viscous_heat.finish(step, closing.to_come))
        ledger.add_term("kinetic_offset", closing.offset - opening.offset + taken)
        ledger.add_term("heat_supplied", system.temperatures.supplied)
        ledger.add_term("heat_stored", system.temperatures.stored)
        for part in (*system.solids, *([] if system.deletion is None else [system.deletion])):
            for name, energy in part.take_energies().items():
                ledger.add_term(name, energy)

    def _viscous_loss(self, step: float, taken: float) -> float:
        """Energy [J] that the viscosity took in a step [s] from particles whose stored energy does not get it; taken
        [J]: from all particles."""
        if not self.warms:
            return taken
        heat = self.particles.owned_rows("viscous_heat")
        return step * float(sum(heat[here].sum() for solid, here in self.system.parts() if not solid.stores_heat))

    @property
    def warms(self) -> bool:
        """Whether stored energies of any law, the same on all ranks, take up the heat of the viscosity."""
        return self.system.viscosity is not None and any(solid.stores_heat for solid in self.system.solids)
