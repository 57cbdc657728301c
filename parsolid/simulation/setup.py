"""The systems of a scene: each body's particles go to the method that has the body."""

import dataclasses
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from parsolid.collective import SolverError
from parsolid.contact.interactions import declare_interactions
from parsolid.methods import method_class
from parsolid.methods.protocol import ParticleSystem
from parsolid.observables.declared import Observables
from parsolid.particles.distribution import distribute, take
from parsolid.particles.generation import generate
from parsolid.particles.meshes.slices import MeshSlices
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene import Scene, SceneError
from parsolid.scene.method_settings import named_observables
from parsolid.scene.systems import SystemOfScene, qualify_keys
from parsolid.scene.validation_errors import fault
from parsolid.simulation.restart import Restart
from parsolid.simulation.starting_state import refuse_damaged_results, refuse_unsound_start


def build_systems(
    comm: Any, scene: Scene, restart: Restart | None, meshes: dict[Any, MeshSlices] | None = None
) -> tuple[list[ParticleSystem], list[ParticleSet]]:
    """Systems in their state at time 0, or in that of a restart, and the sorted particles of each; collective.

    meshes: see `generation.generate`. Raises SceneError or SolverError on all ranks when the scene cannot be set up.
    """
    plans = scene.systems
    if not restart:
        refuse_damaged_results(comm, scene)
    if restart and not restart.same_ranks:
        restart.distribute(scene)
    drawn = restart.particle_sets if restart else _generated(comm, scene, plans, meshes)
    systems: list[ParticleSystem] = []
    particle_sets, orders = [], []
    for plan, particle_set in zip(plans, drawn):
        kind, part = method_class(plan.settings), scene.part(plan)
        order = np.arange(len(particle_set))
        with _keys_of(scene, plan):
            if not (restart and restart.same_ranks):
                order = kind.sort(comm, part, particle_set)
            particle_sets.append(take(particle_set, order))
            orders.append(order)
            system = kind(comm, part, particle_sets[-1])
            system.bodies, system.name = plan.bodies, plan.name
            declare_interactions(scene, system)
            systems.append(system)
            if not restart:
                system.begin(part, particle_sets[-1])
        if not restart:
            refuse_unsound_start(comm, part, system, particle_sets[-1])
    for particle_set in particle_sets:
        particle_set.meshes.clear()
    if restart:
        restart.apply_state(systems, orders)
    # raise SceneError for fields that the scene names and its methods may have, but do not have with its
    # options
    observables = Observables(systems)
    of_methods = {name for system in scene.systems for name in system.settings.field_kinds(scene.dimension)}
    faults = [
        fault(place, "a field that a method of this scene has with its options", name)
        for place, name in named_observables(scene)
        if place[-1] != "quantity" and name in of_methods and not observables.has(name)
    ]
    if faults:
        raise SceneError(faults)
    return systems, particle_sets


@contextmanager
def _keys_of(scene: Scene, plan: SystemOfScene) -> Iterator[None]:
    """Errors of a system, which knows its own part of the scene alone, in the keys of the whole scene."""
    try:
        yield
    except SceneError as error:
        raise SceneError([qualify_keys(scene, plan, text) for text in error.faults]) from error
    except SolverError as error:
        raise SolverError(qualify_keys(scene, plan, str(error))) from error


def _generated(
    comm: Any, scene: Scene, plans: tuple[SystemOfScene, ...], meshes: dict[Any, MeshSlices] | None
) -> list[ParticleSet]:
    """This rank's particles of each system, whose bodies are numbered anew from 0; collective."""
    whole = generate(scene, comm, meshes)
    pieces = []
    for plan in plans:
        piece = whole
        if len(plans) > 1:
            piece = take(whole, np.flatnonzero(np.isin(whole.body, plan.bodies)))
            number = np.zeros(len(scene.bodies), whole.body.dtype)
            number[list(plan.bodies)] = np.arange(len(plan.bodies))
            piece = dataclasses.replace(piece, body=number[piece.body])
        owner = method_class(plan.settings).owners(comm, scene.part(plan), piece)
        pieces.append(distribute(comm, piece, owner=owner))
    return pieces
