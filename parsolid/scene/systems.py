"""Systems of a scene (a method with its bodies), the part of the scene that each of them sees, and stages of a run."""

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
    """A later part of a run, with other settings of the method; it starts from the state of the part before it."""

    on_restart: ClassVar = {"start": OnRestart.FIXED}
    start: Positive = Field(description="the time [s] at which the stage begins, later than those before it")
    method: dict[str, float | int | str | bool] = Field(
        description="settings of the method in this stage: integrator, and the keys that go with it; others are those "
        "of [method]"
    )


def settings_of_stages(scene: "Scene") -> list[Any]:
    """Settings of the method from time 0 on, and of every stage."""
    return [scene.method, *(scene.method.in_stage(one.method) for one in scene.stages)]


def stage_faults(scene: "Scene") -> list[FaultDetail]:
    """Faults of stages: starts that do not rise, and settings that a stage cannot have."""
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
        return [((*place, "integrator"), "an integrator, such as 'static' or 'leapfrog'", NOTHING, "missing")]
    try:
        settings.in_stage(stated)
    except ValidationError as error:
        return [((*place, one.key), one.expected, Phrase(one.found), one.code) for one in faults_of_errors(error)]
    return []


# tolerance on positions, as a share of the size of a body
_ROUND_OFF = 1e-9


class SystemOfScene(NamedTuple):
    """Settings of a method, and the indices of its bodies in the scene.

    name: unique in the scene, empty if there is one system; place: location of the settings in the scene
    """

    settings: MethodSettings
    bodies: tuple[int, ...]
    name: str = ""
    place: tuple[str | int, ...] = ("method",)


def systems_of(scene: "Scene") -> tuple[SystemOfScene, ...]:
    """One system per method with bodies; several if its bodies share a velocity field and some are in contact."""
    methods: list[Any] = [("", ("method",), scene.method, tuple(range(len(scene.bodies))))]
    if scene.methods is not None:
        # bodies need not name a single method
        names = [body.method or scene.methods[0].name for body in scene.bodies]
        methods = [
            (one.name, ("methods", i), one, tuple(k for k, name in enumerate(names) if name == one.name))
            for i, one in enumerate(scene.methods)
        ]
    systems = []
    for name, place, settings, bodies in methods:
        groups = fields_of(scene, bodies) if settings.shared_field else [bodies]
        for number, group in enumerate(groups if bodies else ()):
            system_name = f"{name or settings.kind}-{number + 1}" if len(groups) > 1 else name
            systems.append(SystemOfScene(settings, group, system_name, place))
    return tuple(systems)


def resolve_defaults(scene: "Scene") -> "Scene":
    """The scene with defaults of methods and bodies that depend on each other."""
    bodies, methods = list(scene.bodies), list(scene.methods or ())
    changes: dict[str, Any] = {"bodies": bodies}
    for system in systems_of(scene):
        for i in system.bodies:
            if _lacks_cells(system, bodies[i]) and bodies[i].placement is None:
                bodies[i] = bodies[i].model_copy(update={"placement": "cells"})
        settings = system.settings.with_defaults(system.settings.defaults_for(scene, system.bodies))
        if scene.methods is None:
            changes["method"] = settings
        else:
            number = int(system.place[1])
            methods[number] = settings
            changes["methods"] = methods
    return scene.model_copy(update=changes)


def _lacks_cells(system: SystemOfScene, body: Any) -> bool:
    """Whether a lattice has particles on its boundary and the method accepts only particles in cells."""
    return system.settings.in_cells and body.shape.kind != "mesh" and body.placed_on == "vertices"


def fields_of(scene: "Scene", bodies: tuple[int, ...]) -> list[tuple[int, ...]]:
    """Groups of bodies that share a velocity field: bodies joined by bonds stay together, bodies in contact do not."""
    contact = scene.in_contact
    if contact is None:
        return [bodies]
    groups: list[list[int]] = []
    # indices of the contacts of each group
    contacts_of_group: list[set[int]] = []
    for joined in _joined(scene, bodies, contact):
        contacts = set().union(*(contact.tables.get(body, set()) for body in joined))
        free = (k for k, other in enumerate(contacts_of_group) if other.isdisjoint(contacts))
        group = next(free, len(groups))
        if group == len(groups):
            groups.append([])
            contacts_of_group.append(set())
        groups[group] += joined
        contacts_of_group[group] |= contacts
    return [tuple(sorted(group)) for group in groups]


