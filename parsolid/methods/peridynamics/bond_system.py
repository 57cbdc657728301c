"""Bonds of the peridynamic methods: the pairs of a rank's particles within the horizon, over their container."""

from typing import Any

import numpy as np

from parsolid.boundary.mirror_planes import MirrorCodes
from parsolid.numerics.layout import LAYOUT
from parsolid.pairs.pair_system import PairSystem
from parsolid.pairs.radial_weights import INFLUENCES, RadialWeights
from parsolid.pairs.terms import KINEMATICS
from parsolid.particles.container import Particles
from parsolid.particles.declaration import Field, Within
from parsolid.particles.generated import declare_generated


def build_bond_system(
    comm: Any,
    particles: Particles,
    settings: Any,
    particle_set: Any,
    share: np.ndarray,
    stabiliser: Any,
    codes: MirrorCodes | None,
    unbonded: np.ndarray | None = None,
) -> PairSystem:
    """Declare what bonds need, plan ghosts and build every list; bars lie in the plane. Collective.

    settings: `settings.Peridynamics`; share (owned,): the part of a particle on this side of mirror planes,
    whose whole counts in the pair sums. A bond's horizon is that of the mean metric 1/delta^2 of its ends. Raises
    SolverError, on all ranks, for coincident particles and for one whose bonds do not span space.
    """
    dimension = particle_set.position.shape[1]
    space: Any = LAYOUT[max(2, dimension)]
    weights = RadialWeights(INFLUENCES[settings.influence], bar=dimension == 1)
    bonds = PairSystem(comm, particles, space, weights, stabiliser, codes)
    bonds.unbonded = unbonded
    columns = KINEMATICS[space.dimension]
    told: dict[str, Any] = {"ghosts": "forward", "message": "motion"}
    place = Within("kinematics", columns.reference)
    declare_generated(particles, particle_set, ("identifier", "reference_position"), reference_position=place)
    driving = Within("kinematics", columns.field)
    particles.declare(Field("relaxing_displacement", space.dimension, "m", mirror="vector", layout=driving, **told))
    moved = Field(
        "displacement",
        dimension,
        "m",
        checkpointed=True,
        shown=True,
        mirror="vector",
        **told,
        layout=Within("kinematics", columns.position),
    )
    particles.declare(moved)
    horizon = horizons(settings, particle_set)
    metric = np.zeros((len(particle_set), 6))
    metric[:, :3] = 1.0 / horizon[:, None] ** 2
    if space.dimension == 2:
        metric[:, 2] = 1.0
    bonds.rebuild(embedded(particle_set.position), particle_set.body, metric, particle_set.volume / share)
    return bonds


def horizons(settings: Any, particle_set: Any) -> np.ndarray:
    """Horizon (owned,) [m] of each particle."""
    return np.array([settings.horizon(spacing) for spacing in particle_set.spacing.max(axis=1)])


def embedded(positions: np.ndarray) -> np.ndarray:
    """Positions (n, 1) of a bar as (n, 2), in the plane; others as they are."""
    return np.pad(positions, ((0, 0), (0, 1))) if positions.shape[1] == 1 else positions
