"""Rigid tools that bodies touch: shapes, motion, forces; their code is loaded where a scene has any."""

from typing import Any

from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene


def build_tools(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The tools of a scene, if it has any; collective. Raises SolverError on all ranks for one that cannot be."""
    if not scene.tools:
        return []
    from parsolid.contact.tools.contact import RigidTools

    return [RigidTools(comm, scene, systems)]


def declare_tool_fields(scene: Scene, system: ParticleSystem) -> None:
    """What a system's particles need to be touched by a scene's tools; nothing where there are none."""
    if scene.tools:
        from parsolid.contact.tools.touch import declare

        declare(scene, system)
