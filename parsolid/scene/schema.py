"""The scene as a whole; checks between its tables are in `scene.checks`."""

from typing import Annotated, Any, ClassVar, Literal

import numpy as np
from pydantic import Field, ValidationInfo, field_validator, model_validator
from pydantic_core import InitErrorDetails

from parsolid.materials.declaration import Phrase
from parsolid.scene.base_model import OnRestart, Positive, SceneModel, is_within, mismatch, reject
from parsolid.scene.bodies import Body
from parsolid.scene.boundaries import Boundary
from parsolid.scene.contact import ALL, BodyPairs, Bond, Contact, Tie
from parsolid.scene.initial_state import InitialState
from parsolid.scene.load_histories import Loads
from parsolid.scene.methods import Method
from parsolid.scene.named_regions import Region, all_regions, uses_of_regions
from parsolid.scene.observation import ErrorBars, Output, Reference, RunTargets
from parsolid.scene.probes import Probe
from parsolid.scene.systems import Stage, SystemOfScene, faults_of_methods, part_of, systems_of
from parsolid.scene.tools import Tool
from parsolid.scene.validation_errors import NOTHING


class Scene(SceneModel):
    """The input of a run, in SI units; made by `load_scene` or `parse_scene`."""

    on_restart: ClassVar = {
        **dict.fromkeys(("title", "end_time", "output", "errors", "run"), OnRestart.SILENT),
        "undeclared_contact": OnRestart.FREE,
        **dict.fromkeys(("dimension", "initial"), OnRestart.FIXED),
    }
    exactly_one: ClassVar = (("method", "methods"),)
    title: str = Field("", description="the title of the run")
    dimension: Literal[1, 2, 3] = Field(description="1, 2 or 3, as the method allows")
    end_time: Positive = Field(description="the simulated time [s]")
    method: Method = Field(None, description="a table with the key kind")
    methods: Annotated[list[Method], Field(min_length=1)] | None = Field(
        None, description="in place of method: several, with names, of which each body names one"
    )
    stages: list[Stage] = Field([], description="later parts of the run with other settings of the method")
    bodies: Annotated[list[Body], Field(min_length=1)] = Field(description="at least one body")
    regions: list[Region] = Field([], description="named parts of bodies or of space")
    boundaries: list[Boundary] = Field([], description="supports, loads on surfaces and prescribed motion")
    initial: list[InitialState] = Field([], description="initial states of regions, or from results of another run")
    loads: Loads = Loads()
    contact: list[Contact] = Field([], description="bodies that press on one another and can separate")
    bond: list[Bond] = Field([], description="bodies of one method that are joined where they touch at the start")
    undeclared_contact: Literal["stop", "warn"] | None = Field(
        None, description="if bodies meet that no contact names: 'stop' ends the run (default), 'warn' goes on"
    )
    tie: list[Tie] = Field([], description="bodies of different methods that are joined")
    tools: list[Tool] = Field([], description="rigid bodies in contact with the bodies")
    probes: list[Probe] = Field([], description="values written as columns of history.csv")
    output: Output = Output()
    reference: Reference | None = None
    errors: ErrorBars | None = Field(None, description="error bars of the columns of history.csv")
    run: RunTargets | None = Field(None, description="requested errors, reached by runs from coarse to fine")

    @classmethod
    def _conflicts(cls, table: dict[str, Any]) -> list[Any]:
        if "method" not in table and "methods" not in table:
            error = mismatch("a table with the key kind", NOTHING, "missing")
            return [InitErrorDetails(type=error, loc=("method",), input=table)]
        if "method" in table and "methods" in table:
            error = mismatch("one of method, methods", Phrase("both"))
            return [InitErrorDetails(type=error, loc=(), input=table)]
        return []

    @field_validator("method")
    @classmethod
    def _without_name(cls, method: Any) -> Any:
        if method is not None and method.name is not None:
            known = ", ".join(key for key in type(method).model_fields if key != "name")
            reject((("name",), f"one of {known}", Phrase("the unknown key 'name'"), "unknown-key"))
        return method

    @field_validator("methods")
    @classmethod
    def _unique_names(cls, methods: list[Any] | None) -> list[Any] | None:
        names = [one.name for one in methods or ()]
        wanted = "a name without '.' and ',', by which bodies call the method"
        reject(*(((i, "name"), wanted, NOTHING) for i, name in enumerate(names) if name is None))
        again = [(i, name) for i, name in enumerate(names) if name in names[:i]]
        reject(*(((i, "name"), f"a name other than that of {names.index(name)}", name) for i, name in again))
        return methods

    @field_validator("dimension", mode="before")
    @classmethod
    def _integer(cls, dimension: Any) -> Any:
        # true == 1 and 2.0 == 2 would be accepted
        if isinstance(dimension, bool | float):
            raise mismatch("1, 2 or 3", dimension, "choice")
        return dimension

    @field_validator("dimension")
    @classmethod
    def _known_to_method(cls, dimension: int, info: ValidationInfo) -> int:
        known = (info.context or {}).get("dimensions", (1, 2, 3))
        if dimension not in known:
            raise mismatch(f"{' or '.join(map(str, known))} with this method", dimension)
        return dimension

    @model_validator(mode="after")
    def _known_to_methods(self, info: ValidationInfo) -> "Scene":
        """Refuse what the methods do not accept, but for tables that error recovery has replaced."""
        repairs: Any = (info.context or {}).get("repairs")
        if repairs is None or repairs.methods_known:
            replaced = () if repairs is None else repairs.stand_ins
            reject(*(one for one in faults_of_methods(self) if not is_within(one[0], replaced)))
        return self

    def resolved(self) -> dict[str, Any]:
        """The scene with its defaults, as plain tables that validate to the same scene."""
        return self.model_dump(exclude_none=True)

    @property
    def in_contact(self) -> BodyPairs | None:
        """Pairs of bodies in contact; None if there are none."""
        pairs = BodyPairs.named([one.bodies for one in self.contact], [body.name for body in self.bodies])
        return pairs if any(len(one.bodies) > 1 for one in self.contact) and pairs.tables else None

    @property
    def unbonded(self) -> BodyPairs | None:
        """Pairs of bodies between which the method makes no pairs of particles; None if there are none."""
        return self.in_contact

    @property
    def bonded(self) -> BodyPairs:
        """Pairs of bodies that bonds join."""
        if all(one.bodies != ALL for one in self.bond):
            return BodyPairs.named([one.bodies for one in self.bond], [body.name for body in self.bodies])
        groups: dict[str | None, list[int]] = {}
        for number, body in enumerate(self.bodies):
            groups.setdefault(body.method if len(self.methods or ()) > 1 else None, []).append(number)
        return BodyPairs(groups.values(), self.in_contact)

    @property
    def systems(self) -> tuple[SystemOfScene, ...]:
        """The systems: settings of a method with its bodies."""
        return systems_of(self)

    @property
    def named_regions(self) -> dict[str, Region]:
        """Regions by name, then groups of meshes that other tables name; regions are numbered in this order."""
        return all_regions(self.regions, [name for _, name in uses_of_regions(self)])

    def part(self, system: SystemOfScene) -> "Scene":
        """The scene of one system: its method and bodies, and the boundaries and loads that act on it."""
        if self.methods is None and len(system.bodies) == len(self.bodies) and system.settings == self.method:
            return self
        return type(self).model_construct(**(dict(self) | part_of(self, system)))

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
        # no last interval as short as a rounding error
        count = int(np.ceil(self.end_time / interval * (1.0 - 1e-12)))
        return [min(i * interval, self.end_time) for i in range(count)] + [self.end_time]
