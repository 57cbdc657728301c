"""Linear viscoelastic and linear elastic solids as a scene states them."""

from typing import Annotated, ClassVar, Literal

from parsolid.materials.declaration import Density, Parameter, Phrase, law
from parsolid.materials.elastic_constants import ElasticConstants, elastic_constants


class PronyTerm:
    """One term of the relaxation function: its stiffness as `modulus` or as a `ratio` of the equilibrium modulus, and
    `tau`.
    """

    exactly_one: ClassVar = (("modulus", "ratio"),)
    modulus: Annotated[
        float | None, Parameter("Pa", "E_j, or G_j where shear_modulus is given", at_least=0.0, default=None)
    ]
    ratio: Annotated[
        float | None,
        Parameter("1", "gamma_j = E_j/E_0, or G_j/G_0 where shear_modulus is given", at_least=0.0, default=None),
    ]
    tau: Annotated[float, Parameter("s", "the relaxation time", above=0.0)]


@law("prony", "prony")
class StatedProny:
    """Linear viscoelastic solid whose modulus relaxes as E_0 + sum E_j exp(-t/tau_j) (Galadima et al., section 5).

    The equilibrium constants are youngs_modulus or shear_modulus, with poissons_ratio or bulk_modulus (a bar needs
    neither); the terms belong to the first of them.

    bulk        "relaxing": all moduli relax in one ratio, Poisson's ratio is constant; "elastic": only the shear
    modulus relaxes
    conversion  of E(t) into G(t) for an elastic bulk: "exact", or "paper" with the ratios and times of E(t)
    strain      "small", or "finite": Green-Lagrange strain and second Piola-Kirchhoff stress (St. Venant and Kirchhoff)
    """

    exactly_one: ClassVar = (("youngs_modulus", "shear_modulus"),)
    at_most_one: ClassVar = (("poissons_ratio", "bulk_modulus"),)
    density: Density
    youngs_modulus: Annotated[
        float | None, Parameter("Pa", "Young's modulus at equilibrium, E_0", above=0.0, default=None)
    ]
    shear_modulus: Annotated[
        float | None, Parameter("Pa", "the shear modulus at equilibrium, G_0", above=0.0, default=None)
    ]
    poissons_ratio: Annotated[
        float | None, Parameter("1", "Poisson's ratio at equilibrium", above=-1.0, below=0.5, default=None)
    ]
    bulk_modulus: Annotated[float | None, Parameter("Pa", "the bulk modulus at equilibrium", above=0.0, default=None)]
    terms: Annotated[list[PronyTerm], Parameter(default=[])]
    bulk: Annotated[
        Literal["relaxing", "elastic"], Parameter(description="whether the bulk relaxes", default="relaxing")
    ]
    conversion: Annotated[
        Literal["exact", "paper"] | None, Parameter("1", "'exact' or 'paper'; exact unless given", default=None)
    ]
    strain: Annotated[Literal["small", "finite"], Parameter(description="what the law is for", default="small")]

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

    def faults_in(self, dimension: int | None) -> list[tuple[tuple[str, ...], str, object]]:
        """Faults of the solid in a scene of a dimension: (key, what was expected, what was found)."""
        details: list[tuple[tuple[str, ...], str, object]] = []
        pair = self.poissons_ratio is not None or self.bulk_modulus is not None
        if not pair and not (dimension == 1 and self.bulk == "relaxing"):
            details.append((("poissons_ratio",), "exactly one of poissons_ratio, bulk_modulus", Phrase("nothing")))
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
        return details


@law("prony", "linear-elastic")
class StatedLinearElastic(StatedProny):
    """A Prony solid without terms."""

    terms: Annotated[list[PronyTerm], Parameter(default=[], most=0)]
