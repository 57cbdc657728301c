"""The scene as a whole, and the checks that look at several of its tables at once."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from pydantic import Field, TypeAdapter, ValidationError, ValidationInfo, field_validator, model_validator

from parsolid.scene.base_model import Plane, Positive, SceneModel, method_of, mismatch, reject
from parsolid.scene.bodies import Body, FilledShape
from parsolid.scene.boundaries import Boundary
from parsolid.scene.contact import CONTACT_TERMS, Contact, contact_faults, unbonded
from parsolid.scene.fillings import filling_of
from parsolid.scene.lattice import Filling
from parsolid.scene.loads import Loads
from parsolid.scene.methods import Method
from parsolid.scene.observation import HISTORY_COLUMNS, MANUFACTURED, SOLUTIONS_KNOWN, Output, Reference
from parsolid.scene.probes import Probe, ProbeTable
from parsolid.scene.systems import SystemOfScene
from parsolid.scene.tools import Tool, still_faults, tool_faults
from parsolid.scene.validation_errors import NOTHING, SceneError, fault, key_path, suggestion

# more than these, in a run to its end, nobody wants
MOST_OUTPUTS = {"history_interval": 10**7, "fields_interval": 10**5, "checkpoint_interval": 10**7}


class Scene(SceneModel):
    """Everything that a run needs to know, in SI units; made by `load_scene` or `parse_scene`."""

    title: str = ""
    dimension: Literal[1, 2, 3] = Field(description="1, 2 or 3, as the method allows")
    end_time: Positive = Field(description="the simulated time [s]")
    method: Method = Field(description="a table with the key kind")
    bodies: Annotated[list[Body], Field(min_length=1)] = Field(description="at least one body")
    boundaries: list[Boundary] = []
    loads: Loads = Loads()
    contact: list[Contact] = []
    tools: list[Tool] = []
    probes: list[ProbeTable] = []
    output: Output = Output()
    reference: Reference | None = None

    @field_validator("dimension")
    @classmethod
    def _known_to_method(cls, dimension: int, info: ValidationInfo) -> int:
        method: Any = method_of(info)
        if method and dimension not in method.dimensions:
            raise mismatch(f"{' or '.join(map(str, method.dimensions))} with this method", dimension)
        return dimension

    @model_validator(mode="after")
    def _fits_method(self) -> "Scene":
        details = self.method.scene_faults(self) + still_faults(self.tools, self.method)
        if self.contact and self.method.contact_refused(self) is not None:
            details.append((("contact",), f"no such table {self.method.contact_refused(self)}", self.contact[0].bodies))
        exact = None if self.reference is None else self.reference.exact
        if self.loads.manufactured and exact not in MANUFACTURED:
            known = " or ".join(map(repr, MANUFACTURED))
            details.append(
                (("loads", "manufactured"), f"reference.exact = {known}", NOTHING if exact is None else exact)
            )
        kinds, kind = SOLUTIONS_KNOWN[exact][1] if exact else (), self.bodies[0].material.kind
        if exact and kind not in kinds:
            details.append((("reference", "exact"), f"a solution for the material {kind!r}", exact))
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
    def systems(self) -> tuple[SystemOfScene, ...]:
        """Which method has which bodies."""
        return (SystemOfScene(self.method, tuple(range(len(self.bodies)))),)

    def part(self, system: SystemOfScene) -> "Scene":
        """The scene of one system: its method and bodies, and boundaries that are for any body or one of its own."""
        bodies = [self.bodies[number] for number in system.bodies]
        if system.settings == self.method and bodies == self.bodies:
            return self
        names = {None, *(body.name for body in bodies)}
        boundaries = [boundary for boundary in self.boundaries if boundary.body in names]
        own = {"method": system.settings, "bodies": bodies, "boundaries": boundaries}
        return Scene.model_construct(**(dict(self) | own))

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
    tools: dict[int, Tool]
    reference: Reference | None
    method: Any
    complete: bool
    stated_bodies: int

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
        return cls(
            **sound, dimension=dimension, reference=reference, method=method, complete=complete, stated_bodies=stated
        )


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
    faults += _empty_bodies(fillings) + _boundary_faults(parts, fillings, every_body_known)
    if every_body_known:
        faults += _distant_probes(parts, fillings)
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
        elif boundary.needs_bounding_plane and every_body_known:
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


def _distant_probes(parts: Parts, fillings: dict[int, Filling]) -> list[str]:
    faults = []
    for i, probe in parts.probes.items():
        if probe.at is None:
            continue
        at = np.array(probe.at)
        beyond = [
            np.linalg.norm(np.maximum(0.0, np.maximum(f.lower - at, at - f.upper))) - f.coarsest
            for f in fillings.values()
        ]
        if min(beyond) > 0.0:
            faults.append(fault(("probes", i, "at"), "a point within one spacing of a body", probe.at))
    return faults


def _reference_faults(parts: Parts) -> list[str]:
    if parts.reference is None or not parts.complete or parts.method is None:
        return []
    key = "final" if parts.reference.final is not None else "columns"
    known = [*HISTORY_COLUMNS, *parts.method.ledger_terms, *(CONTACT_TERMS if parts.contact or parts.tools else ())]
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