def _joined(scene: "Scene", bodies: tuple[int, ...], contact: BodyPairs) -> list[list[int]]:
    """Groups of bodies that bonds join, in the order of their first bodies; bodies in contact are not joined."""
    index = {scene.bodies[body].name: body for body in bodies}
    group_of = {body: [body] for body in bodies}
    for bond in scene.bond:
        groups = {id(group_of[index[name]]): group_of[index[name]] for name in bond.bodies if name in index}
        joined = sorted(body for group in groups.values() for body in group)
        contacts = [table for body in joined for table in contact.tables.get(body, ())]
        if len(set(contacts)) == len(contacts):
            group_of |= dict.fromkeys(joined, joined)
    return list({id(group): group for group in group_of.values()}.values())


def part_of(scene: "Scene", system: SystemOfScene) -> dict[str, Any]:
    """The tables in which the scene of one system differs from the whole scene."""
    loads = scene.loads
    if loads.heat_source is not None and "heat_source" not in system.settings.loads:
        loads = loads.model_copy(update={"heat_source": None})
    boundaries = [scene.boundaries[number] for number in boundaries_of(scene, system)]
    if system.settings.shared_field and len(system.bodies) == 1:
        # conditions on nodes of a grid hold for all bodies of the system
        boundaries = [one.model_copy(update={"body": None}) if one.body else one for one in boundaries]
    return {
        "method": system.settings.model_copy(update={"name": None}),
        "methods": None,
        "bodies": [scene.bodies[number] for number in system.bodies],
        "boundaries": boundaries,
        "regions": list(scene.named_regions.values()),
        "loads": loads,
    }


def boundaries_of(scene: "Scene", system: SystemOfScene) -> list[int]:
    """Indices of the boundaries that act on a system.

    A boundary that names a body acts on its system. Others act on systems that accept their kind and have a body in
    their region at the start; those that are not on particles (walls, temperatures of planes) need no body there.
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
    """For each boundary of a scene, the settings of the methods that it acts on."""
    result: list[list[MethodSettings]] = [[] for _ in scene.boundaries]
    for system in scene.systems:
        numbers = range(len(scene.boundaries)) if len(scene.systems) == 1 else boundaries_of(scene, system)
        for number in numbers:
            if scene.boundaries[number].kind in system.settings.boundaries:
                result[number].append(system.settings)
    return result


def meets(scene: "Scene", boundary: Any, number: int) -> bool:
    """Whether a body may be in a boundary's region at the start; always true for meshes, which are not read here."""
    body = scene.bodies[number]
    if body.shape.kind == "mesh":
        return True
    lower, upper, _ = body.extent()
    slack = _ROUND_OFF * float(abs(upper - lower).max() + abs(upper).max())
    return bool(boundary.region.meets(lower, upper, slack))


def faults_of_methods(scene: "Scene") -> list[FaultDetail]:
    """Faults of keys that the methods of a scene do not accept, see also `methods.refused_kinds`."""
    methods: list[Any] = [scene.method] if scene.methods is None else scene.methods
    named = {one.name: one for one in methods}
    details: list[FaultDetail] = []
    method_of_body: dict[str, Any] = {}
    for i, body in enumerate(scene.bodies):
        settings = named.get(body.method, methods[0])
        if body.name is not None:
            method_of_body[body.name] = settings
        role = type(body.material).declared.role
        if role not in settings.materials and isinstance(getattr(body.material, "law", None), str):
            expected = f"a law with the role {' or '.join(map(repr, settings.materials))}"
            details.append((("bodies", i, "material", "law"), expected, role))
        if body.temperature is not None and "temperature" not in settings.field_kinds(scene.dimension):
            details.append((("bodies", i, "temperature"), "no such key with this method", body.temperature.source))
        if body.grading is not None and not settings.graded_bodies:
            details.append((("bodies", i, "grading"), "no such key with this method", body.grading))
    for i, boundary in enumerate(scene.boundaries):
        near = [method_of_body[boundary.body]] if boundary.body in method_of_body else methods
        for key in boundary.exactly_one[0] if boundary.kind == "pressure" else ():
            if getattr(boundary, key) is not None and all(key not in one.pressed for one in near):
                expected = f"one of {', '.join(near[0].pressed)} with this method"
                details.append((("boundaries", i, key), expected, Phrase(key)))
    return details


