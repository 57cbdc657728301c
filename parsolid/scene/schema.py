"""The scene as a whole, and the checks that look at several of its tables at once."""

from dataclasses import dataclass, field
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError, ValidationInfo, field_validator, model_validator
from pydantic_core import InitErrorDetails

from parsolid.materials.declaration import Phrase
from parsolid.observables.reaction import reaction_columns
from parsolid.scene.base_model import Plane, Positive, SceneModel, method_of, mismatch, reject
from parsolid.scene.bodies import FilledShape, OwnBody, own_method
from parsolid.scene.boundaries import Boundary
from parsolid.scene.boundaries.condition import clashes, reaction_details
from parsolid.scene.contact import Contact, contact_faults, contact_pairs, energy_terms, grid_faults, unbonded
from parsolid.scene.error_bars import ErrorBars, RunTargets
from parsolid.scene.fillings import filling_of
from parsolid.scene.initial_state import InitialState, initial_details
from parsolid.scene.lattice import Filling
from parsolid.scene.loads import Loads
from parsolid.scene.methods import Method, NamedMethodTable
from parsolid.scene.named_regions import Region, all_regions, region_details, uses_of_regions
from parsolid.scene.observation import HISTORY_COLUMNS, MANUFACTURED, Output, Reference, solution_faults
from parsolid.scene.probes import Probe, ProbeTable
from parsolid.scene.substeps import substep_faults
from parsolid.scene.systems import SystemOfScene, carriers_of, complete, faults_of_systems, part_of, systems_of
from parsolid.scene.tie import TIE_TERMS, Tie, tie_faults
from parsolid.scene.tools import Tool, still_faults, tool_faults
from parsolid.scene.validation_errors import NOTHING, SceneError, fault, key_path, suggestion

# more than these, in a run to its end, nobody wants
MOST_OUTPUTS = {"history_interval": 10**7, "fields_interval": 10**5, "checkpoint_interval": 10**7}


