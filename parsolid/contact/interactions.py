"""All that acts between the bodies of a scene: contact of particles and of grids, tools, ties."""

from typing import Any

from parsolid.contact.contact import build_contact, declare_fields
from parsolid.contact.grid import build_grid_contact, enable_grid_contact
from parsolid.contact.tie import build_ties, declare_tie_fields
from parsolid.contact.tools import build_tools, declare_tool_fields
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene


def declare_interactions(scene: Scene, number: int, system: ParticleSystem) -> None:
    """Give the system of a number in the scene the particle fields that its interactions need, before it begins."""
    declare_fields(scene, system)
    declare_tie_fields(scene, system)
    declare_tool_fields(scene, system)
    enable_grid_contact(scene, number, system)


def build_interactions(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """The interactions of a scene, in the order in which they act in a step; collective."""
    return [
        *build_contact(comm, scene, systems),
        *build_tools(comm, scene, systems),
        *build_ties(comm, scene, systems),
        *build_grid_contact(comm, scene, systems),
    ]
