"""What acts between the particles of a scene's systems."""

from typing import Any

from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene


def interactions_of(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """All of them; their fields of particles are declared, with the values of a new run. Collective.

    The code of what a scene lacks is not loaded. Raises SolverError on all ranks when one cannot be set up.
    """
    result: list[Interaction] = []
    if scene.tools:
        from parsolid.contact.tools.contact import RigidTools

        result.append(RigidTools(comm, scene, systems))
    return result
