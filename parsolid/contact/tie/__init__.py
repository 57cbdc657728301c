"""Ties: bodies of different methods bonded where they touch at the start; the code is loaded where a scene has any."""

from typing import Any

from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.tie import tied_pairs


def build_ties(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The ties of a scene, if it has any; collective."""
    if not scene.tie:
        return []
    from parsolid.contact.tie.ties import Ties

    return [Ties(comm, scene, systems)]


def declare_tie_fields(scene: Scene, system: ParticleSystem) -> None:
    """What a system's particles need to be tied, before its state is set; nothing where there are no ties."""
    if any({first, second} & set(system.bodies) for first, second, _ in tied_pairs(scene)):
        system.take_external_forces(keep_rows=True)
