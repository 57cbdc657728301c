"""Materials as a scene states them; a new law is one class more, told apart by its `kind`."""

from typing import ClassVar, Literal, NamedTuple

from pydantic import Field, model_validator

from parsolid.scene.base_model import NotNegative, Positive, SceneModel, by_kind, reject
from parsolid.scene.plasticity import ElasticPlastic
from parsolid.scene.validation_errors import Phrase
from parsolid.scene.viscoelastic import BondBased, ElasticConstants, LinearElastic, PronySolid, elastic_constants


class Moduli(NamedTuple):
    """Elastic constants of the equilibrium law in the undeformed state, all in Pa."""

    xi: float
    zeta: float
    lambda_hat: float
    shear_modulus: float
    first_lame: float
    bulk_modulus: float


class Branch(SceneModel):
    """One Maxwell branch: its stiffness, as a multiple `beta` of the shear modulus or as `modulus`, and `tau`."""

    exactly_one: ClassVar = (("beta", "modulus"),)
    beta: NotNegative | None = Field(None, description="branch modulus over equilibrium shear modulus")
    modulus: NotNegative | None = Field(None, description="the branch modulus [Pa]")
    tau: Positive = Field(description="the relaxation time [s]")


class MooneyRivlin(SceneModel):
    """Polyconvex Mooney-Rivlin solid with Maxwell branches (Lee et al., eqs (19), (20)).

    The equilibrium law is given either by `youngs_modulus` and `poissons_ratio` (with `zeta`, 0 unless given) or by `xi`,
    `zeta` and `lambda_hat`: mu = 2 (xi + zeta), lambda = lambda_hat + 4 zeta.
    """

    exactly_one: ClassVar = (("youngs_modulus", "xi"), ("poissons_ratio", "lambda_hat"))
    kind: Literal["mooney-rivlin"]
    density: Positive = Field(description="the density [kg/m^3]")
    youngs_modulus: Positive | None = Field(None, description="Young's modulus [Pa]")
    poissons_ratio: float | None = Field(None, gt=-1, lt=0.5, description="Poisson's ratio")
    xi: NotNegative | None = Field(None, description="the factor of F:F - 3 [Pa]")
    zeta: NotNegative = Field(0.0, description="the factor of H:H - 3 [Pa]")
    lambda_hat: NotNegative | None = Field(None, description="twice the factor of (J - 1)^2 [Pa]")
    branches: list[Branch] = []

    @property
    def moduli(self) -> Moduli:
        """xi, zeta, lambda_hat and the linear elastic constants [Pa]."""
        if self.youngs_modulus is None:
            shear, lame = 2.0 * (self.xi + self.zeta), self.lambda_hat + 4.0 * self.zeta
            xi, lambda_hat = self.xi, self.lambda_hat
        else:
            E, nu = self.youngs_modulus, self.poissons_ratio
            shear, lame = E / (2.0 * (1.0 + nu)), E * nu / ((1.0 + nu) * (1.0 - 2.0 * nu))
            xi, lambda_hat = 0.5 * shear - self.zeta, lame - 4.0 * self.zeta
        return Moduli(xi, self.zeta, lambda_hat, shear, lame, lame + 2.0 / 3.0 * shear)

    @property
    def equilibrium(self) -> ElasticConstants:
        """Linear elastic constants when everything has relaxed."""
        return elastic_constants(None, self.moduli.shear_modulus, None, self.moduli.bulk_modulus)

    @property
    def instantaneous(self) -> ElasticConstants:
        """Linear elastic constants before anything has relaxed; a branch has the first Lame constant 0."""
        added = sum(self.branch_moduli)
        return elastic_constants(
            None, self.moduli.shear_modulus + added, None, self.moduli.bulk_modulus + 2.0 / 3.0 * added
        )

    @property
    def branch_moduli(self) -> tuple[float, ...]:
        """mu_alpha [Pa] of the branches that have any stiffness."""
        return tuple(modulus for modulus, _ in self._branches())

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        """tau_alpha [s] of the branches that have any stiffness."""
        return tuple(tau for _, tau in self._branches())

    def _branches(self) -> list[tuple[float, float]]:
        shear = self.moduli.shear_modulus
        moduli = [branch.beta * shear if branch.modulus is None else branch.modulus for branch in self.branches]
        return [(modulus, branch.tau) for modulus, branch in zip(moduli, self.branches) if modulus > 0.0]

    @model_validator(mode="after")
    def _polyconvex(self) -> "MooneyRivlin":
        mixed = (self.youngs_modulus is None) != (self.poissons_ratio is None)
        if mixed:
            reject(((), "youngs_modulus with poissons_ratio, or xi with lambda_hat", Phrase("one of each")))
        moduli = self.moduli
        details = []
        if moduli.shear_modulus <= 0.0:
            details.append((("xi",), "xi + zeta > 0", moduli.xi + moduli.zeta))
        if moduli.xi < 0.0:
            details.append(
                (("zeta",), f"zeta <= mu/2 = {0.5 * moduli.shear_modulus:g} (xi = mu/2 - zeta >= 0)", self.zeta)
            )
        elif moduli.lambda_hat < 0.0:
            # with lambda_hat < 0 the law is not polyconvex and loses real wave speeds in extension
            bound = "lambda_hat = lambda - 4 zeta >= 0 (polyconvexity)"
            details.append((("poissons_ratio",), f"a value with {bound}", self.poissons_ratio))
        reject(*details)
        return self


class NeoHookean(MooneyRivlin):
    """Mooney-Rivlin with zeta = 0."""

    kind: Literal["neo-hookean"]
    zeta: Literal[0, 0.0] = 0.0


_KINDS = (MooneyRivlin, NeoHookean, PronySolid, LinearElastic, BondBased, ElasticPlastic)
Material = by_kind(*_KINDS, known="materials")
