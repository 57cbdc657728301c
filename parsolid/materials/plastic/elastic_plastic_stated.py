"""What a scene states of elastic-plastic solids besides their parts."""

from typing import Annotated, Any

from parsolid.materials.declaration import Parameter, Phrase, law


@law("elastic-plastic", "elastic-plastic")
class StatedElasticPlastic:
    """Elastic-plastic solid with an equation of state and heat (Banerjee).

    youngs_modulus and poissons_ratio are short for a linear equation of state and a constant shear modulus.
    """

    density: Annotated[float | None, Parameter("kg/m^3", "the density", above=0.0, default=None)]
    specific_heat: Annotated[float | None, Parameter("J/(kg K)", "C_v", above=0.0, default=None)]
    specific_heat_slope: Annotated[
        float | None, Parameter("J/(kg K^2)", "dC_v/dT, 0 unless given", at_least=0.0, default=None)
    ]
    reference_temperature: Annotated[
        float | None, Parameter("K", "of no stress and energy, 300 unless given", above=0.0, default=None)
    ]
    taylor_quinney: Annotated[
        float | None,
        Parameter(
            "1", "share of the plastic work that heats, 0.9 unless given", at_least=0.0, at_most=1.0, default=None
        ),
    ]
    conductivity: Annotated[float | None, Parameter("W/(m K)", "of heat", above=0.0, default=None)]
    youngs_modulus: Annotated[float | None, Parameter("Pa", "Young's modulus", above=0.0, default=None)]
    poissons_ratio: Annotated[float | None, Parameter("1", "Poisson's ratio", above=-1.0, below=0.5, default=None)]

    def faults(self) -> list[tuple[tuple[str, ...], str, object]]:
        """Constants that do not go together."""
        stated: Any = self
        details: list[tuple[tuple[str, ...], str, object]] = []
        if (self.youngs_modulus is None) != (self.poissons_ratio is None):
            details.append(((), "both youngs_modulus and poissons_ratio, or neither", Phrase("one of them")))
        if self.youngs_modulus is not None:
            given = [key for key in ("equation_of_state", "shear_modulus") if getattr(stated, key) is not None]
            details += [((key,), "no such key with youngs_modulus", Phrase("it")) for key in given]
        return details