class Scene(SceneModel):
    """Everything that a run needs to know, in SI units; made by `load_scene` or `parse_scene`."""

    title: str = Field("", description="what the run is called")
    dimension: Literal[1, 2, 3] = Field(description="1, 2 or 3, as the method allows")
    end_time: Positive = Field(description="the simulated time [s]")
    method: Method = Field(None, description="a table with the key kind")
    methods: Annotated[list[NamedMethodTable], Field(min_length=1)] | None = Field(
        None, description="in place of method: several, with names, of which each body names one"
    )
    bodies: Annotated[list[OwnBody], Field(min_length=1)] = Field(description="at least one body")
    regions: list[Region] = Field([], description="parts of bodies or of space with a name")
    boundaries: list[Boundary] = Field([], description="supports, loads on surfaces and prescribed motion")
    initial: list[InitialState] = Field([], description="initial states of regions, or from results of another run")
    loads: Loads = Loads()
    contact: list[Contact] = Field([], description="bodies that meet")
    tie: list[Tie] = Field([], description="bodies of different methods that are bonded")
    tools: list[Tool] = Field([], description="rigid bodies that others touch")
    probes: list[ProbeTable] = Field([], description="what is watched: columns of history.csv")
    output: Output = Output()
    reference: Reference | None = None
    errors: ErrorBars | None = Field(None, description="error bars for what is in history.csv")
    run: RunTargets | None = Field(None, description="errors to be reached, by runs from coarse to fine")

    @classmethod
    def _conflicts(cls, table: dict[str, Any]) -> list[Any]:
        if "method" not in table and "methods" not in table:
            return [InitErrorDetails(type="missing", loc=("method",), input=table)]
        if "method" in table and "methods" in table:
            error = mismatch("one of method, methods", Phrase("both"))
            return [InitErrorDetails(type=error, loc=(), input=table)]
        return []

    @field_validator("methods")
    @classmethod
    def _named_apart(cls, methods: list[Any] | None) -> list[Any] | None:
        names = [one.name for one in methods or ()]
        again = [(i, name) for i, name in enumerate(names) if name in names[:i]]
        reject(*(((i, "name"), f"a name other than that of {names.index(name)}", name) for i, name in again))
        return methods

    @field_validator("dimension")
    @classmethod
    def _known_to_method(cls, dimension: int, info: ValidationInfo) -> int:
        method: Any = method_of(info)
        if method and dimension not in method.dimensions:
            raise mismatch(f"{' or '.join(map(str, method.dimensions))} with this method", dimension)
        return dimension

    @model_validator(mode="after")
    def _fits_method(self) -> "Scene":
        complete(self)
        details = faults_of_systems(self) + still_faults(self) + tie_faults(self) + substep_faults(self)
        details += grid_faults(self)
        exact = None if self.reference is None else self.reference.exact
        if self.loads.manufactured and exact not in MANUFACTURED:
            known = " or ".join(map(repr, MANUFACTURED))
            details.append(
                (("loads", "manufactured"), f"reference.exact = {known}", NOTHING if exact is None else exact)
            )
        if exact and len(self.methods or ()) > 1:
            details.append((("reference", "exact"), "no such key with several methods", exact))
        elif exact:
            details += solution_faults(exact, self.bodies[0].material)
        details += region_details(self) + initial_details(self)
        details += reaction_details(self.boundaries, [probe.name for probe in self.probes], carriers_of(self))
        reject(*details)
        return self

    @model_validator(mode="after")
    def _outputs_counted(self) -> "Scene":
        output = self.output
        stated = [(key, getattr(output, key), most) for key, most in MOST_OUTPUTS.items() if getattr(output, key)]
        reject(
            *(
                (("output", key), f"at least end_time/{most:g} = {self.end_time / most:g} s", interval)
                for key, interval, most in stated
                if interval < self.end_time / most
            )
        )
        return self

    def resolved(self) -> dict[str, Any]:
        """The scene with its defaults, as plain tables that validate to the same scene."""
        return self.model_dump(exclude_none=True)

    @property
    def unbonded(self) -> np.ndarray | None:
        """Which bodies (bodies, bodies) are in contact with which, so that nothing bonds them; None without any."""
        return unbonded(self.contact, [body.name for body in self.bodies])

    @property
    def apart(self) -> frozenset[frozenset[int]]:
        """Pairs of numbers of bodies that are not to stick together where they meet."""
        pairs = contact_pairs(self.contact, [body.name for body in self.bodies])
        return frozenset(frozenset((pair.first, pair.second)) for pair in pairs if pair.first != pair.second)

    @property
    def systems(self) -> tuple[SystemOfScene, ...]:
        """Which method has which bodies."""
        return systems_of(self)

    @property
    def named_regions(self) -> dict[str, Region]:
        """Regions by name, also those groups of meshes that are named directly; numbered in this order."""
        return all_regions(self.regions, [name for _, name in uses_of_regions(self)])

    def part(self, system: SystemOfScene) -> "Scene":
        """The scene of one system: its method, its bodies, and the boundaries and loads that it carries."""
        if self.methods is None and len(system.bodies) == len(self.bodies) and system.settings == self.method:
            return self
        return Scene.model_construct(**(dict(self) | part_of(self, system)))

    @property
    def reference_times(self) -> tuple[float, ...]:
        """Times [s] at which the run is compared with an exact solution."""
        times = () if self.reference is None else self.reference.times or ()
        return tuple(time for time in times if time <= self.end_time)

    @property
    def fields_times(self) -> list[float]:
        """Times [s] at which fields are written, always ending with end_time."""
        if self.output.fields_times is not None:
            return [time for time in self.output.fields_times if time < self.end_time] + [self.end_time]
        interval = self.output.fields_interval or self.end_time / 20.0
        # the last interval may be short, but never a rounding error long
        count = int(np.ceil(self.end_time / interval * (1.0 - 1e-12)))
        return [min(i * interval, self.end_time) for i in range(count)] + [self.end_time]


