"""The neo-Hookean solid: Mooney-Rivlin with zeta = 0, of which nothing is computed."""

from typing import Annotated, Literal

from parsolid.materials.declaration import Parameter, law
from parsolid.materials.hyperelastic.mooney_rivlin import StatedMooneyRivlin


@law("hyperelastic", "neo-hookean")
class StatedNeoHookean(StatedMooneyRivlin):
    """Mooney-Rivlin with zeta = 0."""

    zeta: Annotated[Literal[0, 0.0], Parameter(description="nothing but 0", default=0.0)]  # type: ignore[valid-type]
