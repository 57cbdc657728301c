"""Failed particles that are deleted: they keep a trifle of their mass and stand still, so that no neighbour feels them.

They go when lists are made anew, at the start of the next step on all ranks, so that no ghost keeps what its owner has
lost.
"""

from typing import Any

import numpy as np

from parsolid.methods.failed_matter import failed_to_delete, note_deleted
from parsolid.methods.failure_fields import DELETED_KINETIC, DELETED_STORED

# of the mass that stays, so that sums over neighbours are divided by something
_LEFT = 1e-12


def due_to_delete(system: Any) -> bool:
    """Whether this rank has failed particles to delete."""
    return len(failed_to_delete(system.particles, system.blocks)) > 0


def delete_failed(system: Any) -> dict[str, float]:
    """Delete what has failed; energies [J] that go with it."""
    particles = system.particles
    rows = failed_to_delete(particles, system.blocks)
    if not len(rows):
        return {}
    before = system.energies()
    mass, velocity = (1.0 - _LEFT) * system.mass[rows], particles.owned_rows("velocity")[rows].copy()
    note_deleted(particles, rows, mass, velocity)
    without_deleted(system)
    after = system.energies()
    return {DELETED_KINETIC: before[0] - after[0], DELETED_STORED: before[1] - after[1]}


def without_deleted(system: Any) -> None:
    """Take the mass and the motion of deleted particles; also after a restart, whose masses are those of time 0."""
    particles = system.particles
    if "deleted_mass" in particles:
        gone = np.flatnonzero(particles.owned_rows("deleted_mass") > 0.0)
        particles.owned_rows("mass")[gone] = particles.owned_rows("deleted_mass")[gone] * _LEFT / (1.0 - _LEFT)
        particles.owned_rows("velocity")[gone] = 0.0
