"""Whether momentum is kept where nothing acts from outside: linear and angular, of all particles of a scene."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from parsolid.methods.failure_fields import DELETED_KINETIC
from parsolid.methods.protocol import ParticleSystem
from parsolid.observables.declared import Observables
from parsolid.observables.quantities import AngularMomentum
from parsolid.scene import Scene

# kinds of boundaries that exert no force
_FORCELESS = ("temperature", "heat-flux", "micro-hard")
# of sum m |x| |v|, up to which the motion about the centre of mass may be rounding
_ROUND_OFF = 1e-9


def isolated(scene: Scene) -> bool:
    """Whether only the bodies of a scene act on one another: no supports, loads or tools, and no mass that goes."""
    loads = scene.loads
    loaded = loads.acceleration is not None or loads.body_force is not None or bool(loads.manufactured)
    held = any(one.kind not in _FORCELESS for one in scene.boundaries)
    deletes = any(DELETED_KINETIC in getattr(body.material, "ledger_terms", {}) for body in scene.bodies)
    about_an_axis = any(getattr(one.settings, "geometry", None) == "axisymmetric" for one in scene.systems)
    return not (loaded or held or scene.tools or deletes or about_an_axis)


class MomentumBalance:
    """What of the momenta is lost, over the largest sums of their particles' parts.

    first, largest: linear momentum and angular momentum about the origin at the start, and the largest
    sum m |v| [kg m/s] and sum m |x - x_c| |v - v_c| [kg m^2/s] about the centre of mass so far, 0 where that is
    rounding; lost: the largest changes of the momenta so far. None until `check`.
    """

    def __init__(self, comm: Any, systems: Sequence[ParticleSystem]) -> None:
        self.comm, self.observables = comm, Observables(systems)
        self.first: np.ndarray | None = None
        self.largest, self.lost = np.zeros(2), np.zeros(2)

    def check(self) -> None:
        """Take the present state in; collective."""
        momenta, sizes, centre = self._present()
        d = self.observables.dimension
        if self.first is None:
            self.first = momenta
        change = momenta - self.first
        # what a change of linear momentum does to the angular momentum about the origin is counted once
        change[d:] -= _cross(centre, change[:d])
        self.largest = np.maximum(self.largest, sizes)
        self.lost = np.maximum(self.lost, [np.linalg.norm(change[:d]), np.linalg.norm(change[d:])])

    def _present(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Momenta, sizes (2,) of their parts, centre of mass [m]; of all ranks."""
        watched = self.observables
        d, mass = watched.dimension, watched.tributary_mass
        x, v = watched.rows("position"), watched.rows("velocity")
        angular = AngularMomentum("", [""] * (3 if d == 3 else 1)).part(watched)
        mine = np.concatenate(([mass.sum()], mass @ x, mass @ v, angular))
        total = np.empty_like(mine)
        self.comm.Allreduce(mine, total)
        centre, mean = (total[k : k + d] / (total[0] or 1.0) for k in (1, 1 + d))
        arm, speed = np.linalg.norm(x - centre, axis=1), np.linalg.norm(v - mean, axis=1)
        whole = np.linalg.norm(v, axis=1)
        own = np.array([mass @ whole, mass @ (arm * speed), mass @ (np.linalg.norm(x, axis=1) * whole)])
        sizes = np.empty_like(own)
        self.comm.Allreduce(own, sizes)
        linear, angular, about_origin = sizes
        return total[1 + d :], np.array([linear, angular if angular > _ROUND_OFF * about_origin else 0.0]), centre

    def shares(self) -> tuple[float, float]:
        """Linear and angular momentum that were lost, over the largest sums of parts; 0 where nothing has moved."""
        linear, angular = (float(lost / size) if size > 0.0 else 0.0 for lost, size in zip(self.lost, self.largest))
        return linear, angular

    def state(self) -> dict[str, Any]:
        """What a restart goes on with, as JSON has it."""
        first = None if self.first is None else self.first.tolist()
        return {"first": first, "largest": self.largest.tolist(), "lost": self.lost.tolist()}

    def set_state(self, state: dict[str, Any]) -> None:
        """Take back what `state` gave."""
        self.first = None if state["first"] is None else np.array(state["first"])
        self.largest, self.lost = np.array(state["largest"]), np.array(state["lost"])


def _cross(arm: np.ndarray, vector: np.ndarray) -> np.ndarray:
    """(1,) in the plane, (3,) in space, zero along a line."""
    if len(arm) == 3:
        return np.cross(arm, vector)
    return np.array([arm[0] * vector[1] - arm[1] * vector[0] if len(arm) == 2 else 0.0])
