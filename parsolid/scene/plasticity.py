"""Elastic-plastic solids of the material point method, as a scene states them: a law in parts, each told apart by its
`kind`.
"""

import sys
from functools import cache, cached_property
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from pydantic import Field, ValidationInfo, model_validator

from parsolid.materials.declaration import Phrase
from parsolid.materials.registry import declared
from parsolid.scene.base_model import Positive, SceneModel, reject
from parsolid.scene.declared import by_law, model_of
from parsolid.scene.validation_errors import NOTHING, suggestion

if sys.version_info >= (3, 11):
    import tomllib
else:
    import tomli as tomllib

_LIBRARY = Path(__file__).parents[1] / "materials" / "plastic" / "library.toml"


EquationOfState: Any = by_law("equation-of-state")
ShearModulus: Any = by_law("shear-modulus")
FlowStress: Any = by_law("flow-stress")
Melting: Any = by_law("melting")


class ElasticPlastic(SceneModel):
    """Elastic-plastic solid with an equation of state and heat (Banerjee).

    With `library`, what is not given is that of the material library; without, everything but conductivity and melting
    is needed. youngs_modulus and poissons_ratio are short for a linear equation of state and a constant shear modulus.
    """

    kind: Literal["elastic-plastic"]
    library: str | None = Field(None, description="a name of parsolid/materials/plastic/library.toml")
    density: Positive | None = Field(None, description="the density [kg/m^3]")
    specific_heat: Positive | None = Field(None, description="C_v [J/(kg K)]")
    reference_temperature: Positive | None = Field(None, description="of no stress and energy [K], 300 unless given")
    taylor_quinney: float | None = Field(
        None, ge=0, le=1, description="share of the plastic work that heats, 0.9 unless given"
    )
    conductivity: Positive | None = Field(None, description="of heat [W/(m K)]")
    youngs_modulus: Positive | None = Field(None, description="Young's modulus [Pa]")
    poissons_ratio: float | None = Field(None, gt=-1, lt=0.5, description="Poisson's ratio")
    equation_of_state: EquationOfState | None = None
    shear_modulus: ShearModulus | None = None
    flow_stress: FlowStress | None = None
    melting: Melting | None = None
    integration: Literal["radial-return", "rate-form"] = Field(
        "radial-return", description="the rate form is the paper's"
    )

    @model_validator(mode="after")
    def _complete(self, info: ValidationInfo) -> "ElasticPlastic":
        if self.library is not None and self.library not in library():
            expected = f"one of {', '.join(map(repr, library()))}{suggestion(self.library, library())}"
            reject((("library",), expected, self.library))
        details: list[Any] = []
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            details.append(((), "both youngs_modulus and poissons_ratio, or neither", Phrase("one of them")))
        if self.youngs_modulus is not None:
            given = [key for key in ("equation_of_state", "shear_modulus") if getattr(self, key) is not None]
            details += [((key,), "no such key with youngs_modulus", Phrase("it")) for key in given]
        reject(*details)
        needed = ("density", "specific_heat", "equation_of_state", "shear_modulus", "flow_stress")
        missing = [key for key in needed if self.parts[key] is None]
        details = [((key,), "a value (or a library that has it)", NOTHING) for key in missing]
        for key in ("flow_stress", "shear_modulus"):
            part = self.parts[key]
            if self.parts["melting"] is None and getattr(getattr(part, "declared", None), "needs_melting", False):
                details.append((("melting",), f"a table, needed by the {key.replace('_', ' ')} {part.kind!r}", NOTHING))
        reject(*details)
        return self

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        return import_module("parsolid.materials.plastic.elastic_plastic").of_material(self)

    @cached_property
    def parts(self) -> dict[str, Any]:
        """Every parameter and part, with the library's and the defaults where the scene gives none."""
        known = None if self.library is None else library()[self.library]
        result: dict[str, Any] = {
            "conductivity": None,
            "melting": None,
            "reference_temperature": 300.0,
            "taylor_quinney": 0.9,
        }
        for key in (*_SHARED, "equation_of_state", "shear_modulus", "flow_stress", "melting"):
            stated = getattr(self, key)
            if stated is None and known is not None:
                stated = known.parts[key]
            if stated is not None or key not in result:
                result[key] = stated
        if self.youngs_modulus is not None:
            E, nu = self.youngs_modulus, self.poissons_ratio or 0.0
            linear: Any = model_of(declared("equation-of-state", "linear"))
            constant: Any = model_of(declared("shear-modulus", "constant"))
            bulk, shear = E / (3.0 * (1.0 - 2.0 * nu)), E / (2.0 * (1.0 + nu))
            result["equation_of_state"] = linear(kind="linear", bulk_modulus=bulk)
            result["shear_modulus"] = constant(kind="constant", modulus=shear)
        return result


_SHARED = ("density", "specific_heat", "reference_temperature", "taylor_quinney", "conductivity")


@cache
def library() -> dict[str, ElasticPlastic]:
    """The material library: name -> material, without names of other materials."""
    with open(_LIBRARY, "rb") as file:
        tables = tomllib.load(file)
    return {
        name: ElasticPlastic.model_validate(
            {"kind": "elastic-plastic"} | {k: v for k, v in table.items() if k != "source"}
        )
        for name, table in tables.items()
    }
