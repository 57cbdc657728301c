"""What a step of the motion takes from loads and boundaries and what it loses, for the ledger."""

import numpy as np

from parsolid.methods.failure_fields import DELETED_KINETIC
from parsolid.methods.mpm.grid import energy_of_particle_changes, kinetic_energy
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.nodes import Nodes
from parsolid.methods.mpm.waiting import WaitingImpulses
from parsolid.methods.protocol import EnergyLedger


class StepEnergies:
    """Made before the particles move, booked after. forces (capacity, 4): of the loads on the particles
    [N], or None; waiting: where something acts between steps.
    """

    def __init__(
        self, points: MaterialPoints, nodes: Nodes, forces: np.ndarray | None, waiting: WaitingImpulses | None
    ):
        self.points, self.nodes, self.forces, self.waiting = points, nodes, forces, waiting
        settings = points.settings
        self.adds = settings.adds_changes
        self.again = settings.order == "musl"
        self.loses = "velocity_slope" in points or not (self.adds and self.again) or waiting is not None
        self.kinetic = kinetic_energy(points.owned, points.motion) if self.loses else 0.0
        kept = forces is not None or (self.adds and not self.again and waiting is None)
        self.before = points.motion[: points.owned].copy() if kept else None

    def book(
        self, ledger: EnergyLedger, step: float, boundaries: tuple[float, float], materials: dict[str, float]
    ) -> None:
        """boundaries: work of walls and driven regions and what of it is lost [J]; materials: further terms of the
        ledger [J].
        """
        supplied, caught = boundaries
        kicked = step if self.waiting is None else self.waiting.kicked(step)
        if self.forces is not None and self.before is not None:
            moved = _moved(self.before, self.points.motion[: self.points.owned], step)
            moved *= kicked / step if step > 0.0 else 1.0
            supplied += float((self.forces[: len(moved), :3] * moved).sum())
            if self.nodes.surface_loads is not None:
                self.nodes.surface_loads.tell(kicked, moved[:, : self.points.dimension])
        lost = self._lost() + caught if self.waiting is None else self._not_gained(self.waiting, supplied)
        ledger.add(1.0, 0.0, lost, supplied)
        for told in self.nodes.told:
            told.finish(kicked, ledger)
        for name, energy in (materials | self._delete(step)).items():
            ledger.add_term(name, energy)

    def _delete(self, step: float) -> dict[str, float]:
        """Terms [J] of what is deleted, which leaves after the step, so that it is not taken for a loss of the
        scheme."""
        waiting = self.waiting
        if waiting is None:
            return self.points.delete_failed()
        waiting.follow(step)
        gone = self.points.delete_failed()
        if gone:
            # velocities that went with it were behind, too
            gone[DELETED_KINETIC] -= waiting.follow(step)
        return gone

    def _not_gained(self, waiting: WaitingImpulses, supplied: float) -> float:
        """What particles have not gained [J] of the work that forces did along the ways of matter, and of what loads
        and boundaries supplied."""
        return self.kinetic + waiting.work + supplied - kinetic_energy(self.points.owned, self.points.motion)

    def _lost(self) -> float:
        """What the scheme takes in the step [J].

        Particles do not keep D = K_p + dK_i - K_p+ of the nodes' kinetic energy. MUSL strains matter with velocities
        u_i of the momentum that is mapped back instead of v_i, and loses sum_i m_i a_i . (v_i - u_i) / 2 less: where
        particles add the changes a_i alone, nothing. USL strains with all of a_i, of which the next step's nodes keep
        but what particles took: it loses L = (sum_i m_i a_i^2 - sum_p m_p (sum_i w_ip a_i)^2) / 2 once more there.
        """
        if not self.loses:
            return 0.0
        lost = self.kinetic + self.nodes.kinetic_gain() - kinetic_energy(self.points.owned, self.points.motion)
        if self.again:
            return lost - self.nodes.energy_of_mapping_back()
        return lost + self._filtered() if self.adds else lost

    def _filtered(self) -> float:
        """L above [J]."""
        assert self.before is not None
        return self.nodes.energy_of_changes() - float(energy_of_particle_changes(self.before, self.points.motion))


def _moved(before: np.ndarray, after: np.ndarray, step: float) -> np.ndarray:
    """By what (n, 3) [m] forces act on particles: the nodal velocity in the middle of the step is the mean of the old
    and the new."""
    return np.asarray(after[:, :3] - before[:, :3] - 0.5 * step * (after[:, 4:7] - before[:, 4:7]))
