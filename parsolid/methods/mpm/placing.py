"""Where bodies may be at the start: on one side of every wall, and joined where they would not meet later."""

from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.collective import SolverError
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene, initial_displacement

# nodes that particles reach beyond themselves, in cells: bodies farther apart than twice that share none
_REACH = {"linear": 1.0, "ugimp": 1.5, "cpgimp": 1.5, "quadratic-spline": 1.5, "cubic-spline": 2.0}
_ROUND_OFF = 1e-6


def refuse_bad_places(comm: MPI.Comm, scene: Scene, particle_set: ParticleSet) -> None:
    """Raise SolverError on all ranks for a wall with a body behind it, and for bodies that would pass through others.

    particle_set: this rank's particles. Collective.
    """
    count, d = len(scene.bodies), scene.dimension
    displacement = initial_displacement(scene, particle_set.body, particle_set.position, particle_set.regions)
    start = particle_set.position if displacement is None else particle_set.position + displacement
    lower, upper = np.full((count, d), np.inf), np.full((count, d), -np.inf)
    np.minimum.at(lower, particle_set.body, start)
    np.maximum.at(upper, particle_set.body, start)
    comm.Allreduce(MPI.IN_PLACE, lower, op=MPI.MIN)
    comm.Allreduce(MPI.IN_PLACE, upper, op=MPI.MAX)
    for i, boundary in enumerate(scene.boundaries):
        if boundary.kind == "wall":
            _refuse_wall_inside(i, boundary, lower, upper, _ROUND_OFF * scene.method.cell)
    if scene.method.formulation == "total-lagrangian":
        _refuse_apart(lower, upper, 2.0 * _REACH[scene.method.basis] * scene.method.cell)


def _refuse_wall_inside(number: int, wall: Any, lower: np.ndarray, upper: np.ndarray, margin: float) -> None:
    axis, place = wall.plane.axis, wall.plane.offset
    beyond = lower[:, axis] < place - margin if wall.side == "above" else upper[:, axis] > place + margin
    if beyond.any():
        body = int(np.argmax(beyond))
        raise SolverError(
            f"boundaries.{number}.plane: expected a wall with all bodies {wall.side} it, found particles of "
            f"bodies.{body} from {'XYZ'[axis]} = {lower[body, axis]:g} to {upper[body, axis]:g}"
        )


def _refuse_apart(lower: np.ndarray, upper: np.ndarray, reach: float) -> None:
    """Bodies that share nodes with none of those that the first is joined to, by boxes around them."""
    joined, size = np.arange(len(lower)) == 0, 0
    near = (lower[:, None] < upper[None] + reach) & (lower[None] < upper[:, None] + reach)
    while joined.sum() > size:
        size = int(joined.sum())
        joined = np.asarray(np.asarray(near.all(axis=2))[joined].any(axis=0))
    if not joined.all():
        raise SolverError(
            f"bodies.{int(np.argmin(joined))}: expected bodies that are joined with formulation 'total-lagrangian', "
            "whose grid knows nothing of where they meet later, found one apart from bodies.0"
        )
