"""The fields of total-Lagrangian SPH, and the arrays of them that its kernels take."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.methods.tlsph.moved import Moved
from parsolid.methods.tlsph.stage_losses import STRESSES, StageStresses
from parsolid.numerics.layout import BRANCH_ROWS, DEFORMATION_ROWS, GRADIENT_ROWS
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Rows, Within
from parsolid.particles.generated import declare_generated

# F (and H) = 1 and J = 1, by the rows of `numerics.layout`
_UNSTRAINED = {rows: (*np.tile(np.eye(d).ravel(), rows // (d * d)), 1.0) for d, rows in ((2, 5), (3, 19), (3, 10))}
_UNSTRAINED_BRANCH = {2: (1.0, 1.0, 0.0), 3: (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}


class Body(NamedTuple):
    """Arrays of a rank's particles, see `numerics.layout`; branches is None without Maxwell branches.

    start: F, H, J at the start of the step, None where H and J are not evolved but those of F, in every state.
    volume, tributary: (1, capacity), the particle's volume in the pair sums and its share of the body; sums, record:
    `pairs.passes`; moved is None where the reference is fixed, stages where nothing is told of what these lose.
    """

    deformation: np.ndarray
    start: np.ndarray | None
    branches: np.ndarray | None
    correction: np.ndarray
    volume: np.ndarray
    tributary: np.ndarray
    sums: np.ndarray
    record: np.ndarray
    moved: Moved | None
    stages: StageStresses | None


def body_of(particles: Particles, branches: bool, moved: Moved | None = None) -> Body:
    """The arrays that the kernels of strain and stress take, of laws with or without branches."""
    names = ("strain", "strain_at_start", "branches", "correction", "pair_volume", "volume", "pair_sums", "record")
    absent = {name for name in ("strain_at_start", "branches") if name not in particles}
    absent |= set() if branches else {"branches"}
    storages: list[Any] = [None if name in absent else particles.storage(name) for name in names]
    stages = StageStresses(*map(particles.storage, STRESSES)) if STRESSES[0] in particles else None
    return Body(*storages, moved, stages)  # type: ignore[call-arg]


def declare_motion(particles: Particles, particle_set: Any, fixed: bool, staged: bool) -> None:
    """What a particle is made with, and v and x at rest; ghosts take v and x with the message "motion".

    fixed: whether X is the reference that the passes read; staged: whether a step has stages, which need its start, or
    else begins with the forces that the last one ended with.
    """
    position = particle_set.position
    d = position.shape[1]
    at = KINEMATICS[d]
    place = Within("kinematics", at.reference) if fixed else Rows()
    declare_generated(particles, particle_set, ("reference_position",), reference_position=place, volume=Columns())
    role: dict[str, Any] = {"ghosts": "forward", "message": "motion", "checkpointed": True, "shown": True}
    particles.declare(Field("velocity", d, "m/s", **role, mirror="vector", layout=Within("kinematics", at.field)))
    particles.declare(
        Field("position", d, "m", **role, mirror="vector", layout=Within("kinematics", at.position)), position
    )
    if staged:
        particles.declare(Field("motion_at_start", 8, "", layout=Rows(), carried=False))
        return
    for name, first in (("stress_force", 0), ("dissipative_force", 4)):
        place = Within("pair_force", first)
        particles.declare(Field(name, d, "N", checkpointed=True, mirror="vector", layout=place))


def declare_strain(particles: Particles, dimension: int, branches: int, staged: bool) -> None:
    """F, J and A of each branch, unstrained; a law with fewer branches than another has A = 1 in the rest.

    staged: see `declare_motion`; H is evolved, too, where it is true.
    """
    d, rows = dimension, (DEFORMATION_ROWS if staged else GRADIENT_ROWS)[dimension]
    rest = _UNSTRAINED[rows]
    for name in ("strain", "strain_at_start") if staged else ("strain",):
        carried = name == "strain"
        particles.declare(Field(name, rows, "1", layout=Columns(), padding=rest, carried=carried), rest)
    role: dict[str, Any] = {"checkpointed": True, "mirror": "tensor"}
    place = Within("strain", 0)
    particles.declare(Field("deformation_gradient", d * d, "1", **role, layout=place), rest[: d * d])
    if d == 3 and staged:
        particles.declare(Field("cofactor", 9, "1", **role, layout=Within("strain", 9)), rest[9:18])
    place = Within("strain", rows - 1)
    particles.declare(Field("jacobian", 1, "1", checkpointed=True, shown=True, layout=place), 1.0)
    if branches:
        rest, rows = _UNSTRAINED_BRANCH[d], BRANCH_ROWS[d]
        whole = rest * branches
        particles.declare(Field("branches", len(whole), "1", layout=Columns(), padding=whole), whole)
        for alpha in range(branches):
            place = Within("branches", alpha * rows)
            particles.declare(Field(f"viscous_strain_inverse_{alpha + 1}", rows, "1", **role, layout=place), rest)
