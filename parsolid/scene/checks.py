"""What looks at several tables of a scene at once."""

from typing import Any

import numpy as np

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import FaultDetail, Plane
from parsolid.scene.bond import bond_faults
from parsolid.scene.boundaries.condition import clashes, reaction_columns, reaction_details
from parsolid.scene.contact import (
    CONTACT_TERMS,
    FRICTION_HEAT,
    GRID_TERMS,
    TOOL_TERMS,
    contact_faults,
    energy_terms,
    grid_faults,
    of_model,
)
from parsolid.scene.fillings import filling_of
from parsolid.scene.initial_state import initial_details
from parsolid.scene.lattice import Filling
from parsolid.scene.method_settings import named_observables
from parsolid.scene.named_regions import region_details
from parsolid.scene.observation import HISTORY_COLUMNS, MANUFACTURED, solution_faults
from parsolid.scene.observed import FIELDS_OF_CONTACT, with_components
from parsolid.scene.schema import Scene
from parsolid.scene.sound_part import LeftOut
from parsolid.scene.substeps import substep_faults
from parsolid.scene.systems import carriers_of, faults_of_systems
from parsolid.scene.tie import TIE_TERMS, tie_faults
from parsolid.scene.tools import still_faults, tool_faults
from parsolid.scene.validation_errors import NOTHING, Fault, SceneError, suggestion

# outputs in a run to its end, at most, by the keys of their intervals
MOST_OUTPUTS = {"history_interval": 10**7, "fields_interval": 10**5, "checkpoint_interval": 10**7}


def check_scene(scene: Scene, left_out: LeftOut | None = None) -> list[Fault]:
    """Faults between the tables of a scene, or of the sound part of one that lacks what is left out.

    What depends on a method or a material that is itself at fault is not told.
    """
    lacking = LeftOut.nothing(scene.resolved()) if left_out is None else left_out
    fillings, details = _fillings(scene, lacking)
    details += _repeated_names("bodies", scene.bodies, lacking) + _repeated_names("probes", scene.probes, lacking)
    details += [] if lacking.incomplete else _contact_fields(scene)
    details += _empty_bodies(fillings) + _boundary_details(scene, fillings, lacking)
    details += clashes(scene.boundaries)
    if len(fillings) == len(scene.bodies):
        details += _distant_probes(scene, fillings)
    details += contact_faults(scene.contact, lacking.body_names) + tool_faults(scene, lacking.body_names)
    details += region_details(scene, lacking.regions, lacking.shape_unknown) + _loads_details(scene, lacking.incomplete)
    if lacking.end_known:
        details += _output_details(scene)
    if lacking.models_known:
        if len(fillings) == len(scene.bodies):
            details += _fields_elsewhere(scene, fillings)
        if lacking.systems_known:
            details += faults_of_systems(scene) + still_faults(scene) + substep_faults(scene)
        if lacking.systems_known and lacking.body_names is not None:
            details += tie_faults(scene) + bond_faults(scene)
        details += grid_faults(scene) + ([] if lacking.body_names is None else initial_details(scene))
        names = [probe.name for probe in scene.probes]
        details += reaction_details(scene.boundaries, names, carriers_of(scene))
        details += _solution_details(scene) + _reference_details(scene, lacking.incomplete)
    return list(dict.fromkeys(lacking.faults(details)))


def _fillings(scene: Scene, lacking: LeftOut) -> tuple[dict[int, Filling], list[FaultDetail]]:
    """The particles of bodies that are where the file would have them, but for meshes, which are not read here."""
    fillings: dict[int, Filling] = {}
    details: list[FaultDetail] = []
    for i, body in enumerate(scene.bodies):
        if body.shape.kind != "mesh" and i not in lacking.misplaced:
            try:
                fillings[i] = filling_of(body, scene.dimension)
            except SceneError as error:
                found = (one for one in error.faults if isinstance(one, Fault))
                details += [(("bodies", i), one.expected, Phrase(one.found)) for one in found]
    return fillings, details


def _repeated_names(key: str, entries: list[Any], lacking: LeftOut) -> list[FaultDetail]:
    details: list[FaultDetail] = []
    seen: dict[str, int] = {}
    for i, entry in enumerate(entries):
        if entry.name is not None and entry.name in seen:
            before = f"{key}.{lacking.number(key, seen[entry.name])}"
            details.append(((key, i, "name"), f"a name other than that of {before}", entry.name, "repeated"))
        seen.setdefault(entry.name, i)
    return details


def _empty_bodies(fillings: dict[int, Filling]) -> list[FaultDetail]:
    expected = "a body of at least two particles"
    return [(("bodies", i), expected, filling.count) for i, filling in fillings.items() if filling.count < 2]


def plane_side(plane: Plane, filling: Filling) -> int:
    """-1 or +1 when the plane is the lower or upper bound of the body, 0 when it bounds it nowhere."""
    lower, upper = filling.lower[plane.axis], filling.upper[plane.axis]
    tolerance = 1e-9 * max(abs(lower), abs(upper), upper - lower)
    if abs(plane.offset - lower) <= tolerance:
        return -1
    return 1 if abs(plane.offset - upper) <= tolerance else 0


def _boundary_details(scene: Scene, fillings: dict[int, Filling], lacking: LeftOut) -> list[FaultDetail]:
    details: list[FaultDetail] = []
    for i, boundary in enumerate(scene.boundaries):
        if boundary.body is not None and lacking.body_names is not None and boundary.body not in lacking.body_names:
            expected = f"the name of a body{suggestion(boundary.body, lacking.body_names)}"
            details.append((("boundaries", i, "body"), expected, boundary.body, "unknown-name"))
        else:
            details += unbounded_plane(i, boundary, scene.bodies, fillings)
    return details


