"""Failure of elastic-plastic solids as a scene states it: criteria, what becomes of failed matter, scatter."""

from functools import cache
from importlib import import_module
from pathlib import Path
from typing import Any, ClassVar, Literal

from pydantic import Field

from parsolid.materials.declaration import parameters_of
from parsolid.scene.base_model import OnRestart, Positive, SceneModel
from parsolid.scene.declared import laws, table_of
from parsolid.scene.library import LibraryTable, stated_sets
from parsolid.scene.method_settings import named_observables

_LIBRARY = Path(__file__).parents[1] / "materials" / "failure" / "library.toml"
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
        return {key: table for key, table in library().items() if table["kind"] == kind}


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


@cache
def library() -> dict[str, dict[str, Any]]:
    """Name -> what a set of constants states, without its source."""
    return stated_sets(_LIBRARY)
