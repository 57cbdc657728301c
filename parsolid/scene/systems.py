"""A scene's systems, which method has which bodies and the scene that each of them sees; and the stages of a run."""

import re
from typing import TYPE_CHECKING, Any, ClassVar, NamedTuple

from pydantic import Field, ValidationError

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import Detail, FaultDetail, OnRestart, Positive, SceneModel, faults_of_errors
from parsolid.scene.codes import Note
from parsolid.scene.contact import BodyPairs
from parsolid.scene.method_settings import MethodSettings
from parsolid.scene.validation_errors import NOTHING

if TYPE_CHECKING:
    from parsolid.scene.schema import Scene


class Stage(SceneModel):
    """A part of a run that goes on from the state of the part before it with other settings of the method."""

    on_restart: ClassVar = {"start": OnRestart.FIXED}
    start: Positive = Field(description="the time [s] at which the stage begins, later than those before it")
    method: dict[str, float | int | str | bool] = Field(
        description="settings of the method in this stage: integrator, and the keys that go with it; others are those "
        "of [method]"
    )


def settings_of_stages(scene: "Scene") -> list[Any]:
    """Those of the scene's method from time 0 on, and those of every stage."""
    return [scene.method, *(scene.method.in_stage(one.method) for one in scene.stages)]


def stage_faults(scene: "Scene") -> list[FaultDetail]:
    """Stages that do not follow one another, and settings that no stage may have."""
    if not scene.stages:
        return []
    settings, faults, before = scene.method, list[FaultDetail](), 0.0
    if settings is None or not settings.stage_keys:
        found = Phrase("several methods" if settings is None else f"the method {settings.kind!r}")
        return [(("stages",), "no such table but with the method 'tlsph' alone", found)]
    for i, one in enumerate(scene.stages):
        if not before < one.start < scene.end_time:
            expected = f"a time between {before:g} s and the end, {scene.end_time:g} s"
            faults.append((("stages", i, "start"), expected, one.start))
        before = one.start
        faults += _faults_of_settings(settings, one.method, ("stages", i, "method"))
    return faults


def _faults_of_settings(settings: MethodSettings, stated: dict[str, Any], place: tuple[Any, ...]) -> list[FaultDetail]:
    unknown = stated.keys() - set(settings.stage_keys)
    if unknown:
        known = ", ".join(settings.stage_keys)
        return [
            ((*place, key), f"one of {known}", Phrase(f"the key {key!r}"), "unknown-key") for key in sorted(unknown)
        ]
    if "integrator" not in stated:
        return [((*place, "integrator"), "what the stage is, as 'static' or 'leapfrog'", NOTHING, "missing")]
    try:
        settings.in_stage(stated)
    except ValidationError as error:
        return [((*place, one.key), one.expected, Phrase(one.found), one.code) for one in faults_of_errors(error)]
    return []


# of the size of a body
_ROUND_OFF = 1e-9


class SystemOfScene(NamedTuple):
    """Settings of a method, and the numbers of its bodies among those of the scene.

    name: unlike that of any other system of the scene, empty where there is one; place: of the settings in the scene.
    """

    settings: MethodSettings
    bodies: tuple[int, ...]
    name: str = ""
    place: tuple[str | int, ...] = ("method",)


def systems_of(scene: "Scene") -> tuple[SystemOfScene, ...]:
    """One system a method, and more of a method whose bodies share a field, where some of them must not."""
    if scene.methods is None:
        stated: list[Any] = [("", ("method",), scene.method, tuple(range(len(scene.bodies))))]
    else:
        # the only one of a scene need not be named
        own = [body.method or scene.methods[0].name for body in scene.bodies]
        stated = [
            (one.name, ("methods", i), one, tuple(k for k, name in enumerate(own) if name == one.name))
            for i, one in enumerate(scene.methods)
        ]
    result = []
    for name, place, settings, bodies in stated:
        groups = fields_of(scene, bodies) if settings.shared_field else [bodies]
        for number, group in enumerate(groups if bodies else ()):
            own_name = f"{name or settings.kind}-{number + 1}" if len(groups) > 1 else name
            result.append(SystemOfScene(settings, group, own_name, place))
    return tuple(result)


def resolve_defaults(scene: "Scene") -> "Scene":
    """The scene whose methods and bodies have values of keys that it leaves out, where those depend on each other."""
    bodies, methods = list(scene.bodies), list(scene.methods or ())
    changes: dict[str, Any] = {"bodies": bodies}
    for system in systems_of(scene):
        for i in system.bodies:
            if _wants_cells(system, bodies[i]) and bodies[i].placement is None:
                bodies[i] = bodies[i].model_copy(update={"placement": "cells"})
        settings = system.settings.with_defaults(system.settings.defaults_for(scene, system.bodies))
        if scene.methods is None:
            changes["method"] = settings
        else:
            number = int(system.place[1])
            methods[number] = settings
            changes["methods"] = methods
    return scene.model_copy(update=changes)


