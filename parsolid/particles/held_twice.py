"""Components of particles whose motion two boundary conditions hold in different ways."""

import itertools
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.materials.declaration import Phrase
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.boundaries import Condition, MotionCondition, Support
from parsolid.scene.load_histories import LoadHistory
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import fault

# parts of the end time at which values are compared, unlikely to be zeros of a load
_MOMENTS = (0.0, 0.1372, 0.4619, 0.8317, 1.0)
# of the larger value: the same motion in other words
_SAME = 1e-9
# of a spacing: a particle on a plane, which a support with images holds
_ON_PLANE = 1e-6


def contradictions(scene: Scene, particle_set: ParticleSet, chosen: list[np.ndarray], comm: MPI.Comm) -> list[str]:
    """Faults of conditions that hold a component of the same particles to different values, the same on all ranks;
    chosen: this rank's particles (n,) bool of each condition. Collective.

    Where values are equal there is no fault: planes of rest and of symmetry meet at edges. Supports with images hold
    the particles on their plane alone; those of surfaces of any direction hold no component.
    """
    held: dict[int, np.ndarray] = {}
    for i, (one, here) in enumerate(zip(scene.boundaries, chosen)):
        components = _held(one, particle_set, here)
        if components is not None:
            held[i] = components
    pairs = list(itertools.combinations(held, 2))
    counts = np.zeros((len(pairs), scene.dimension), np.int64)
    for k, (j, i) in enumerate(pairs):
        both = held[j] & held[i]
        for axis in np.flatnonzero(both.any(axis=0)):
            points = np.ascontiguousarray(particle_set.position[both[:, axis]])
            counts[k, axis] = _unlike(scene, scene.boundaries[j], scene.boundaries[i], points, int(axis)).sum()
    comm.Allreduce(MPI.IN_PLACE, counts, op=MPI.SUM)
    faults: list[str] = []
    for (j, i), row in zip(pairs, counts):
        axes = np.flatnonzero(row)
        if len(axes):
            along = " and ".join("XYZ"[axis] for axis in axes)
            expected = (
                f"no other motion along {along} of particles that boundaries.{j} ({scene.boundaries[j].kind!r}) holds"
            )
            faults.append(fault(("boundaries", i), expected, Phrase(f"{row.max()} particles in both"), "contradiction"))
    return faults


def _held(condition: Condition, particle_set: ParticleSet, here: np.ndarray) -> np.ndarray | None:
    """Components (n, d) bool of particles that a condition holds, None for one that holds none."""
    d = particle_set.position.shape[1]
    if isinstance(condition, MotionCondition):
        return np.asarray(here[:, None] & ~condition.prescribed.free[:d])
    if not isinstance(condition, Support) or (condition.plane is None and condition.kind != "fixed"):
        return None
    if condition.plane is None:
        return np.repeat(here[:, None], d, axis=1)
    if condition.mirror:
        away = np.abs(particle_set.position[:, condition.plane.axis] - condition.plane.offset)
        here = here & (away <= _ON_PLANE * particle_set.spacing.min(axis=1))
    return np.asarray(here[:, None] & condition.holds(d))


def _unlike(scene: Scene, first: Condition, second: Condition, points: np.ndarray, axis: int) -> np.ndarray:
    """At which points (n, d) [m] two conditions want other values of a component; a velocity and a displacement are
    alike where both are zero."""
    result = np.zeros(len(points), bool)
    same_quantity = _quantity(first) in (None, _quantity(second)) or _quantity(second) is None
    for moment in _MOMENTS:
        values = [_values(one, points, moment * scene.end_time, axis) for one in (first, second)]
        largest = np.maximum(*np.abs(values))
        result |= (np.abs(values[0] - values[1]) > _SAME * largest) if same_quantity else largest > 0.0
    return result


def _quantity(condition: Any) -> str | None:
    """ "velocity", "displacement", or None of what is at rest."""
    if isinstance(condition, Support):
        return None if condition.velocity is None else "velocity"
    return str(condition.quantity)


def _values(condition: Any, points: np.ndarray, time: float, axis: int) -> np.ndarray:
    """Values (n,) of a component at points (n, d) [m] and a time [s]."""
    if isinstance(condition, Support):
        if condition.velocity is None:
            return np.zeros(len(points))
        return np.asarray(LoadHistory(condition.velocity).evaluate(points, time)[:, axis])
    return np.asarray(condition.prescribed.evaluate(points, time)[:, axis])