@dataclass
class Parts:
    """The tables of a scene that are sound in themselves, by place, so that faults between them can be told too."""

    dimension: int
    bodies: dict[int, FilledShape]
    boundaries: dict[int, Any]
    probes: dict[int, Probe]
    contact: dict[int, Contact]
    tie: dict[int, Tie]
    tools: dict[int, Tool]
    reference: Reference | None
    method: Any
    complete: bool
    stated_bodies: int
    # what bodies say the kind of their material is
    materials: list[Any]
    # number of a body -> class of its method, where bodies have several
    methods_of_bodies: dict[int, Any] = field(default_factory=dict)

    @classmethod
    def of(cls, data: dict[str, Any], context: dict[str, Any]) -> "Parts | None":
        """The sound parts of raw tables; None when not even the dimension is known."""
        if context.get("dimension") is None:
            return None
        complete = True
        lists: dict[str, dict[int, Any]] = {}
        for key, kind in (
            ("bodies", FilledShape),
            ("boundaries", Boundary),
            ("probes", ProbeTable),
            ("contact", Contact),
            ("tie", Tie),
            ("tools", Tool),
        ):
            adapter = TypeAdapter(kind)
            entries = data.get(key, [])
            lists[key] = {}
            for i, entry in enumerate(entries if isinstance(entries, list) else []):
                if kind is FilledShape and isinstance(entry, dict):
                    # where a body is can be sound when its material is not
                    entry = {word: entry[word] for word in FilledShape.model_fields if word in entry}
                try:
                    lists[key][i] = adapter.validate_python(entry, context=context)
                except ValidationError:
                    complete = False
        try:
            reference = TypeAdapter(Reference | None).validate_python(data.get("reference"), context=context)
        except ValidationError:
            reference = None
        stated = len(data["bodies"]) if isinstance(data.get("bodies"), list) else 0
        dimension, method = context["dimension"], context["method"]
        sound: Any = lists
        bodies = lists["bodies"]
        own = {i: own_method(data["bodies"][i], context) for i in bodies} if context.get("methods") else {}
        sound |= {"dimension": dimension, "reference": reference, "method": method, "complete": complete}
        tables = [one.get("material") for one in data.get("bodies") or () if isinstance(one, dict)] if stated else []
        kinds = [one.get("kind") for one in tables if isinstance(one, dict)]
        return cls(**sound, stated_bodies=stated, materials=kinds, methods_of_bodies=own)


def cross_faults(parts: Parts) -> list[str]:
    """Faults between the tables of a scene."""
    fillings, faults = {}, []
    for i, body in parts.bodies.items():
        if body.shape.kind != "mesh":
            try:
                fillings[i] = filling_of(body, parts.dimension)
            except SceneError as error:
                faults += [f"{key_path(('bodies', i))}: {text}" for text in error.faults]
    every_body_known = 0 < len(fillings) == parts.stated_bodies
    faults += _repeated_names("bodies", parts.bodies) + _repeated_names("probes", parts.probes)
    faults += _empty_bodies(fillings) + _boundary_faults(parts, fillings, every_body_known) + clashes(parts.boundaries)
    if every_body_known:
        faults += _distant_probes(parts, fillings) + _fields_elsewhere(parts, fillings)
    faults += contact_faults(parts.contact, parts.bodies, parts.complete) + tool_faults(parts)
    return faults + _reference_faults(parts)


def _repeated_names(key: str, entries: dict[int, Any]) -> list[str]:
    faults: list[str] = []
    seen: dict[str, int] = {}
    for i, entry in entries.items():
        if entry.name is not None and entry.name in seen:
            faults.append(fault((key, i, "name"), f"a name other than that of {key}.{seen[entry.name]}", entry.name))
        seen.setdefault(entry.name, i)
    return faults


def _empty_bodies(fillings: dict[int, Filling]) -> list[str]:
    return [
        fault(("bodies", i), "a body of at least two particles", filling.count)
        for i, filling in fillings.items()
        if filling.count < 2
    ]


def plane_side(plane: Plane, filling: Filling) -> int:
    """-1 or +1 when the plane is the lower or upper bound of the body, 0 when it bounds it nowhere."""
    lower, upper = filling.lower[plane.axis], filling.upper[plane.axis]
    tolerance = 1e-9 * max(abs(lower), abs(upper), upper - lower)
    if abs(plane.offset - lower) <= tolerance:
        return -1
    return 1 if abs(plane.offset - upper) <= tolerance else 0


