"""Elastic-plastic solids as a scene states them: a law in parts, each with a `kind`, and their failure."""

from functools import cache, cached_property, partial
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Literal

import numpy as np
from pydantic import Field, FiniteFloat, model_validator

from parsolid.materials.declaration import Phrase, parameters_of
from parsolid.materials.registry import declared
from parsolid.scene.base_model import OnRestart, Positive, SceneModel, reject
from parsolid.scene.declared import DeclaredModel, LibraryTable, entry, laws, model_of, stated_sets, table_of
from parsolid.scene.method_settings import named_observables
from parsolid.scene.validation_errors import NOTHING

library_of_criteria = partial(stated_sets, Path(__file__).parents[1] / "materials" / "failure" / "library.toml")
# names that only a scene with failure, or with deletion, may ask for
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
    """What is not given is that of the library of criteria, if one is named."""

    library: str | None = Field(None, description="a name of parsolid/materials/failure/library.toml")

    @classmethod
    def entries(cls) -> dict[str, dict[str, Any]]:
        """Those of the criterion's kind."""
        kind = getattr(cls.declared, "kind", None)
        return {key: table for key, table in library_of_criteria().items() if table["kind"] == kind}


Criterion: Any = laws("failure")


class Scatter(SceneModel):
    """Weibull's spread of the strengths of particles, of mean 1, drawn from their identifiers."""

    on_restart: ClassVar = {"seed": OnRestart.FIXED}
    modulus: Positive = Field(description="Weibull's modulus m: the higher, the less spread")
    seed: int = Field(0, ge=0, description="of the draw")


class Failure(SceneModel):
    """Matter fails by the first of its criteria that is met."""

    criteria: list[Criterion] = Field(min_length=1, description="tables with the key kind")
    after: Literal["pressure", "delete"] = Field(
        "pressure", description='failed matter bears pressure alone ("pressure"), or is taken away ("delete")'
    )
    scatter: Scatter | None = Field(None, description="of what particles withstand")

    def build(self, density: float) -> Any:
        """The NamedTuple in SI units."""
        room = import_module("parsolid.materials.failure.failure")
        spread = None if self.scatter is None else room.Scatter(float(self.scatter.modulus), int(self.scatter.seed))
        criteria = [criterion.part_of(density=density) for criterion in self.criteria]
        return room.Failure(room.chained(criteria), self.after == "delete", spread)

    def faults(self, melts: bool) -> list[Any]:
        """(location, expected, found) of criteria that need a melting temperature which the material has not."""
        return [
            (("failure", "criteria", i), "a table melting of the material, needed by this criterion", criterion.kind)
            for i, criterion in enumerate(self.criteria)
            if not melts and getattr(criterion.declared, "needs_melting", False) and getattr(criterion, "d5", 1.0)
        ]

    @property
    def ledger_terms(self) -> dict[str, int]:
        """See `simulation.ledger.Ledger`: released energy stays as heat, what is deleted leaves."""
        deleted = {"deleted_kinetic": 1, "deleted_internal_energy": 1} if self.after == "delete" else {}
        return {"failure_dissipation": 0} | deleted


def faults_of_names(scene: Any) -> list[tuple[tuple[Any, ...], str, object]]:
    """What is to be shown of failure, or of deletion, that no body of a scene has."""
    stated = [getattr(body.material, "failure", None) for body in scene.bodies]
    lacking: dict[str, str] = {} if any(stated) else dict.fromkeys(OF_FAILURE, "a body with failure")
    if any("damage" in parameters_of(type(body.material).declared) for body in scene.bodies):
        # a state variable of that name
        lacking.pop("damage", None)
    if not any(failure.after == "delete" for failure in stated if failure):
        lacking |= dict.fromkeys(OF_DELETION, 'a body whose failure has after = "delete"')
    return [(place, lacking[name], name) for place, name in named_observables(scene) if name in lacking]


_LIBRARY = Path(__file__).parents[1] / "materials" / "plastic" / "library.toml"


EquationOfState: Any = laws("equation-of-state")
ShearModulus: Any = laws("shear-modulus")
FlowStress: Any = laws("flow-stress")
Melting: Any = laws("melting")
KinematicHardening: Any = laws("kinematic-hardening")


@table_of("elastic-plastic")
class ElasticPlasticTable(DeclaredModel):
    """With `library`, what is not given is that of the material library; without, everything but conductivity and
    melting is needed.
    """

    conductivity_tensor: list[FiniteFloat] | None = Field(
        None, description="xx yy zz xy xz yz [W/(m K)] in axes that turn with the matter"
    )
    library: str | None = Field(None, description="a name of parsolid/materials/plastic/library.toml")
    equation_of_state: EquationOfState | None = Field(None, description="a table: pressure of volume and heat")
    shear_modulus: ShearModulus | None = Field(None, description="a table: that of pressure and temperature")
    flow_stress: FlowStress | None = Field(None, description="a table: that of strain, rate and temperature")
    melting: Melting | None = Field(None, description="a table: the melting temperature under pressure")
    kinematic_hardening: KinematicHardening | None = Field(None, description="a table: the back stress that flow moves")
    failure: Failure | None = Field(None, description="a table: when matter fails, and what becomes of it")

    @model_validator(mode="after")
    def _complete(self) -> "ElasticPlasticTable":
        stated: Any = self
        if stated.library is not None:
            entry(stated.library, library())
        needed = ("density", "specific_heat", "equation_of_state", "shear_modulus", "flow_stress")
        missing = [key for key in needed if self.parts[key] is None]
        details: list[Any] = [((key,), "a value (or a library that has it)", NOTHING) for key in missing]
        for key in ("flow_stress", "shear_modulus"):
            part = self.parts[key]
            if self.parts["melting"] is None and getattr(getattr(part, "declared", None), "needs_melting", False):
                details.append((("melting",), f"a table, needed by the {key.replace('_', ' ')} {part.kind!r}", NOTHING))
        if getattr(getattr(self.parts["flow_stress"], "declared", None), "flows_in_volume", False):
            # parts that do not go with a flow that changes the volume
            kind = self.parts["flow_stress"].kind
            for key, usual in (("equation_of_state", "linear"), ("shear_modulus", "constant")):
                part = self.parts[key]
                if part is not None and part.kind != usual:
                    details.append(((key, "kind"), f"{usual!r} with the flow stress {kind!r}", part.kind))
            if self.parts["kinematic_hardening"] is not None:
                expected = f"no such key with the flow stress {kind!r}"
                details.append((("kinematic_hardening",), expected, Phrase("it")))
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
        """The energy terms of a solid that fails or has a back stress, see `simulation.ledger.Ledger`."""
        stated: Any = self
        back = {} if self.parts["kinematic_hardening"] is None else {"back_stress_energy": 0}
        return back if stated.failure is None else back | dict(stated.failure.ledger_terms)

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        return import_module("parsolid.materials.plastic.elastic_plastic").of_material(self)

    @cached_property
    def parts(self) -> dict[str, Any]:
        """Every parameter and part, with the library's and the defaults where the scene gives none."""
        table: Any = self
        known = None if table.library is None else library()[table.library]
        result: dict[str, Any] = {
            "conductivity": None,
            "conductivity_tensor": None,
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
            # that of the library is of the isotropic solid
            result["conductivity"] = None
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
    """The material library: name -> material, without names of other materials."""
    table: Any = model_of(declared("elastic-plastic", "elastic-plastic"))
    return {
        name: table.model_validate({"kind": "elastic-plastic"} | stated)
        for name, stated in stated_sets(_LIBRARY).items()
    }
