"""What particles and nodes give to one another in a step, in the two orders that a scene may choose."""

import numpy as np

from decomposition.recalled import RecalledEach
from parsolid.methods.mpm.gather import gather
from parsolid.methods.mpm.grid import CauchyStress, FirstPiolaKirchhoffStress
from parsolid.methods.mpm.grid_conditions import GridConditions
from parsolid.methods.mpm.material_points import MaterialPoints, VelocityTransfer
from parsolid.methods.mpm.nodes import Nodes
from parsolid.methods.mpm.scatter import scatter
from parsolid.methods.mpm.waiting import WaitingImpulses


class UpdateStressLast:
    """USL: velocity gradients are those of the nodes' new velocities."""

    def __init__(self, points: MaterialPoints, nodes: Nodes, conditions: GridConditions):
        self.points, self.nodes, self.conditions = points, nodes, conditions
        # lists of cells, transfers, stresses and loads are other objects of the same types at every step
        self._scatter = RecalledEach(scatter, free=(0, 2, 3, 4))
        self._gather_kernel = RecalledEach(gather, free=(0, 3, 4, 7))
        self._local = points.settings.transfer == "flip" and "velocity_slope" in points
        self._seen, self._beside = -1, np.zeros(0, bool)
        # where something acts between steps
        self.waiting: WaitingImpulses | None = None

    def particles_to_nodes(self, stress: CauchyStress | FirstPiolaKirchhoffStress, forces: np.ndarray | None) -> None:
        """Mass, momentum and force of all ranks' particles; stress: see `scatter`; forces (capacity, 4) [N] of loads,
        or None.
        """
        points, nodes = self.points, self.nodes
        self._keep_slopes_beside_driven()
        nodes.clear(nodes.motion)
        arrays = (forces, nodes.motion, nodes.partial)
        # impulses make forces in some steps, loads in all
        self._scatter(forces is None, nodes.interpolation, points.motion, points.velocity_transfer, stress, *arrays)
        nodes.sum("motion")

    def nodes_to_particles(self, time: float, step: float) -> float:
        """Velocities, places and velocity gradients after a step [s] that ends at a time [s].

        Gives what is lost [J] where boundaries held nodes to which particles brought a velocity.
        """
        self._move(step, self.points.velocity_transfer, None)
        return 0.0

    def _move(self, step: float, transfer: VelocityTransfer | None, remapped: np.ndarray | None) -> None:
        """Places and velocity gradients.

        Where something acts between steps, by places, and particles forget velocities that nodes do not see, places
        follow the velocities that strain matter: motion that strains nothing would give way to it for ever.
        """
        rate, waiting = self.points.storage("velocity_gradient"), self.waiting
        ways = None if waiting is None or step == 0.0 else waiting.ways()
        if ways is None or self.points.settings.adds_changes:
            self._gather(self.nodes.motion, step, transfer, rate, remapped, ways)
        else:
            self._gather(self._strained_by(), step, transfer, rate, None, ways)
        if ways is not None and waiting is not None:
            waiting.note_work(step)

    def _strained_by(self) -> np.ndarray:
        """Nodes (slots, 8) whose velocities strain matter."""
        return self.nodes.motion

    def _keep_slopes_beside_driven(self) -> None:
        """Of FLIP's particles only those with a driven node in their stencil give slopes.

        Without them the nodes' velocities before they are driven are not those of the particles even where these move
        as the nodes are driven to, and what changes them in every step drifts into the particles.
        """
        if not self._local:
            return
        nodes, cells, slopes = self.nodes, self.nodes.ranks.cells, self.points.storage("velocity_slope")
        if self._seen != nodes.changes:
            self._seen = nodes.changes
            self._beside = np.asarray(self.conditions.driven_nodes(nodes)[cells.stencil]).any(axis=1).astype(bool)
        beside = cells.order[: cells.start[-1]][np.repeat(self._beside, np.diff(cells.start))]
        kept = slopes[beside]
        slopes[: self.points.owned] = 0.0
        slopes[beside] = kept

    def _gather(
        self,
        nodes: np.ndarray,
        step: float,
        transfer: VelocityTransfer | None,
        rate: np.ndarray | None,
        remapped: np.ndarray | None,
        ways: np.ndarray | None,
    ) -> None:
        what = transfer is None, rate is None, remapped is None, ways is None
        arrays = self.nodes.interpolation, nodes, self.points.motion
        self._gather_kernel(what, *arrays, step, transfer, rate, remapped, ways)


class ModifiedUpdateStressLast(UpdateStressLast):
    """MUSL: velocity gradients are those of the particles' new velocities, mapped to the nodes once more."""

    def nodes_to_particles(self, time: float, step: float) -> float:
        """See `UpdateStressLast`."""
        self._gather(self.nodes.motion, step, self.points.velocity_transfer, None, None, None)
        lost = self._map_back(time)
        self._move(step, None, self.nodes.again)
        return lost

    def _strained_by(self) -> np.ndarray:
        """See `UpdateStressLast`."""
        return self.nodes.again

    def _map_back(self, time: float) -> float:
        """Nodal velocities of the particles' momentum; what the boundaries do to them is no work."""
        points, nodes = self.points, self.nodes
        self._keep_slopes_beside_driven()
        nodes.clear(nodes.again)
        arrays = (None, nodes.again, nodes.partial)
        self._scatter("again", nodes.interpolation, points.motion, points.velocity_transfer, None, *arrays)
        nodes.sum("again")
        nodes.find_velocities()
        return self.conditions.obey(nodes, nodes.again, time)[1]


ORDERS = {"usl": UpdateStressLast, "musl": ModifiedUpdateStressLast}
