"""Which conditions of a scene tell their force, and where each finds it."""

from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np
from mpi4py import MPI

from parsolid.boundary.declarations import (
    Declarations,
    Declared,
    HeldRegion,
    PrescribedMotion,
    RegionTraction,
    Support,
    SurfacePressure,
    SurfaceSpring,
    SurfaceTraction,
)
from parsolid.boundary.loads import Load
from parsolid.boundary.rows import HasRows
from parsolid.methods.tlsph.reactions import Found, Reaction, Reactions, Taken, held_against
from parsolid.particles.particle_set import ParticleSet
from parsolid.scene.regions import selected

Finder = Callable[[Taken], Found]


def reactions_of(
    comm: MPI.Comm,
    declared: Declarations,
    particle_set: ParticleSet,
    boundaries: Any,
    tractions: dict[str, Load],
) -> Reactions | None:
    """Those of a `boundaries.BoundarySet`, tractions by their keys; None where no condition tells any; collective."""
    result = []
    for one in declared.all:
        if one.where.reports is None:
            continue
        about = np.array(one.where.moment_about or [0.0] * declared.dimension)  # type: ignore[attr-defined]
        find, driven = _finder(comm, declared, one, particle_set, boundaries, tractions)
        result.append(Reaction(one.where.reports, about, find, driven))
    return Reactions(boundaries.particles, result) if result else None


def _finder(
    comm: MPI.Comm,
    declared: Declarations,
    one: Declared,
    particle_set: ParticleSet,
    boundaries: Any,
    tractions: dict[str, Load],
) -> tuple[Finder, Callable[[], Any] | None]:
    particles, surfaces = boundaries.particles, boundaries.surfaces
    if isinstance(one, PrescribedMotion):
        place = partial(boundaries.prescribed.of, one)
        return lambda stage: (place()[0], held_against(stage, *place())), place
    if isinstance(one, SurfaceTraction | RegionTraction):
        return partial(_of_load, particles, tractions[one.key], declared.dimension), None
    if isinstance(one, SurfacePressure | SurfaceSpring):
        load = next(each for each in surfaces.loads if each.one is one)
        return lambda stage: load.forces(stage.time, stage.before), None
    if isinstance(one, HeldRegion) and one.kind != "fixed":
        number = next(i for i, each in enumerate(surfaces.slides) if each.one is one)
        return partial(_of_slide, surfaces.slides[number], number), None
    assert isinstance(one, Support | HeldRegion)
    components = np.ones(declared.dimension, bool)
    if isinstance(one, Support):
        components = one.plane.held(declared.dimension)
    chosen = particles.selection(selected(declared.scene, one.where, particle_set, comm))
    return partial(_of_clamp, chosen, components), None


def _of_load(particles: Any, load: Load, dimension: int, stage: Taken) -> Found:
    rows = load.chosen.rows
    accelerations = np.zeros((particles.owned, 4))
    load.put(accelerations, stage.time, stage.before)
    return np.asarray(rows), (stage.mass[rows] * stage.share[rows])[:, None] * accelerations[rows, :dimension]


def _of_slide(slide: Any, number: int, stage: Taken) -> Found:
    return slide.rows, stage.share[slide.rows, None] * stage.supports[number]


def _of_clamp(chosen: HasRows, components: np.ndarray, stage: Taken) -> Found:
    rows = chosen.rows
    return rows, held_against(stage, rows, np.broadcast_to(components, (len(rows), len(components))))
