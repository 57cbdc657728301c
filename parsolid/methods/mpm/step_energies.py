"""What a step of the motion takes from loads and boundaries and what it loses, for the ledger."""

import numpy as np

from parsolid.methods.mpm.grid import kinetic_energy
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.nodes import Nodes
from parsolid.methods.protocol import EnergyLedger


class StepEnergies:
    """Made before the particles move, booked after. forces (capacity, 4): of the loads on the particles
    [N], or None.
    """

    def __init__(self, points: MaterialPoints, nodes: Nodes, forces: np.ndarray | None):
        self.points, self.nodes, self.forces = points, nodes, forces
        # what filters the particles' velocities loses kinetic energy; FLIP alone does not
        settings = points.settings
        self.filters = settings.transfer == "apic" or settings.flip_fraction < 1.0
        self.kinetic = kinetic_energy(points.owned, points.motion) if self.filters else 0.0
        self.before = None if forces is None else points.motion[: points.owned].copy()

    def book(
        self, ledger: EnergyLedger, step: float, boundaries: tuple[float, float], materials: dict[str, float]
    ) -> None:
        """boundaries: work of walls and driven regions and what of it is lost [J]; materials: further terms of the
        ledger [J].
        """
        supplied, caught = boundaries
        if self.forces is not None and self.before is not None:
            supplied += _work(self.forces, self.before, self.points.motion[: self.points.owned], step)
        lost = 0.0
        if self.filters:
            lost = self.kinetic + self.nodes.kinetic_gain() - kinetic_energy(self.points.owned, self.points.motion)
        ledger.add(1.0, 0.0, lost + caught, supplied)
        for name, energy in materials.items():
            ledger.add_term(name, energy)


def _work(forces: np.ndarray, before: np.ndarray, after: np.ndarray, step: float) -> float:
    """Work [J] on particles: the nodal velocity in the middle of the step is the mean of the old and the new."""
    moved = after[:, :3] - before[:, :3] - 0.5 * step * (after[:, 4:7] - before[:, 4:7])
    return float((forces[: len(after), :3] * moved).sum())
