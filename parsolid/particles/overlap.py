"""Bodies that lie in one another, whose matter would be there twice: found by particles inside other bodies' shapes."""

from typing import Any

import numpy as np
from mpi4py import MPI

from decomposition.pair_search import close_boxes
from parsolid.materials.declaration import Phrase
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.schema import Scene
from parsolid.scene.validation_errors import fault

# shares of a spacing: round-off, and how far jitter moves a particle
_ROUND_OFF, _JITTER = 1e-6, 0.5


def overlap_faults(scene: Scene, fillings: list[Any], particle_set: ParticleSet, comm: MPI.Comm) -> list[str]:
    """Pairs of bodies of which one has particles inside the other, the same on all ranks; collective.

    Particles on a surface are in neither.
    """
    lower, upper = (np.array([getattr(one, name) for one in fillings], float) for name in ("lower", "upper"))
    close = [(i, j) for i, j in np.transpose(close_boxes(lower, upper, 0.0)).tolist() if _near(fillings, i, j)]
    pairs = sorted([*close, *((j, i) for i, j in close)])
    counts = np.zeros(len(pairs), np.int64)
    for number, (outer, inner) in enumerate(pairs):
        shape: Any = scene.bodies[outer].shape
        places = particle_set.position[particle_set.body == inner]
        moved = scene.bodies[outer].jitter or scene.bodies[inner].jitter
        margin = (_JITTER if moved else _ROUND_OFF) * max(fillings[outer].coarsest, fillings[inner].coarsest)
        if shape.kind == "mesh":
            # collective
            counts[number] = fillings[outer].inside(places, margin)
        elif len(places):
            counts[number] = np.count_nonzero(shape.model.inside(places, margin))
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


def _near(fillings: list[Any], i: int, j: int) -> bool:
    one, other = fillings[i], fillings[j]
    return bool((one.lower < other.upper).all() and (other.lower < one.upper).all())


def _name(scene: Scene, number: int) -> str:
    return repr(scene.bodies[number].name or f"bodies.{number}")
