"""Heat through surfaces: where it enters, and what it does to the temperatures of nodes near it.

The grid takes a flux up by the weights of the surface itself, not of the particles beside it, and particles count at
the nodes with the slopes of their temperatures, so that a linear profile is one on the grid. Behind a mirror plane
through which heat enters the image has T - 2 d q/kappa at a depth d: it continues the profile, which an image of the
same temperatures would bend.
"""

import numpy as np

from parsolid.boundary.heat import HeatSupply
from parsolid.methods.mpm import heat as grid_heat
from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.methods.mpm.nodes import Nodes
from parsolid.numerics.lanes import aligned_zeros


class HeatedSurfaces:
    """Powers of a rank's particles at surfaces [W], one surface after the other, each with the places it enters at."""

    def __init__(self, supply: HeatSupply, points: MaterialPoints):
        """supply: whose surfaces these are."""
        self.supply, self.points = supply, points
        self._feet, self._power = aligned_zeros((0, 4)), np.zeros((0, 1))

    def supply_to(self, nodes: Nodes, time: float) -> None:
        """Add the heat of a time [s] to the flows of the nodes; after `heat.conduct`."""
        points, owned = self.points, self.points.owned
        if len(self._feet) < points.capacity:
            self._feet, self._power = aligned_zeros((points.capacity, 4)), np.zeros((points.capacity, 1))
        for plane, surface in zip(self.supply.planes, self.supply.surfaces):
            self._power[:owned] = 0.0
            surface.put(self._power[:owned], time)
            rows = np.flatnonzero(self._power[:owned, 0])
            self._feet[rows, : points.dimension] = self._places(rows, plane.axis, plane.offset)
            grid_heat.supply_at_faces(nodes.interpolation, self._feet, self._power[:, 0], nodes.heat, nodes.partial)

    def _places(self, rows: np.ndarray, axis: int, offset: float) -> np.ndarray:
        """Places (k, d) [m], of the weights' configuration, of the surface's points nearest to particles."""
        points, d = self.points, self.points.dimension
        reference = points.owned_rows("reference_position")[rows][:, :d]
        beyond = offset - reference[:, axis]
        if points.where != "motion":
            reference[:, axis] = offset
            return reference
        # column `axis` of F: 11, 12, 21, 22 in two dimensions
        column = points.storage("deformation_gradient")[axis : d * d : d][:, rows].T
        return np.asarray(points.motion[rows, :d] + column * beyond[:, None])
