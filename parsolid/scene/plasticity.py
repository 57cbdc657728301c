"""Tables of elastic-plastic solids, whose law consists of parts chosen by `kind`, and of their failure."""

from functools import cache, cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, FiniteFloat, model_validator
from pydantic_core import InitErrorDetails

from parsolid.materials.declaration import Phrase, parameters_of
from parsolid.materials.plastic.heat_capacity import POINTS, heat_points
from parsolid.materials.registry import declared
from parsolid.scene.base_model import OnRestart, Positive, SceneModel, mismatch, reject
from parsolid.scene.declared import DeclaredModel, LibraryTable, entry, laws, model_of, stated_sets, table_of
from parsolid.scene.formulas import number_of
from parsolid.scene.method_settings import named_observables
from parsolid.scene.validation_errors import NOTHING

library_of_criteria = partial(stated_sets, Path(__file__).parents[1] / "materials" / "failure" / "library.toml")
# fields and quantities that need failure, or failure with deletion
OF_FAILURE = ("damage", "maximum_damage", "failed_mass")
OF_DELETION = ("deleted_mass", "deleted_momentum")
QUANTITIES = {
    "maximum_damage": "scalar",
    "failed_mass": "scalar",
    "deleted_mass": "scalar",
    "deleted_momentum": "vector",
}


@table_of("failure")
class CriterionTable(LibraryTable):
    """A criterion of failure, with `library`."""

    library: str | None = Field(None, description="a name of parsolid/materials/failure/library.toml")

    @classmethod
    def entries(cls) -> dict[str, dict[str, Any]]:
        """Entries of the criterion's kind."""
        kind = getattr(cls.declared, "kind", None)
        return {key: table for key, table in library_of_criteria().items() if table["kind"] == kind}


Criterion: Any = laws("failure")


class Scatter(SceneModel):
    """Weibull scatter of the strengths of particles with mean 1, drawn from their identifiers."""

    on_restart: ClassVar = {"seed": OnRestart.FIXED}
    modulus: Positive = Field(description="Weibull modulus m: the higher, the less scatter")
    seed: int = Field(0, ge=0, description="seed of the random numbers")


class Failure(SceneModel):
    """Failure by the first criterion that is met."""

    criteria: list[Criterion] = Field(min_length=1, description="tables with the key kind")
    after: Literal["pressure", "delete"] = Field(
        "pressure", description='failed particles carry pressure only ("pressure"), or are removed ("delete")'
    )
    scatter: Scatter | None = Field(None, description="scatter of the strengths of particles")

    def build(self, density: float) -> Any:
        """The NamedTuple in SI units."""
        module = import_module("parsolid.materials.failure.failure")
        scatter = None if self.scatter is None else module.Scatter(float(self.scatter.modulus), int(self.scatter.seed))
        criteria = [criterion.part_of(density=density) for criterion in self.criteria]
        return module.Failure(module.chained(criteria), self.after == "delete", scatter)

    def faults(self, melts: bool) -> list[Any]:
        """Faults of criteria that need a melting temperature; melts: whether the material has one."""
        return [
            (("failure", "criteria", i), "a table melting of the material, needed by this criterion", criterion.kind)
            for i, criterion in enumerate(self.criteria)
            if not melts and getattr(criterion.declared, "needs_melting", False) and getattr(criterion, "d5", 1.0)
        ]

    @property
    def ledger_terms(self) -> dict[str, int]:
        """Energy terms, see `simulation.ledger.Ledger`: failure turns energy into heat, deletion removes it."""
        terms = {"failure_dissipation": 0}
        if self.after == "delete":
            terms |= {"deleted_kinetic": 1, "deleted_internal_energy": 1}
        return terms


