"""Materials as a scene states them; a new law is one file in `materials`, told apart by its `kind`, or a file of the
user's.
"""

from importlib import import_module
from typing import Any, ClassVar

from pydantic import Field

from parsolid.materials.elastic_constants import ElasticConstants, elastic_constants
from parsolid.scene import micro_inertia, plasticity, viscoelastic  # noqa: F401 (what tables of roles have in common)
from parsolid.scene.base_model import NotNegative, Positive, SceneModel
from parsolid.scene.declared import DeclaredModel, laws, table_of


class Branch(SceneModel):
    """One Maxwell branch: its stiffness, as a multiple `beta` of the shear modulus or as `modulus`, and `tau`."""

    exactly_one: ClassVar = (("beta", "modulus"),)
    beta: NotNegative | None = Field(None, description="branch modulus over equilibrium shear modulus")
    modulus: NotNegative | None = Field(None, description="the branch modulus [Pa]")
    tau: Positive = Field(description="the relaxation time [s]")


@table_of("hyperelastic")
class HyperelasticSolid(DeclaredModel):
    """What every hyperelastic law has: Maxwell branches, and elastic constants of the undeformed state."""

    branches: list[Branch] = []

    def equilibrium_law(self) -> Any:
        """The law, a NamedTuple, without branches."""
        return self.part_of(branch_moduli=None, relaxation_times=None)

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        moduli, times = (tuple(map(float, values)) or None for values in (self.branch_moduli, self.relaxation_times))
        return self.equilibrium_law()._replace(branch_moduli=moduli, relaxation_times=times)

    @property
    def elastic_moduli(self) -> tuple[float, float]:
        """Shear modulus and first Lame constant [Pa] when everything has relaxed."""
        shear, lame = import_module("parsolid.materials.hyperelastic.functions").elastic_moduli(self.equilibrium_law())
        return shear, lame

    @property
    def equilibrium(self) -> ElasticConstants:
        """Linear elastic constants when everything has relaxed."""
        return self._constants(0.0)

    @property
    def instantaneous(self) -> ElasticConstants:
        """Linear elastic constants before anything has relaxed; a branch has the first Lame constant 0."""
        return self._constants(sum(self.branch_moduli))

    def _constants(self, added: float) -> ElasticConstants:
        shear, lame = self.elastic_moduli
        return elastic_constants(None, shear + added, None, lame + 2.0 / 3.0 * shear + 2.0 / 3.0 * added)

    @property
    def branch_moduli(self) -> tuple[float, ...]:
        """mu_alpha [Pa] of the branches that have any stiffness."""
        return tuple(modulus for modulus, _ in self._branches())

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        """tau_alpha [s] of the branches that have any stiffness."""
        return tuple(tau for _, tau in self._branches())

    def _branches(self) -> list[tuple[float, float]]:
        shear = self.elastic_moduli[0]
        moduli = [
            (branch.beta or 0.0) * shear if branch.modulus is None else branch.modulus for branch in self.branches
        ]
        return [(modulus, branch.tau) for modulus, branch in zip(moduli, self.branches) if modulus > 0.0]


Material: Any = laws("hyperelastic", "micro-inertia", "prony", "bond-based", "elastic-plastic", of_method=True)
