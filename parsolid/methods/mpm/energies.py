"""The energy balance of a step: work of loads and boundaries, and losses of the transfers."""

import numpy as np

from parsolid.boundary.loads import Loads
from parsolid.kernels import kernel
from parsolid.methods.failure_fields import DELETED_KINETIC
from parsolid.methods.mpm.external_forces import ExternalForces, LaggingWork, power
from parsolid.methods.mpm.grid import Nodes
from parsolid.methods.mpm.hyperelastic import MATERIAL
from parsolid.methods.mpm.points import MaterialPoints
from parsolid.methods.protocol import EnergyLedger
from parsolid.scene.method_settings import KINETIC_OFFSET


@kernel
def kinetic_energy(owned, motion):
    """sum m v^2/2 [J] of particles."""
    energy = 0.0
    for p in range(owned):
        energy += motion[p, 3] * (motion[p, 4] ** 2 + motion[p, 5] ** 2 + motion[p, 6] ** 2)
    return 0.5 * energy


@kernel
def energy_of_particle_changes(before, motion):
    """sum_p m_p (v_p - v_p before)^2 / 2 [J] of the particles in before (n, 8)."""
    energy = 0.0
    for p in range(len(before)):
        square = 0.0
        for d in range(4, 7):
            square += (motion[p, d] - before[p, d]) ** 2
        energy += motion[p, 3] * square
    return 0.5 * energy


@kernel
def nodal_energies(count, nodes, remapped, share):
    """Energies [J] of the step's changes a of nodal velocities v, as far as this rank counts nodes: the gain of kinetic
    energy sum m a . (v - a/2); sum m a^2 / 2; and sum m a . (v - u) / 2 with the remapped velocities u, if any."""
    gain, changes, remapping = 0.0, 0.0, 0.0
    for i in range(count):
        mass = share[i] * nodes[i, 3]
        for d in range(3):
            change = nodes[i, 4 + d]
            gain += mass * change * (nodes[i, d] - 0.5 * change)
            changes += 0.5 * mass * change * change
            if remapped is not None:
                remapping += 0.5 * mass * change * (nodes[i, d] - remapped[i, d])
    return gain, changes, remapping


class StepEnergies:
    """The energy balance of the transfers in one step; made before the particles give to the nodes, booked at its end.

    Particles do not keep D = K_p + dK_i - K_p+ of the nodes' kinetic energy. MUSL strains matter with velocities u_i of
    the momentum that is mapped back instead of v_i, and loses sum_i m_i a_i . (v_i - u_i) / 2 less: where particles add
    all of the changes a_i, nothing. USL strains with all of a_i, of which the next step's nodes keep only what
    particles took: it loses L = (sum_i m_i a_i^2 - sum_p m_p (sum_i w_ip a_i)^2) / 2 more. Where particles forget
    velocities, stresses have worked on what the next step's nodes no longer have: there D = K_p + W - K_p+, W the work
    of the step's stresses, for the first part on the strains of the last step, as velocities are behind places.

    Kinetic energy is that of velocities behind places; the work of stresses that they do not have yet is its offset.
    """

    def __init__(
        self,
        points: MaterialPoints,
        nodes: Nodes,
        forces: np.ndarray | None,
        external: ExternalForces | None,
        behind: LaggingWork,
    ):
        """forces (capacity, 4) [N]: of the loads, or None; external: where contact, ties or tools act."""
        self.points, self.nodes, self.forces, self.external, self.behind = points, nodes, forces, external, behind
        settings = points.settings
        self.adds_changes, self.remaps = settings.adds_changes, settings.order == "musl"
        self.loses = "velocity_slope" in points or not (self.adds_changes and self.remaps) or external is not None
        self.forgets = not self.adds_changes and not self.remaps
        self.work = 0.0
        self.kinetic = kinetic_energy(points.owned, points.motion) if self.loses else 0.0
        kept = forces is not None or (self.adds_changes and not self.remaps and external is None)
        self.before = points.motion[: points.owned].copy() if kept else None

    def note_work(self, step: float) -> None:
        """Work of stresses and external forces in a step [s] that has strained particles, before stresses change."""
        if step == 0.0:
            return
        if self.external is not None:
            self.external.note_work(step)
            self.work = self.external.work
        elif self.forgets:
            storage = self.points.storage
            rate = power(self.points.owned, storage("stress_and_volume"), storage("velocity_gradient"))
            self.work = self.behind.work - (step - self.behind.lag) * rate

    def book(
        self,
        ledger: EnergyLedger,
        step: float,
        boundaries: tuple[float, float],
        materials: dict[str, float],
        loads: Loads,
    ) -> None:
        """boundaries: work of walls and driven regions and what is lost there [J]; materials: terms of the laws [J]."""
        supplied, caught = boundaries
        duration = step if self.external is None else self.external.duration(step)
        if self.forces is not None and self.before is not None and step > 0.0:
            # the nodal velocity in the middle of the step is the mean of the old and the new one
            after = self.points.motion[: self.points.owned]
            moved = after[:, :3] - self.before[:, :3] - 0.5 * step * (after[:, 4:7] - self.before[:, 4:7])
            mean = moved / step
            supplied += duration * float((self.forces[: len(mean), :3] * mean).sum())
            loads.observe(duration, mean[:, : self.points.dimension].T)
        before = self.behind.work
        if self.external is not None or self.forgets:
            lost = self.kinetic + self.work + supplied - self._kinetic_now()
        else:
            lost = self._lost() + caught
        ledger.add(1.0, materials.pop(MATERIAL, 0.0), lost, supplied)
        loads.report(duration, ledger)
        # deleted after the balance of the step, which would count the energy as a loss
        in_halves = self.external is not None
        self.behind.follow(step, in_halves)
        if self.external is not None and step > 0.0:
            self.external.goes_on = False
        gone = self.points.delete_failed()
        if gone:
            loads.masses_changed()
            # velocities that went with it were half a step behind, too
            gone[DELETED_KINETIC] -= self.behind.follow(step, in_halves)
        for name, energy in (materials | gone).items():
            ledger.add_term(name, energy)
        if self.external is None:
            ledger.add_term(KINETIC_OFFSET, before - self.behind.work)

    def _kinetic_now(self) -> float:
        return float(kinetic_energy(self.points.owned, self.points.motion))

    def _lost(self) -> float:
        """Energy that the transfers lose in the step [J]."""
        if not self.loses:
            return 0.0
        nodes = self.nodes
        remapped = nodes.remapped if self.remaps else None
        gain, changes, remapping = nodal_energies(nodes.count, nodes.motion, remapped, nodes.share)
        lost = self.kinetic + gain - self._kinetic_now()
        if self.remaps:
            return float(lost - remapping)
        if self.adds_changes:
            lost += changes - energy_of_particle_changes(self.before, self.points.motion)
        return float(lost)