def faults_of_names(scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
    """Faults of fields and quantities of failure or deletion that no body of a scene has."""
    failures = [getattr(body.material, "failure", None) for body in scene.bodies]
    lacking: dict[str, str] = {} if any(failures) else dict.fromkeys(OF_FAILURE, "a body with failure")
    if any("damage" in parameters_of(type(body.material).declared) for body in scene.bodies):
        # a state variable of a law
        lacking.pop("damage", None)
    if not any(failure.after == "delete" for failure in failures if failure):
        lacking |= dict.fromkeys(OF_DELETION, 'a body whose failure has after = "delete"')
    return [(place, lacking[name], name) for place, name in named_observables(scene) if name in lacking]


_LIBRARY = Path(__file__).parents[1] / "materials" / "plastic" / "library.toml"
EquationOfState: Any = laws("equation-of-state")
ShearModulus: Any = laws("shear-modulus")
FlowStress: Any = laws("flow-stress")
Melting: Any = laws("melting")
KinematicHardening: Any = laws("kinematic-hardening")


# number of temperatures at which a formula is sampled; relative error at which no more points are added, and the
# largest accepted one
_SAMPLES, _NEGLIGIBLE, _LARGEST_ERROR = 2001, 1e-6, 1e-3


class HeatCapacity(SceneModel):
    """C_v over temperature: linear between points, or a formula of T between two temperatures; constant outside."""

    temperature: list[Positive] | None = Field(None, description="temperatures of points, rising [K]")
    value: list[Positive] | None = Field(None, description="C_v at the points [J/(kg K)]")
    formula: str | None = Field(None, description="C_v [J/(kg K)], a formula of T [K]")
    between: list[Positive] | None = Field(None, description="the two temperatures between which the formula holds [K]")

    @model_validator(mode="after")
    def _consistent(self) -> "HeatCapacity":
        stated = {key for key in ("temperature", "value", "formula", "between") if getattr(self, key) is not None}
        if stated not in ({"temperature", "value"}, {"formula", "between"}):
            found = Phrase(", ".join(sorted(stated)) or "nothing")
            reject(((), "temperature and value, or formula and between", found))
        _ = self.points
        return self

    @cached_property
    def points(self) -> Any:
        """The points in the form that laws take."""
        T, c = self._sampled() if self.formula is not None else (self.temperature or [], self.value or [])
        if not 2 <= len(T) <= POINTS or len(c) != len(T):
            reject((("temperature",), f"2 to {POINTS} numbers, as many as value has", len(T)))
        if not np.all(np.diff(T) > 0.0):
            reject((("temperature",), "numbers that rise", T))
        return heat_points(T, c)

    def _sampled(self) -> tuple[Any, Any]:
        """Points of a piecewise linear approximation of the formula; each is added where the error is largest."""
        assert self.formula is not None and self.between is not None
        if len(self.between) != 2 or not self.between[0] < self.between[1]:
            reject((("between",), "two temperatures that rise", self.between))
        T, chosen = np.linspace(self.between[0], self.between[1], _SAMPLES), [0, _SAMPLES - 1]
        try:
            c = np.array([number_of(self.formula, {"T": one}) for one in T])
        except ValueError as error:
            reject((("formula",), "a formula in T", Phrase(str(error))))
        if not (np.isfinite(c).all() and c.min() > 0.0):
            reject((("formula",), "C_v above 0 between both temperatures", self.formula))
        while True:
            deviation = np.abs(c - np.interp(T, T[chosen], c[chosen])) / c.max()
            if deviation.max() < _NEGLIGIBLE or len(chosen) == POINTS:
                break
            chosen = sorted([*chosen, int(deviation.argmax())])
        if deviation.max() > _LARGEST_ERROR:
            expected = f"a formula that {POINTS} points approximate within {_LARGEST_ERROR:g}"
            reject((("formula",), expected, Phrase(f"{deviation.max():.2g}")))
        return T[chosen], c[chosen]


# keys of a material without a library, and what each can be replaced by
_NEEDED = {
    "density": "",
    "specific_heat": "heat_capacity",
    "equation_of_state": "youngs_modulus",
    "shear_modulus": "youngs_modulus",
    "flow_stress": "",
}


@table_of("elastic-plastic")
class ElasticPlasticTable(DeclaredModel):
    """An elastic-plastic solid. With `library`, missing keys are those of the entry; without, all keys but conductivity
    and melting are needed.
    """

    conductivity_tensor: list[FiniteFloat] | None = Field(
        None, description="xx yy zz xy xz yz [W/(m K)] in axes that turn with the body"
    )
    heat_capacity: HeatCapacity | None = Field(
        None, description="a table: C_v over temperature, in place of specific_heat and its slope"
    )
    library: str | None = Field(None, description="a name of parsolid/materials/plastic/library.toml")
    equation_of_state: EquationOfState | None = Field(None, description="a table: pressure over volume and heat")
    shear_modulus: ShearModulus | None = Field(None, description="a table: modulus over pressure and temperature")
    flow_stress: FlowStress | None = Field(None, description="a table: flow stress over strain, rate and temperature")
    melting: Melting | None = Field(None, description="a table: melting temperature over pressure")
    kinematic_hardening: KinematicHardening | None = Field(None, description="a table: evolution of the back stress")
    failure: Failure | None = Field(None, description="a table: criteria of failure, and behaviour after it")

    @classmethod
    def _conflicts(cls, table: dict[str, Any]) -> list[InitErrorDetails]:
        """Also keys that are missing: told together with the faults of keys that are there."""
        details = super()._conflicts(table)
        for key, substitute in _NEEDED.items():
            if all(table.get(name) is None for name in ("library", key, substitute)):
                error = mismatch("a value (or a library that has it)", NOTHING, "missing")
                details.append(InitErrorDetails(type=error, loc=(key,), input=table))
        return details

    @model_validator(mode="after")
    def _complete(self) -> "ElasticPlasticTable":
        stated: Any = self
        if stated.library is not None:
            entry(stated.library, library())
        details: list[Any] = []
        for key in ("flow_stress", "shear_modulus"):
            part = self.parts[key]
            if self.parts["melting"] is None and getattr(getattr(part, "declared", None), "needs_melting", False):
                details.append((("melting",), f"a table, needed by the {key.replace('_', ' ')} {part.kind!r}", NOTHING))
        if getattr(getattr(self.parts["flow_stress"], "declared", None), "flows_in_volume", False):
            # flow that changes the volume restricts the other parts
            kind = self.parts["flow_stress"].kind
            for key, allowed in (("equation_of_state", "linear"), ("shear_modulus", "constant")):
                part = self.parts[key]
                if part is not None and part.kind != allowed:
                    details.append(((key, "kind"), f"{allowed!r} with the flow stress {kind!r}", part.kind))
            if self.parts["kinematic_hardening"] is not None:
                expected = f"no such key with the flow stress {kind!r}"
                details.append((("kinematic_hardening",), expected, Phrase("it")))
        if stated.heat_capacity is not None:
            given = [key for key in ("specific_heat", "specific_heat_slope") if getattr(stated, key) is not None]
            details += [((key,), "no such key with heat_capacity", getattr(stated, key)) for key in given]
        heat, slope = self.parts["specific_heat"], self.parts["specific_heat_slope"]
        if heat is not None and not heat > slope * self.parts["reference_temperature"]:
            details.append((("specific_heat_slope",), "a specific heat that is positive at 0 K", slope))
        tensor = stated.conductivity_tensor
        if tensor is not None and stated.conductivity is not None:
            details.append((("conductivity",), "no such key with conductivity_tensor", stated.conductivity))
        # xx yy zz xy xz yz as a matrix
        rows = [[0, 3, 4], [3, 1, 5], [4, 5, 2]]
        if tensor is not None and not (len(tensor) == 6 and np.linalg.eigvalsh(np.array(tensor)[rows])[0] > 0.0):
            expected = "six numbers xx yy zz xy xz yz of a positive definite tensor"
            details.append((("conductivity_tensor",), expected, tensor))
        if stated.failure is not None:
            details += stated.failure.faults(melts=self.parts["melting"] is not None)
        reject(*details)
        return self

    @property
    def ledger_terms(self) -> dict[str, int]:
        """Energy terms of back stress and failure, see `simulation.ledger.Ledger`."""
        stated: Any = self
        terms = {} if self.parts["kinematic_hardening"] is None else {"back_stress_energy": 0}
        return terms if stated.failure is None else terms | dict(stated.failure.ledger_terms)

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        return import_module("parsolid.materials.plastic.elastic_plastic").of_material(self)

    @cached_property
    def parts(self) -> dict[str, Any]:
        """All parameters and parts: of the scene, else of the library, else the default."""
        table: Any = self
        known = None if table.library is None else library()[table.library]
        result: dict[str, Any] = {
            "conductivity": None,
            "conductivity_tensor": None,
            "heat_capacity": None,
            "specific_heat_slope": 0.0,
            "melting": None,
            "kinematic_hardening": None,
            "reference_temperature": 300.0,
            "taylor_quinney": 0.9,
        }
        for key in (*_SHARED, "equation_of_state", "shear_modulus", "flow_stress", "melting", "kinematic_hardening"):
            stated = getattr(table, key)
            if stated is None and known is not None:
                stated = known.parts[key]
            if stated is not None or key not in result:
                result[key] = stated
        if table.conductivity_tensor is not None:
            # the tensor replaces the conductivity of the library
            result["conductivity"] = None
        if table.heat_capacity is not None:
            points = table.heat_capacity.points
            value = np.interp(result["reference_temperature"], points.temperatures, points.values)
            result |= {"heat_capacity": points, "specific_heat": float(value), "specific_heat_slope": 0.0}
        if table.youngs_modulus is not None:
            E, nu = table.youngs_modulus, table.poissons_ratio or 0.0
            linear: Any = model_of(declared("equation-of-state", "linear"))
            constant: Any = model_of(declared("shear-modulus", "constant"))
            bulk, shear = E / (3.0 * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
            result["equation_of_state"] = linear(kind="linear", bulk_modulus=bulk)
            result["shear_modulus"] = constant(kind="constant", modulus=shear)
        return result


_SHARED = (
    *("density", "specific_heat", "specific_heat_slope", "reference_temperature", "taylor_quinney"),
    *("conductivity", "conductivity_tensor"),
)


@cache
def library() -> dict[str, Any]:
    """The material library: name -> material."""
    table: Any = model_of(declared("elastic-plastic", "elastic-plastic"))
    return {
        name: table.model_validate({"kind": "elastic-plastic"} | stated)
        for name, stated in stated_sets(_LIBRARY).items()
    }
