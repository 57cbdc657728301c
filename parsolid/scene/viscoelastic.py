"""Linear elastic and viscoelastic solids of the peridynamic method, as a scene states them."""

from importlib import import_module
from typing import Annotated, Any, ClassVar, Literal, NamedTuple

from pydantic import Field, ValidationInfo, model_validator

from parsolid.scene.base_model import NotNegative, Positive, SceneModel, dimension_of, reject
from parsolid.scene.validation_errors import NOTHING


class ElasticConstants(NamedTuple):
    """Young's modulus, shear modulus, bulk modulus [Pa], Poisson's ratio."""

    youngs_modulus: float
    shear_modulus: float
    bulk_modulus: float
    poissons_ratio: float


class PronyTerm(SceneModel):
    """One term of the relaxation function: its stiffness as `modulus` or as a `ratio` of the equilibrium modulus, and
    `tau`.
    """

    exactly_one: ClassVar = (("modulus", "ratio"),)
    modulus: NotNegative | None = Field(None, description="E_j, or G_j where shear_modulus is given [Pa]")
    ratio: NotNegative | None = Field(None, description="gamma_j = E_j/E_0, or G_j/G_0 where shear_modulus is given")
    tau: Positive = Field(description="the relaxation time [s]")


class PronySolid(SceneModel):
    """Linear viscoelastic solid whose modulus relaxes as E_0 + sum E_j exp(-t/tau_j) (Galadima et al., section 5).

    The equilibrium constants are youngs_modulus or shear_modulus, with poissons_ratio or bulk_modulus (a bar needs
    neither); the terms belong to the first of them.

    bulk        "relaxing": all moduli relax in one ratio, Poisson's ratio is constant; "elastic": only the shear
    modulus relaxes
    conversion  of E(t) into G(t) for an elastic bulk: "exact", or "paper" with the ratios and times of E(t)
    strain      "small", or "finite": Green-Lagrange strain and second Piola-Kirchhoff stress
    """

    exactly_one: ClassVar = (("youngs_modulus", "shear_modulus"),)
    at_most_one: ClassVar = (("poissons_ratio", "bulk_modulus"),)
    kind: Literal["prony"]
    density: Positive = Field(description="the density [kg/m^3]")
    youngs_modulus: Positive | None = Field(None, description="Young's modulus at equilibrium, E_0 [Pa]")
    shear_modulus: Positive | None = Field(None, description="the shear modulus at equilibrium, G_0 [Pa]")
    poissons_ratio: float | None = Field(None, gt=-1, lt=0.5, description="Poisson's ratio at equilibrium")
    bulk_modulus: Positive | None = Field(None, description="the bulk modulus at equilibrium [Pa]")
    terms: list[PronyTerm] = []
    bulk: Literal["relaxing", "elastic"] = "relaxing"
    conversion: Literal["exact", "paper"] | None = Field(None, description="'exact' or 'paper'; exact unless given")
    strain: Literal["small", "finite"] = "small"

    @property
    def _stated_modulus(self) -> float:
        return self.youngs_modulus or self.shear_modulus or 0.0

    @property
    def term_moduli(self) -> tuple[float, ...]:
        """E_j, or G_j where shear_modulus is given [Pa], of the terms that have any stiffness."""
        return tuple(modulus for modulus, _ in self._terms())

    @property
    def relaxation_times(self) -> tuple[float, ...]:
        """tau_j [s] of the terms that have any stiffness."""
        return tuple(tau for _, tau in self._terms())

    def _terms(self) -> list[tuple[float, float]]:
        stated = self._stated_modulus
        moduli = [(term.ratio or 0.0) * stated if term.modulus is None else term.modulus for term in self.terms]
        return [(modulus, term.tau) for modulus, term in zip(moduli, self.terms) if modulus > 0.0]

    @property
    def equilibrium(self) -> ElasticConstants:
        """Elastic constants when everything has relaxed; a bar without Poisson's ratio has 0."""
        return elastic_constants(self.youngs_modulus, self.shear_modulus, self.poissons_ratio, self.bulk_modulus)

    @property
    def instantaneous(self) -> ElasticConstants:
        """Elastic constants before anything has relaxed."""
        known, factor = self.equilibrium, 1.0 + sum(self.term_moduli) / self._stated_modulus
        if self.bulk == "relaxing":
            return elastic_constants(known.youngs_modulus * factor, None, known.poissons_ratio, None)
        if self.youngs_modulus is None or self.conversion == "paper":
            return elastic_constants(None, known.shear_modulus * factor, None, known.bulk_modulus)
        return elastic_constants(known.youngs_modulus * factor, None, None, known.bulk_modulus)

    def build(self, state: str) -> Any:
        """The law, made for the state of strain."""
        return import_module("parsolid.materials.viscoelastic.prony").of_material(self, state)

    @model_validator(mode="after")
    def _stable(self, info: ValidationInfo) -> "PronySolid":
        details: list[Any] = []
        bar = dimension_of(info) == 1
        pair = self.poissons_ratio is not None or self.bulk_modulus is not None
        if not pair and not (bar and self.bulk == "relaxing"):
            details.append((("poissons_ratio",), "exactly one of poissons_ratio, bulk_modulus", NOTHING))
        # elsewhere it would silently do nothing
        converts = self.bulk == "elastic" and self.youngs_modulus is not None
        if self.conversion is not None and not converts:
            details.append(
                (("conversion",), "no such key but with youngs_modulus and bulk = 'elastic'", self.conversion)
            )
        if pair and self.youngs_modulus is not None:
            K, E = self.equilibrium.bulk_modulus, self.youngs_modulus
            if converts and self.conversion != "paper":
                E += sum(self.term_moduli)
            if not 9.0 * K > E:
                key = "bulk_modulus" if self.bulk_modulus is not None else "poissons_ratio"
                expected = f"a bulk modulus of more than a ninth of Young's modulus {E:g} (positive shear modulus)"
                details.append(((key,), expected, getattr(self, key)))
        reject(*details)
        return self


class LinearElastic(PronySolid):
    """A Prony solid without terms."""

    kind: Literal["linear-elastic"]  # type: ignore[assignment]
    terms: Annotated[list[PronyTerm], Field(max_length=0)] = []


class BondBased(SceneModel):
    """Elastic bond-based solid (Silling); Poisson's ratio is 1/3 in plane stress, 1/4 in plane strain and in space."""

    kind: Literal["bond-based"]
    density: Positive = Field(description="the density [kg/m^3]")
    youngs_modulus: Positive = Field(description="Young's modulus [Pa]")

    @property
    def equilibrium(self) -> ElasticConstants:
        """Elastic constants with the Poisson's ratio of space and plane strain."""
        return elastic_constants(self.youngs_modulus, None, 0.25, None)

    instantaneous: ClassVar[Any] = equilibrium

    def build(self, state: str) -> Any:
        """The law, the same in every state of strain."""
        return import_module("parsolid.materials.damage.bond_based").of_material(self)


def elastic_constants(E: Any, G: Any, nu: Any, K: Any) -> ElasticConstants:
    """All constants from E or G, with nu or K; neither means nu = 0."""
    if K is None:
        nu = nu or 0.0
    elif E is not None:
        nu = 0.5 - E / (6.0 * K)
    else:
        nu = (3.0 * K - 2.0 * G) / (6.0 * K + 2.0 * G)
    E = 2.0 * G * (1.0 + nu) if E is None else E
    return ElasticConstants(E, E / (2.0 * (1.0 + nu)), E / (3.0 * (1.0 - 2.0 * nu)) if K is None else K, nu)
