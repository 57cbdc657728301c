"""What a step of the motion takes from loads and boundaries and what it loses, for the ledger."""

import numpy as np

from parsolid.methods.mpm.grid import kinetic_energy
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.nodes import Nodes
from parsolid.methods.mpm.settings import MaterialPoint as MaterialPointSettings
from parsolid.methods.protocol import EnergyLedger


class StepEnergies:
    """Made before the particles move, booked after. forces (capacity, 4): of the loads on the particles
    [N], or None.
    """

    def __init__(self, points: MaterialPoints, nodes: Nodes, forces: np.ndarray | None):
        self.points, self.nodes, self.forces = points, nodes, forces
        self.passes = _lossy_passes(points.settings)
        self.kinetic = kinetic_energy(points.owned, points.motion) if self.passes else 0.0
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
        if self.passes:
            filtered = self.kinetic + self.nodes.kinetic_gain() - kinetic_energy(self.points.owned, self.points.motion)
            lost = self.passes * filtered
        ledger.add(1.0, 0.0, lost + caught, supplied)
        for name, energy in materials.items():
            ledger.add_term(name, energy)


def _lossy_passes(settings: MaterialPointSettings) -> int:
    """How often a step loses what particles do not keep of the nodes' kinetic energy, D = K_p + dK_i - K_p+.

    With FLIP, D = (sum_i m_i a_i^2 - sum_p m_p (sum_i w_ip a_i)^2) / 2. USL strains matter with all of a_i, of which
    the next step's nodes keep but what the particles took: it loses D in the motion and D in the strain. MUSL strains
    with what they took, and has neither. Transfers that filter the velocity itself lose D.
    """
    if settings.transfer == "apic" or settings.flip_fraction < 1.0:
        return 1
    return 2 if settings.order == "usl" else 0


def _work(forces: np.ndarray, before: np.ndarray, after: np.ndarray, step: float) -> float:
    """Work [J] on particles: the nodal velocity in the middle of the step is the mean of the old and the new."""
    moved = after[:, :3] - before[:, :3] - 0.5 * step * (after[:, 4:7] - before[:, 4:7])
    return float((forces[: len(after), :3] * moved).sum())
