"""The total-Lagrangian form of the material point method: a grid on the undeformed body, so that weights and cells never change.

Accurate where the updated form's quadrature is not, up to moderate strain. Against locking, the dilatation rate of the particles of a
cell is their mean, and so is, adjointly, the pressure of the internal force (see `methods.mpm.lagrangian`).
"""

import numpy as np

from parsolid.methods.mpm import lagrangian as kernels
from parsolid.methods.mpm.grid import FirstPiolaKirchhoffStress


class ReferenceGrid:
    """What the total-Lagrangian form adds to a step.

    stretch: the smallest of this rank's particles; slowness [s/m]: the least time that waves take over a metre of the undeformed body.
    """

    def __init__(self, points, space):
        """points: `MaterialPoints` with the arrays "reference" and "nominal"; space: Plane, Axisymmetric or Space."""
        self.points, self.space, self.stretch, self.slowness = points, space, 1.0, np.inf

    def resume(self) -> None:
        """Weights and forces from fields that were put back."""
        points, owned = self.points, self.points.owned
        points.store["reference"][:owned, : points.dimension] = points.table.owned_rows("reference_position")
        self._finish()

    @property
    def stress(self) -> FirstPiolaKirchhoffStress:
        """What the particles give to the nodes' forces."""
        return FirstPiolaKirchhoffStress(self.points.store["nominal"])

    def advance_stress(self, grid, step: float) -> tuple[bool, float, float, float]:
        """As `MaterialPoints.advance_stress`, from velocity gradients by reference place; grid: `methods.mpm.grid.Grid`."""
        points, cells = self.points, len(grid.base)
        kernels.to_spatial_gradient(0, points.owned, self.space, points.store["deformation"], points.rate)
        kernels.average_dilatation(0, cells, self.space, grid, points.motion, points.rate)
        result = points.advance_stress(step)
        kernels.average_pressure(0, cells, self.space, grid, points.motion, points.stress)
        self._finish()
        return result

    def _finish(self) -> None:
        points, deformation = self.points, self.points.store["deformation"]
        nominal = points.store["nominal"]
        kernels.to_first_piola_kirchhoff(0, points.owned, self.space, deformation, points.stress, nominal)
        self.stretch, self.slowness = kernels.smallest_stretches(
            0, points.owned, self.space, deformation, points.stress
        )


def reference_rows(position: np.ndarray) -> np.ndarray:
    """Reference positions (n, d) as rows (n, 4) for the grid's kernels."""
    result = np.zeros((len(position), 4))
    result[:, : position.shape[1]] = position
    return result
