"""Bodies that lie in one another, whose matter would be there twice: found by particles inside other bodies' shapes."""

from collections.abc import Callable
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.materials.declaration import Phrase
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.lattice import Filling
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import fault

# shares of a spacing: round-off, and how far jitter moves a particle
_ROUND_OFF, _JITTER = 1e-6, 0.5


def overlap_faults(scene: Scene, fillings: list[Filling], particle_set: ParticleSet, comm: MPI.Comm) -> list[str]:
    """Pairs of bodies of which one has particles inside the other, the same on all ranks; collective.

    Particles on a surface are in neither. Nobody's particles are looked for inside a mesh, whose own particles are
    looked for in the others.
    """
    pairs = [(i, j) for i in range(len(fillings)) for j in range(len(fillings)) if i != j and _near(fillings, i, j)]
    counts = np.zeros(len(pairs), np.int64)
    for number, (outer, inner) in enumerate(pairs):
        inside = _INSIDE.get(scene.bodies[outer].shape.kind)
        places = particle_set.position[particle_set.body == inner]
        if inside is not None and len(places):
            moved = scene.bodies[outer].jitter or scene.bodies[inner].jitter
            margin = (_JITTER if moved else _ROUND_OFF) * max(fillings[outer].coarsest, fillings[inner].coarsest)
            counts[number] = np.count_nonzero(inside(scene.bodies[outer].shape.model, places, margin))
    comm.Allreduce(MPI.IN_PLACE, counts, op=MPI.SUM)
    return [
        fault(
            ("bodies", inner),
            "a body that lies in no other",
            Phrase(f"{count} particles of {_name(scene, inner)} inside {_name(scene, outer)}"),
        )
        for (outer, inner), count in zip(pairs, counts)
        if count
    ]


def _near(fillings: list[Filling], i: int, j: int) -> bool:
    one, other = fillings[i], fillings[j]
    return bool((one.lower < other.upper).all() and (other.lower < one.upper).all())


def _name(scene: Scene, number: int) -> str:
    return repr(scene.bodies[number].name or f"bodies.{number}")


def _in_box(box: Any, places: np.ndarray, margin: float) -> np.ndarray:
    within = (places > np.array(box.lower) + margin) & (places < np.array(box.upper) - margin)
    return np.asarray(within.all(axis=1))


def _in_perforated_box(box: Any, places: np.ndarray, margin: float) -> np.ndarray:
    return _in_box(box, places, margin) & (_distance(places, box.centre) > box.radius + margin)


def _in_sphere(sphere: Any, places: np.ndarray, margin: float) -> np.ndarray:
    return _distance(places, sphere.centre) < sphere.radius - margin


def _distance(places: np.ndarray, centre: list[float]) -> np.ndarray:
    return np.asarray(np.linalg.norm(places - np.array(centre), axis=1))


def _in_cylinder(cylinder: Any, places: np.ndarray, margin: float) -> np.ndarray:
    axis = "XYZ".index(cylinder.axis)
    from_base = places - np.array(cylinder.base)
    across = [i for i in range(3) if i != axis]
    inside = np.linalg.norm(from_base[:, across], axis=1) < cylinder.radius - margin
    inside &= (from_base[:, axis] > margin) & (from_base[:, axis] < cylinder.length - margin)
    for i in across[: {"whole": 0, "half": 1, "quarter": 2}[cylinder.part]]:
        inside &= from_base[:, i] > margin
    return np.asarray(inside)


def _in_shell(shell: Any, places: np.ndarray, margin: float) -> np.ndarray:
    dimension = places.shape[1]
    axis = 2 if dimension == 2 else "XYZ".index(shell.axis)
    from_centre = places - np.array(shell.centre if dimension == 2 else shell.base)
    first, second = from_centre[:, (axis + 1) % 3], from_centre[:, (axis + 2) % 3]
    radius = np.hypot(first, second)
    inside = np.abs(radius - shell.radius) < 0.5 * shell.thickness - margin
    if dimension == 3:
        inside &= (from_centre[:, axis] > margin) & (from_centre[:, axis] < shell.length - margin)
    if not shell.closed:
        begin, end = np.radians(shell.angles)
        turned = (np.arctan2(second, first) - begin) % (2.0 * np.pi)
        slack = margin / shell.radius
        inside &= (turned > slack) & (turned < end - begin - slack)
    return np.asarray(inside)


_INSIDE: dict[str, Callable[[Any, np.ndarray, float], np.ndarray]] = {
    "box": _in_box,
    "perforated_box": _in_perforated_box,
    "sphere": _in_sphere,
    "cylinder": _in_cylinder,
    "cylindrical_shell": _in_shell,
}