def unbounded_plane(place: int, boundary: Any, bodies: list[Any], fillings: dict[int, Filling]) -> list[FaultDetail]:
    """The fault of a support or traction whose plane bounds none of the bodies it is meant for; none where one of them
    is not known."""
    meant = [i for i, body in enumerate(bodies) if boundary.body in (None, body.name)]
    if not boundary.needs_bounding_plane or boundary.plane is None or any(i not in fillings for i in meant):
        return []
    if not meant or any(plane_side(boundary.plane, fillings[i]) for i in meant):
        return []
    axis = boundary.plane.axis
    bounds = sorted({float(bound[axis]) for i in meant for bound in (fillings[i].lower, fillings[i].upper)})
    expected = f"a plane that bounds a body ({'XYZ'[axis]} = {' or '.join(f'{bound:g}' for bound in bounds)})"
    return [(("boundaries", place, "plane"), expected, str(boundary.plane), "elsewhere")]


def _away(filling: Filling, at: list[float]) -> float:
    """Distance [m] of a point from a body's bounds."""
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(filling.lower - at, at - filling.upper))))


def _distant_probes(scene: Scene, fillings: dict[int, Filling]) -> list[FaultDetail]:
    details: list[FaultDetail] = []
    for i, probe in enumerate(scene.probes):
        if probe.at is None:
            continue
        beyond = [_away(filling, probe.at) - filling.coarsest for filling in fillings.values()]
        if min(beyond) > 0.0:
            details.append((("probes", i, "at"), "a point within one spacing of a body", probe.at, "elsewhere"))
    return details


def _fields_elsewhere(scene: Scene, fillings: dict[int, Filling]) -> list[FaultDetail]:
    """Fields of probes at bodies whose methods have no such field, where other methods of the scene have it."""
    known = [with_components(one.settings.field_kinds(scene.dimension), scene.dimension) for one in scene.systems]
    kinds = {body: known[number] for number, one in enumerate(scene.systems) for body in one.bodies}
    details: list[FaultDetail] = []
    for i, probe in enumerate(scene.probes):
        if probe.at is None:
            continue
        distance = {body: _away(filling, probe.at) for body, filling in fillings.items()}
        near = [body for body, away in distance.items() if away == min(distance.values())]
        for k, name in enumerate(probe.fields or ()):
            if any(name in each for each in kinds.values()) and not any(name in kinds[body] for body in near):
                expected = f"a field that the method of bodies.{near[0]} knows"
                details.append((("probes", i, "fields", k), expected, name))
    return details


def _contact_fields(scene: Scene) -> list[FaultDetail]:
    """Fields of contact that are asked for where there is none between particles."""
    if of_model(scene.contact, "kernel"):
        return []
    known = with_components(FIELDS_OF_CONTACT, scene.dimension)
    expected = "a field of a scene with [[contact]] of model 'kernel'"
    return [(place, expected, name) for place, name in named_observables(scene) if name in known]


def _loads_details(scene: Scene, incomplete: bool) -> list[FaultDetail]:
    exact = None if scene.reference is None else scene.reference.exact
    if not scene.loads.manufactured or exact in MANUFACTURED or (scene.reference is None and incomplete):
        return []
    expected = f"reference.exact = {' or '.join(map(repr, MANUFACTURED))}"
    return [(("loads", "manufactured"), expected, NOTHING if exact is None else exact)]


def _solution_details(scene: Scene) -> list[FaultDetail]:
    exact = None if scene.reference is None else scene.reference.exact
    if exact is not None and len(scene.methods or ()) > 1:
        return [(("reference", "exact"), "no such key with several methods", exact)]
    return [] if exact is None else [*solution_faults(exact, scene.bodies[0].material)]


def _output_details(scene: Scene) -> list[FaultDetail]:
    stated = [(key, getattr(scene.output, key), most) for key, most in MOST_OUTPUTS.items()]
    return [
        (("output", key), f"at least end_time/{most:g} = {scene.end_time / most:g} s", interval)
        for key, interval, most in stated
        if interval and interval < scene.end_time / most
    ]


def _reference_details(scene: Scene, incomplete: bool) -> list[FaultDetail]:
    """Columns of a reference that the history does not have; incomplete: some may be of entries that are left out."""
    if scene.reference is None:
        return []
    key = "final" if scene.reference.final is not None else "columns"
    terms = [name for system in scene.systems for name in system.settings.ledger_terms]
    met = energy_terms(scene.contact, scene.tools, [body.material for body in scene.bodies])
    known = [*HISTORY_COLUMNS, *terms, *met, *(TIE_TERMS if scene.tie else ())]
    for name in (one.reports for one in scene.boundaries if one.reports is not None):
        known += [f"{name}.work", *reaction_columns(name, scene.dimension)]
    every: list[Any] = [*scene.probes, *scene.tools]
    for watched in every:
        known += watched.columns(scene.dimension)
    elsewhere = CONTACT_TERMS | TOOL_TERMS | GRID_TERMS | FRICTION_HEAT | TIE_TERMS if incomplete else {}
    return [
        (("reference", key, column), f"a column of the history{suggestion(column, known)}", column, "unknown-name")
        for column in getattr(scene.reference, key) or ()
        if column not in known and column not in elsewhere and not (incomplete and "." in column)
    ]