def _wants_cells(system: SystemOfScene, body: Any) -> bool:
    """Whether a body's lattice is on the corners of cells, and its method takes their middles alone."""
    return system.settings.in_cells and body.shape.kind != "mesh" and body.placed_on == "vertices"


def fields_of(scene: "Scene", bodies: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Bodies in groups, each with a field of its own: each body, with those that bonds name with it, in the first group
    that has none in contact with them."""
    contact = scene.in_contact
    if contact is None:
        return [bodies]
    groups: list[list[int]] = []
    # numbers of the contacts of each group
    taken: list[set[int]] = []
    for joined in _joined(scene, bodies, contact):
        met = set().union(*(contact.tables.get(body, set()) for body in joined))
        home = next((k for k, other in enumerate(taken) if other.isdisjoint(met)), len(groups))
        if home == len(groups):
            groups.append([])
            taken.append(set())
        groups[home] += joined
        taken[home] |= met
    return [tuple(sorted(group)) for group in groups]


def _joined(scene: "Scene", bodies: tuple[int, ...], contact: BodyPairs) -> list[list[int]]:
    """Bodies with all that named bonds join to them, in the order of the first; each alone if some are in contact."""
    number = {scene.bodies[body].name: body for body in bodies}
    group = {body: [body] for body in bodies}
    for one in scene.bond:
        together = {id(group[number[name]]): group[number[name]] for name in one.bodies if name in number}
        joined = sorted(body for each in together.values() for body in each)
        met = [table for body in joined for table in contact.tables.get(body, ())]
        if len(set(met)) == len(met):
            group |= dict.fromkeys(joined, joined)
    return list({id(each): each for each in group.values()}.values())


def part_of(scene: "Scene", system: SystemOfScene) -> dict[str, Any]:
    """The tables that one system's scene has otherwise: its method and bodies, the boundaries and loads it carries."""
    loads = scene.loads
    if loads.heat_source is not None and "heat_source" not in system.settings.loads:
        loads = loads.model_copy(update={"heat_source": None})
    carried = [scene.boundaries[number] for number in boundaries_of(scene, system)]
    # that of the only body is one of all, as conditions on a grid's nodes are
    alone = system.settings.shared_field and len(system.bodies) == 1
    return {
        "method": system.settings.model_copy(update={"name": None}),
        "methods": None,
        "bodies": [scene.bodies[number] for number in system.bodies],
        "boundaries": [one.model_copy(update={"body": None}) if alone and one.body else one for one in carried],
        "regions": list(scene.named_regions.values()),
        "loads": loads,
    }


def boundaries_of(scene: "Scene", system: SystemOfScene) -> list[int]:
    """Numbers of the boundaries that a system carries: of kinds that it knows, and in whose region it has a body.

    A boundary for any body holds those that are in its region at the start; what is no matter of particles, a wall or a
    temperature of a plane, is for every system that knows it.
    """
    names, result = {scene.bodies[number].name for number in system.bodies}, []
    for number, boundary in enumerate(scene.boundaries):
        if boundary.body is not None:
            if boundary.body in names:
                result.append(number)
        elif boundary.kind in system.settings.boundaries and (
            not boundary.on_particles or any(meets(scene, boundary, body) for body in system.bodies)
        ):
            result.append(number)
    return result


def methods_of_boundaries(scene: "Scene") -> list[list[MethodSettings]]:
    """Settings of the methods that carry each boundary of a scene."""
    every = range(len(scene.boundaries))
    alone = len(scene.systems) == 1
    carried = [(system.settings, every if alone else boundaries_of(scene, system)) for system in scene.systems]
    return [
        [settings for settings, numbers in carried if number in numbers and one.kind in settings.boundaries]
        for number, one in enumerate(scene.boundaries)
    ]


def meets(scene: "Scene", boundary: Any, number: int) -> bool:
    """Whether a body may be in a boundary's region at the start; a mesh, which is not read for this, always may."""
    body = scene.bodies[number]
    if body.shape.kind == "mesh":
        return True
    lower, upper, _ = body.extent()
    slack = _ROUND_OFF * float(abs(upper - lower).max() + abs(upper).max())
    met: bool = boundary.region.meets(lower, upper, slack)
    return met


def faults_of_systems(scene: "Scene") -> list[Detail]:
    """What methods cannot make of the tables of their bodies, and what of a scene is for no method."""
    systems = scene.systems
    details: list[Detail] = []
    # fields of probes and of the output that some methods refuse: faults where no method knows them
    doubted: dict[tuple[str | int, ...], list[Detail]] = {}
    for system in systems:
        part = scene.part(system)
        refused = system.settings.contact_refused(part) if _touching(scene, system) else None
        if refused is not None:
            details.append((("contact",), f"no such table {refused}", _touching(scene, system)))
        on_corners = [i for i in system.bodies if _wants_cells(system, scene.bodies[i])]
        details += [(("bodies", i, "placement"), "'cells' with this method", "vertices") for i in on_corners]
        for place, expected, found in system.settings.scene_faults(part):
            if place[0] in ("probes", "output"):
                doubted.setdefault(place, []).append((place, expected, found))
            else:
                details.append((_in_scene(scene, system, place), expected, found))
    for faults in doubted.values():
        name = faults[0][2]
        settings = [one.settings for one in systems]
        if len(faults) >= sum(name in one.field_kinds(scene.dimension) | one.extra_quantities for one in settings):
            details.append(faults[0])
    details += _uncarried(scene, systems) if len(systems) > 1 else []
    # methods that no body has, and one per radian of an axis beside one per metre of thickness
    methods = scene.methods or ()
    used = {body.method for body in scene.bodies}
    for i, one in enumerate(methods):
        if len(methods) > 1 and one.name not in used:
            details.append((("methods", i, "name"), "the name of a method that a body has", one.name))
    round_an_axis = [getattr(one, "geometry", None) == "axisymmetric" for one in methods]
    if any(round_an_axis) and not all(round_an_axis):
        place = ("methods", round_an_axis.index(True), "geometry")
        details.append((place, "'axisymmetric' for all methods or for none", "axisymmetric"))
    return details + _substep_faults(scene)


def _touching(scene: "Scene", system: SystemOfScene) -> list[str]:
    """The bodies of the first contact that one of a system's is in."""
    own = {scene.bodies[number].name for number in system.bodies}
    return next((one.bodies for one in scene.contact if own.intersection(one.bodies)), [])


def _in_scene(scene: "Scene", system: SystemOfScene, place: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """A place in a system's scene as one in the whole scene."""
    if scene.part(system) is scene:
        return place
    if place[0] == "method":
        return (*system.place, *place[1:])
    if place[0] == "bodies" and len(place) > 1:
        return ("bodies", system.bodies[int(place[1])], *place[2:])
    if place[0] == "boundaries" and len(place) > 1:
        return ("boundaries", boundaries_of(scene, system)[int(place[1])], *place[2:])
    return place


def qualify_keys(scene: "Scene", system: SystemOfScene, text: str) -> str:
    """A message about a system's scene with the keys of the whole scene."""
    if len(scene.systems) == 1 and scene.methods is None:
        return text

    def renamed(found: re.Match[str]) -> str:
        place = system.place if found[1] is None else _in_scene(scene, system, (found[1], int(found[2])))
        return ".".join(map(str, place))

    return re.sub(r"\bmethod(?=\.[a-z])|\b(bodies|boundaries)\.(\d+)\b", renamed, text)


def _uncarried(scene: "Scene", systems: tuple[SystemOfScene, ...]) -> list[Detail]:
    """Boundaries for any body in whose region are bodies of methods that do not know them, and nearest particles."""
    details: list[Detail] = []
    for i, boundary in enumerate(scene.boundaries):
        if boundary.body is not None or not boundary.on_particles:
            continue
        if getattr(boundary, "point", None) is not None:
            details.append((("boundaries", i, "body"), "a name, where a point is of one of several methods", NOTHING))
        for system in systems:
            here = [body for body in system.bodies if meets(scene, boundary, body)]
            if here and boundary.kind not in system.settings.boundaries:
                known = ", ".join(map(repr, system.settings.boundaries))
                expected = f"one of {known}, which the method of bodies.{here[0]} knows, or a body for it"
                details.append((("boundaries", i, "kind"), expected, boundary.kind))
                break
    return details


def notes_of(scene: "Scene") -> list[Note]:
    """What bodies of several systems do not take part in, in words."""
    systems, notes = scene.systems, list[Note]()
    for i, boundary in enumerate(scene.boundaries if len(systems) > 1 else ()):
        without = [one for one in systems if boundary.kind not in one.settings.boundaries]
        # what has no temperature needs to know none
        if boundary.kind == "wall" and without:
            names = ", ".join(f"bodies.{body}" for one in without for body in one.bodies)
            text = f"boundaries.{i}: {names} know nothing of this {boundary.kind}, as their methods have none"
            notes.append(Note("boundary-without-effect", text))
    return notes


def _substep_faults(scene: "Scene") -> list[Detail]:
    """Of one system alone; of solvers of equilibrium, or that break bonds; where all take several."""
    systems = scene.systems
    stated = [system for system in systems if system.settings.substeps not in (None, 1)]
    details: list[Detail] = []
    for system in stated:
        place, found = (*system.place, "substeps"), system.settings.substeps
        if len(systems) == 1:
            details.append((place, "no such key where no other system takes steps", found))
        refused = system.settings.substeps_refused()
        if refused is not None:
            details.append((place, f"no such key {refused}", found))
    timed = [system for system in systems if getattr(system.settings, "balance", "particles") == "measured"]
    if len(systems) == 1:
        details += [((*one.place, "balance"), "'particles' where there is one method", "measured") for one in timed]
    whole = [system for system in stated if isinstance(system.settings.substeps, int)]
    if len(systems) > 1 and len(whole) == len(systems):
        expected = "1 or 'auto' for one method at least"
        details.append(((*systems[0].place, "substeps"), expected, systems[0].settings.substeps))
    return details
