"""Motion and deformation of material points at time 0, by the bodies' formulas."""

from collections.abc import Callable

import numpy as np

from parsolid.methods.mpm.material_points import MaterialPoints
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene, initial_deformation_gradient, initial_displacement, initial_velocity

# of the cell, for the gradients of formulas
_DIFFERENCE = 1e-4


def set_initial_motion(scene: Scene, particle_set: ParticleSet, points: MaterialPoints) -> None:
    """Velocity, position and F of `MaterialPoints`, in the order of the particle_set, and slopes of velocity if any.

    The slopes are those at the places that weights belong to; those of a body at rest would smooth its first step.
    """
    d, place = points.dimension, (scene, particle_set.body, particle_set.position, particle_set.regions)
    rows = points.owned_rows
    rows("velocity")[:] = initial_velocity(*place)
    displacement, given = initial_displacement(*place), initial_deformation_gradient(*place)
    F = np.tile(np.eye(d), (points.owned, 1, 1))
    if displacement is not None:
        rows("position")[:] += displacement
        F += _gradient(initial_displacement, scene, particle_set)
    if given is not None:
        gradient, where = given
        F[where] = gradient[where]
    rows("deformation_gradient")[:, : d * d] = F.reshape(-1, d * d)
    if "velocity_slope" in points:
        slope = _gradient(initial_velocity, scene, particle_set)
        if points.where == "motion":
            slope = slope @ np.linalg.inv(F)
        rows("velocity_slope").reshape(-1, 3, 4)[:, :d, :d] = slope
    if d == 2 and points.axisymmetric:
        rows("deformation_gradient")[:, 4] = rows("position")[:, 0] / particle_set.position[:, 0]


def _gradient(formula: Callable[..., np.ndarray | None], scene: Scene, particle_set: ParticleSet) -> np.ndarray:
    """(n, d, d) of the bodies' formulas, by reference place, by central differences."""
    columns, body, place = [], particle_set.body, particle_set.position
    small = _DIFFERENCE * scene.method.cell
    for step in small * np.eye(place.shape[1]):
        ahead, behind = (formula(scene, body, place + s * step, particle_set.regions) for s in (1.0, -1.0))
        assert ahead is not None and behind is not None
        columns.append((ahead - behind) / (2.0 * small))
    return np.stack(columns, axis=2)
