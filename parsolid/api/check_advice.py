"""Notes on settings of a scene that cost accuracy and can be avoided, before it is run."""

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from parsolid.particles.meshes.quality import quality_of
from parsolid.particles.meshes.slices import MeshSlices, part_of_body, whole_mesh
from parsolid.scene import Scene
from parsolid.scene.codes import Note
from parsolid.scene.previous_results import methods_of
from parsolid.scene.systems import notes_of, settings_of_stages
from parsolid.simulation.loop import Simulation
from parsolid.simulation.representation import layers, thinnest

# (method, placement) -> particles across -> stiffness of a cantilever over that with many particles across, in plane
# strain, ten times as long as thick, in its first mode; with two particles a cell in mpm
BENDING = {
    ("tlsph", "vertices"): {2: 2.3, 3: 1.16},
    ("tlsph", "cells"): {2: 0.59, 3: 0.78, 4: 0.87},
    ("peridynamics", "cells"): {2: 5.5, 3: 3.0, 4: 1.7, 5: 1.33, 6: 1.18, 7: 1.11},
    ("mpm", "cells"): {1: 205.0, 2: 0.81},
}
_METHOD = re.compile(r"\bmethod(?=\.[a-z])")
_POLYCONVEX = ("mooney-rivlin", "neo-hookean")
# too few particles across, for methods that are not in BENDING
_FEW = 3
# a mesh with longer sides [m] may be in millimetres
_LARGE = 5.0
# in equilibrium it may be so if its spacing is above this [m]: structures of that size have finer elements, or weight
_COARSE = 0.5


def scene_advice(scene: Scene) -> list[Note]:
    """Notes that follow from the scene alone."""
    result = notes_of(scene) + list(_of_other_methods(scene))
    for system in scene.systems:
        place = ".".join(map(str, system.place))
        # notes of settings name keys of "method"; indices of bodies are those of the scene
        result += [Note(code, _METHOD.sub(place, text)) for code, text in system.settings.notes(scene, system.bodies)]
    result += _of_laws(scene)
    given = {
        "output.fields_times": scene.output.fields_times or [],
        "output.fields_interval": [scene.output.fields_interval or 0.0],
        "output.history_interval": [scene.output.history_interval or 0.0],
        "output.checkpoint_interval": [scene.output.checkpoint_interval or 0.0],
        "reference.times": (scene.reference and scene.reference.times) or [],
    }
    for key, times in given.items():
        if late := [time for time in times if time > scene.end_time * (1.0 + 1e-9)]:
            text = (
                f"{key}: expected times up to end_time, {scene.end_time:g} s, found {late[0]:g} s, which has no effect"
            )
            result.append(Note("beyond-the-end", text))
    uneven = [
        (i, scene.bodies[i].shape.kind == "mesh" and scene.bodies[i].placed_on == "vertices")
        for system in scene.systems
        for i in system.bodies
        if getattr(system.settings, "pair_weights", "") == "kernel"
        and bool(scene.bodies[i].jitter > 0.0 or scene.bodies[i].shape.kind == "mesh")
    ]
    for weights, of_meshes in (("mesh", True), ("closure", False)):
        if names := ", ".join(f"bodies.{i}" for i, of_mesh in uneven if of_mesh == of_meshes):
            text = f'{names}: uneven particles; method.weights = "{weights}" makes them many times more accurate'
            result.append(Note("uneven-particles", text))
    return result


def _of_laws(scene: Scene) -> Iterator[Note]:
    """Notes on hyperelastic laws that lose ellipticity at moderate strain."""
    from parsolid.materials.hyperelastic.ellipticity import least_wave

    known: dict[Any, float] = {}
    for i, body in enumerate(scene.bodies):
        declared = getattr(body.material, "declared", None)
        if getattr(declared, "role", None) != "hyperelastic" or body.material.kind in _POLYCONVEX:
            continue
        law = body.material.equilibrium_law()
        if law not in known:
            try:
                known[law] = least_wave(law)
            except (ArithmeticError, ValueError):
                # the law is not defined at these strains
                known[law] = np.nan
        if known[law] < 0.0:
            text = f"at strains of 0.3 rho c^2 falls to {known[law]:.2g} of the shear modulus, and waves grow"
            yield Note("lost-waves", f"bodies.{i}.material: {text}; for smaller strain, or another law")


def _of_other_methods(scene: Scene) -> Iterator[Note]:
    """Notes on initial states from results of another method."""
    own = {system.settings.kind for system in scene.systems}
    for i, state in enumerate(scene.initial):
        known = methods_of(Path(state.results)) if state.results and not state.takes_state else []
        if known and not own.intersection(known):
            names = ", ".join(field.name for field in state.of_results)
            methods = " and ".join(sorted(own))
            text = f"initial.{i}: of results of {' and '.join(known)}, {methods} takes only {names}"
            yield Note("other-method", f"{text}; other state of that run is lost")


def advice(simulation: Simulation, meshes: dict[Any, MeshSlices] | None = None) -> list[Note]:
    """All notes on scene, particles and meshes; meshes: see `quality_advice`. Collective, the same on all ranks."""
    scene, result = simulation.scene, scene_advice(simulation.scene) + size_advice(simulation)
    result += quality_advice(simulation, meshes)
    result += [note for system in simulation.systems for note in system.cost_notes()]
    for stated in scene.systems:
        result += stated.settings.choices(scene, stated.bodies)
    return result + thin_advice(simulation)


