"""The total-Lagrangian form of the material point method: a grid on the undeformed body, so that weights and cells
never change.

Accurate where the updated form's quadrature is not, up to moderate strain. Against locking, the dilatation rate of the
particles of a cell is their mean, and so is, adjointly, the pressure of the internal force (see
`methods.mpm.lagrangian`).
"""

import numpy as np

from parsolid.methods.mpm import lagrangian as kernels
from parsolid.methods.mpm.grid import FirstPiolaKirchhoffStress
from parsolid.methods.mpm.nodes import Nodes
from parsolid.methods.mpm.stress_update import StressUpdate


class ReferenceGrid:
    """What the total-Lagrangian form adds to a step.

    stretch: the smallest of this rank's particles; slowness [s/m]: the least time that waves take over a metre of the
    undeformed body.
    """

    def __init__(self, materials: StressUpdate, nodes: Nodes):
        self.points, self.materials, self.nodes, self.space = materials.points, materials, nodes, nodes.space
        self.stretch, self.slowness = 1.0, np.inf

    def resume(self) -> None:
        """Forces from fields that were put back."""
        self._finish()

    @property
    def on_nodes(self) -> FirstPiolaKirchhoffStress:
        """What the particles give to the nodes' forces."""
        return FirstPiolaKirchhoffStress(self.points.storage("nominal_stress_and_volume"))

    def advance(self, step: float) -> tuple[bool, dict[str, float]]:
        """As `StressUpdate.advance`, from velocity gradients by reference place."""
        points, grid, storage = self.points, self.nodes.interpolation.grid, self.points.storage
        cells = len(grid.base)
        rate, stress = storage("velocity_gradient"), storage("stress_and_volume")
        kernels.to_spatial_gradient(0, points.owned, self.space, storage("deformation_gradient"), rate)
        kernels.average_dilatation(0, cells, self.space, grid, points.motion, rate)
        result = self.materials.advance(step)
        kernels.average_pressure(0, cells, self.space, grid, points.motion, stress)
        self._finish()
        return result

    def _finish(self) -> None:
        owned, storage = self.points.owned, self.points.storage
        tensors = storage("deformation_gradient"), storage("stress_and_volume")
        kernels.to_first_piola_kirchhoff(0, owned, self.space, *tensors, storage("nominal_stress_and_volume"))
        self.stretch, self.slowness = kernels.smallest_stretches(0, owned, self.space, *tensors)
