"""Contact on the nodes of a background grid, of the method that has one; its code is loaded where a scene has any."""

from typing import Any

from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.contact import grid_pairs


def enable_grid_contact(scene: Scene, number: int, system: ParticleSystem) -> None:
    """Let a system, of a number in the scene, give energies of one time where others act on its nodes."""
    if any(number in pair for pair in grid_pairs(scene)):
        system.take_external_forces(keep_rows=False)


def build_grid_contact(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The grid contact of a scene, if it has any; after all that gives impulses before a step."""
    pairs = grid_pairs(scene)
    if not pairs:
        return []
    from parsolid.methods.mpm.nodal_contact import NodalContact

    return [NodalContact(comm, [((systems[i], systems[j]), one.friction) for (i, j), one in pairs.items()])]