def _boundary_faults(parts: Parts, fillings: dict[int, Filling], every_body_known: bool) -> list[str]:
    faults = []
    names = [body.name for body in parts.bodies.values() if body.name is not None]
    for i, boundary in parts.boundaries.items():
        if boundary.body is not None and boundary.body not in names:
            if parts.complete:
                expected = f"the name of a body{suggestion(boundary.body, names)}"
                faults.append(fault(("boundaries", i, "body"), expected, boundary.body))
        elif boundary.needs_bounding_plane and boundary.plane is not None and every_body_known:
            faults += unbounded_plane(i, boundary, parts.bodies, fillings)
    return faults


def unbounded_plane(
    place: int, boundary: Any, bodies: dict[int, FilledShape], fillings: dict[int, Filling]
) -> list[str]:
    """The fault of a support or traction whose plane bounds none of the bodies it is meant for."""
    meant = [i for i, body in bodies.items() if boundary.body in (None, body.name)]
    if any(plane_side(boundary.plane, fillings[i]) for i in meant):
        return []
    axis = boundary.plane.axis
    bounds = sorted({float(bound[axis]) for i in meant for bound in (fillings[i].lower, fillings[i].upper)})
    expected = f"a plane that bounds a body ({'XYZ'[axis]} = {' or '.join(f'{bound:g}' for bound in bounds)})"
    return [fault(("boundaries", place, "plane"), expected, str(boundary.plane))]


def _away(filling: Filling, at: list[float]) -> float:
    """Distance [m] of a point from a body's bounds."""
    return float(np.linalg.norm(np.maximum(0.0, np.maximum(filling.lower - at, at - filling.upper))))


def _fields_elsewhere(parts: Parts, fillings: dict[int, Filling]) -> list[str]:
    """Fields of probes at bodies whose methods have no such field, where other methods of the scene have it."""
    faults = []
    for i, probe in parts.probes.items() if len(set(parts.methods_of_bodies.values())) > 1 else ():
        distance = {body: _away(filling, probe.at) for body, filling in fillings.items() if probe.at is not None}
        near = [body for body, away in distance.items() if away == min(distance.values())]
        for k, name in enumerate(probe.fields or () if near else ()):
            methods = [parts.methods_of_bodies[body] for body in near]
            # a body whose method is at fault says so itself
            kinds = [method.field_kinds(parts.dimension) for method in methods if method is not None]
            if parts.method is None or len(kinds) < len(near):
                continue
            if name in parts.method.field_kinds(parts.dimension) and not any(name in each for each in kinds):
                expected = f"a field that the method of bodies.{near[0]} knows"
                faults.append(fault(("probes", i, "fields", k), expected, name))
    return faults


def _distant_probes(parts: Parts, fillings: dict[int, Filling]) -> list[str]:
    faults = []
    for i, probe in parts.probes.items():
        if probe.at is None:
            continue
        beyond = [_away(filling, probe.at) - filling.coarsest for filling in fillings.values()]
        if min(beyond) > 0.0:
            faults.append(fault(("probes", i, "at"), "a point within one spacing of a body", probe.at))
    return faults


def _reference_faults(parts: Parts) -> list[str]:
    if parts.reference is None or not parts.complete or parts.method is None:
        return []
    key = "final" if parts.reference.final is not None else "columns"
    met = energy_terms(parts.contact.values(), parts.tools.values(), parts.materials)
    known = [*HISTORY_COLUMNS, *parts.method.ledger_terms, *met, *(TIE_TERMS if parts.tie else ())]
    for name in (one.reports for one in parts.boundaries.values() if one.reports is not None):
        known += [f"{name}.work", *reaction_columns(name, parts.dimension)]
    try:
        watched: list[Any] = [*parts.probes.values(), *parts.tools.values()]
        known += [column for one in watched for column in one.columns(parts.dimension)]
    except KeyError:
        # a field that other faults keep from being known
        return []
    return [
        fault(("reference", key, column), f"a column of the history{suggestion(column, known)}", column)
        for column in getattr(parts.reference, key) or ()
        if column not in known
    ]
