"""Checks between the tables of a scene."""

from typing import Any

import numpy as np

from parsolid.scene import contact
from parsolid.scene.base_model import FaultDetail, Plane
from parsolid.scene.bodies import Extent
from parsolid.scene.boundary_faults import clashes, reaction_columns, reaction_details
from parsolid.scene.error_recovery import Repairs
from parsolid.scene.initial_state import initial_details
from parsolid.scene.method_settings import named_observables
from parsolid.scene.named_regions import region_details
from parsolid.scene.observation import HISTORY_COLUMNS, MANUFACTURED, solution_faults
from parsolid.scene.observed import FIELDS_OF_CONTACT, with_components
from parsolid.scene.schema import Scene
from parsolid.scene.systems import faults_of_systems, methods_of_boundaries, stage_faults
from parsolid.scene.tools import tool_faults, tool_motion_faults
from parsolid.scene.validation_errors import NOTHING, Fault, suggestion

# largest number of outputs in a run, by the key of their interval
MOST_OUTPUTS = {"history_interval": 10**7, "fields_interval": 10**5, "checkpoint_interval": 10**7}


def check_scene(scene: Scene, repairs: Repairs | None = None) -> list[Fault]:
    """Faults between the tables of a scene, which may have been repaired after faults of single tables.

    Checks that depend on a faulty method or material are left out.
    """
    repairs = Repairs.none(scene.resolved()) if repairs is None else repairs
    # bodies with an extent as the file states it; meshes are not read here
    placed = {
        i: body for i, body in enumerate(scene.bodies) if body.shape.kind != "mesh" and i not in repairs.misplaced
    }
    extents = {i: body.extent() for i, body in placed.items()}
    details: list[FaultDetail] = [(("bodies", i), *one) for i, body in placed.items() for one in body.lattice_faults()]
    details += _repeated_names("bodies", scene.bodies, repairs) + _repeated_names("probes", scene.probes, repairs)
    if not repairs.incomplete and not contact.of_model(scene.contact, "kernel"):
        of_contact = with_components(FIELDS_OF_CONTACT, scene.dimension)
        expected = "a field other than those of [[contact]] with model 'kernel'"
        details += [(place, expected, name) for place, name in named_observables(scene) if name in of_contact]
    unknown = [] if repairs.body_names is None else _unknown_bodies(scene, repairs.body_names)
    details += unknown
    for i, boundary in enumerate(scene.boundaries):
        details += unbounded_plane(i, boundary, scene.bodies, extents)
    details += clashes(scene.boundaries)
    if len(extents) == len(scene.bodies):
        details += _misplaced_probes(scene, extents, repairs.models_known)
    details += contact.contact_faults(scene.contact) + tool_faults(scene)
    details += region_details(scene, repairs.regions, repairs.shape_unknown)
    exact = None if scene.reference is None else scene.reference.exact
    if scene.loads.manufactured and exact not in MANUFACTURED and not (scene.reference is None and repairs.incomplete):
        expected = f"reference.exact = {' or '.join(map(repr, MANUFACTURED))}"
        details.append((("loads", "manufactured"), expected, NOTHING if exact is None else exact))
    if repairs.end_known:
        for key, most in MOST_OUTPUTS.items():
            interval, least = getattr(scene.output, key), scene.end_time / most
            if interval and interval < least:
                details.append((("output", key), f"at least end_time/{most:g} = {least:g} s", interval))
        method_known = repairs.models_known and not repairs.reduced_methods
        details += stage_faults(scene) if repairs.systems_known or method_known else []
    if repairs.body_names is not None:
        ties_known = all(place[0] != "tie" for place, *_ in unknown)
        details += contact.tie_faults(scene, ties_known and repairs.models_known and repairs.systems_known)
        details += contact.bond_faults(scene, repairs.models_known)
    if repairs.models_known:
        if repairs.systems_known:
            details += faults_of_systems(scene) + tool_motion_faults(scene)
        details += contact.grid_faults(scene) + ([] if repairs.body_names is None else initial_details(scene))
        names = [probe.name for probe in scene.probes]
        details += reaction_details(scene.boundaries, names, methods_of_boundaries(scene))
        if exact is not None and len(scene.methods or ()) > 1:
            details.append((("reference", "exact"), "no such key with several methods", exact))
        elif exact is not None:
            details += solution_faults(exact, scene.bodies[0].material)
        details += _reference_details(scene, repairs.incomplete)
    return list(dict.fromkeys(repairs.faults(details)))


def _unknown_bodies(scene: Scene, names: list[str]) -> list[FaultDetail]:
    """Faults of names of bodies in other tables that no body has; names: of all bodies."""
    uses: list[tuple[tuple[str | int, ...], str | None]] = []
    uses += [(("boundaries", i, "body"), one.body) for i, one in enumerate(scene.boundaries)]
    uses += [(("initial", i, "body"), one.body) for i, one in enumerate(scene.initial)]
    uses += [
        (("tools", i, "bodies", k), name)
        for i, one in enumerate(scene.tools)
        for k, name in enumerate(one.bodies or ())
    ]
    for key in ("contact", "tie", "bond"):
        tables: list[Any] = getattr(scene, key)
        uses += [
            ((key, i, "bodies"), name)
            for i, one in enumerate(tables)
            for name in one.bodies
            if one.bodies != contact.ALL
        ]
    known = set(names)
    return [
        (place, f"the name of a body{suggestion(name, names)}", name, "unknown-name")
        for place, name in uses
        if name is not None and name not in known
    ]


