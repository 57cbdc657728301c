"""From generated points to each rank's own particles: partition, migration, order along cells."""

import dataclasses
from typing import Any

import numpy as np

from decomposition.bisection import bisect
from decomposition.migration import migrate
from parsolid.collective import anywhere
from parsolid.materials.blocks import block_numbers
from parsolid.particles.generated import widths


def distribute(
    comm: Any, particle_set: Any, values: dict[str, Any] | None = None, owner: np.ndarray | None = None
) -> Any:
    """Give each rank a compact part with an equal number of particles; collective.

    owner (n,) int32: ranks of particles where they are known, else -1; given on all ranks or on none.

    With values, further arrays (n, ...) of the particles by name, returns (particle_set, values), else the
    particle_set.
    """
    if anywhere(comm, particle_set.axes is not None) and particle_set.axes is None:
        particle_set = dataclasses.replace(
            particle_set, axes=np.tile(np.eye(particle_set.position.shape[1]), (len(particle_set.position), 1, 1))
        )
    # in units of the spacing, so that parts have few interactions across their cuts
    places = particle_set.position / _typical_spacing(comm, particle_set)
    rest = np.ones(len(places), bool) if owner is None else owner < 0
    found = np.zeros(len(places), np.int32) if owner is None else owner
    if anywhere(comm, bool(rest.any())):
        found[rest] = bisect(comm, np.ascontiguousarray(places[rest]))
    owner = found
    moved = dataclasses.replace(particle_set, **migrate(comm, owner, columns(particle_set)))
    return moved if values is None else (moved, migrate(comm, owner, values))


def columns(particle_set: Any) -> dict[str, np.ndarray]:
    """The arrays of a particle_set, by name."""
    values = {entry.name: getattr(particle_set, entry.name) for entry in dataclasses.fields(particle_set)}
    return {name: array for name, array in values.items() if isinstance(array, np.ndarray)}


def take(particle_set: Any, order: np.ndarray) -> Any:
    """The particles of a particle_set in another order, or some of them."""
    return dataclasses.replace(particle_set, **{name: array[order] for name, array in columns(particle_set).items()})


def sort_for_speed(comm: Any, particle_set: Any, laws: list[Any]) -> np.ndarray:
    """Order (n,) by law and then along cells of one spacing, so that neighbours lie close in memory; collective.

    Cells are in rows along the shortest side of the rank's part, rows in layers across the longest: the passes then
    walk through memory layer by layer, with forces a third faster than along a space-filling curve
    (docs/performance.md).
    """
    _, number = block_numbers(laws, particle_set.body)
    scaled = particle_set.position / _typical_spacing(comm, particle_set)
    if len(scaled) == 0:
        return np.zeros(0, np.int64)
    cells = np.rint(scaled - scaled.min(axis=0))
    shortest_first = np.argsort(np.ptp(scaled, axis=0), kind="stable")
    return np.lexsort((particle_set.identifier, *(cells[:, axis] for axis in shortest_first), number))


def _typical_spacing(comm: Any, particle_set: Any) -> np.ndarray:
    """Mean spacing (d,) [m] along the coordinate axes over all particles; collective."""
    spacing = widths(particle_set.spacing, particle_set.axes)
    total = comm.allreduce(np.append(spacing.sum(axis=0), len(spacing)))
    return total[:-1] / total[-1]
