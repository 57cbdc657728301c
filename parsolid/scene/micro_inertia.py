"""The law "micro-inertia" as a scene states it: the declared table, and a library that fills in what is not given."""

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any

from pydantic import Field, model_validator

from parsolid.scene.base_model import reject
from parsolid.scene.declared import table_of
from parsolid.scene.library import LibraryTable, stated_sets

_LIBRARY = Path(__file__).parents[1] / "materials" / "plastic" / "micro_inertia.toml"
_STATED = "parsolid.materials.plastic.micro_inertia"
_ELASTIC = ("youngs_modulus", "poissons_ratio", "shear_modulus", "bulk_modulus")


@table_of("micro-inertia")
class MicroInertiaSolid(LibraryTable):
    """What is not given is that of the library, if one is named; elastic constants are the library's all or none."""

    library: str | None = Field(None, description="a material of the library")

    @classmethod
    def entries(cls) -> dict[str, dict[str, Any]]:
        """Published sets."""
        return library()

    @classmethod
    def taken(cls, known: dict[str, Any], stated: dict[str, Any]) -> dict[str, Any]:
        """Without its elastic constants where the scene states one."""
        return {key: known[key] for key in known if key not in _ELASTIC} if {*_ELASTIC} & {*stated} else known

    @model_validator(mode="after")
    def _derived(self) -> "MicroInertiaSolid":
        declared = type(self).declared
        if not issubclass(declared, import_module(_STATED).StatedMicroInertia):
            reject((("law",), "a class derived from StatedMicroInertia", declared.__name__))
        return self

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        law: Any = self
        return law.micro_inertia_law()


@cache
def library() -> dict[str, dict[str, Any]]:
    """Name -> what a set states, without its source."""
    return stated_sets(_LIBRARY)