def _repeated_names(key: str, entries: list[Any], repairs: Repairs) -> list[FaultDetail]:
    details: list[FaultDetail] = []
    seen: dict[str, int] = {}
    for i, entry in enumerate(entries):
        if entry.name is not None and entry.name in seen:
            before = f"{key}.{repairs.number(key, seen[entry.name])}"
            details.append(((key, i, "name"), f"a name other than that of {before}", entry.name, "repeated"))
        seen.setdefault(entry.name, i)
    return details


def plane_side(plane: Plane, extent: Extent) -> int:
    """-1 or +1 if the plane is the lower or upper bound of the body, 0 if it does not bound it."""
    lower, upper = extent.lower[plane.axis], extent.upper[plane.axis]
    tolerance = 1e-9 * max(abs(lower), abs(upper), upper - lower)
    if abs(plane.offset - lower) <= tolerance:
        return -1
    return 1 if abs(plane.offset - upper) <= tolerance else 0


def unbounded_plane(place: int, boundary: Any, bodies: list[Any], extents: dict[int, Extent]) -> list[FaultDetail]:
    """The fault of a support or traction whose plane bounds none of its bodies; none if an extent is not known."""
    own = [i for i, body in enumerate(bodies) if boundary.body in (None, body.name)]
    if not boundary.needs_bounding_plane or boundary.plane is None or any(i not in extents for i in own):
        return []
    if not own or any(plane_side(boundary.plane, extents[i]) for i in own):
        return []
    axis = boundary.plane.axis
    bounds = sorted({float(bound[axis]) for i in own for bound in (extents[i].lower, extents[i].upper)})
    expected = f"a plane that bounds a body ({'XYZ'[axis]} = {' or '.join(f'{bound:g}' for bound in bounds)})"
    return [(("boundaries", place, "plane"), expected, str(boundary.plane), "elsewhere")]


def _misplaced_probes(scene: Scene, extents: dict[int, Extent], models_known: bool) -> list[FaultDetail]:
    """Faults of probes at a point: no body there, or fields that only methods of other bodies have."""
    details: list[FaultDetail] = []
    fields_of_body: dict[int, dict[str, str]] = {}
    for system in scene.systems if models_known else ():
        fields = with_components(system.settings.field_kinds(scene.dimension), scene.dimension)
        fields_of_body |= dict.fromkeys(system.bodies, fields)
    for i, probe in enumerate(scene.probes):
        if probe.at is None:
            continue
        distance = {
            body: float(np.linalg.norm(np.maximum(0.0, np.maximum(one.lower - probe.at, probe.at - one.upper))))
            for body, one in extents.items()
        }
        if min(distance[body] - extent.coarsest for body, extent in extents.items()) > 0.0:
            details.append((("probes", i, "at"), "a point within one spacing of a body", probe.at, "elsewhere"))
        near = [body for body, away in distance.items() if away == min(distance.values())]
        for k, name in enumerate(probe.fields or () if models_known else ()):
            known = [body for body, fields in fields_of_body.items() if name in fields]
            if known and not set(known) & set(near):
                expected = f"a field that the method of bodies.{near[0]} knows"
                details.append((("probes", i, "fields", k), expected, name))
    return details


def _reference_details(scene: Scene, incomplete: bool) -> list[FaultDetail]:
    """Faults of columns of a reference that the history does not have; incomplete: some tables were left out, and their
    columns are accepted."""
    if scene.reference is None:
        return []
    key = "final" if scene.reference.final is not None else "columns"
    terms = [name for system in scene.systems for name in system.settings.ledger_terms]
    of_contact = contact.energy_terms(scene.contact, scene.tools, [body.material for body in scene.bodies])
    known = [*HISTORY_COLUMNS, *terms, *of_contact, *(contact.TIE_TERMS if scene.tie else ())]
    for name in (one.reports for one in scene.boundaries if one.reports is not None):
        known += [f"{name}.work", *reaction_columns(name, scene.dimension)]
    for probe in scene.probes:
        known += probe.columns(scene.dimension)
    for tool in scene.tools:
        known += tool.columns(scene.dimension)
    of_lost_tables = (
        contact.CONTACT_TERMS | contact.TOOL_TERMS | contact.GRID_TERMS | contact.FRICTION_HEAT | contact.TIE_TERMS
        if incomplete
        else {}
    )
    return [
        (("reference", key, column), f"a column of the history{suggestion(column, known)}", column, "unknown-name")
        for column in getattr(scene.reference, key) or ()
        if column not in known and column not in of_lost_tables and not (incomplete and "." in column)
    ]
