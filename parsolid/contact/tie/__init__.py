"""Ties: bodies of different methods bonded where they touch at the start; the code is loaded where a scene has any."""

from typing import Any

from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.particles.declaration import Field
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
    here = [
        (number, first, second)
        for number, (first, second, _) in enumerate(tied_pairs(scene))
        if {first, second} & set(system.bodies)
    ]
    if not here:
        return
    system.take_external_forces(keep_rows=True)
    failures = [getattr(body.material, "failure", None) for body in scene.bodies]
    deletes = [failure is not None and failure.after == "delete" for failure in failures]
    ending = [number for number, first, second in here if deletes[first] or deletes[second]]
    if ending:
        from parsolid.contact.tie.tied_faces import START, held_field

        system.particles.declare(Field(START, system.dimension, "m", mirror="vector"))
        for number in ending:
            system.particles.declare(Field(held_field(number), 1, "1", checkpointed=True), 1.0)