def faults_of_systems(scene: "Scene") -> list[Detail]:
    """Faults between methods and the tables of their bodies, and tables of a scene that no method uses."""
    systems = scene.systems
    details: list[Detail] = []
    # fields of probes and of the output that some methods do not know: faults if no method knows them
    doubted: dict[tuple[str | int, ...], list[Detail]] = {}
    for system in systems:
        part = scene.part(system)
        refused = system.settings.contact_refused(part) if _touching(scene, system) else None
        if refused is not None:
            details.append((("contact",), f"no such table {refused}", _touching(scene, system)))
        on_corners = [i for i in system.bodies if _lacks_cells(system, scene.bodies[i])]
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
    # methods without bodies, and axisymmetric methods beside others
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
    """The names in the first contact of a body of the system; empty without a contact."""
    names = {scene.bodies[number].name for number in system.bodies}
    return next((contact.bodies for contact in scene.contact if names.intersection(contact.bodies)), [])


def _in_scene(scene: "Scene", system: SystemOfScene, place: tuple[str | int, ...]) -> tuple[str | int, ...]:
    """A location in the scene of a system as a location in the whole scene."""
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
    """A message about the scene of a system with the keys of the whole scene."""
    if len(scene.systems) == 1 and scene.methods is None:
        return text

    def renamed(found: re.Match[str]) -> str:
        place = system.place if found[1] is None else _in_scene(scene, system, (found[1], int(found[2])))
        return ".".join(map(str, place))

    return re.sub(r"\bmethod(?=\.[a-z])|\b(bodies|boundaries)\.(\d+)\b", renamed, text)


def _uncarried(scene: "Scene", systems: tuple[SystemOfScene, ...]) -> list[Detail]:
    """Faults of boundaries without a body in a scene of several methods: bodies in their region whose method does not
    accept them, and points, which need a body."""
    details: list[Detail] = []
    for i, boundary in enumerate(scene.boundaries):
        if boundary.body is not None or not boundary.on_particles:
            continue
        if getattr(boundary, "point", None) is not None:
            details.append((("boundaries", i, "body"), "a name, because a scene has several methods", NOTHING))
        for system in systems:
            here = [body for body in system.bodies if meets(scene, boundary, body)]
            if here and boundary.kind not in system.settings.boundaries:
                known = ", ".join(map(repr, system.settings.boundaries))
                expected = f"one of {known}, which the method of bodies.{here[0]} knows, or a body for it"
                details.append((("boundaries", i, "kind"), expected, boundary.kind))
                break
    return details


def notes_of(scene: "Scene") -> list[Note]:
    """Notes on bodies that pass through walls, because their method has none."""
    systems, notes = scene.systems, list[Note]()
    for i, boundary in enumerate(scene.boundaries if len(systems) > 1 else ()):
        without = [one for one in systems if boundary.kind not in one.settings.boundaries]
        if boundary.kind == "wall" and without:
            names = ", ".join(f"bodies.{body}" for one in without for body in one.bodies)
            text = f"boundaries.{i}: this wall does not act on {names}, because their methods have no walls"
            notes.append(Note("boundary-without-effect", text))
    return notes


def _substep_faults(scene: "Scene") -> list[Detail]:
    """Faults of `substeps`: in a scene of one system, of methods that cannot take substeps, and if all systems take
    several."""
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
    whole = [system for system in stated if isinstance(system.settings.substeps, int)]
    if len(systems) > 1 and len(whole) == len(systems):
        expected = "1 or 'auto' for one method at least"
        details.append(((*systems[0].place, "substeps"), expected, systems[0].settings.substeps))
    return details
