"""Interactions of a scene: contact, tools, ties. Their modules are imported where a scene needs them."""

from typing import Any

from parsolid.contact.undeclared import undeclared_contact
from parsolid.methods.interaction import Interaction
from parsolid.methods.protocol import ParticleSystem
from parsolid.scene import Scene
from parsolid.scene.contact import grid_pairs, of_model


def declare_interactions(scene: Scene, system: ParticleSystem) -> None:
    """Declare the fields that contact, ties and tools need on a system's particles, before its state is set."""
    if of_model(scene.contact, "kernel"):
        from parsolid.contact.contact import declare_fields

        declare_fields(scene, system)
    if scene.tie:
        from parsolid.contact.ties import declare_tie_fields

        declare_tie_fields(scene, system)
    if scene.tools:
        from parsolid.contact.tools.touch import declare_tool_fields

        declare_tool_fields(scene, system)
    on_grid = {name for one in of_model(scene.contact, "grid") for name in one.bodies}
    if any(scene.bodies[body].name in on_grid for body in system.bodies):
        system.take_external_forces(keep_rows=False)


def build_interactions(comm: Any, scene: Scene, systems: list[ParticleSystem]) -> list[Interaction]:
    """Interactions of a scene; contact on grids comes after those that add impulses before a step; collective.

    Raises SolverError on all ranks for bodies or tools that cannot be in contact or tied.
    """
    result: list[Interaction] = []
    if of_model(scene.contact, "kernel"):
        from parsolid.contact.contact import KernelContact

        result.append(KernelContact(comm, scene, systems))
    if scene.tools:
        from parsolid.contact.tools.contact import RigidTools

        result.append(RigidTools(comm, scene, systems))
    if scene.tie:
        from parsolid.contact.ties import Ties

        result.append(Ties(comm, scene, systems))
    if of_model(scene.contact, "grid"):
        from parsolid.methods.mpm.nodal_contact import NodalContact

        pairs = [((systems[i], systems[j]), friction) for (i, j), friction in grid_pairs(scene).items()]
        result.append(NodalContact(comm, pairs))
    undeclared = undeclared_contact(comm, scene, systems)
    return result if undeclared is None else [*result, undeclared]
