"""What particles carry of laws that fail, for the methods of plastic flow: fields, deletion, what is measured and told.

Kernels do the rest, see `materials.plastic.tile_update`.
"""

from typing import Any

import numpy as np

from parsolid.collective import maximum
from parsolid.materials.failure.failure import count_of
from parsolid.materials.failure.scatter import strengths
from parsolid.methods.failure_fields import DAMAGE, kept_column
from parsolid.particles.container import Particles


def declare_failure(particles: Particles, laws: list[Any]) -> None:
    """Damage from 0 to 1, that of each criterion, factors of strength and what was deleted, where a law has them.

    particles: with their identifiers and velocities declared.
    """
    failures = [getattr(law, "failure", None) for law in laws]
    if not any(failures):
        return
    particles.declare(DAMAGE)
    particles.declare(kept_column("criterion_damage", max(map(count_of, failures)), "1"))
    if any(failure.scatter for failure in failures if failure):
        factors, number = np.ones(particles.owned), particles.law_of_body[particles.owned_rows("body")]
        for index, failure in enumerate(failures):
            if failure is not None and failure.scatter is not None:
                mine = number == index
                factors[mine] = strengths(failure.scatter, particles.owned_rows("identifier")[mine])
        particles.declare(kept_column("strength_factor", 1, "1"), factors)
    if any(failure.deletes for failure in failures if failure):
        particles.declare(kept_column("deleted_mass", 1, "kg"))
        particles.declare(kept_column("deleted_momentum", particles.fields["velocity"].components, "kg m/s"))


def failed_to_delete(particles: Particles, blocks: list[Any]) -> np.ndarray:
    """Rows of failed particles that are to be deleted and have not been."""
    if "deleted_mass" not in particles:
        return np.zeros(0, np.int64)
    due = (particles.owned_rows("damage") >= 1.0) & (particles.owned_rows("deleted_mass") == 0.0)
    deletes = np.zeros(particles.owned, bool)
    for block in blocks:
        failure = getattr(block.law, "failure", None)
        deletes[block.first : block.last] = failure is not None and failure.deletes
    return np.flatnonzero(due & deletes)


def note_deleted(particles: Particles, rows: np.ndarray, mass: np.ndarray, velocity: np.ndarray) -> float:
    """Note what goes with some particles: mass (n,) [kg] and velocity (n, d) [m/s]; their kinetic energy [J]."""
    particles.owned_rows("deleted_mass")[rows] = mass
    momentum = mass[:, None] * velocity
    particles.owned_rows("deleted_momentum")[rows] = momentum
    return 0.5 * float((momentum * velocity).sum())


def measure(particles: Particles, mass: np.ndarray, name: str) -> tuple[str, np.ndarray] | None:
    """This rank's part of a quantity of failure, None for other names; mass (owned,) [kg] of what is left.

    Zero where no law of the particles fails, as in one of several systems.
    """

    def field(of: str) -> np.ndarray:
        return particles.owned_rows(of) if of in particles else np.zeros(particles.owned)

    if name == "maximum_damage":
        return "maximum", np.array([field("damage").max(initial=0.0)])
    if name == "failed_mass":
        return "sum", np.array([float(((mass + field("deleted_mass")) * (field("damage") >= 1.0)).sum())])
    if name == "deleted_mass":
        return "sum", np.array([field(name).sum()])
    if name == "deleted_momentum":
        lost = field(name).sum(axis=0)
        return "sum", lost + np.zeros(particles.fields["velocity"].components)
    return None


def summary(comm: Any, particles: Particles, mass: np.ndarray) -> dict[str, Any]:
    """Entries of summary.json; collective, the same on all ranks; none without a law that fails."""
    if "damage" not in particles:
        return {}
    damage = particles.owned_rows("damage")
    found: Any = measure(particles, mass, "failed_mass")
    result = {
        "failed_particles": comm.allreduce(int((damage >= 1.0).sum())),
        "failed_mass": comm.allreduce(float(found[1][0])),
        "largest_damage": maximum(comm, float(damage.max(initial=0.0))),
    }
    if "deleted_mass" in particles:
        result["deleted_mass"] = comm.allreduce(float(particles.owned_rows("deleted_mass").sum()))
    return result