def thin_advice(simulation: Simulation) -> list[Note]:
    """Notes on slender bodies with too few particles across; collective, the same on all ranks."""
    scene, result = simulation.scene, list[Note]()
    for stated, system in zip(scene.systems, simulation.systems):
        # BENDING is measured with kernel weights
        kind = stated.settings.kind if getattr(stated.settings, "pair_weights", "kernel") == "kernel" else ""
        for number, i in enumerate(stated.bodies):
            thin = thinnest(scene, i, layers(simulation.comm, system, number))
            if thin is not None:
                result += _few_layers(f"bodies.{i}", *thin, kind, scene.bodies[i].placed_on)
    return result


def quality_advice(simulation: Simulation, meshes: dict[Any, MeshSlices] | None = None) -> list[Note]:
    """Notes on shape and size of elements; meshes: that have been read, see `slices.whole_mesh`. Collective, the same
    on all ranks."""
    scene, comm, result = simulation.scene, simulation.comm, list[Note]()
    meshes = {} if meshes is None else meshes
    # bodies whose steps do not depend on the size of elements
    implicit: set[int] = set()
    for system in scene.systems:
        settings = settings_of_stages(scene) if scene.stages else [system.settings]
        if all(getattr(one, "integrator", "") in ("static", "implicit") for one in settings):
            implicit.update(system.bodies)
    for i, body in enumerate(scene.bodies):
        if body.shape.kind != "mesh":
            continue
        model = body.shape.model
        quality = quality_of(part_of_body(whole_mesh(comm, model, scene.dimension, meshes), model))
        where = ", ".join(f"{x:.4g}" for x in quality.place)
        shape = f"the worst aspect of an element is {quality.worst:.3g}, 1 % are above {quality.high:.3g}"
        edge = f"the shortest edge is {quality.shortest:.3g} m at ({where})"
        if i not in implicit:
            saved = f"{1.0 - quality.shortest / quality.short:.0%} fewer steps"
            edge += f" and sets the step: without the 1 % of elements with the shortest edges {saved}"
        result.append(Note("mesh-quality", f"bodies.{i}: {shape}; {edge}"))
    return result


# smallest size [m] of a part in a unit, the unit, units per metre
_UNITS = ((1e3, "km", 1e-3), (1.0, "m", 1.0), (1e-3, "mm", 1e3), (1e-6, "um", 1e6), (0.0, "nm", 1e9))
# shortest and longest credible time [s] in which a wave crosses a part
_CREDIBLE = (1e-9, 3600.0)


def size_advice(simulation: Simulation) -> list[Note]:
    """Notes on ignored or turned elements of meshes, on the size of parts, and on parts that may be in millimetres;
    collective, the same on all ranks."""
    scene, result = simulation.scene, list(simulation.particle_sets[0].notes)
    for stated, system in zip(scene.systems, simulation.systems):
        for number, i in enumerate(stated.bodies):
            if scene.bodies[i].shape.kind != "mesh":
                continue
            lower, upper, spacing = layers(simulation.comm, system, number)
            _, unit, factor = next(one for one in _UNITS if float((upper - lower).max()) >= one[0])
            sides = " x ".join(f"{one:.3g}" for one in factor * (upper - lower))
            result.append(Note("part-size", f"bodies.{i}: a part of {sides} {unit}"))
            modulus, density = system.wave_modulus(number)
            side = float((upper - lower).max())
            if not modulus:
                continue
            crossing = side * float(np.sqrt(density / modulus))
            quasi_static = getattr(getattr(system.settings, "solution", None), "kind", "") == "quasi-static"
            coarse = float(spacing.min()) > _COARSE and scene.loads.acceleration is None
            doubtful = not _CREDIBLE[0] <= crossing <= _CREDIBLE[1]
            large = scene.bodies[i].shape.model.scale == 1.0 and side > _LARGE
            if doubtful or (large and (coarse if quasi_static else scene.end_time < crossing)):
                sides = " x ".join(f"{one:.4g}" for one in upper - lower)
                wave = f", which a wave crosses in {crossing:.3g} s (end_time is {scene.end_time:g} s)"
                hint = f"if it is in millimetres, bodies.{i}.shape.mesh.scale = 1e-3 is wanted"
                text = f"bodies.{i}: its mesh has sides of {sides} m{'' if quasi_static else wave}; {hint}"
                result.append(Note("mesh-scale", text))
    return result


def _few_layers(body: str, across: int, axis: str, kind: str, placement: str) -> Iterator[Note]:
    figure = BENDING.get((kind, placement), {}).get(across)
    here = f"{body}: {across} {'particle' if across == 1 else 'particles'} across {axis}, where it is thin"
    if figure is not None:
        yield Note("few-layers", f"{here}; a cantilever with so many bends as if it were {figure:g} times as stiff")
    elif across <= _FEW and (kind, placement) not in BENDING:
        yield Note("few-layers", f"{here}; too few for bending")
