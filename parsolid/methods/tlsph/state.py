"""The fields of total-Lagrangian SPH, and the arrays of them that its kernels take."""

from typing import Any, NamedTuple

import numpy as np

from parsolid.methods.tlsph.moved import Moved
from parsolid.numerics.layout import BRANCH_ROWS, DEFORMATION_ROWS
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Columns, Field, Rows, Within
from parsolid.particles.generated import declare_generated

# F (and H) = 1 and J = 1, by the rows of `numerics.layout`
_UNSTRAINED = {2: (1.0, 0.0, 0.0, 1.0, 1.0), 3: (*np.eye(3).ravel(), *np.eye(3).ravel(), 1.0)}
_UNSTRAINED_BRANCH = {2: (1.0, 1.0, 0.0), 3: (1.0, 1.0, 1.0, 0.0, 0.0, 0.0)}


class Body(NamedTuple):
    """Arrays of a rank's particles, see `numerics.layout`; branches is None without Maxwell branches.

    volume, tributary: (1, capacity), the particle's volume in the pair sums and its share of the body; sums, record:
    `pairs.passes`; moved is None where the reference is fixed.
    """

    deformation: np.ndarray
    start: np.ndarray
    branches: np.ndarray | None
    correction: np.ndarray
    volume: np.ndarray
    tributary: np.ndarray
    sums: np.ndarray
    record: np.ndarray
    moved: Moved | None


def body_of(particles: Particles, branches: bool, moved: Moved | None = None) -> Body:
    """The arrays that the kernels of strain and stress take, of laws with or without branches."""
    names = ("strain", "strain_at_start", "branches", "correction", "pair_volume", "volume", "pair_sums", "record")
    storages: list[Any] = [particles.storage(name) if name != "branches" or branches else None for name in names]
    return Body(*storages, moved)  # type: ignore[call-arg]


def declare_motion(particles: Particles, particle_set: Any, fixed: bool) -> None:
    """What a particle is made with, and v and x at rest; ghosts take v and x with the message "motion".

    fixed: whether X is the reference that the passes read.
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
    particles.declare(Field("motion_at_start", 8, "", layout=Rows(), carried=False))


def declare_strain(particles: Particles, dimension: int, branches: int) -> None:
    """F, H, J and A of each branch, unstrained; a law with fewer branches than another has A = 1 in the rest."""
    d, rest, rows = dimension, _UNSTRAINED[dimension], DEFORMATION_ROWS[dimension]
    for name in ("strain", "strain_at_start"):
        carried = name == "strain"
        particles.declare(Field(name, rows, "1", layout=Columns(), padding=rest, carried=carried), rest)
    role: dict[str, Any] = {"checkpointed": True, "mirror": "tensor"}
    place = Within("strain", 0)
    particles.declare(Field("deformation_gradient", d * d, "1", **role, layout=place), rest[: d * d])
    if d == 3:
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
