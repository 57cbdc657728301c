"""Solids of the peridynamic method alone, as a scene states them: the declared tables, and what is asked of them."""

from importlib import import_module
from typing import Any, ClassVar

from pydantic import ValidationInfo, model_validator

from parsolid.materials.elastic_constants import ElasticConstants, elastic_constants
from parsolid.scene.base_model import dimension_of, reject
from parsolid.scene.declared import DeclaredModel, table_of


@table_of("prony")
class PronyTable(DeclaredModel):
    """Linear viscoelastic and linear elastic solids."""

    @model_validator(mode="after")
    def _stable(self, info: ValidationInfo) -> "PronyTable":
        stated: Any = self
        reject(*stated.faults_in(dimension_of(info)))
        return self

    def build(self, state: str) -> Any:
        """The law, made for the state of strain."""
        stated: Any = self
        name = "prony" if stated.base is None else "hyperelastic_series"
        module = import_module(f"parsolid.materials.viscoelastic.{name}")
        return module.of_material(self, state) if stated.base is None else module.of_material(self)


@table_of("bond-based")
class BondBasedTable(DeclaredModel):
    """Poisson's ratio is 1/3 in plane stress, 1/4 in plane strain and in space."""

    @property
    def equilibrium(self) -> ElasticConstants:
        """Elastic constants with the Poisson's ratio of space and plane strain."""
        law = self.part_of()
        return elastic_constants(law.youngs_modulus, None, 0.25, None)

    instantaneous: ClassVar[Any] = equilibrium

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        return self.part_of()
